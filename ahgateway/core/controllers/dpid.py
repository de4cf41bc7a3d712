"""Delta DPID (API 0707): position form, independent gains, MV = Kp·E + Ki·∫E dt + Kd·dE/dt.

This file alone decides the order of DPID's law; what its parts compute in a dialect stands in `delta_terms`. It does
not know when an execution is due, nor where operands stand in a PLC.

Theory of operation: sanitise, error with its plain dead band, P and D, then either manual (MV = MOUT, integral
held), the bumpless transfer (the integral is set so that MV goes on from where it is) or the automatic step, in
which the integral stands still while the sum is beyond a limit. History is tracked in manual, so that a transfer
kicks no D.

Source:
    MANUAL AH500 programming manual, API 0707: operands, clamping, PID_RUN, modes, freeze, law (spec A.1-A.5).
    ASSUMED discretisation, order of operations, inclusive edge of the dead band, D on E (spec A.3, A.8).
"""

from __future__ import annotations

from typing import NamedTuple

from ahgateway.core import flags as flag
from ahgateway.core.controllers import delta
from ahgateway.core.controllers import delta_terms as terms_of
from ahgateway.core.controllers.delta import ZERO, clamped_cycle, finite, gain, limit
from ahgateway.core.dialect import (
    DEFAULT,
    BadInput,
    Band,
    Dialect,
    FormChange,
    Freeze,
    Limits,
    ManualIntegral,
    RunOff,
    RunOffHistory,
)
from ahgateway.core.operands import Kind, Operand
from ahgateway.core.real import REAL

HUNDRED = REAL(100)
ONE = REAL(1)
CYCLE_MAX = 2000

OPERANDS: tuple[Operand, ...] = (
    delta.PID_RUN,
    delta.SV,
    delta.PV,
    delta.pid_mode(
        2, "0 automatic, transfer from manual is bumpless; 1 auto-tuning; 2 automatic, transfer takes the held integral"
    ),
    delta.PID_MAN,
    delta.MOUT_AUTO,
    delta.operand("CYCLE", Kind.DINT, 100, "sampling time", unit="10 ms", minimum=1, maximum=CYCLE_MAX),
    delta.operand("Kp", Kind.REAL, 1.0, "proportional gain, 0 switches P off", unit="MV/PV", minimum=0),
    delta.operand("Ki", Kind.REAL, 0.0, "integral gain, 0 switches I off", unit="MV/(PV·s)", minimum=0),
    delta.operand("Kd", Kind.REAL, 0.0, "derivative gain, 0 switches D off", unit="MV·s/PV", minimum=0),
    delta.PID_DIR,
    delta.operand("ERR_DBW", Kind.REAL, 0.0, "errors from -ERR_DBW to +ERR_DBW count as 0; 0 is off", unit="PV"),
    delta.MV_MAX,
    delta.MV_MIN,
    delta.MOUT,
    delta.i_mv(12),
    delta.MV,
)


class Operands(NamedTuple):
    """What the instruction reads: REALs in engineering units, CYCLE in 10 ms."""

    pid_run: bool = True
    sv: REAL = ZERO
    pv: REAL = ZERO
    pid_mode: int = 0
    pid_man: bool = False
    mout_auto: bool = False
    cycle: int = 100
    kp: REAL = REAL(1)
    ki: REAL = ZERO
    kd: REAL = ZERO
    pid_dir: bool = True
    err_dbw: REAL = ZERO
    mv_max: REAL = REAL(100)
    mv_min: REAL = ZERO
    mout: REAL = ZERO


class State(NamedTuple):
    """What one execution leaves to the next.

    Attributes:
        i: Integral in output units, the first REAL of I_MV.
        pv1: PV of the last execution, the second REAL of I_MV.
        mv: The MV register.
        e1: Error of the last execution, after the dead band; hidden.
        man1: The last execution was in manual; hidden.
        valid: History exists, so that a difference means something; hidden.
        dir1: PID_DIR at the last execution; hidden.
    """

    i: REAL = ZERO
    pv1: REAL = ZERO
    mv: REAL = ZERO
    e1: REAL = ZERO
    man1: bool = False
    valid: bool = False
    dir1: bool = True


class Terms(NamedTuple):
    """Every term of one execution, before and after limiting, in output units but for `e`."""

    e: REAL
    p: REAL
    i: REAL
    d: REAL
    raw: REAL
    mv: REAL
    mout: REAL
    flags: int


def nominal_ts(operands: Operands) -> REAL:
    """Return the configured sampling time in s: CYCLE, held within 1…2000, divided by 100."""
    return REAL(clamped_cycle(operands.cycle, CYCLE_MAX)) / HUNDRED


def law_ts(operands: Operands, dialect: Dialect, ticks: int = 0) -> REAL:
    """Return Ts as the law takes it: from CYCLE, or from `ticks` of the dialect's clock where it measures."""
    per_second = terms_of.ticks_per_second(dialect)
    if per_second:
        return terms_of.interval(dialect, ticks, per_second)
    return terms_of.interval(dialect, clamped_cycle(operands.cycle, CYCLE_MAX), 100)


def raw_error(operands: Operands, pv: REAL, dialect: Dialect = DEFAULT) -> REAL:
    """E by PID_DIR for this PV, before the dead band."""
    return operands.sv - pv if operands.pid_dir != bool(dialect.direction) else pv - operands.sv


def inside_band(operands: Operands, er: REAL, dialect: Dialect) -> bool:
    """Tell whether this raw error lies inside the dead band."""
    if operands.err_dbw == ZERO:
        return False
    return bool(abs(er) < abs(operands.err_dbw) or (abs(er) == abs(operands.err_dbw) and not dialect.band_edge))


def error(operands: Operands, er: REAL, dialect: Dialect = DEFAULT) -> REAL:
    """E that counts for this raw error: 0 inside the dead band."""
    if operands.err_dbw == ZERO:
        return er
    if inside_band(operands, er, dialect):
        return er if dialect.band == Band.OFF else ZERO
    if dialect.band == Band.SHIFTED:
        return er - abs(operands.err_dbw) if er > ZERO else er + abs(operands.err_dbw)
    return er


def step(operands: Operands, state: State, dialect: Dialect, ts: REAL) -> tuple[State, Terms]:
    """Advance DPID by one execution; equal arguments give equal bits.

    Args:
        operands: Gains, limits, flags and values as the PLC holds them; nothing needs to be in range.
        state: What the execution before left behind.
        dialect: Choices where the manual is silent.
        ts: Sampling time as the law takes it, positive; `law_ts` makes it.

    Returns:
        The next state, and every term of MV.
    """
    if not operands.pid_run:
        return _stopped(operands, state, dialect)
    if operands.pid_mode == 1:
        return state, _held(operands, state, flag.AUTOTUNE)

    # A raw error is a number only if SV and PV are.
    is_bad = not finite(operands.sv - operands.pv) or (operands.pid_man and not finite(operands.mout))
    if is_bad and not dialect.bad_input:
        return state, _held(operands, state, flag.BAD_INPUT)
    if is_bad and dialect.bad_input == BadInput.AS_ZERO:
        operands = _numbers(operands)
    er = raw_error(operands, operands.pv, dialect)
    manual = operands.pid_man
    flags = 0
    if not (finite(operands.kp) and finite(operands.ki) and finite(operands.kd)):
        flags |= flag.BAD_PARAM
    kp, ki, kd = gain(operands.kp), gain(operands.ki), gain(operands.kd)
    mv_max, mv_min = operands.mv_max, operands.mv_min
    if mv_max < mv_min and dialect.limits != Limits.AS_WRITTEN:
        mv_max, mv_min = mv_min, mv_max
        flags |= flag.LIMITS_SWAPPED

    e = error(operands, er, dialect)
    e1, pv1 = state.e1, state.pv1
    if not state.valid and not (kd > ZERO and dialect.first_history):
        e1, pv1 = e, operands.pv
    p = kp * e
    # Off is 0, whatever E does: 0 times a difference that overflows would be no number.
    d = ZERO
    if kd > ZERO:
        ed1, pd1 = e1, pv1
        if state.valid and state.dir1 != operands.pid_dir and dialect.form_change:
            ed1 = terms_of.turned(dialect, e1, True)
            if dialect.form_change == FormChange.RESET:
                ed1, pd1 = e, operands.pv
        d = _derivative(operands, dialect, kd, e - ed1, pd1, ts)

    i = state.i
    mout = operands.mout
    kind, mv_before = 0, state.mv
    if state.man1 and not manual and ki > ZERO:
        kind = terms_of.transfer_kind(operands.pid_mode, dialect)
    if kind > 0:
        flags |= flag.BUMPLESS
        mv_before = terms_of.taken_over(dialect, state.mv, mout, mv_min, mv_max)
        wanted = terms_of.preset_term(dialect, kind, mv_before, p, d, ZERO, mv_min, mv_max)
        i = terms_of.stored(dialect, False, ki, ONE, wanted)
    if manual:
        flags |= flag.MANUAL
        raw = mout
        mv = limit(mv_min, mout, mv_max)
        if ki > ZERO and dialect.manual_integral:
            i = _in_manual(dialect, i, ki, e, e1, ts, mv, p, d, mv_min, mv_max)
    elif kind == 1 and not dialect.preset_integrates:
        raw = mv_before
        mv = limit(mv_min, mv_before, mv_max)
    elif operands.err_dbw != ZERO and dialect.band == Band.MV_ZERO and inside_band(operands, er, dialect):
        raw = ZERO
        mv = limit(mv_min, ZERO, mv_max)
    else:
        i, raw, mv, limit_flags = _automatic(dialect, state.mv, i, ki, p, e, e1, d, ts, mv_min, mv_max)
        flags |= limit_flags
    if (raw != raw or (kind > 0 and not finite(i))) and dialect.bad_input != BadInput.PROPAGATED:
        return state, _held(operands, state, flags | flag.BAD_INPUT)
    if operands.mout_auto and (not manual or (mv != mout and dialect.mout_auto)):
        mout = mv
    if manual and dialect.manual_history:
        held = State(i, state.pv1, mv, state.e1, True, state.valid, state.dir1)
        return held, Terms(e, p, i, d, raw, mv, mout, flags)
    return State(i, operands.pv, mv, e, manual, True, operands.pid_dir), Terms(e, p, i, d, raw, mv, mout, flags)


def _numbers(operands: Operands) -> Operands:
    """The operands, 0 for what is no number; gains and limits as they are."""
    return Operands(
        operands.pid_run,
        terms_of.number(operands.sv),
        terms_of.number(operands.pv),
        operands.pid_mode,
        operands.pid_man,
        operands.mout_auto,
        operands.cycle,
        operands.kp,
        operands.ki,
        operands.kd,
        operands.pid_dir,
        operands.err_dbw,
        operands.mv_max,
        operands.mv_min,
        terms_of.number(operands.mout),
    )


def _automatic(
    dialect: Dialect,
    mv_before: REAL,
    i: REAL,
    ki: REAL,
    p: REAL,
    e: REAL,
    e1: REAL,
    d: REAL,
    ts: REAL,
    low: REAL,
    high: REAL,
) -> tuple[REAL, REAL, REAL, int]:
    """Integrate, add, limit: the integral, the sum, MV and FREEZE flags."""
    if ki > ZERO:
        x = terms_of.integrated(dialect, e, e1)
        candidate, increment = terms_of.advanced(dialect, False, ki, ONE, x, ts, i)
        before = terms_of.term(dialect, False, ki, ONE, i)
        after = terms_of.term(dialect, False, ki, ONE, candidate)
        if dialect.integral_used:
            after = before
    else:
        candidate, after = terms_of.idle(dialect, i)
        before, increment = after, ZERO
    raw = terms_of.summed(dialect, p, after, d)
    tested = raw
    if d != ZERO:
        without = p + after
        if terms_of.outside(without, low, high) != terms_of.outside(raw, low, high) and dialect.freeze_test:
            tested = without
    kept, flags = terms_of.limited(dialect, tested, low, high, mv_before, i, candidate, increment)
    mv = limit(low, raw, high)
    if flags and ki > ZERO and kept != candidate:
        if dialect.limited_output:
            mv = limit(low, terms_of.summed(dialect, p, before, d), high)
        if dialect.freeze == Freeze.BACK_CALCULATED:
            kept = terms_of.stored(dialect, False, ki, ONE, terms_of.preset(dialect, mv, p, d, ZERO))
    return (kept if ki > ZERO else candidate), raw, mv, flags


def _in_manual(
    dialect: Dialect,
    i: REAL,
    ki: REAL,
    e: REAL,
    e1: REAL,
    ts: REAL,
    mv: REAL,
    p: REAL,
    d: REAL,
    low: REAL,
    high: REAL,
) -> REAL:
    """The integral where it does not stand in manual: it runs on, or follows MV as a transfer would set it."""
    if dialect.manual_integral == ManualIntegral.TRACKS:
        followed = terms_of.stored(dialect, False, ki, ONE, terms_of.preset_term(dialect, 1, mv, p, d, ZERO, low, high))
        return followed if finite(followed) else i
    return terms_of.advanced(dialect, False, ki, ONE, terms_of.integrated(dialect, e, e1), ts, i)[0]


def _derivative(operands: Operands, dialect: Dialect, kd: REAL, change: REAL, pv1: REAL, ts: REAL) -> REAL:
    """D of the error, or of PV with the sign of the direction."""
    if dialect.derivative_of:
        moved = operands.pv - pv1
        change = -moved if operands.pid_dir != bool(dialect.direction) else moved
    return terms_of.slope(dialect, kd, change, ts)


def _stopped(operands: Operands, state: State, dialect: Dialect) -> tuple[State, Terms]:
    """PID_RUN is FALSE: MV is 0, and nothing is computed."""
    kept = ZERO if dialect.run_off == RunOff.CLEAR else state.i
    mout = ZERO if operands.mout_auto and dialect.run_off_mout else operands.mout
    e1, pv1, valid, dir1 = state.e1, state.pv1, False, state.dir1
    if dialect.run_off_history == RunOffHistory.KEPT:
        valid = state.valid
    elif dialect.run_off_history == RunOffHistory.TRACKED:
        er = raw_error(operands, operands.pv, dialect)
        if finite(er):
            e1, pv1, valid, dir1 = error(operands, er, dialect), operands.pv, True, operands.pid_dir
    man1 = terms_of.manual_before(dialect, state.man1, operands.pid_man)
    stopped = State(kept, pv1, ZERO, e1, man1, valid, dir1)
    return stopped, Terms(ZERO, ZERO, kept, ZERO, ZERO, ZERO, mout, flag.STOPPED)


def _held(operands: Operands, state: State, flags: int) -> Terms:
    """Terms of an execution that changes nothing."""
    return Terms(ZERO, ZERO, state.i, ZERO, state.mv, state.mv, operands.mout, flags)


def recall(operands: Operands, seen: State, dialect: Dialect = DEFAULT) -> tuple[tuple[State, State], ...]:
    """Return what the execution before can have left hidden, given what the block shows after it.

    Args:
        operands: What that execution read, as far as known.
        seen: `i`, `pv1` and `mv` as read from the PLC; the rest is ignored.
        dialect: Choices where the manual is silent.

    Returns:
        Pairs of a lowest and a highest state that bound each possibility, here always equal: one pair, or two while
        PID_RUN is FALSE, which leaves it open what the last execution in RUN was. None where the history stands still
        since a time that nobody saw.
    """
    manuals = (operands.pid_man,) if operands.pid_run else (False, True)
    if (operands.pid_man and dialect.manual_history) or not (operands.pid_run or not dialect.run_off_history):
        return ()
    e1 = error(operands, raw_error(operands, seen.pv1, dialect), dialect)
    states = [State(seen.i, seen.pv1, seen.mv, e1, man1, operands.pid_run, operands.pid_dir) for man1 in manuals]
    return tuple((state, state) for state in states)
