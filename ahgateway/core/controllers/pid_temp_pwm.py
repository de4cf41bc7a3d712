"""Pulse width modulation of PID_Temp: whole ticks of the call period, minimum times, error carried on.

This file alone decides how many ticks of a period are on. It does not know where the percentage comes from.

Theory of operation: at the start of a period the wanted ticks are its percentage and what earlier periods owe. Less
than the minimum on time gives no pulse, less than the minimum off time gives no gap, else whole ticks; what was not
given is carried. The comparison comes before the rounding: 15 % of 10 ticks is 1.5 and gives no pulse of 2.

Source:
    MANUAL PID control function manual 03/2017, PID_Temp: multiples of the call period, minimum times, carry, example.
    ASSUMED the margin of 0.001 tick, the percentage sampled at the start of a period, which rule wins (spec E.6).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ahgateway.core.controllers.delta import ZERO, finite, limit
from ahgateway.core.controllers.pid_temp_dialect import PwmConflict
from ahgateway.core.real import REAL

HUNDRED = REAL(100)
MARGIN = REAL(0.001)


class Pulse(NamedTuple):
    """What one call leaves of a pulse output.

    Attributes:
        tick: Calls since the period began, 0 before its first.
        on: Calls of this period that are on; -1 where no period has run since they were cleared.
        calls: Calls of this period.
        carry: Ticks owed to the next period, negative if given too much.
    """

    tick: int = 0
    on: int = -1
    calls: int = 1
    carry: REAL = ZERO


class Timing(NamedTuple):
    """A period in calls, and how many of them a pulse and a gap have at least."""

    calls: int
    on_min: int
    off_min: int


def period(percent: REAL, timing: Timing, carry: REAL, conflict: PwmConflict) -> tuple[int, REAL]:
    """Return the calls of one period that are on, and the ticks carried to the next one."""
    count = REAL(timing.calls)
    want = ((percent * count) / HUNDRED) + carry
    if not finite(want):
        return 0, ZERO
    short_on = bool(want < REAL(timing.on_min))
    short_off = bool(count - want < REAL(timing.off_min))
    if short_on and short_off and conflict == PwmConflict.OFF_RULE:
        short_on = False
    if short_on:
        on = 0
    elif short_off:
        on = timing.calls
    else:
        on = int(np.floor(want + MARGIN))
    on = min(max(on, 0), timing.calls)
    return on, limit(-count, want - REAL(on), count)


def advance(pulse: Pulse, percent: REAL, timing: Timing, conflict: PwmConflict) -> tuple[Pulse, bool]:
    """Advance by one call: on first, then off; `percent` and `timing` count only where a period begins."""
    on, count, carry = pulse.on, pulse.calls, pulse.carry
    if pulse.tick == 0:
        on, carry = period(percent, timing, carry, conflict)
        count = timing.calls
    tick = pulse.tick + 1
    return Pulse(0 if tick >= count else tick, on, count, carry), pulse.tick < on


def conflicting(timing: Timing) -> bool:
    """Tell whether the minimum times do not fit into the period together."""
    return timing.on_min + timing.off_min > timing.calls
