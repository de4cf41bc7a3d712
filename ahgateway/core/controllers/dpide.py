"""Delta DPIDE (API 0708): position form, independent or dependent gains, filtered D on E or PV, BIAS.

This file alone decides the order of DPIDE's operations. It does not know when an execution is due, nor where
operands stand in a PLC.

Theory of operation: as DPID, with four differences. The dead band is the zero-cross one: the true error counts until
PV has passed SV inside the band, then 0 until PV leaves it. D runs through a first-order filter Tf (backward
Euler). The dependent form scales I and D by Kc. BIAS joins the sum before the limiter and after I.
Trap: Ti_Ki is Ti in s when PID_EQ is TRUE and Ki in 1/s when it is FALSE.

Source:
    MANUAL AH500 programming manual, API 0708: operands, clamping, laws, zero-cross dead band (spec B.1, B.2, B.4).
    ASSUMED discretisation, order of operations, filter form, what PID_RUN = FALSE clears (spec B.3, B.5).
"""

from __future__ import annotations

from typing import NamedTuple

from ahgateway.core import flags as flag
from ahgateway.core.controllers import delta
from ahgateway.core.controllers.delta import ZERO, clamped_cycle, finite, gain, limit
from ahgateway.core.dialect import Dialect, Freeze, RunOff
from ahgateway.core.operands import Kind, Operand
from ahgateway.core.real import REAL

THOUSAND = REAL(1000)
CYCLE_MAX = 40000
D_BOUND = REAL(1e30)
"""Any D filter content that a real loop can hold lies within ±D_BOUND (ASSUMED)."""

OPERANDS: tuple[Operand, ...] = (
    delta.PID_RUN,
    delta.SV,
    delta.PV,
    delta.pid_mode(1, "0 automatic, transfer from manual is bumpless; 1 auto-tuning"),
    delta.PID_MAN,
    delta.MOUT_AUTO,
    delta.operand("CYCLE", Kind.DINT, 1000, "sampling time", unit="ms", minimum=1, maximum=CYCLE_MAX),
    delta.operand("Kc_Kp", Kind.REAL, 1.0, "Kc (dependent) or Kp (independent)", unit="MV/PV", minimum=0),
    delta.operand(
        "Ti_Ki",
        Kind.REAL,
        1.0,
        "Ti in s (dependent) or Ki in 1/s (independent), 0 switches I off",
        unit="s or 1/s",
        minimum=0,
    ),
    delta.operand("Td_Kd", Kind.REAL, 0.1, "Td (dependent) or Kd (independent), 0 switches D off", unit="s", minimum=0),
    delta.operand("Tf", Kind.REAL, 0.0, "time constant of the derivative filter, 0 is no filter", unit="s", minimum=0),
    delta.operand("PID_EQ", Kind.BOOL, False, "TRUE dependent, FALSE independent formula"),
    delta.operand("PID_DE", Kind.BOOL, False, "TRUE derivative of PV, FALSE derivative of E"),
    delta.PID_DIR,
    delta.operand("ERR_DBW", Kind.REAL, 0.0, "zero-cross dead band, its absolute value counts; 0 is off", unit="PV"),
    delta.MV_MAX,
    delta.MV_MIN,
    delta.MOUT,
    delta.operand("BIAS", Kind.REAL, 0.0, "feed-forward, added to the sum before the limits", unit="MV"),
    delta.i_mv(20),
    delta.MV,
)


class Operands(NamedTuple):
    """What the instruction reads: REALs in engineering units, CYCLE in ms, Tf in s."""

    pid_run: bool = True
    sv: REAL = ZERO
    pv: REAL = ZERO
    pid_mode: int = 0
    pid_man: bool = False
    mout_auto: bool = False
    cycle: int = 1000
    kc_kp: REAL = REAL(1)
    ti_ki: REAL = REAL(1)
    td_kd: REAL = REAL(0.1)
    tf: REAL = ZERO
    pid_eq: bool = False
    pid_de: bool = False
    pid_dir: bool = True
    err_dbw: REAL = ZERO
    mv_max: REAL = REAL(100)
    mv_min: REAL = ZERO
    mout: REAL = ZERO
    bias: REAL = ZERO


class State(NamedTuple):
    """What one execution leaves to the next.

    Attributes:
        i: Integral in output units, the first REAL of I_MV.
        pv1: True PV of the last execution, the seventh REAL of I_MV.
        mv: The MV register.
        e1: Error of the last execution after the dead band; hidden.
        d: Content of the derivative filter; hidden.
        er1: Error of the last execution before the dead band; hidden.
        cross: PV has passed SV inside the band; hidden.
        man1: The last execution was in manual; hidden.
        valid: History exists; hidden.
    """

    i: REAL = ZERO
    pv1: REAL = ZERO
    mv: REAL = ZERO
    e1: REAL = ZERO
    d: REAL = ZERO
    er1: REAL = ZERO
    cross: bool = False
    man1: bool = False
    valid: bool = False


class Terms(NamedTuple):
    """Every term of one execution, before and after limiting, in output units but for `e` and `cross`."""

    e: REAL
    p: REAL
    i: REAL
    d: REAL
    bias: REAL
    raw: REAL
    mv: REAL
    mout: REAL
    cross: bool
    flags: int


def nominal_ts(operands: Operands) -> REAL:
    """Return the configured sampling time in s: CYCLE, held within 1…40000, divided by 1000."""
    return REAL(clamped_cycle(operands.cycle, CYCLE_MAX)) / THOUSAND


def raw_error(operands: Operands, pv: REAL) -> REAL:
    """E by PID_DIR for this PV, before the dead band."""
    return operands.sv - pv if operands.pid_dir else pv - operands.sv


def inside_band(operands: Operands, er: REAL) -> bool:
    """Tell whether this error lies inside the dead band, edges excluded."""
    return bool(operands.err_dbw != ZERO and abs(er) < abs(operands.err_dbw))


def crossed(operands: Operands, er: REAL, er1: REAL, cross: bool) -> bool:
    """Return the cross status: set when the error passes 0 inside the band, cleared outside; 0 is a sign of its own."""
    if not inside_band(operands, er):
        return False
    return bool(cross or er == ZERO or _sign(er) != _sign(er1))


def _sign(x: REAL) -> int:
    return 1 if x > ZERO else (-1 if x < ZERO else 0)


def step(operands: Operands, state: State, dialect: Dialect, ts: REAL) -> tuple[State, Terms]:
    """Advance DPIDE by one execution; equal arguments give equal bits.

    Args:
        operands: Gains, limits, flags and values as the PLC holds them; nothing needs to be in range.
        state: What the execution before left behind.
        dialect: Choices where the manual is silent.
        ts: Sampling time in s, positive; the nominal one is `nominal_ts`.

    Returns:
        The next state, and every term of MV.
    """
    if not operands.pid_run:
        kept = ZERO if dialect.run_off == RunOff.CLEAR else state.i
        stopped = State(kept, state.pv1, ZERO, state.e1, ZERO, state.er1, False, state.man1, False)
        return stopped, Terms(ZERO, ZERO, kept, ZERO, operands.bias, ZERO, ZERO, operands.mout, False, flag.STOPPED)
    if operands.pid_mode == 1:
        return state, _held(operands, state, flag.AUTOTUNE)

    er = raw_error(operands, operands.pv)
    manual = operands.pid_man
    # A raw error is a number only if SV and PV are.
    if not finite(er) or not finite(operands.bias) or (manual and not finite(operands.mout)):
        return state, _held(operands, state, flag.BAD_INPUT)

    flags = 0
    if not (finite(operands.kc_kp) and finite(operands.ti_ki) and finite(operands.td_kd) and finite(operands.tf)):
        flags |= flag.BAD_PARAM
    kc, ti_ki, td_kd, tf = gain(operands.kc_kp), gain(operands.ti_ki), gain(operands.td_kd), gain(operands.tf)
    mv_max, mv_min = operands.mv_max, operands.mv_min
    if mv_max < mv_min:
        mv_max, mv_min = mv_min, mv_max
        flags |= flag.LIMITS_SWAPPED
    dead = operands.pid_eq and kc <= ZERO
    integrating = ti_ki > ZERO and not dead

    cross = crossed(operands, er, state.er1 if state.valid else er, state.cross)
    e = ZERO if cross else er
    e1 = state.e1 if state.valid else e
    pv1 = state.pv1 if state.valid else operands.pv

    p = kc * e
    d = ZERO
    if td_kd > ZERO and not dead:
        delta_x = _derivative_input(operands, e, e1, pv1, cross)
        kd = kc * td_kd if operands.pid_eq else td_kd
        d = ((tf * state.d) + (kd * delta_x)) / (tf + ts)

    i = state.i
    mout = operands.mout
    bias = operands.bias
    if manual:
        flags |= flag.MANUAL
        raw = mout
        mv = limit(mv_min, mout, mv_max)
    elif state.man1 and integrating:
        flags |= flag.BUMPLESS
        i = ((state.mv - p) - d) - bias
        if not finite(i):
            return state, _held(operands, state, flags | flag.BAD_INPUT)
        raw = state.mv
        mv = limit(mv_min, state.mv, mv_max)
    else:
        increment = ZERO
        candidate = ZERO
        if integrating:
            increment = (p * ts) / ti_ki if operands.pid_eq else (ti_ki * e) * ts
            candidate = i + increment
        raw = ((p + candidate) + d) + bias
        if raw != raw:
            return state, _held(operands, state, flags | flag.BAD_INPUT)
        if raw > mv_max:
            mv = mv_max
            flags |= flag.FREEZE_HI
            inward = bool(increment < ZERO)
        elif raw < mv_min:
            mv = mv_min
            flags |= flag.FREEZE_LO
            inward = bool(increment > ZERO)
        else:
            mv = raw
            i = candidate
            inward = False
        if inward:
            if dialect.freeze == Freeze.OUTWARD:
                i = candidate
            else:
                flags |= flag.LOCKUP
        if not integrating:
            i = ZERO
    if operands.mout_auto and not manual:
        mout = mv
    # An overflow must not stay in the filter for good: it starts again from 0.
    after = State(i, operands.pv, mv, e, d if finite(d) else ZERO, er, cross, manual, True)
    return after, Terms(e, p, i, d, bias, raw, mv, mout, cross, flags)


def _derivative_input(operands: Operands, e: REAL, e1: REAL, pv1: REAL, cross: bool) -> REAL:
    """What D differentiates: E, or PV with the sign of PID_DIR; PV counts as standing still while crossed."""
    if not operands.pid_de:
        return e - e1
    moved = ZERO if cross else operands.pv - pv1
    return -moved if operands.pid_dir else moved


def _held(operands: Operands, state: State, flags: int) -> Terms:
    """Terms of an execution that changes nothing."""
    return Terms(ZERO, ZERO, state.i, ZERO, operands.bias, state.mv, state.mv, operands.mout, state.cross, flags)


def recall(operands: Operands, seen: State) -> tuple[tuple[State, State], ...]:
    """Return what the execution before can have left hidden, given what the block shows after it.

    Args:
        operands: What that execution read, as far as known.
        seen: `i`, `pv1` and `mv` as read from the PLC; the rest is ignored.

    Returns:
        Pairs of a lowest and a highest state that bound each possibility: one pair, more when the cross status
        cannot be told or PID_RUN is FALSE. Only `d` differs within a pair; a larger `d` never gives a smaller MV.
    """
    er = raw_error(operands, seen.pv1)
    bound = D_BOUND if gain(operands.td_kd) > ZERO and operands.pid_run else ZERO
    statuses = (False, True) if inside_band(operands, er) and er != ZERO else (inside_band(operands, er),)
    manuals = (operands.pid_man,) if operands.pid_run else (False, True)
    pairs = []
    for cross in statuses:
        for man1 in manuals:
            e1 = ZERO if cross else er
            low = State(seen.i, seen.pv1, seen.mv, e1, -bound, er, cross, man1, operands.pid_run)
            high = State(seen.i, seen.pv1, seen.mv, e1, bound, er, cross, man1, operands.pid_run)
            pairs.append((low, high))
    return tuple(pairs)
