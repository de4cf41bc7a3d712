"""Which intervals an execution can have computed with: CYCLE, or every value of the clock's grid around it.

Where the dialect measures, Ts is an unknown on a grid. It is bounded by the schedule: an execution is due when CYCLE
has elapsed and is noticed one scan later at most. This file decides which values are possible, not which one it was.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from ahgateway.codec.station import Loop
from ahgateway.core import flags as flag
from ahgateway.core.controllers.delta_terms import is_rough, ticks_per_second
from ahgateway.core.dialect import Freeze, ManualIntegral
from ahgateway.core.real import REAL, bits, quiet, same_bits

UNLIMITED = REAL(3e38)
"""A limit that no sum reaches."""

INTERVALS_MAX = 512
"""More possible intervals than this are only sampled, once I_MV has thinned them out."""

SAMPLES = 8
"""So many of them are tried where they are too many: enough to see whether all leave the same words."""


class Intervals(NamedTuple):
    """Values of Ts that an execution can have computed with.

    Attributes:
        values: As the law takes them; never empty.
        is_whole: These are all that can come out with the I_MV that was seen; else a sample, which proves nothing.
    """

    values: tuple[REAL, ...]
    is_whole: bool = True


def intervals(loop: Loop, inputs: Any, ends: Sequence[Any] = (), i_seen: REAL | None = None) -> Intervals:
    """Return every Ts that an execution can have computed with, as the law takes it; one where nothing is measured.

    Args:
        loop: The loop with its dialect and its longest scan.
        inputs: What the execution read.
        ends: The two states between which the one before it lies, for a fine grid.
        i_seen: I_MV behind it, for a fine grid.
    """
    controller, dialect = loop.controller, loop.dialect
    per_second = ticks_per_second(dialect) if controller.law_ts is not None else 0
    if not per_second:
        return Intervals((controller.ts(inputs, dialect),))
    nominal = round(float(controller.nominal_ts(inputs)) * per_second)
    slack = max(1, -(-loop.scan_ms_max * per_second // 1000))
    first, last = max(1, nominal - slack), nominal + slack
    is_whole = last - first <= INTERVALS_MAX
    if not is_whole and ends and i_seen is not None and _is_monotone(loop, inputs, ends, (first, nominal, last)):
        first, last, is_whole = _thinned(loop, inputs, ends[0], i_seen, first, last)
    stride = 1 if last - first <= INTERVALS_MAX else (last - first) // SAMPLES
    found = {}
    for ticks in (nominal, *range(first, last + 1, stride), last):
        if first <= ticks <= last:
            ts = controller.ts(inputs, dialect, ticks)
            found[bits(ts)] = ts
    return Intervals(tuple(found.values()), is_whole)


def _integral(loop: Loop, inputs: Any, state: Any, ticks: int) -> tuple[REAL, int]:
    """I_MV and the flags behind an execution of so many ticks."""
    with quiet(all="ignore"):
        after, terms = loop.controller.step(
            inputs, state, loop.dialect, loop.controller.ts(inputs, loop.dialect, ticks)
        )
    return after.i, terms.flags


def _is_monotone(loop: Loop, inputs: Any, ends: Sequence[Any], ticks: Sequence[int]) -> bool:
    """Tell whether the integral runs one way with Ts: not where some Ts freeze it, or it is computed back from MV."""
    flags, *others = {_integral(loop, inputs, state, each)[1] for state in ends for each in ticks}
    is_computed_back = (
        flags & flag.BUMPLESS
        or (flags & flag.FROZEN and loop.dialect.freeze == Freeze.BACK_CALCULATED)
        or (flags & flag.MANUAL and loop.dialect.manual_integral == ManualIntegral.TRACKS)
    )
    return not others and not is_computed_back


def _thinned(loop: Loop, inputs: Any, state: Any, i_seen: REAL, first: int, last: int) -> tuple[int, int, bool]:
    """Cut a range of ticks down to those with which the integral comes out as seen; I is monotone in Ts.

    With the range comes whether it is known to the last tick: few enough are left, or none fits.
    """

    def side(ticks: int) -> int:
        i, _ = _integral(loop, inputs, state, ticks)
        return -1 if i < i_seen else (1 if i > i_seen else 0)

    sign = -1 if side(first) > side(last) else 1
    start = first_for(first, last, lambda ticks: sign * side(ticks) >= 0)
    end = first_for(start, last, lambda ticks: sign * side(ticks) > 0) - 1
    return (start, end, end - start <= INTERVALS_MAX) if start <= end else (first, last, True)


def unlimited(inputs: Any) -> Any:
    """The same inputs with limits that no sum reaches, so that none of them freezes the integral."""
    return inputs._replace(mv_max=UNLIMITED, mv_min=-UNLIMITED)


def is_ruled_out(loop: Loop, inputs: Any, ends: Sequence[Any], ts: REAL, seen: Mapping[str, REAL]) -> bool:
    """Tell whether I_MV rules an interval out, whatever D's filter holds between two states.

    MV stands between its limits, so that no content has held the integral at one of them: it is what it would be
    without limits. False where that is not so in this dialect, or where D has a part in the integral.
    """
    dialect = loop.dialect
    is_held_inside = dialect.freeze == Freeze.PREVIOUS_MV or dialect.limited_output or dialect.freeze_test
    if is_held_inside or not {"MV", "I_MV"} <= seen.keys() or not inputs.mv_min < seen["MV"] < inputs.mv_max:
        return False
    wide = unlimited(inputs)
    with quiet(all="ignore"):
        after, terms = loop.controller.step(wide, ends[0], dialect, ts)
        is_set_freely = terms.flags == flag.BUMPLESS and not dialect.preset_limit and not dialect.preset_mv
        if is_set_freely and not is_rough(dialect):
            other, other_terms = loop.controller.step(wide, ends[1], dialect, ts)
            return (
                other_terms.flags == terms.flags
                and same_bits(after.i, other.i)
                and not same_bits(after.i, seen["I_MV"])
            )
    return not terms.flags and not same_bits(after.i, seen["I_MV"])


def first_for(low: int, high: int, holds: Callable[[int], bool]) -> int:
    """Smallest position in low…high for which a monotone condition holds; high + 1 when it never does."""
    while low <= high:
        middle = (low + high) // 2
        if holds(middle):
            high = middle - 1
        else:
            low = middle + 1
    return low
