"""What PID_Temp's outputs show of PidOutputSum: straight lines, peripheral integers, pulses.

This file alone decides the scaling. It does not know where PidOutputSum comes from.

Source:
    MANUAL PID control function manual 03/2017, PID_Temp: lines through two pairs, input limited first (spec E.6).
    ASSUMED rounding of peripheral values, a line without length gives its lower end, periods and minimum times rounded
    half up to calls.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ahgateway.core import flags as flag
from ahgateway.core.controllers import pid_temp_pwm as pwm
from ahgateway.core.controllers.delta import ZERO, finite, limit
from ahgateway.core.controllers.pid_temp_dialect import PerRounding, PidTempDialect, PwmConflict, PwmInactive
from ahgateway.core.controllers.pid_temp_operands import Operands
from ahgateway.core.controllers.pid_temp_pwm import Pulse, Timing
from ahgateway.core.real import REAL

HALF = REAL(0.5)
INT_MIN = REAL(-32768)
INT_MAX = REAL(32767)
TICK_MAX = REAL(2**30)
NO_PULSE = Pulse()
"""Pulses that never ran; a name, for the compiler knows no defaults."""
PWM = 1
PER = 2


class Outputs(NamedTuple):
    """The six outputs, and what the pulses leave to the next call."""

    heat: REAL
    cool: REAL
    heat_per: int
    cool_per: int
    heat_pwm: bool
    cool_pwm: bool
    heat_pulse: Pulse
    cool_pulse: Pulse
    flags: int


def calls(duration: REAL, ts: REAL, minimum: int) -> int:
    """Return a duration in s as calls of `ts` s, rounded half up; at least `minimum`."""
    if not finite(duration):
        return minimum
    count = np.floor((duration / ts) + HALF)
    if count >= TICK_MAX:
        return int(TICK_MAX)
    return int(count) if count > minimum else minimum


def heat_line(operands: Operands, y: REAL, low: REAL, high: REAL) -> REAL:
    """The heating line: `low` at the lower heating limit of PidOutputSum (0 with cooling), `high` at the upper."""
    start = ZERO if operands.activatecooling else operands.heat_pidlowerlimit
    end = operands.heat_pidupperlimit
    if not end > start:
        return low
    return low + (((limit(start, y, end) - start) * (high - low)) / (end - start))


def cool_line(operands: Operands, y: REAL, low: REAL, high: REAL) -> REAL:
    """The cooling line: `low` at PidOutputSum 0, `high` at its lower cooling limit."""
    end = operands.cool_pidlowerlimit
    if not end < ZERO:
        return low
    return low + ((limit(end, y, ZERO) * (high - low)) / end)


def peripheral(x: REAL, rounding: PerRounding) -> int:
    """Round to a 16-bit integer."""
    if not finite(x):
        return 0
    held = limit(INT_MIN, x, INT_MAX)
    if rounding == PerRounding.HALF_AWAY:
        return int(np.floor(held + HALF)) if held >= ZERO else int(np.ceil(held - HALF))
    return int(np.rint(held))


def _rounded(x: REAL, dialect: PidTempDialect) -> int:
    """Round as the dialect does; only a half asks it."""
    even = peripheral(x, PerRounding.HALF_EVEN)
    return even if even == peripheral(x, PerRounding.HALF_AWAY) else peripheral(x, dialect.per_rounding)


def _rule(timing: Timing, dialect: PidTempDialect) -> PwmConflict:
    """Which minimum time wins; only times that do not fit together ask the dialect."""
    return dialect.pwm_conflict if pwm.conflicting(timing) else PwmConflict.ON_RULE


def heat_timing(operands: Operands, ts: REAL) -> Timing:
    """Period and minimum times of the heating pulses in calls; PwmPeriode of 0 is Cycle, and Cycle is the longest."""
    cycle = calls(operands.heat_cycle, ts, 1)
    period = min(calls(operands.heat_pwmperiode, ts, 1), cycle) if operands.heat_pwmperiode > ZERO else cycle
    return Timing(period, calls(operands.heat_minimumontime, ts, 0), calls(operands.heat_minimumofftime, ts, 0))


def cool_timing(operands: Operands, ts: REAL) -> Timing:
    """As `heat_timing`; Cycle is the cooling set's with parameter switching, the heating set's with the factor."""
    cycle = calls(operands.cool_cycle if operands.advancedcooling else operands.heat_cycle, ts, 1)
    period = min(calls(operands.cool_pwmperiode, ts, 1), cycle) if operands.cool_pwmperiode > ZERO else cycle
    return Timing(period, calls(operands.cool_minimumontime, ts, 0), calls(operands.cool_minimumofftime, ts, 0))


def put_out(
    operands: Operands, y: REAL, active: bool, heat: Pulse, cool: Pulse, dialect: PidTempDialect, ts: REAL
) -> Outputs:
    """Scale PidOutputSum to the outputs; inactive makes all 0 and FALSE, whatever limits and scaling."""
    if not active:
        # Pulses that never ran are the same either way.
        if (heat != NO_PULSE or cool != NO_PULSE) and dialect.pwm_inactive == PwmInactive.CLEARED:
            heat, cool = NO_PULSE, NO_PULSE
        return Outputs(ZERO, ZERO, 0, 0, False, False, heat, cool, 0)
    flags = 0
    heat_per, heat_pwm, cool_out, cool_per, cool_pwm = 0, False, ZERO, 0, False
    heat_out = heat_line(operands, y, operands.heat_lowerscaling, operands.heat_upperscaling)
    if operands.heat_select == PER:
        at = heat_line(operands, y, operands.heat_perlowerscaling, operands.heat_perupperscaling)
        heat_per = _rounded(at, dialect)
    if operands.heat_select == PWM:
        timing = heat_timing(operands, ts)
        at = heat_line(operands, y, operands.heat_pwmlowerscaling, operands.heat_pwmupperscaling)
        heat, heat_pwm = pwm.advance(heat, at, timing, _rule(timing, dialect))
        flags |= flag.BAD_PARAM if pwm.conflicting(timing) else 0
    else:
        heat = NO_PULSE
    if operands.activatecooling:
        cool_out = cool_line(operands, y, operands.cool_lowerscaling, operands.cool_upperscaling)
    if operands.activatecooling and operands.cool_select == PER:
        at = cool_line(operands, y, operands.cool_perlowerscaling, operands.cool_perupperscaling)
        cool_per = _rounded(at, dialect)
    if operands.activatecooling and operands.cool_select == PWM:
        timing = cool_timing(operands, ts)
        at = cool_line(operands, y, operands.cool_pwmlowerscaling, operands.cool_pwmupperscaling)
        cool, cool_pwm = pwm.advance(cool, at, timing, _rule(timing, dialect))
        flags |= flag.BAD_PARAM if pwm.conflicting(timing) else 0
    else:
        cool = NO_PULSE
    return Outputs(heat_out, cool_out, heat_per, cool_per, heat_pwm, cool_pwm, heat, cool, flags)
