"""The axes on which the manual is silent, each value named; a dialect is a value, kept in the profile.

Enums are integers, so that a dialect passes unchanged into the compiled core. `DEFAULT` follows spec A.8 and B.5.
"""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple


class Freeze(IntEnum):
    """When the integral stands still beyond a limit (spec A.8/4)."""

    ALWAYS = 0
    OUTWARD = 1


class RunOff(IntEnum):
    """What PID_RUN = FALSE does to the integral (spec A.8/6)."""

    KEEP = 0
    CLEAR = 1


class FirstCall(IntEnum):
    """When the very first execution is due (spec A.8/13)."""

    AT_ONCE = 0
    AFTER_CYCLE = 1


class Dialect(NamedTuple):
    """One way to discretise the manual's formulas.

    Attributes:
        freeze: Integral beyond a limit.
        run_off: Integral while PID_RUN is FALSE.
        first_call: Due time of the first execution.
    """

    freeze: Freeze = Freeze.ALWAYS
    run_off: RunOff = RunOff.KEEP
    first_call: FirstCall = FirstCall.AT_ONCE


DEFAULT = Dialect()

AXES: dict[str, type[IntEnum]] = {"freeze": Freeze, "run_off": RunOff, "first_call": FirstCall}
"""Axis name in a profile to its enum; a value is written in lower case, `freeze = "outward"`."""
