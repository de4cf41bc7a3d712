"""The parts of DPID's and DPIDE's law that a dialect chooses: interval, increment, derivative, sum, preset, limits.

This file alone decides what each axis of a dialect computes; `dpid` and `dpide` decide the order of the law. Every
function is pure; those above `limited` take no decision on a value, so that they work on arrays of REALs too, which is
how a trace is searched. Each asks for an axis only where it makes a difference: what was not asked is known to be open.

Source:
    MANUAL gives the continuous law; which of these a firmware computes is not stated (spec ah500 §2).
"""

from __future__ import annotations

import numpy as np

from ahgateway.core import flags as flag
from ahgateway.core.controllers.delta import ZERO, finite, limit
from ahgateway.core.dialect import (
    BiasJoins,
    DerivativeProduct,
    Dialect,
    Filter,
    FilterContent,
    FormChange,
    Freeze,
    IntegralStore,
    Integrator,
    KiOff,
    PresetOrder,
    Product,
    RunOffManual,
    SumOrder,
    Transfer,
    TsSource,
    TsUnit,
)
from ahgateway.core.real import REAL

ONE = REAL(1)
TWO = REAL(2)
HALF = REAL(0.5)

ONE_64, HALF_64 = np.float64(1.0), np.float64(0.5)
EXP_MIN = np.float64(-104.0)
"""exp of less is 0 as a REAL."""
PER_LN2 = np.float64(1.4426950408889634)
LN2_HIGH, LN2_LOW = np.float64(6.93147180369123816490e-01), np.float64(1.90821492927058770002e-10)
"""ln 2 in two parts, the first short enough that its multiples are exact."""


def ticks_per_second(dialect: Dialect) -> int:
    """Grid of the measured interval, ticks per second; 0 when the interval is CYCLE."""
    if dialect.ts_source == TsSource.MS:
        return 1000
    if dialect.ts_source == TsSource.TENTH_MS:
        return 10_000
    return 1_000_000 if dialect.ts_source == TsSource.MICROSECOND else 0


def interval(dialect: Dialect, count: int, per_second: int) -> REAL:
    """Return Ts as the law takes it, from a count of units of which `per_second` make a second."""
    if not dialect.ts_unit:
        if dialect.ts_scale:
            return REAL(count) * (ONE / REAL(per_second))
        return REAL(count) / REAL(per_second)
    if dialect.ts_unit == TsUnit.LEFT_OUT:
        return ONE
    if dialect.ts_unit == TsUnit.HUNDRED_MS:
        return REAL(count) / REAL(per_second // 10)
    if dialect.ts_unit == TsUnit.TEN_MS and per_second > 100:
        return REAL(count) / REAL(per_second // 100)
    return REAL(count)


def is_rough(dialect: Dialect) -> bool:
    """Tell whether rounding keeps D's filter from being monotone in what it remembers, while it smooths."""
    return dialect.filter in (Filter.FORWARD, Filter.ALPHA) or dialect.filter_content == FilterContent.INPUT


def product(dialect: Dialect, k: REAL, x: REAL, ts: REAL) -> REAL:
    """K times E times Ts."""
    if not dialect.product:
        return (k * x) * ts
    return k * (x * ts) if dialect.product == Product.K_ETS else (k * ts) * x


def integrated(dialect: Dialect, e: REAL, e1: REAL) -> REAL:
    """The error that one execution integrates."""
    if not dialect.integrator or dialect.integrator == Integrator.DVP:
        return e
    return (e + e1) * HALF if dialect.integrator == Integrator.TRAPEZOID else e1


def increment(dialect: Dialect, dependent: bool, k: REAL, kc: REAL, x: REAL, ts: REAL) -> REAL:
    """What one execution adds to I_MV, in the unit in which that is kept; `k` is Ti in the dependent form."""
    if dialect.integral_store == IntegralStore.SUM:
        return x * ts
    if not dependent:
        return product(dialect, k, x, ts)
    gain = ONE if dialect.integral_store == IntegralStore.WITHOUT_KC else kc
    return product(dialect, gain / k, x, ts) if dialect.ratio else product(dialect, gain, x, ts) / k


def advanced(dialect: Dialect, dependent: bool, k: REAL, kc: REAL, x: REAL, ts: REAL, i: REAL) -> tuple[REAL, REAL]:
    """I_MV one execution on, and the increment, whose sign says where the integral goes."""
    if dialect.integrator == Integrator.DVP:
        candidate = (i + increment(dialect, dependent, k, kc, x, ONE)) * ts
        return candidate, candidate - i
    step = increment(dialect, dependent, k, kc, x, ts)
    return i + step, step


def term(dialect: Dialect, dependent: bool, k: REAL, kc: REAL, i: REAL) -> REAL:
    """The integral term in MV's unit from what I_MV holds; `k` above 0."""
    if not dialect.integral_store:
        return i
    if dialect.integral_store == IntegralStore.WITHOUT_KC:
        return kc * i if dependent else i
    if not dependent:
        return k * i
    return (kc / k) * i if dialect.ratio else (kc * i) / k


def stored(dialect: Dialect, dependent: bool, k: REAL, kc: REAL, wanted: REAL) -> REAL:
    """What I_MV must hold for a wanted term; the inverse of `term`, rounded its own way."""
    if not dialect.integral_store:
        return wanted
    if dialect.integral_store == IntegralStore.WITHOUT_KC:
        return wanted / kc if dependent else wanted
    if not dependent:
        return wanted / k
    return wanted / (kc / k) if dialect.ratio else (wanted * k) / kc


def slope(dialect: Dialect, kd: REAL, change: REAL, ts: REAL) -> REAL:
    """Kd times change by Ts."""
    if not dialect.derivative_product:
        return (kd * change) / ts
    return kd * (change / ts) if dialect.derivative_product == DerivativeProduct.SLOPE_FIRST else (kd / ts) * change


def filtered(dialect: Dialect, d: REAL, kd: REAL, change: REAL, tf: REAL, ts: REAL) -> REAL:
    """The filter's content one execution on; `tf` above 0."""
    if not dialect.filter:
        span = tf + ts
        if not dialect.derivative_product:
            return ((tf * d) + (kd * change)) / span
        if dialect.derivative_product == DerivativeProduct.SLOPE_FIRST:
            return ((tf / span) * d) + (kd * (change / span))
        return ((tf / span) * d) + ((kd / span) * change)
    if dialect.filter == Filter.TUSTIN:
        twice = tf + tf
        return (((twice - ts) * d) + (TWO * (kd * change))) / (twice + ts)
    steep = slope(dialect, kd, change, ts)
    if dialect.filter == Filter.FORWARD:
        return d + ((ts / tf) * (steep - d))
    if dialect.filter == Filter.ALPHA:
        return d + ((ts / (tf + ts)) * (steep - d))
    if dialect.filter == Filter.EXACT:
        decay = decayed(-ts / tf)
        return (decay * d) + ((ONE - decay) * steep)
    return steep


def smoothed(dialect: Dialect, content: REAL, x: REAL, x1: REAL, tf: REAL, ts: REAL) -> REAL:
    """The filtered E or PV one execution on, where the filter stands before the difference; `tf` above 0."""
    if not dialect.filter:
        return ((tf * content) + (ts * x)) / (tf + ts)
    if dialect.filter == Filter.TUSTIN:
        twice = tf + tf
        return (((twice - ts) * content) + (ts * (x + x1))) / (twice + ts)
    if dialect.filter == Filter.FORWARD:
        return content + ((ts / tf) * (x - content))
    if dialect.filter == Filter.ALPHA:
        return content + ((ts / (tf + ts)) * (x - content))
    if dialect.filter == Filter.EXACT:
        decay = decayed(-ts / tf)
        return (decay * content) + ((ONE - decay) * x)
    return x


def turned(dialect: Dialect, e1: REAL, has_turned: bool) -> REAL:
    """The last E as D takes it when PID_DIR has changed since."""
    return -e1 if has_turned and dialect.form_change == FormChange.TURNED else e1


def number(x: REAL) -> REAL:
    """What is no number counts as 0."""
    return x if finite(x) else ZERO


def decayed(x: REAL) -> REAL:
    """exp(x) of an x not above 0, in binary64 by IEEE operations alone, rounded once: equal bits on any machine."""
    wide = np.float64(x)
    if not wide > EXP_MIN:
        return ZERO
    halvings = np.floor(wide * PER_LN2 + 0.5)
    rest = (wide - halvings * LN2_HIGH) - halvings * LN2_LOW
    total = ONE_64
    for number in range(13, 0, -1):
        total = ONE_64 + (rest / np.float64(number)) * total
    for _ in range(int(-halvings)):
        total = total * HALF_64
    return REAL(total)


def summed(dialect: Dialect, p: REAL, i: REAL, d: REAL) -> REAL:
    """P, I and D together."""
    if not dialect.sum_order:
        return (p + i) + d
    return p + (i + d) if dialect.sum_order == SumOrder.P_ID else (p + d) + i


def summed_with(dialect: Dialect, p: REAL, i: REAL, d: REAL, bias: REAL) -> REAL:
    """P, I, D and a BIAS that is not 0 together."""
    if not dialect.bias_joins:
        return summed(dialect, p, i, d) + bias
    first, second, outer = p, i, d
    if dialect.sum_order == SumOrder.P_ID:
        first, second, outer = i, d, p
    elif dialect.sum_order == SumOrder.PD_I:
        second, outer = d, i
    if dialect.bias_joins == BiasJoins.PAIR:
        return ((first + second) + bias) + outer
    if dialect.bias_joins == BiasJoins.OUTER:
        return (first + second) + (outer + bias)
    if dialect.bias_joins == BiasJoins.FIRST:
        return ((first + bias) + second) + outer
    return (first + (second + bias)) + outer


def preset(dialect: Dialect, mv: REAL, p: REAL, d: REAL, bias: REAL) -> REAL:
    """The integral term with which the sum is `mv`."""
    if dialect.preset_d:
        d = ZERO
    if not dialect.preset_order:
        return ((mv - p) - d) - bias
    if dialect.preset_order == PresetOrder.SUM:
        return mv - ((p + d) + bias)
    return ((mv - bias) - p) - d if dialect.preset_order == PresetOrder.BIAS_P_D else ((mv - d) - p) - bias


def limited(
    dialect: Dialect, tested: REAL, low: REAL, high: REAL, mv: REAL, i: REAL, candidate: REAL, step: REAL
) -> tuple[REAL, int]:
    """Decide whether the integral may go on.

    Args:
        dialect: Choices where the manual is silent.
        tested: The sum that is held against the limits.
        low: Lower limit.
        high: Upper limit, not below it.
        mv: MV before this execution.
        i: Integral before it.
        candidate: Integral behind it, if it may go on.
        step: Increment; its sign says where the integral goes.

    Returns:
        The integral, and FREEZE_HI or FREEZE_LO, LOCKUP when it stands though it would lead back.
    """
    over, under = bool(tested > high), bool(tested < low)
    stood_high, stood_low = bool(mv >= high), bool(mv <= low)
    if not over and not under and tested in (high, low) and dialect.limit_edge:
        over, under = bool(tested == high), bool(tested == low)
    if (stood_high != over or stood_low != under) and dialect.freeze == Freeze.PREVIOUS_MV:
        over, under = stood_high, stood_low
    if not over and not under:
        return candidate, 0
    flags = flag.FREEZE_HI if over else flag.FREEZE_LO
    if dialect.freeze == Freeze.NEVER:
        return candidate, flags
    if step < ZERO if over else step > ZERO:
        if dialect.freeze == Freeze.OUTWARD:
            return candidate, flags
        return i, flags | flag.LOCKUP
    return i, flags


def outside(x: REAL, low: REAL, high: REAL) -> int:
    """Where a sum lies: 1 above the limits, -1 below, 0 between."""
    return 1 if x > high else (-1 if x < low else 0)


def idle(dialect: Dialect, i: REAL) -> tuple[REAL, REAL]:
    """Integral and its term while integration is switched off."""
    if i == ZERO or not dialect.ki_off:
        return ZERO, ZERO
    return i, (i if dialect.ki_off == KiOff.HELD else ZERO)


def transfer_kind(mode: int, dialect: Dialect) -> int:
    """How automatic begins after manual: 0 with the integral as it stands, 1 bumpless, 2 with MV as the integral."""
    if mode == 2:
        return int(dialect.transfer_2)
    if not dialect.transfer:
        return 1
    return 2 if dialect.transfer == Transfer.MV_AS_I else 0


def preset_term(dialect: Dialect, kind: int, mv: REAL, p: REAL, d: REAL, bias: REAL, low: REAL, high: REAL) -> REAL:
    """The integral term with which automatic begins; `kind` is 1 or 2 of `transfer_kind`."""
    wanted = preset(dialect, mv, p, d, bias) if kind == 1 else mv
    if (wanted < low or wanted > high) and dialect.preset_limit:
        return limit(low, wanted, high)
    return wanted


def taken_over(dialect: Dialect, mv: REAL, mout: REAL, low: REAL, high: REAL) -> REAL:
    """The MV from which automatic goes on after manual."""
    held = limit(low, mout, high)
    if held != mv and dialect.preset_mv:
        return held
    return mv


def manual_before(dialect: Dialect, man1: bool, manual: bool) -> bool:
    """Whether manual counts as having come before, behind an execution with PID_RUN off."""
    if not (man1 or manual) or not dialect.run_off_manual:
        return man1
    return manual and dialect.run_off_manual == RunOffManual.TRACKED
