"""Delta DPIDE (API 0708): position form, independent or dependent gains, filtered D on E or PV, BIAS.

This file alone decides the order of DPIDE's law; what its parts compute in a dialect stands in `delta_terms`. It does
not know when an execution is due, nor where operands stand in a PLC.

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
from ahgateway.core.controllers import delta_terms as terms_of
from ahgateway.core.controllers.delta import ZERO, clamped_cycle, finite, gain, limit
from ahgateway.core.dialect import (
    DEFAULT,
    BadInput,
    CrossBand,
    CrossD,
    Dialect,
    Filter,
    FilterContent,
    FormChange,
    FormIntegral,
    Freeze,
    IntegralStore,
    Limits,
    ManualFilter,
    ManualIntegral,
    RunOff,
    RunOffHistory,
)
from ahgateway.core.operands import Kind, Operand
from ahgateway.core.real import REAL

THOUSAND = REAL(1000)
ONE = REAL(1)
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
        form1: PID_DIR, PID_EQ and PID_DE at the last execution, as `form_of` puts them together; hidden.
        sv1: SV at the last execution; hidden.
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
    form1: int = 1
    sv1: REAL = ZERO


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


def law_ts(operands: Operands, dialect: Dialect, ticks: int = 0) -> REAL:
    """Return Ts as the law takes it: from CYCLE, or from `ticks` of the dialect's clock where it measures."""
    per_second = terms_of.ticks_per_second(dialect)
    if per_second:
        return terms_of.interval(dialect, ticks, per_second)
    return terms_of.interval(dialect, clamped_cycle(operands.cycle, CYCLE_MAX), 1000)


def raw_error(operands: Operands, pv: REAL, dialect: Dialect = DEFAULT) -> REAL:
    """E by PID_DIR for this PV, before the dead band."""
    return operands.sv - pv if operands.pid_dir != bool(dialect.direction) else pv - operands.sv


def inside_band(operands: Operands, er: REAL, dialect: Dialect = DEFAULT) -> bool:
    """Tell whether this error lies inside the dead band."""
    if operands.err_dbw == ZERO or abs(er) > abs(operands.err_dbw) or dialect.cross_band == CrossBand.OFF:
        return False
    return bool(abs(er) < abs(operands.err_dbw) or (abs(er) == abs(operands.err_dbw) and dialect.cross_edge))


def crossed(operands: Operands, er: REAL, er1: REAL, cross: bool, dialect: Dialect = DEFAULT) -> bool:
    """Return the cross status: set when the error passes 0 inside the band, cleared outside; 0 is a sign of its own."""
    if not inside_band(operands, er, dialect):
        return False
    if cross or dialect.cross_band == CrossBand.PLAIN:
        return True
    if (er == ZERO or er1 == ZERO) and dialect.cross_touch:
        return False
    if er != ZERO and _sign(er) == _sign(er1):
        return False
    return inside_band(operands, er1, dialect) or not dialect.cross_jump


def form_of(operands: Operands) -> int:
    """PID_DIR as 1, PID_EQ as 2, PID_DE as 4, added up."""
    return (1 if operands.pid_dir else 0) + (2 if operands.pid_eq else 0) + (4 if operands.pid_de else 0)


def _sign(x: REAL) -> int:
    return 1 if x > ZERO else (-1 if x < ZERO else 0)


def step(operands: Operands, state: State, dialect: Dialect, ts: REAL) -> tuple[State, Terms]:
    """Advance DPIDE by one execution; equal arguments give equal bits.

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

    is_bad = _is_bad(operands)
    if is_bad and not dialect.bad_input:
        return state, _held(operands, state, flag.BAD_INPUT)
    if is_bad and dialect.bad_input == BadInput.AS_ZERO:
        operands = _numbers(operands)
    er = raw_error(operands, operands.pv, dialect)
    manual = operands.pid_man
    flags = 0
    if not (finite(operands.kc_kp) and finite(operands.ti_ki) and finite(operands.td_kd) and finite(operands.tf)):
        flags |= flag.BAD_PARAM
    kc, ti_ki, td_kd, tf = gain(operands.kc_kp), gain(operands.ti_ki), gain(operands.td_kd), gain(operands.tf)
    mv_max, mv_min = operands.mv_max, operands.mv_min
    if mv_max < mv_min and dialect.limits != Limits.AS_WRITTEN:
        mv_max, mv_min = mv_min, mv_max
        flags |= flag.LIMITS_SWAPPED
    dead = operands.pid_eq and kc <= ZERO and not dialect.kc_off
    integrating = bool(ti_ki > ZERO and not dead)

    fresh = not state.valid and not (td_kd > ZERO and dialect.first_history)
    was_crossed = state.cross
    if was_crossed and operands.sv != state.sv1 and dialect.cross_sv:
        was_crossed = False
    cross = crossed(operands, er, state.er1 if state.valid else er, was_crossed, dialect)
    e = ZERO if cross else er
    e1 = e if fresh else state.e1
    er1 = er if fresh else state.er1
    pv1 = operands.pv if fresh else state.pv1

    p = kc * e
    content = inner = d = ZERO
    if td_kd > ZERO and not dead:
        if state.valid and state.form1 != form_of(operands) and dialect.form_change:
            past = _past(operands, dialect, state.form1, e, e1, er, er1, pv1)
        else:
            past = (e1, er1, pv1)
        if dialect.filter_content == FilterContent.INPUT:
            content, inner = _smoothed(operands, dialect, state.d, fresh, kc, td_kd, tf, e, er, past, cross, ts)
        else:
            delta_x = _derivative_input(operands, dialect, e, past[0], er, past[1], past[2], cross)
            content, inner = _derivative(operands, dialect, state.d, kc, td_kd, tf, delta_x, ts)
        d = kc * inner if operands.pid_eq and dialect.dependent_sum else inner

    i = state.i
    if i != ZERO and state.valid and bool(state.form1 & 2) != operands.pid_eq and dialect.form_integral:
        i = _reformed(operands, dialect, i, ti_ki, kc, integrating)
    mout = operands.mout
    bias = operands.bias
    kind, mv_before = 0, state.mv
    if state.man1 and not manual and integrating and (kc > ZERO or not operands.pid_eq):
        kind = terms_of.transfer_kind(0, dialect)
    if kind > 0:
        flags |= flag.BUMPLESS
        mv_before = terms_of.taken_over(dialect, state.mv, operands.mout, mv_min, mv_max)
        wanted = terms_of.preset_term(dialect, kind, mv_before, p, d, bias, mv_min, mv_max)
        i = terms_of.stored(dialect, operands.pid_eq, ti_ki, kc, wanted)
    if manual:
        flags |= flag.MANUAL
        raw = mout
        mv = limit(mv_min, mout, mv_max)
        if integrating and dialect.manual_integral:
            i = _in_manual(operands, dialect, i, ti_ki, kc, e, e1, ts, mv, p, d, mv_min, mv_max)
        if cross and dialect.cross_manual:
            cross = False
        if dialect.manual_filter and (content != state.d):
            content = state.d if dialect.manual_filter == ManualFilter.HELD else ZERO
    elif kind == 1 and not dialect.preset_integrates:
        raw = mv_before
        mv = limit(mv_min, mv_before, mv_max)
    else:
        i, raw, mv, limit_flags = _automatic(
            operands, dialect, state.mv, i, integrating, ti_ki, kc, p, e, e1, d, inner, ts, mv_min, mv_max
        )
        flags |= limit_flags
    is_held = raw != raw or (kind > 0 and not finite(i))
    if is_held and dialect.bad_input != BadInput.PROPAGATED:
        return state, _held(operands, state, flags | flag.BAD_INPUT)
    if operands.mout_auto and (not manual or (mv != mout and dialect.mout_auto)):
        mout = mv
    terms = Terms(e, p, i, d, bias, raw, mv, mout, cross, flags)
    # An overflow must not stay in the filter for good: it starts again from 0.
    content = content if finite(content) or is_held else ZERO
    if manual and dialect.manual_history:
        held = State(i, state.pv1, mv, state.e1, content, state.er1, cross, True, state.valid, state.form1, state.sv1)
        return held, terms
    return State(i, operands.pv, mv, e, content, er, cross, manual, True, form_of(operands), operands.sv), terms


def _is_bad(operands: Operands) -> bool:
    """Tell whether something that is added is no number; a raw error is one only if SV and PV are."""
    if not finite(operands.sv - operands.pv) or not finite(operands.bias):
        return True
    return bool(operands.pid_man and not finite(operands.mout))


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
        operands.kc_kp,
        operands.ti_ki,
        operands.td_kd,
        operands.tf,
        operands.pid_eq,
        operands.pid_de,
        operands.pid_dir,
        operands.err_dbw,
        operands.mv_max,
        operands.mv_min,
        terms_of.number(operands.mout),
        terms_of.number(operands.bias),
    )


def _past(
    operands: Operands, dialect: Dialect, form1: int, e: REAL, e1: REAL, er: REAL, er1: REAL, pv1: REAL
) -> tuple[REAL, REAL, REAL]:
    """The last E that counts, raw E and PV as D takes them when PID_DIR, PID_EQ or PID_DE has changed since."""
    if dialect.form_change == FormChange.RESET:
        return e, er, operands.pv
    if dialect.form_change == FormChange.TURNED:
        has_turned = bool(form1 & 1) != operands.pid_dir
        return terms_of.turned(dialect, e1, has_turned), terms_of.turned(dialect, er1, has_turned), pv1
    if bool(form1 & 4) != operands.pid_de:
        return (e1, er1, e1) if operands.pid_de else (pv1, pv1, pv1)
    return e1, er1, pv1


def _reformed(operands: Operands, dialect: Dialect, i: REAL, ti_ki: REAL, kc: REAL, integrating: bool) -> REAL:
    """I_MV when PID_EQ has changed since the last execution."""
    if dialect.form_integral == FormIntegral.ZEROED:
        return ZERO
    if not integrating or not kc > ZERO:
        return i
    wanted = terms_of.term(dialect, not operands.pid_eq, ti_ki, kc, i)
    return terms_of.stored(dialect, operands.pid_eq, ti_ki, kc, wanted)


def _smoothed(
    operands: Operands,
    dialect: Dialect,
    content: REAL,
    fresh: bool,
    kc: REAL,
    td_kd: REAL,
    tf: REAL,
    e: REAL,
    er: REAL,
    past: tuple[REAL, REAL, REAL],
    cross: bool,
    ts: REAL,
) -> tuple[REAL, REAL]:
    """The filtered E or PV behind this execution, and D of it; a filter that holds 0 begins with what it meets."""
    is_still = False
    if operands.pid_de:
        is_still = cross
        is_reverse = operands.pid_dir != bool(dialect.direction)
        x, x1 = (-operands.pv, -past[2]) if is_reverse else (operands.pv, past[2])
    else:
        x, x1 = e, past[0]
        if cross and dialect.cross_d:
            x, x1 = er, past[1]
            is_still = dialect.cross_d == CrossD.SUPPRESSED
    tf, kd = _tf(operands, dialect, tf, td_kd), _kd(operands, dialect, kc, td_kd)
    before = x if fresh or content == ZERO else content
    after = terms_of.smoothed(dialect, before, x, x1, tf, ts) if tf > ZERO else x
    return after, (ZERO if is_still else terms_of.slope(dialect, kd, after - before, ts))


def _derivative_input(
    operands: Operands, dialect: Dialect, e: REAL, e1: REAL, er: REAL, er1: REAL, pv1: REAL, cross: bool
) -> REAL:
    """What D differentiates: E, or PV with the sign of PID_DIR; PV counts as standing still while crossed."""
    if not operands.pid_de:
        if (cross or e1 != er1) and dialect.cross_d:
            return er - er1 if dialect.cross_d == CrossD.TRUE_ERROR or not cross else ZERO
        return e - e1
    moved = ZERO if cross else operands.pv - pv1
    return -moved if operands.pid_dir != bool(dialect.direction) else moved


def _tf(operands: Operands, dialect: Dialect, tf: REAL, td_kd: REAL) -> REAL:
    """Tf in s."""
    if operands.pid_eq and tf > ZERO and dialect.tf_unit:
        return tf * td_kd
    return tf


def _kd(operands: Operands, dialect: Dialect, kc: REAL, td_kd: REAL) -> REAL:
    """The gain of D, with Kc in the dependent form unless that stands before the bracket."""
    if operands.pid_eq and not dialect.dependent_sum:
        return kc * td_kd
    return td_kd


def _derivative(
    operands: Operands, dialect: Dialect, d: REAL, kc: REAL, td_kd: REAL, tf: REAL, change: REAL, ts: REAL
) -> tuple[REAL, REAL]:
    """Content of the filter behind this execution, and D, without Kc where that stands before the bracket."""
    tf, kd = _tf(operands, dialect, tf, td_kd), _kd(operands, dialect, kc, td_kd)
    if not tf > ZERO and not dialect.derivative_product:
        content = ((tf * d) + (kd * change)) / (tf + ts)
        return content, content
    if not tf > ZERO or dialect.filter == Filter.IGNORED:
        content = terms_of.slope(dialect, kd, change, ts)
        return content, content
    if dialect.filter_content:
        content = terms_of.filtered(dialect, d, ONE, change, tf, ts)
        return content, kd * content
    content = terms_of.filtered(dialect, d, kd, change, tf, ts)
    return content, content


def _total(
    operands: Operands, dialect: Dialect, kc: REAL, p: REAL, e: REAL, i: REAL, j: REAL, d: REAL, inner: REAL
) -> REAL:
    """The sum, BIAS included; `j` and `inner` are I and D as they stand in the bracket."""
    bias = operands.bias
    if operands.pid_eq and dialect.dependent_sum:
        if not dialect.integral_store:
            return ((kc * (e + inner)) + i) + bias
        return (kc * terms_of.summed(dialect, e, j, inner)) + bias
    if bias != ZERO:
        return terms_of.summed_with(dialect, p, i, d, bias)
    return terms_of.summed(dialect, p, i, d) + bias


def _in_bracket(operands: Operands, dialect: Dialect, ti: REAL, i: REAL) -> REAL:
    """The integral as it stands in the bracket of the dependent form."""
    if operands.pid_eq and dialect.dependent_sum and dialect.integral_store == IntegralStore.SUM:
        return i / ti
    return i


def _automatic(
    operands: Operands,
    dialect: Dialect,
    mv_before: REAL,
    i: REAL,
    integrating: bool,
    ti_ki: REAL,
    kc: REAL,
    p: REAL,
    e: REAL,
    e1: REAL,
    d: REAL,
    inner: REAL,
    ts: REAL,
    low: REAL,
    high: REAL,
) -> tuple[REAL, REAL, REAL, int]:
    """Integrate, add, limit: the integral, the sum, MV and FREEZE flags."""
    form = operands.pid_eq
    if integrating:
        x = terms_of.integrated(dialect, e, e1)
        candidate, increment = terms_of.advanced(dialect, form, ti_ki, kc, x, ts, i)
        before, j_before = terms_of.term(dialect, form, ti_ki, kc, i), _in_bracket(operands, dialect, ti_ki, i)
        after, j = terms_of.term(dialect, form, ti_ki, kc, candidate), _in_bracket(operands, dialect, ti_ki, candidate)
        if dialect.integral_used:
            after, j = before, j_before
    else:
        candidate, after = terms_of.idle(dialect, i)
        before = j_before = j = after
        increment = ZERO
    raw = _total(operands, dialect, kc, p, e, after, j, d, inner)
    tested = raw
    if d != ZERO:
        without = (p + after) + operands.bias
        if terms_of.outside(without, low, high) != terms_of.outside(raw, low, high) and dialect.freeze_test:
            tested = _total(operands, dialect, kc, p, e, after, j, ZERO, ZERO)
    kept, flags = terms_of.limited(dialect, tested, low, high, mv_before, i, candidate, increment)
    mv = limit(low, raw, high)
    if flags and integrating and kept != candidate:
        if dialect.limited_output:
            mv = limit(low, _total(operands, dialect, kc, p, e, before, j_before, d, inner), high)
        if dialect.freeze == Freeze.BACK_CALCULATED and (kc > ZERO or not form):
            kept = terms_of.stored(dialect, form, ti_ki, kc, terms_of.preset(dialect, mv, p, d, operands.bias))
    return (kept if integrating else candidate), raw, mv, flags


def _in_manual(
    operands: Operands,
    dialect: Dialect,
    i: REAL,
    ti_ki: REAL,
    kc: REAL,
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
        wanted = terms_of.preset_term(dialect, 1, mv, p, d, operands.bias, low, high)
        if operands.pid_eq and not kc > ZERO:
            return i
        followed = terms_of.stored(dialect, operands.pid_eq, ti_ki, kc, wanted)
        return followed if finite(followed) else i
    x = terms_of.integrated(dialect, e, e1)
    return terms_of.advanced(dialect, operands.pid_eq, ti_ki, kc, x, ts, i)[0]


def _stopped(operands: Operands, state: State, dialect: Dialect) -> tuple[State, Terms]:
    """PID_RUN is FALSE: MV is 0, and nothing is computed."""
    kept = ZERO if dialect.run_off == RunOff.CLEAR else state.i
    mout = ZERO if operands.mout_auto and dialect.run_off_mout else operands.mout
    d, cross = ZERO, False
    if dialect.run_off_filter:
        d, cross = state.d, state.cross
    pv1, e1, er1, valid, form1, sv1 = state.pv1, state.e1, state.er1, False, state.form1, state.sv1
    if dialect.run_off_history == RunOffHistory.KEPT:
        valid = state.valid
    elif dialect.run_off_history == RunOffHistory.TRACKED:
        er = raw_error(operands, operands.pv, dialect)
        if finite(er):
            cross = crossed(operands, er, er1 if state.valid else er, cross, dialect)
            pv1, er1, valid, form1, sv1 = operands.pv, er, True, form_of(operands), operands.sv
            e1 = ZERO if cross else er
    man1 = terms_of.manual_before(dialect, state.man1, operands.pid_man)
    stopped = State(kept, pv1, ZERO, e1, d, er1, cross, man1, valid, form1, sv1)
    return stopped, Terms(ZERO, ZERO, kept, ZERO, operands.bias, ZERO, ZERO, mout, False, flag.STOPPED)


def _held(operands: Operands, state: State, flags: int) -> Terms:
    """Terms of an execution that changes nothing."""
    return Terms(ZERO, ZERO, state.i, ZERO, operands.bias, state.mv, state.mv, operands.mout, state.cross, flags)


def recall(operands: Operands, seen: State, dialect: Dialect = DEFAULT) -> tuple[tuple[State, State], ...]:
    """Return what the execution before can have left hidden, given what the block shows after it.

    Args:
        operands: What that execution read, as far as known.
        seen: `i`, `pv1` and `mv` as read from the PLC; the rest is ignored.
        dialect: Choices where the manual is silent.

    Returns:
        Pairs of a lowest and a highest state that bound each possibility: one pair, more when the cross status
        cannot be told or PID_RUN is FALSE; none where the history stands still since a time that nobody saw. Only
        `d` differs within a pair.
    """
    if (operands.pid_man and dialect.manual_history) or not (operands.pid_run or not dialect.run_off_history):
        return ()
    er = raw_error(operands, seen.pv1, dialect)
    is_open = gain(operands.td_kd) > ZERO and (operands.pid_run or dialect.run_off_filter)
    bound = D_BOUND if is_open else ZERO
    inside = inside_band(operands, er, dialect)
    statuses: tuple[bool, ...] = (False,)
    if inside:
        decided = dialect.cross_band == CrossBand.PLAIN or (er == ZERO and not dialect.cross_touch)
        statuses = (True,) if decided else (False, True)
    if not operands.pid_run and dialect.run_off_filter:
        statuses = (False, True)
    manuals = (operands.pid_man,) if operands.pid_run else (False, True)
    pairs, form = [], form_of(operands)
    for cross in statuses:
        for man1 in manuals:
            e1 = ZERO if cross else er
            after = cross and not (man1 and operands.pid_run and dialect.cross_manual)
            shown = State(seen.i, seen.pv1, seen.mv, e1, ZERO, er, after, man1, operands.pid_run, form, operands.sv)
            pairs.append((shown._replace(d=-bound), shown._replace(d=bound)))
    return tuple(pairs)
