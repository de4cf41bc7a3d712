"""PID_REG_CE: pulse-step controller for an actuator of constant speed.

This file alone decides the order of its operations and of its pulse machine. It does not know the actuator: limit
switches come in as CONC_*, motion goes out as OPEN_OUT and CLOSE_OUT, never both.

Theory of operation: Y in % is an ordinary PID; a series begins with one pulse of T1 = T_PERIOD/100·|Y| seconds and
goes on with pulses of PT_MIN_IMP and pauses of PT_MIN_IMP/T1·T_PERIOD, until the error enters the zone or changes its
sign. So the actuator integrates, with Ti = T_PERIOD + T1, and TN acts only on Y where a series begins. Durations are
counted in calls. Trap: D acts from one call to the next, so an error that jumps has a large Y for one call.

Source:
    MANUAL one-page description, version 23.12.10: interface, law, zone, manual, CONC_* (spec D.1, D.2).
    ASSUMED order of the steps, rounding to calls, everything in spec D.4, D.6, D.7; kernel as CoDeSys `util.lib` PID.
    ASSUMED the first call has no D; Y goes on being shown while a limit switch blocks, for the demand is still there.
    ASSUMED a series that `rearm_ratio` restarts begins with the present Y and an empty integral.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ahgateway.core import flags as flag
from ahgateway.core.controllers.delta import ZERO, finite, gain, limit, operand
from ahgateway.core.controllers.pid_reg_ce_dialect import (
    BacklashPause,
    ErrorSign,
    FirstBacklash,
    IdleY,
    IntegralSpan,
    NoMinimumPulse,
    PauseFrom,
    PulseDialect,
    SeriesEnd,
    ShortPulse,
    Stopped,
    ZonePulse,
)
from ahgateway.core.operands import Access, Kind, Operand, Source
from ahgateway.core.real import REAL

HALF = REAL(0.5)
HUNDRED = REAL(100)
TICK_MAX = REAL(2**30)
"""Longest duration in calls that is counted (ASSUMED); a longer one lasts as if for ever."""

IDLE = 0
PULSE = 1
PAUSE = 2
MANUAL = 3
PHASES: tuple[str, ...] = ("IDLE", "PULSE", "PAUSE", "MANUAL")

OPERANDS: tuple[Operand, ...] = (
    operand("ACTUAL", Kind.REAL, 0.0, "process value", unit="PV"),
    operand("SET_POINT", Kind.REAL, 0.0, "target value", unit="PV"),
    operand("D_ZONE", Kind.REAL, 0.0, "half width of the zone without effect, edges excluded", unit="PV"),
    operand("KP", Kind.REAL, 1.0, "gain; negative counts as 0, direction is ACTION's", unit="%/PV", minimum=0),
    operand("TN", Kind.REAL, 0.0, "integration constant, 0 switches I off", unit="s", minimum=0),
    operand("TV", Kind.REAL, 0.0, "differentiation constant, 0 switches D off", unit="s", minimum=0),
    operand("PT_MIN_IMP", Kind.REAL, 0.5, "minimum pulse, 0.5 to 1 % of the stroke time", unit="s", minimum=0),
    operand(
        "PT_LUFT",
        Kind.REAL,
        0.0,
        "backlash time, added where the direction changes",
        unit="s",
        minimum=0,
    ),
    operand("Y_OGR", Kind.REAL, 100.0, "limit of Y on either side", unit="%", minimum=0, maximum=100),
    operand("ACTION", Kind.BOOL, False, "FALSE direct, TRUE reverse"),
    operand("REG_AVT", Kind.BOOL, True, "TRUE automatic, FALSE manual"),
    operand("IN_OPEN_R", Kind.BOOL, False, "manual open, without IN_CLOSE_R"),
    operand("IN_CLOSE_R", Kind.BOOL, False, "manual close, without IN_OPEN_R"),
    operand("CONC_OPEN", Kind.BOOL, True, "limit switch, FALSE is fully open"),
    operand("CONC_CLOSE", Kind.BOOL, True, "limit switch, FALSE is fully closed"),
    operand("T_PERIOD", Kind.REAL, 10.0, "period of the control pulses", unit="s", minimum=0),
    operand(
        "DT",
        Kind.REAL,
        0.1,
        "period of the calls; no input of the block",
        unit="s",
        source=Source.ASSUMED,
    ),
    operand("Y", Kind.REAL, 0.0, "demand", unit="%", access=Access.OUT),
    operand("ERROR", Kind.REAL, 0.0, "SET_POINT - ACTUAL", unit="PV", access=Access.OUT),
    operand("OPEN_OUT", Kind.BOOL, False, "drives the actuator open", access=Access.OUT),
    operand("CLOSE_OUT", Kind.BOOL, False, "drives the actuator closed", access=Access.OUT),
    operand("OSTANOV", Kind.BOOL, True, "regulator stopped", access=Access.OUT),
)
"""Defaults are ours, ASSUMED (spec D.1)."""


class Operands(NamedTuple):
    """What the block reads: REALs in the units of the table, `dt` in s."""

    actual: REAL = ZERO
    set_point: REAL = ZERO
    d_zone: REAL = ZERO
    kp: REAL = REAL(1)
    tn: REAL = ZERO
    tv: REAL = ZERO
    pt_min_imp: REAL = HALF
    pt_luft: REAL = ZERO
    y_ogr: REAL = HUNDRED
    action: bool = False
    reg_avt: bool = True
    in_open_r: bool = False
    in_close_r: bool = False
    conc_open: bool = True
    conc_close: bool = True
    t_period: REAL = REAL(10)
    dt: REAL = REAL(0.1)


class State(NamedTuple):
    """What one call leaves to the next; all but `y` is hidden.

    Attributes:
        phase: IDLE, PULSE or PAUSE.
        ticks: Calls left of the pulse or pause.
        sgn: Sign of the error for which the series began.
        dir: Direction of the series, 1 opens, −1 closes.
        last: Direction of the last real motion, 0 before any.
        t1: T1 of the series in s.
        i: Integral, in units of the error.
        e1: Error of the last call, by ACTION.
        y: Demand in %.
        y_first: |Y| where the series began.
        age: Calls since the series began.
        rest: Calls since the last motion.
        valid: `e1` means something.
    """

    phase: int = IDLE
    ticks: int = 0
    sgn: int = 0
    dir: int = 0
    last: int = 0
    t1: REAL = ZERO
    i: REAL = ZERO
    e1: REAL = ZERO
    y: REAL = ZERO
    y_first: REAL = ZERO
    age: int = 0
    rest: int = 0
    valid: bool = False


class Terms(NamedTuple):
    """Every term of one call: `i` and `d` in units of the error, `t1` in s, `ticks` left after this call."""

    error: REAL
    e: REAL
    i: REAL
    d: REAL
    y: REAL
    t1: REAL
    phase: int
    ticks: int
    open_out: bool
    close_out: bool
    ostanov: bool
    flags: int


class _Tuning(NamedTuple):
    """The parameters as the block uses them: negative and non-finite ones are 0, Y_OGR lies within 0…100."""

    d_zone: REAL
    kp: REAL
    tn: REAL
    tv: REAL
    minimum: REAL
    luft: REAL
    y_ogr: REAL
    period: REAL
    flags: int


def nominal_ts(operands: Operands) -> REAL:
    """Return the call period in s."""
    return operands.dt


def recall(operands: Operands, seen: State) -> tuple[tuple[State, State], ...]:
    """Return nothing: Y and the outputs do not show how many calls a pulse or pause has left."""
    return ()


def ticks(duration: REAL, ts: REAL) -> int:
    """Return a duration in s as calls of `ts` s: rounded half up, at least 1."""
    count = np.floor((duration / ts) + HALF)
    return max(1, int(count)) if count < TICK_MAX else int(TICK_MAX)


def inside_zone(operands: Operands, d_zone: REAL) -> bool:
    """Tell whether SET_POINT − D_ZONE < ACTUAL < SET_POINT + D_ZONE."""
    low, high = operands.set_point - d_zone, operands.set_point + d_zone
    return bool(low < operands.actual < high)


def step(operands: Operands, state: State, dialect: PulseDialect, ts: REAL) -> tuple[State, Terms]:
    """Advance PID_REG_CE by one call; equal arguments give equal bits.

    Args:
        operands: Inputs as the block sees them; nothing needs to be in range.
        state: What the call before left behind.
        dialect: Choices where the page is silent.
        ts: Call period in s, positive; the nominal one is `nominal_ts`.

    Returns:
        The next state, and every term with the two outputs.
    """
    error = operands.set_point - operands.actual
    e = -error if operands.action else error
    shown = e if operands.action and dialect.error_sign == ErrorSign.BY_ACTION else error
    if not finite(e):
        return _off(state, shown, state.e1, state.valid, flag.BAD_INPUT)
    tuning = _tuning(operands, dialect, ts)
    if tuning.period <= ZERO or tuning.minimum <= ZERO:
        return _off(state, shown, e, True, tuning.flags | flag.BAD_PARAM | flag.STOPPED)
    if not operands.reg_avt:
        return _manual(operands, state, dialect, shown, e, tuning.flags)

    e1 = state.e1 if state.valid else e
    sg = 0 if inside_zone(operands, tuning.d_zone) else _sign(e)
    s = State(
        state.phase, state.ticks, state.sgn, state.dir, state.last, state.t1, state.i, e, state.y,
        state.y_first, state.age, state.rest, True,
    )  # fmt: skip
    d = ZERO
    if sg == 0:
        if s.phase != PULSE or dialect.zone_pulse == ZonePulse.CUT:
            s = _ended(s, dialect)
    else:
        if s.phase != IDLE and sg != s.sgn:
            s = _ended(s, dialect)
        s, d = _demand(s, tuning, dialect, e, e1, ts)
        if not finite(s.y):
            return _off(state, shown, e, True, tuning.flags | flag.BAD_INPUT)
    s = _counted(s, tuning, dialect, sg, ts)
    s = _begun(operands, s, tuning, dialect, sg, ts)
    return _driven(operands, s, dialect, shown, e, d, tuning.flags)


def _tuning(operands: Operands, dialect: PulseDialect, ts: REAL) -> _Tuning:
    """Sanitise the parameters; BAD_PARAM for what is not finite and for a negative KP."""
    raw = (
        operands.d_zone, operands.kp, operands.tn, operands.tv, operands.pt_min_imp, operands.pt_luft,
        operands.y_ogr, operands.t_period,
    )  # fmt: skip
    flags = 0
    for value in raw:
        if not finite(value):
            flags |= flag.BAD_PARAM
    if operands.kp < ZERO:
        flags |= flag.BAD_PARAM
    minimum = gain(operands.pt_min_imp)
    if minimum <= ZERO and dialect.no_minimum_pulse == NoMinimumPulse.ONE_CALL:
        minimum = ts
    y_ogr = limit(ZERO, operands.y_ogr, HUNDRED) if finite(operands.y_ogr) else ZERO
    d_zone = operands.d_zone if finite(operands.d_zone) else ZERO
    return _Tuning(
        d_zone, gain(operands.kp), gain(operands.tn), gain(operands.tv), minimum, gain(operands.pt_luft), y_ogr,
        gain(operands.t_period), flags,
    )  # fmt: skip


def _sign(x: REAL) -> int:
    return 1 if x > ZERO else (-1 if x < ZERO else 0)


def _ended(s: State, dialect: PulseDialect) -> State:
    """No series: I and Y are 0, unless the dialect keeps them."""
    i = s.i if s.i != ZERO and dialect.series_end == SeriesEnd.KEPT else ZERO
    y = s.y if s.y != ZERO and dialect.idle_y == IdleY.HELD else ZERO
    return State(IDLE, 0, s.sgn, s.dir, s.last, s.t1, i, s.e1, y, s.y_first, 0, s.rest, s.valid)


def _demand(s: State, tuning: _Tuning, dialect: PulseDialect, e: REAL, e1: REAL, ts: REAL) -> tuple[State, REAL]:
    """Y, the integral and D of this call; outside a series the integral starts from 0."""
    i, age = s.i, s.age
    if s.phase == IDLE:
        age = 0
        if i != ZERO and dialect.series_end == SeriesEnd.CLEARED:
            i = ZERO
    within = REAL(age) * ts < tuning.tn
    if tuning.tn > ZERO and (within or dialect.integral_span == IntegralSpan.RUNNING):
        i = i + ((e * ts) / tuning.tn)
    d = (tuning.tv * (e - e1)) / ts if tuning.tv > ZERO else ZERO
    y = tuning.kp * ((e + i) + d)
    if y == y:
        y = limit(-tuning.y_ogr, y, tuning.y_ogr)
    return State(s.phase, s.ticks, s.sgn, s.dir, s.last, s.t1, i, s.e1, y, s.y_first, age + 1, s.rest, s.valid), d


def _counted(s: State, tuning: _Tuning, dialect: PulseDialect, sg: int, ts: REAL) -> State:
    """What follows when the counter of a pulse or pause has run out, and when the demand outgrew its series."""
    phase, left, t1 = s.phase, s.ticks, s.t1
    if phase == PAUSE and sg != 0 and dialect.rearm_ratio > ZERO and abs(s.y) > dialect.rearm_ratio * s.y_first:
        return State(IDLE, 0, s.sgn, s.dir, s.last, t1, ZERO, s.e1, s.y, s.y_first, 0, s.rest, s.valid)
    if phase == IDLE or left > 0:
        return s
    if sg == 0:
        return _ended(s, dialect)
    if phase == PAUSE:
        phase, left = PULSE, ticks(tuning.minimum, ts)
    else:
        tracked = (tuning.period / HUNDRED) * abs(s.y)
        if s.y != ZERO and tracked != t1 and dialect.pause_from == PauseFrom.TRACKING:
            t1 = tracked
        phase, left = PAUSE, ticks((tuning.minimum / t1) * tuning.period, ts)
    return State(phase, left, s.sgn, s.dir, s.last, t1, s.i, s.e1, s.y, s.y_first, s.age, s.rest, s.valid)


def _begun(operands: Operands, s: State, tuning: _Tuning, dialect: PulseDialect, sg: int, ts: REAL) -> State:
    """A new series, when there is a demand, the way is free and the actuator has rested before it reverses."""
    direction = _sign(s.y)
    if s.phase != IDLE or sg == 0 or direction == 0:
        return s
    if not (operands.conc_open if direction > 0 else operands.conc_close):
        return s
    reversing = s.last not in (0, direction)
    if reversing and dialect.reverse_pause > ZERO and s.rest < ticks(dialect.reverse_pause, ts):
        return s
    t1 = (tuning.period / HUNDRED) * abs(s.y)
    pulse = tuning.minimum if t1 < tuning.minimum else t1
    if pulse != t1 and dialect.short_pulse == ShortPulse.PAUSE_FROM_STRETCHED:
        t1 = pulse
    if reversing or (s.last == 0 and tuning.luft > ZERO and dialect.first_backlash == FirstBacklash.YES):
        pulse = pulse + tuning.luft
        if tuning.luft > ZERO and dialect.backlash_pause == BacklashPause.WITH_LUFT:
            t1 = t1 + tuning.luft
    return State(PULSE, ticks(pulse, ts), sg, direction, s.last, t1, s.i, s.e1, s.y, abs(s.y), s.age, s.rest, s.valid)


def _driven(
    operands: Operands, s: State, dialect: PulseDialect, shown: REAL, e: REAL, d: REAL, flags: int
) -> tuple[State, Terms]:
    """The outputs of an automatic call behind the limit switches, and the counter one call further."""
    opens = s.phase == PULSE and s.dir > 0
    closes = s.phase == PULSE and s.dir < 0
    blocked = (opens and not operands.conc_open) or (closes and not operands.conc_close)
    phase, left, i = s.phase, max(0, s.ticks - 1), s.i
    if blocked:
        opens = closes = False
        phase, left = IDLE, 0
        if i != ZERO and dialect.series_end == SeriesEnd.CLEARED:
            i = ZERO
    stopped = phase == IDLE
    if not (stopped or opens or closes) and dialect.stopped == Stopped.NO_OUTPUT:
        stopped = True
    moving = 1 if opens else (-1 if closes else 0)
    last, rest = (moving, 0) if moving else (s.last, min(s.rest + 1, int(TICK_MAX)))
    after = State(phase, left, s.sgn, s.dir, last, s.t1, i, s.e1, s.y, s.y_first, s.age, rest, True)
    return after, Terms(shown, e, i, d, s.y, s.t1, phase, left, opens, closes, stopped, flags)


def _manual(
    operands: Operands, state: State, dialect: PulseDialect, shown: REAL, e: REAL, flags: int
) -> tuple[State, Terms]:
    """Manual: one input alone drives its output, behind its limit switch; the history goes on."""
    opens = operands.in_open_r and not operands.in_close_r and operands.conc_open
    closes = operands.in_close_r and not operands.in_open_r and operands.conc_close
    ended = _ended(state, dialect)
    moving = 1 if opens else (-1 if closes else 0)
    last, rest = (moving, 0) if moving else (state.last, min(state.rest + 1, int(TICK_MAX)))
    after = State(IDLE, 0, 0, ended.dir, last, ended.t1, ended.i, e, ended.y, ZERO, 0, rest, True)
    stopped = moving == 0 or dialect.stopped == Stopped.NO_SERIES_OR_MANUAL
    terms = Terms(shown, e, after.i, ZERO, after.y, after.t1, MANUAL, 0, opens, closes, stopped, flags | flag.MANUAL)
    return after, terms


def _off(state: State, shown: REAL, e1: REAL, valid: bool, flags: int) -> tuple[State, Terms]:
    """Both outputs off and no series: a motor must not run on a bad signal."""
    rest = min(state.rest + 1, int(TICK_MAX))
    after = State(IDLE, 0, 0, state.dir, state.last, ZERO, ZERO, e1, ZERO, ZERO, 0, rest, valid)
    return after, Terms(shown, e1, ZERO, ZERO, ZERO, ZERO, IDLE, 0, False, False, True, flags)
