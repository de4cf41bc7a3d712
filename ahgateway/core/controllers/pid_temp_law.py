"""The law of PID_Temp: PIDT1 with weights, dead and control zone, cooling factor or two parameter sets.

This file alone decides the order of the law's operations and what a preset of the integral is. It does not know modes,
errors or outputs.

Theory of operation: choose the parameter set, dead-zone the error, D on the weighted error through a filter of a·Td
(backward Euler), then either the control zone (full output, integral held), a preset (integral set so that the output
goes on from where it is, no integration) or the step, in which only the worsening direction stops the integral.
The weights act on the dead-zoned error as −(1−b)·w and −(1−c)·w, so that PV moves inside the zone change nothing.

Source:
    MANUAL PID control function manual 03/2017 and TIA Portal help, PID_Temp: law, zones, anti-windup (spec E.2–E.4).
    ASSUMED discretisation, parameter switching, presets of the integral (spec E.3, E.5, E.7).
    ASSUMED a switch of the set outside the control zone drops its preset as a transfer does; a control zone that is not
    positive is off; a Cycle that is not positive is the call period.
"""

from __future__ import annotations

from typing import NamedTuple

from ahgateway.core import flags as flag
from ahgateway.core.controllers.delta import ZERO, finite, gain, limit
from ahgateway.core.controllers.pid_temp_dialect import (
    DeadZone,
    DisturbancePlace,
    InvalidGain,
    PidTempDialect,
    SamplingTime,
    Switching,
    ZoneAtTransfer,
    ZoneReturn,
)
from ahgateway.core.controllers.pid_temp_operands import Core, Operands
from ahgateway.core.controllers.pid_temp_output import calls
from ahgateway.core.real import REAL

ONE = REAL(1)

STAY = 0
START = 1
TRANSFER = 2
"""How automatic mode is entered in this call: not at all, from inactive, from manual or substitute output."""

NO_PRESET = 0
OF_START = 1
OF_TRANSFER = 2


class Set(NamedTuple):
    """The active parameters, unusable ones replaced by 0; `kp` is as it is, for a bad gain is a warning."""

    kp: REAL
    ti: REAL
    td: REAL
    a: REAL
    b: REAL
    c: REAL
    cycle: REAL
    ts: REAL
    flags: int


class Parts(NamedTuple):
    """What one execution computed: `e`, `ez` in PV units, the others in output units."""

    e: REAL = ZERO
    ez: REAL = ZERO
    p: REAL = ZERO
    raw: REAL = ZERO
    failed: bool = False
    flags: int = 0


NOTHING = Parts()
"""Of a call in which the law was not due; a name, for the compiler knows no defaults."""


def two_sets(operands: Operands) -> bool:
    """Tell whether the block switches between heating and cooling parameters."""
    return bool(operands.activatecooling and operands.advancedcooling)


def with_factor(operands: Operands) -> bool:
    """Tell whether a negative output is multiplied by CoolFactor."""
    return bool(operands.activatecooling and not operands.advancedcooling)


def limits(operands: Operands) -> tuple[REAL, REAL]:
    """Return the lowest and highest PidOutputSum."""
    low = operands.cool_pidlowerlimit if operands.activatecooling else operands.heat_pidlowerlimit
    return low, operands.heat_pidupperlimit


def gains_valid(operands: Operands) -> bool:
    """Tell whether every gain in use is a positive number, and CoolFactor where it is in use."""
    if not (finite(operands.heat_gain) and operands.heat_gain > ZERO):
        return False
    if two_sets(operands) and not (finite(operands.cool_gain) and operands.cool_gain > ZERO):
        return False
    return not (with_factor(operands) and not (finite(operands.coolfactor) and operands.coolfactor > ZERO))


def cools(operands: Operands, dialect: PidTempDialect, cooling: bool, y: REAL, e: REAL) -> bool:
    """Return whether the cooling set is active, from the last output and the present error."""
    if not two_sets(operands):
        return False
    if y != ZERO or e == ZERO or dialect.switching == Switching.AT_ZERO:
        below, above = bool(y <= ZERO), bool(y >= ZERO)
    else:
        below, above = bool(y < ZERO), bool(y > ZERO)
    if cooling:
        return not (above and e > ZERO)
    return below and bool(e < ZERO)


def active_set(operands: Operands, cooling: bool, dialect: PidTempDialect, ts: REAL) -> Set:
    """Return the heating or the cooling parameters, with the sampling time of the law for calls of `ts` s."""
    if cooling:
        raw = (
            operands.cool_gain, operands.cool_ti, operands.cool_td, operands.cool_tdfiltratio, operands.cool_pweighting,
            operands.cool_dweighting, operands.cool_cycle,
        )  # fmt: skip
    else:
        raw = (
            operands.heat_gain, operands.heat_ti, operands.heat_td, operands.heat_tdfiltratio, operands.heat_pweighting,
            operands.heat_dweighting, operands.heat_cycle,
        )  # fmt: skip
    kp, ti, td, a, b, c, cycle = raw
    flags = 0
    if not (finite(ti) and finite(td) and finite(a) and finite(b) and finite(c) and finite(cycle)):
        flags |= flag.BAD_PARAM
    cycle = cycle if finite(cycle) and cycle > ZERO else ts
    counted = REAL(calls(cycle, ts, 1)) * ts
    sampling = counted if counted != cycle and dialect.sampling_time == SamplingTime.COUNTED else cycle
    return Set(kp, gain(ti), gain(td), gain(a), gain(b), gain(c), cycle, sampling, flags)


def dead_zoned(operands: Operands, dialect: PidTempDialect, e: REAL) -> REAL:
    """The error after the dead zone; with two sets its width below the setpoint is heating's, above it cooling's."""
    zone = operands.cool_deadzone if two_sets(operands) and e < ZERO else operands.heat_deadzone
    zone = gain(zone)
    if abs(e) <= zone:
        return ZERO
    if zone > ZERO and dialect.dead_zone == DeadZone.JUMP:
        return e
    return e - zone if e > ZERO else e + zone


def beyond_control_zone(operands: Operands, w: REAL, x: REAL) -> int:
    """Return 1 where PV lies below the control zone, −1 above it, 0 inside; the widths as for the dead zone."""
    below = operands.heat_controlzone
    above = operands.cool_controlzone if two_sets(operands) else below
    if finite(below) and below > ZERO and x < w - below:
        return 1
    if finite(above) and above > ZERO and x > w + above:
        return -1
    return 0


def execute(
    operands: Operands, core: Core, dialect: PidTempDialect, w: REAL, x: REAL, disturbance: REAL, entry: int, ts: REAL
) -> tuple[Core, Parts]:
    """Execute the law once.

    Args:
        operands: Parameters; nothing needs to be in range.
        core: What the execution before left.
        dialect: Choices where the manual is silent.
        w: Setpoint after its limits, finite.
        x: Process value, finite.
        disturbance: Feed-forward, finite.
        entry: STAY, START or TRANSFER.
        ts: Call period in s, positive.

    Returns:
        The next core and the parts; a result that is no number leaves the core as it was and sets `failed`.
    """
    e = w - x
    cooling = cools(operands, dialect, core.cooling, core.y, e)
    switched = cooling != core.cooling and entry == STAY
    ps = active_set(operands, cooling, dialect, ts)
    ez = dead_zoned(operands, dialect, e)
    if not gains_valid(operands):
        i = ZERO if core.i != ZERO and dialect.invalid_gain == InvalidGain.CLEARED else core.i
        refused = Parts(e, ez, ZERO, ZERO, False, ps.flags | flag.BAD_PARAM)
        return Core(ZERO, i, ZERO, core.u1, False, cooling, core.outside), refused

    u = ez - ((ONE - ps.c) * w)
    known = core.valid and not switched
    d = derivative(ps, core.d if known else ZERO, u, core.u1 if known else u)
    p = ps.kp * (ez - ((ONE - ps.b) * w))
    beyond = beyond_control_zone(operands, w, x)
    i, y, preset = _preset(operands, core, dialect, ps, entry, switched, beyond, x)
    low, high = limits(operands)

    if preset:
        is_early = _joins_early(operands, dialect, disturbance)
        before = _before_factor(operands, y if is_early else y - disturbance)
        i = ((before - p) - d) - (disturbance if is_early else ZERO)
    if beyond:
        if preset == OF_TRANSFER and dialect.zone_at_transfer == ZoneAtTransfer.DROPPED:
            i = core.i
        raw = high if beyond > 0 else low
        flags = ps.flags
    elif preset:
        raw = y
        flags = ps.flags | flag.BUMPLESS
    else:
        i, raw, flags = integrated(operands, dialect, ps, ez, p, i, d, disturbance)
    if not (finite(i) and finite(d) and finite(raw)):
        return core, Parts(e, ez, p, raw, True, ps.flags | flag.BAD_PARAM)
    after = Core(limit(low, raw, high), i, d, u, True, cooling, beyond != 0)
    return after, Parts(e, ez, p, raw, False, flags)


def derivative(ps: Set, d: REAL, u: REAL, u1: REAL) -> REAL:
    """Content of the D filter after this execution; 0 while Td is 0."""
    if ps.td <= ZERO:
        return ZERO
    filtered = ps.a * ps.td
    return ((filtered * d) + ((ps.kp * ps.td) * (u - u1))) / (filtered + ps.ts)


def integrated(
    operands: Operands, dialect: PidTempDialect, ps: Set, ez: REAL, p: REAL, i: REAL, d: REAL, disturbance: REAL
) -> tuple[REAL, REAL, int]:
    """The ordinary step: the integral after it, the output before its limits, and the flags."""
    flags = ps.flags
    low, high = limits(operands)
    inc = ZERO
    if ps.ti > ZERO:
        inc = ((ps.kp * ps.ts) / ps.ti) * ez
    raw = (p + (i + inc)) + d
    is_early = _joins_early(operands, dialect, disturbance)
    if is_early:
        raw = raw + disturbance
    if with_factor(operands) and raw < ZERO:
        raw = raw * operands.coolfactor
    if not is_early:
        raw = raw + disturbance
    if raw > high and inc > ZERO:
        return i, raw, flags | flag.FREEZE_HI
    if raw < low and inc < ZERO:
        return i, raw, flags | flag.FREEZE_LO
    return i + inc, raw, flags


def _preset(
    operands: Operands, core: Core, dialect: PidTempDialect, ps: Set, entry: int, switched: bool, beyond: int, x: REAL
) -> tuple[REAL, REAL, int]:
    """The integral to go on with, the output to go on from, and whether the integral is to be preset to it."""
    if ps.ti <= ZERO:
        return ZERO, core.y, NO_PRESET
    if entry == START:
        mode = operands.integralresetmode
        if mode == 0:
            return core.i, ZERO, OF_START
        if mode == 1:
            return ZERO, core.y, NO_PRESET
        if mode == 2:
            return core.i, core.y, NO_PRESET
        if mode == 3:
            return core.i, operands.overwriteinitialoutputvalue, OF_START
        # Outside 0…4 the block acts as with its default, 4.
        return (ps.kp * (ONE - ps.b)) * x, core.y, NO_PRESET
    returned = core.outside and beyond == 0 and dialect.zone_return == ZoneReturn.PRESET
    if entry == TRANSFER or switched or returned:
        return core.i, core.y, OF_TRANSFER
    return core.i, core.y, NO_PRESET


def _joins_early(operands: Operands, dialect: PidTempDialect, disturbance: REAL) -> bool:
    """Tell whether Disturbance joins before CoolFactor; without a factor both are one."""
    if disturbance == ZERO or not with_factor(operands):
        return True
    return dialect.disturbance_place == DisturbancePlace.BEFORE_FACTOR


def _before_factor(operands: Operands, inner: REAL) -> REAL:
    """The sum that gives this output: divided by CoolFactor where that multiplied it."""
    return inner / operands.coolfactor if with_factor(operands) and inner < ZERO else inner
