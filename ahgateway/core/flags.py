"""What an execution says about itself, as bits of one integer (plain integers, so that the laws stay compilable).

The vendor's blocks have no such outputs; they are diagnostics of the reference (spec A.4).
"""

from __future__ import annotations

FREEZE_HI = 1
FREEZE_LO = 2
BUMPLESS = 4
BAD_INPUT = 8
BAD_PARAM = 16
LIMITS_SWAPPED = 32
LOCKUP = 64
MANUAL = 128
STOPPED = 256
AUTOTUNE = 512

FROZEN = FREEZE_HI | FREEZE_LO
"""At a limit: what would carry the sum further is not integrated."""

NAMES: dict[int, str] = {
    FREEZE_HI: "FREEZE_HI",
    FREEZE_LO: "FREEZE_LO",
    BUMPLESS: "BUMPLESS",
    BAD_INPUT: "BAD_INPUT",
    BAD_PARAM: "BAD_PARAM",
    LIMITS_SWAPPED: "LIMITS_SWAPPED",
    LOCKUP: "LOCKUP",
    MANUAL: "MANUAL",
    STOPPED: "STOPPED",
    AUTOTUNE: "AUTOTUNE",
}


def names(flags: int) -> tuple[str, ...]:
    """Return the names of the flags that are set, in the order of their bits."""
    return tuple(name for bit, name in NAMES.items() if flags & bit)
