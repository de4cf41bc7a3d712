"""Delta DPID (API 0707): position form, independent gains, MV = Kp·E + Ki·∫E dt + Kd·dE/dt.

This file alone decides the order of DPID's operations; in REAL another order is another controller. It does not
know when an execution is due, nor where operands stand in a PLC.

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
from ahgateway.core.controllers.delta import ZERO, clamped_cycle, finite, gain, limit
from ahgateway.core.dialect import Dialect, Freeze, RunOff
from ahgateway.core.operands import Kind, Operand
from ahgateway.core.real import REAL

HUNDRED = REAL(100)
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
    """

    i: REAL = ZERO
    pv1: REAL = ZERO
    mv: REAL = ZERO
    e1: REAL = ZERO
    man1: bool = False
    valid: bool = False


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


def raw_error(operands: Operands, pv: REAL) -> REAL:
    """E by PID_DIR for this PV, before the dead band."""
    return operands.sv - pv if operands.pid_dir else pv - operands.sv


def error(operands: Operands, er: REAL) -> REAL:
    """E that counts for this raw error: 0 inside the dead band, edges included."""
    if operands.err_dbw != ZERO and abs(er) <= abs(operands.err_dbw):
        return ZERO
    return er


def step(operands: Operands, state: State, dialect: Dialect, ts: REAL) -> tuple[State, Terms]:
    """Advance DPID by one execution; equal arguments give equal bits.

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
        stopped = State(kept, state.pv1, ZERO, state.e1, state.man1, False)
        return stopped, Terms(ZERO, ZERO, kept, ZERO, ZERO, ZERO, operands.mout, flag.STOPPED)
    if operands.pid_mode == 1:
        return state, _held(operands, state, flag.AUTOTUNE)

    er = raw_error(operands, operands.pv)
    manual = operands.pid_man
    # A raw error is a number only if SV and PV are.
    if not finite(er) or (manual and not finite(operands.mout)):
        return state, _held(operands, state, flag.BAD_INPUT)

    flags = 0
    if not (finite(operands.kp) and finite(operands.ki) and finite(operands.kd)):
        flags |= flag.BAD_PARAM
    kp, ki, kd = gain(operands.kp), gain(operands.ki), gain(operands.kd)
    mv_max, mv_min = operands.mv_max, operands.mv_min
    if mv_max < mv_min:
        mv_max, mv_min = mv_min, mv_max
        flags |= flag.LIMITS_SWAPPED

    e = error(operands, er)
    e1 = state.e1 if state.valid else e
    p = kp * e
    # Off is 0, whatever E does: 0 times a difference that overflows would be no number.
    d = (kd * (e - e1)) / ts if kd > ZERO else ZERO

    i = state.i
    mout = operands.mout
    if manual:
        flags |= flag.MANUAL
        raw = mout
        mv = limit(mv_min, mout, mv_max)
    elif state.man1 and operands.pid_mode != 2 and ki > ZERO:
        flags |= flag.BUMPLESS
        i = (state.mv - p) - d
        if not finite(i):
            return state, _held(operands, state, flags | flag.BAD_INPUT)
        raw = state.mv
        mv = limit(mv_min, state.mv, mv_max)
    else:
        increment = (ki * e) * ts if ki > ZERO else ZERO
        candidate = i + increment if ki > ZERO else ZERO
        raw = (p + candidate) + d
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
        if ki <= ZERO:
            i = ZERO
    if operands.mout_auto and not manual:
        mout = mv
    return State(i, operands.pv, mv, e, manual, True), Terms(e, p, i, d, raw, mv, mout, flags)


def _held(operands: Operands, state: State, flags: int) -> Terms:
    """Terms of an execution that changes nothing."""
    return Terms(ZERO, ZERO, state.i, ZERO, state.mv, state.mv, operands.mout, flags)


def recall(operands: Operands, seen: State) -> tuple[tuple[State, State], ...]:
    """Return what the execution before can have left hidden, given what the block shows after it.

    Args:
        operands: What that execution read, as far as known.
        seen: `i`, `pv1` and `mv` as read from the PLC; the rest is ignored.

    Returns:
        Pairs of a lowest and a highest state that bound each possibility, here always equal: one pair, or two while
        PID_RUN is FALSE, which leaves it open what the last execution in RUN was.
    """
    e1 = error(operands, raw_error(operands, seen.pv1))
    manuals = (operands.pid_man,) if operands.pid_run else (False, True)
    states = [State(seen.i, seen.pv1, seen.mv, e1, man1, operands.pid_run) for man1 in manuals]
    return tuple((state, state) for state in states)
