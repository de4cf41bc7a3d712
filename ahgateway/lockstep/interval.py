"""Which intervals an execution can have computed with: CYCLE, or every value of the clock's grid around it.

Where the dialect measures, Ts is an unknown on a grid. It is bounded by the schedule: an execution is due when CYCLE
has elapsed and is noticed one scan later at most. This file decides which values are possible, not which one it was.
"""

from __future__ import annotations

from typing import Any

from ahgateway.codec.station import Loop
from ahgateway.core.controllers.delta_terms import ticks_per_second
from ahgateway.core.real import REAL, bits, quiet

INTERVALS_MAX = 512
"""More possible intervals than this are tried only after I_MV has thinned them out."""


def intervals(loop: Loop, inputs: Any, state: Any = None, i_seen: REAL | None = None) -> tuple[REAL, ...]:
    """Return every Ts that an execution can have computed with, as the law takes it; one where nothing is measured.

    Args:
        loop: The loop with its dialect and its longest scan.
        inputs: What the execution read.
        state: State before it, for a fine grid.
        i_seen: I_MV behind it, for a fine grid.
    """
    controller, dialect = loop.controller, loop.dialect
    per_second = ticks_per_second(dialect) if controller.law_ts is not None else 0
    if not per_second:
        return (controller.ts(inputs, dialect),)
    nominal = round(float(controller.nominal_ts(inputs)) * per_second)
    slack = max(1, -(-loop.scan_ms_max * per_second // 1000))
    first, last = max(1, nominal - slack), nominal + slack
    if last - first > INTERVALS_MAX and state is not None and i_seen is not None:
        first, last = _thinned(loop, inputs, state, i_seen, first, last)
    stride = max(1, (last - first) // INTERVALS_MAX)
    found = {}
    for ticks in (nominal, *range(first, last + 1, stride), last):
        if first <= ticks <= last:
            ts = controller.ts(inputs, dialect, ticks)
            found[bits(ts)] = ts
    return tuple(found.values())


def _thinned(loop: Loop, inputs: Any, state: Any, i_seen: REAL, first: int, last: int) -> tuple[int, int]:
    """Cut a range of ticks down to those with which the integral comes out as seen; I is monotone in Ts."""

    def side(ticks: int) -> int:
        with quiet(all="ignore"):
            after, _ = loop.controller.step(
                inputs, state, loop.dialect, loop.controller.ts(inputs, loop.dialect, ticks)
            )
        return -1 if after.i < i_seen else (1 if after.i > i_seen else 0)

    sign = -1 if side(first) > side(last) else 1
    low, high = first, last
    while low < high:
        middle = (low + high) // 2
        low, high = (low, middle) if sign * side(middle) >= 0 else (middle + 1, high)
    start, high = low, last
    while low < high:
        middle = (low + high + 1) // 2
        low, high = (low, middle - 1) if sign * side(middle) > 0 else (middle, high)
    return (start, low) if side(start) == 0 else (first, last)
