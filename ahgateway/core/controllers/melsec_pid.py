"""MELSEC iQ-R PID (chapter 9.2): velocity form, MV grows by ΔMV; filtered D on PV, first-order PV filter.

This file alone decides the order of its operations and what its error codes do. It does not know when an execution
is due, nor where the control block stands in a PLC.

Theory of operation: check the parameters (a bad one stops the operation, MV stays), filter PV, error by ACT.0, the
increment D of a backward-Euler DT1 on PV, ΔMV, then MV is clamped, and the next ΔMV is added to the clamped MV: the
limit is the anti-windup. Trap: KD is no derivative gain. Its time constant is Tf = KD·TD, so that a larger KD filters
more; S(P).PIDINIT has the inverse meaning. Trap: the first ΔMV contains no P.

Source:
    MANUAL iQ-R programming manual chapter 9.2, FX1S p. 5-127, FX3 p. M-28 (spec C.1, C.2, C.5).
    ASSUMED first execution, order of clamps and alarms, number format (spec C.3, C.4, C.6, C.7).
    ASSUMED a PV change beyond 16 bits counts as the largest one in D only; a bad alarm value silences its own bit only.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ahgateway.core import flags as flag
from ahgateway.core.controllers.delta import ZERO, finite, limit, operand
from ahgateway.core.controllers.melsec_dialect import (
    ActionChange,
    AlarmInput,
    DestinationWritten,
    FirstExecution,
    MelsecDialect,
    NumberFormat,
    Variation,
)
from ahgateway.core.operands import Access, Kind, Operand, Source
from ahgateway.core.real import REAL

TWO = REAL(2)
TEN = REAL(10)
HUNDRED = REAL(100)
THOUSAND = REAL(1000)
INT_MIN = REAL(-32768)
INT_MAX = REAL(32767)
D_BOUND = REAL(1e6)
"""Far above what TD/TS and 16-bit values let D hold, as a bound for a D that nobody saw (ASSUMED)."""

ACT_REVERSE = 1
ACT_INPUT_ALARM = 2
ACT_OUTPUT_ALARM = 4
ACT_TUNE = 16
ACT_LIMITS = 32

BAD_TS = 0x11A0
BAD_ALPHA = 0x11A1
BAD_KP = 0x11A2
BAD_TI = 0x11A3
BAD_KD = 0x11A4
BAD_TD = 0x11A5
SHORT_TS = 0x11A6

WARN_TS = 1
WARN_PV_CHANGE = 2
WARN_EV = 4
WARN_INTEGRAL = 8
WARN_DERIVATIVE = 16
WARN_RESULT = 32
WARN_LIMITS = 64
WARN_ALARM_VALUE = 128

FX_CODES: dict[int, int] = {
    WARN_TS: 6740,
    WARN_PV_CHANGE: 6742,
    WARN_EV: 6743,
    WARN_INTEGRAL: 6744,
    WARN_DERIVATIVE: 6746,
    WARN_RESULT: 6747,
    WARN_LIMITS: 6748,
    WARN_ALARM_VALUE: 6749,
}
"""Warning bit to the FX code; the operation goes on.

Source:
    MANUAL FX3 p. M-28; which of 6742…6747 means which value is ASSUMED.
"""

ALARM_IN_INC = 1
ALARM_IN_DEC = 2
ALARM_OUT_INC = 4
ALARM_OUT_DEC = 8


def _int(
    name: str, text: str, default: int | None, low: float, high: float, unit: str = "", access: Access = Access.IN
) -> Operand:
    return operand(
        name, Kind.INT, default, text, unit=unit, minimum=low, maximum=high, access=access, source=Source.MANUAL
    )


OPERANDS: tuple[Operand, ...] = (
    operand("EN", Kind.BOOL, True, "execution contact; the first execution after it turned on starts afresh"),
    _int("SV", "(s1), target value", 0, -32768, 32767, "PV"),
    _int("PV", "(s2), process value", 0, -32768, 32767, "PV"),
    _int("TS", "(s3)+0, sampling time, not below the scan time", 1000, 1, 32767, "ms"),
    _int("ACT", "(s3)+1, bit 0 reverse, 1 input alarm, 2 output alarm, 4 auto-tuning, 5 output limits", 0, 0, 127),
    _int("ALPHA", "(s3)+2, PV filter, 0 is off", 0, 0, 99, "%"),
    _int("KP", "(s3)+3, proportional gain", 100, 1, 32767, "%"),
    _int("TI", "(s3)+4, integral time, 0 switches I off", 0, 0, 32767, "100 ms"),
    _int("KD", "(s3)+5, derivative filter, Tf = KD·TD; 101 to 200 work, 201 is an error", 0, 0, 100, "%"),
    _int("TD", "(s3)+6, derivative time, 0 switches D off", 0, 0, 32767, "10 ms"),
    _int("S20", "(s3)+20, input variation alarm, increase", 0, 0, 32767, "PV"),
    _int("S21", "(s3)+21, input variation alarm, decrease", 0, 0, 32767, "PV"),
    _int("S22", "(s3)+22, output variation alarm, increase, or upper output limit", 0, -32768, 32767, "MV"),
    _int("S23", "(s3)+23, output variation alarm, decrease, or lower output limit", 0, -32768, 32767, "MV"),
    _int("S24", "(s3)+24, alarm output", 0, 0, 15, access=Access.OUT),
    operand(
        "SCAN",
        Kind.INT,
        0,
        "present scan time for the check of TS, 0 if unknown",
        unit="ms",
        minimum=0,
        source=Source.ASSUMED,
    ),
    _int("MV", "(d), manipulated value; its content starts the sum", 0, -32768, 32767, "MV", Access.IN_OUT),
)
"""Defaults: the vendor gives none; these are ours, ASSUMED."""


class Operands(NamedTuple):
    """What the instruction reads: the control block's integers; `sv`, `pv`, `mv` as REAL or integer."""

    en: bool = True
    sv: REAL = ZERO
    pv: REAL = ZERO
    ts: int = 1000
    act: int = 0
    alpha: int = 0
    kp: int = 100
    ti: int = 0
    kd: int = 0
    td: int = 0
    s20: int = 0
    s21: int = 0
    s22: int = 0
    s23: int = 0
    scan: int = 0
    mv: REAL = ZERO


class State(NamedTuple):
    """What one execution leaves to the next; all but `out` lie in the work area and are hidden.

    Attributes:
        mv: MV(n), the sum of all increments, clamped.
        ev1: EV(n), the error.
        pvf1: PVf(n), the filtered PV.
        pvf2: PVf(n-1).
        d: D(n), the derivative's increment.
        pv1: PV(n) before the filter.
        out: What was written into (d).
        reverse1: ACT.0 of the last execution.
        valid: History exists.
    """

    mv: REAL = ZERO
    ev1: REAL = ZERO
    pvf1: REAL = ZERO
    pvf2: REAL = ZERO
    d: REAL = ZERO
    pv1: REAL = ZERO
    out: REAL = ZERO
    reverse1: bool = False
    valid: bool = False


class Terms(NamedTuple):
    """Every term of one execution: `p`, `i`, `d` before KP, `dmv`, `raw` before the clamps, `out` as written to (d)."""

    pvf: REAL
    ev: REAL
    p: REAL
    i: REAL
    d: REAL
    dmv: REAL
    raw: REAL
    mv: REAL
    out: REAL
    alarm: int
    error: int
    warnings: int
    flags: int


def nominal_ts(operands: Operands) -> REAL:
    """Return the sampling time in s: TS/1000, or the scan time where TS does not exceed it; a TS below 1 acts as 1."""
    return REAL(max(operands.ts, operands.scan, 1)) / THOUSAND


def parameter_error(operands: Operands) -> int:
    """Return the code in SD0 of the first parameter that stops the operation, 0 if none does."""
    if operands.ts <= 0:
        return BAD_TS
    if operands.alpha < 0 or operands.alpha >= 100:
        return BAD_ALPHA
    if operands.kp < 0:
        return BAD_KP
    if operands.ti < 0:
        return BAD_TI
    if operands.kd < 0 or operands.kd >= 201:
        return BAD_KD
    if operands.td < 0:
        return BAD_TD
    return 0


def error(operands: Operands, pvf: REAL) -> REAL:
    """EV by ACT.0 for this filtered PV: SV − PVf in reverse action, PVf − SV in direct action."""
    sv = REAL(operands.sv)
    return sv - pvf if operands.act & ACT_REVERSE else pvf - sv


def step(operands: Operands, state: State, dialect: MelsecDialect, ts: REAL) -> tuple[State, Terms]:
    """Advance PID by one execution; equal arguments give equal bits.

    Args:
        operands: The control block as the PLC holds it; nothing needs to be in range.
        state: What the execution before left behind.
        dialect: Choices where the manual is silent.
        ts: Sampling time in s, positive; the nominal one is `nominal_ts`.

    Returns:
        The next state, and every term of MV.
    """
    if not operands.en:
        stopped = State(
            state.mv, state.ev1, state.pvf1, state.pvf2, state.d, state.pv1, state.out, state.reverse1, False
        )
        return stopped, _held(operands, state, 0, flag.STOPPED)
    code = parameter_error(operands)
    if code:
        return state, _held(operands, state, code, flag.BAD_PARAM)
    if operands.act & ACT_TUNE:
        return state, _held(operands, state, 0, flag.AUTOTUNE)
    pv, destination = REAL(operands.pv), REAL(operands.mv)
    if not finite(error(operands, pv)) or not finite(destination):
        return state, _held(operands, state, 0, flag.BAD_INPUT)

    warnings = WARN_TS if operands.scan > 0 and operands.ts <= operands.scan else 0
    before = _history(operands, state, dialect, pv, destination)
    filtered = pv
    if state.valid or dialect.first_execution == FirstExecution.CLEARED:
        filtered = pv + ((REAL(operands.alpha) / HUNDRED) * (before.pvf1 - pv))
    ev, warned = _int16(error(operands, filtered), WARN_EV)
    warnings |= warned
    d, warned = _derivative(operands, before, filtered, ts)
    warnings |= warned

    p = ev - before.ev1
    i = ZERO
    if operands.ti > 0:
        i, warned = _int16((ts / (REAL(operands.ti) / TEN)) * ev, WARN_INTEGRAL)
        warnings |= warned
    dmv = (REAL(operands.kp) / HUNDRED) * ((p + i) + d)
    raw = before.mv + dmv
    if raw != raw:
        return state, _held(operands, state, 0, flag.BAD_INPUT)
    mv, warned, flags = _limited(operands, raw)
    warnings |= warned

    if dialect.number_format == NumberFormat.INTEGER_SUM:
        mv = REAL(np.rint(mv))
    out = REAL(np.rint(mv)) if dialect.number_format == NumberFormat.INTEGER_IO else mv
    alarm = 0
    if state.valid:
        watched, raw_change = filtered - before.pvf1, pv - before.pv1
        if watched != raw_change and operands.act & ACT_INPUT_ALARM and dialect.alarm_input == AlarmInput.RAW:
            watched = raw_change
        alarm = _alarms(operands, dialect, watched, mv - before.mv)
    if _alarm_value_negative(operands):
        warnings |= WARN_ALARM_VALUE

    after = State(mv, ev, filtered, before.pvf1, d, pv, out, bool(operands.act & ACT_REVERSE), True)
    shown = SHORT_TS if warnings & WARN_TS else 0
    return after, Terms(filtered, ev, p, i, d, dmv, raw, mv, out, alarm, shown, warnings, flags)


def _history(operands: Operands, state: State, dialect: MelsecDialect, pv: REAL, destination: REAL) -> State:
    """What the equations see as (n-1): the state, or on the first execution the present values and (d)."""
    reverse = bool(operands.act & ACT_REVERSE)
    if not state.valid:
        if dialect.first_execution == FirstExecution.CLEARED:
            return State(destination, ZERO, ZERO, ZERO, ZERO, ZERO, destination, reverse, True)
        seeded = limit(INT_MIN, error(operands, pv), INT_MAX)
        return State(destination, seeded, pv, pv, ZERO, pv, destination, reverse, True)
    mv = state.mv
    if destination != state.out and dialect.destination_written == DestinationWritten.TAKEN:
        mv = destination
    ev1, d = state.ev1, state.d
    if reverse != state.reverse1 and dialect.action_change == ActionChange.NEGATED:
        ev1, d = -ev1, -d
    return State(mv, ev1, state.pvf1, state.pvf2, d, state.pv1, state.out, reverse, True)


def _derivative(operands: Operands, before: State, filtered: REAL, ts: REAL) -> tuple[REAL, int]:
    """D(n), and its warnings; 0 while TD is 0."""
    if operands.td <= 0:
        return ZERO, 0
    change, warnings = _int16(filtered - before.pvf1, WARN_PV_CHANGE)
    seen = before.pvf1 + change if warnings else filtered
    if operands.act & ACT_REVERSE:
        second = ((TWO * before.pvf1) - seen) - before.pvf2
    else:
        second = (((-TWO) * before.pvf1) + seen) + before.pvf2
    td, kd = REAL(operands.td) / HUNDRED, REAL(operands.kd) / HUNDRED
    den = ts + (kd * td)
    d, warned = _int16(((td / den) * second) + (((kd * td) / den) * before.d), WARN_DERIVATIVE)
    return d, warnings | warned


def _int16(x: REAL, warning: int) -> tuple[REAL, int]:
    """Hold x within 16 bits, and say with `warning` that it was not."""
    held = limit(INT_MIN, x, INT_MAX)
    return held, (warning if held != x else 0)


def _limited(operands: Operands, raw: REAL) -> tuple[REAL, int, int]:
    """MV after output limits and 16 bits, with warnings and flags; ACT.2 together with ACT.5 switches both off."""
    mv, warnings, flags = raw, 0, 0
    if operands.act & ACT_LIMITS and not operands.act & ACT_OUTPUT_ALARM:
        high, low = REAL(operands.s22), REAL(operands.s23)
        if high < low:
            high, low = low, high
            warnings |= WARN_LIMITS
            flags |= flag.LIMITS_SWAPPED
        mv = limit(low, mv, high)
    mv, warned = _int16(mv, WARN_RESULT)
    if mv < raw:
        flags |= flag.FREEZE_HI
    elif mv > raw:
        flags |= flag.FREEZE_LO
    return mv, warnings | warned, flags


def _alarms(operands: Operands, dialect: MelsecDialect, pv_change: REAL, mv_change: REAL) -> int:
    """(s3)+24: a variation strictly beyond its set value; a negative set value gives no alarm."""
    watches = operands.act & (ACT_INPUT_ALARM | ACT_OUTPUT_ALARM)
    if watches and dialect.variation == Variation.OLD_MINUS_NEW:
        pv_change, mv_change = -pv_change, -mv_change
    alarm = 0
    if operands.act & ACT_INPUT_ALARM:
        alarm |= _exceeded(pv_change, operands.s20, ALARM_IN_INC)
        alarm |= _exceeded(-pv_change, operands.s21, ALARM_IN_DEC)
    if operands.act & ACT_OUTPUT_ALARM and not operands.act & ACT_LIMITS:
        alarm |= _exceeded(mv_change, operands.s22, ALARM_OUT_INC)
        alarm |= _exceeded(-mv_change, operands.s23, ALARM_OUT_DEC)
    return alarm


def _exceeded(change: REAL, set_value: int, bit: int) -> int:
    return bit if set_value >= 0 and change > REAL(set_value) else 0


def _alarm_value_negative(operands: Operands) -> bool:
    watches_input = bool(operands.act & ACT_INPUT_ALARM)
    watches_output = bool(operands.act & ACT_OUTPUT_ALARM) and not operands.act & ACT_LIMITS
    return (watches_input and min(operands.s20, operands.s21) < 0) or (
        watches_output and min(operands.s22, operands.s23) < 0
    )


def _held(operands: Operands, state: State, code: int, flags: int) -> Terms:
    """Terms of an execution that changes nothing; (d) stays as it is."""
    destination = REAL(operands.mv)
    mv = state.mv if state.valid else destination
    return Terms(ZERO, ZERO, ZERO, ZERO, ZERO, ZERO, mv, mv, destination, 0, code, 0, flags)


def recall(operands: Operands, seen: State) -> tuple[tuple[State, State], ...]:
    """Return what the execution before can have left hidden, given what (d) shows after it.

    Args:
        operands: What that execution read, as far as known.
        seen: `mv` as read from (d), which is the whole sum only while nothing rounds; the rest is ignored.

    Returns:
        One pair of a lowest and a highest state. Only `d` and `pvf2` differ within it; the highest never gives a
        smaller MV. Nothing while the PV filter runs: PVf(n) is then unknown, and with it every term.
    """
    if operands.alpha != 0 or parameter_error(operands):
        return ()
    reverse = bool(operands.act & ACT_REVERSE)
    pv = REAL(operands.pv)
    ev1 = limit(INT_MIN, error(operands, pv), INT_MAX)
    ends = []
    for sign in (-1, 1):
        d, pvf2 = ZERO, pv
        if operands.td > 0:
            d = D_BOUND if sign > 0 else -D_BOUND
            pvf2 = INT_MAX if (sign > 0) != reverse else INT_MIN
        ends.append(State(seen.mv, ev1, pv, pvf2, d, pv, seen.mv, reverse, operands.en))
    return ((ends[0], ends[1]),)
