"""Wrong arithmetic on purpose: each fault turns a right law into one that a judge must convict.

A fault wraps a controller's step and changes its operands, its state, its terms or its dialect. The deadliest are the
small ones, one gain off by one per cent, binary64 inside, another order of the sum.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from difflib import get_close_matches
from math import inf
from typing import Any

import numpy as np

from ahgateway.core import flags as flag
from ahgateway.core.controllers import Controller
from ahgateway.core.controllers import delta_terms as terms_of
from ahgateway.core.controllers.delta import gain, limit
from ahgateway.core.dialect import DerivativeOf, IntegralUsed, SumOrder
from ahgateway.core.real import REAL
from ahgateway.errors import StateError

Step = Callable[[Any, Any, Any, REAL], tuple[Any, Any]]

ZERO = REAL(0)
ONE_PERCENT_MORE = REAL(1.01)
NOT_COMPUTED = flag.STOPPED | flag.AUTOTUNE | flag.BAD_INPUT
"""With any of these the law computed no sum, so that there is nothing to get wrong."""
NOT_SUMMED = NOT_COMPUTED | flag.MANUAL | flag.BUMPLESS


@dataclass(frozen=True, slots=True)
class Fault:
    """One way to be wrong.

    Attributes:
        name: What one types, `ki-1-percent`.
        text: What is wrong, one sentence without a full stop.
        wrong: Makes the wrong step out of the right one.
        controllers: Instructions for which it means something.
        is_pv_late: The instruction sees PV of the scan before, which the program item must do.
    """

    name: str
    text: str
    wrong: Callable[[Step], Step]
    controllers: frozenset[str]
    is_pv_late: bool = False


def fault(name: str, controller: Controller) -> Fault:
    """Return the fault with this name.

    Raises:
        StateError: There is none, or it means nothing for this instruction.
    """
    # Imported here because its faults are made with this module's means.
    from ahgateway.fake.call_faults import CALL_FAULTS

    known = {**FAULTS, **CALL_FAULTS}
    found = known.get(name)
    suitable = [each.name for each in known.values() if controller.name in each.controllers]
    if found is None:
        near = get_close_matches(name, suitable, 1, 0.5)
        raise StateError(
            f"unknown fault `{name}`, known for {controller.name} are {', '.join(suitable)}",
            hint=f"did you mean `{near[0]}`?" if near else None,
        )
    if controller.name not in found.controllers:
        raise StateError(
            f"fault `{name}` means nothing for {controller.name}", hint=f"it can have {', '.join(suitable)}"
        )
    return found


def _inputs(change: Callable[[Any], dict[str, Any]]) -> Callable[[Step], Step]:
    """Make a fault out of operands that the instruction misreads."""

    def wrap(step: Step) -> Step:
        def wrong(inputs: Any, state: Any, dialect: Any, ts: REAL) -> tuple[Any, Any]:
            return step(inputs._replace(**change(inputs)), state, dialect, ts)

        return wrong

    return wrap


def _more(*attrs: str) -> Callable[[Any], dict[str, Any]]:
    return lambda inputs: {attr: getattr(inputs, attr) * ONE_PERCENT_MORE for attr in attrs if hasattr(inputs, attr)}


def _limits(inputs: Any) -> tuple[REAL, REAL]:
    low, high = inputs.mv_min, inputs.mv_max
    return (high, low) if high < low else (low, high)


def _with_mv(inputs: Any, state: Any, terms: Any, mv: REAL) -> tuple[Any, Any]:
    """Put another MV into what a step left, and let MOUT follow it where it would."""
    follows = inputs.mout_auto and not terms.flags & NOT_COMPUTED and not terms.flags & flag.MANUAL
    return state._replace(mv=mv), terms._replace(mv=mv, mout=mv if follows else terms.mout)


def _wrong_ts(step: Step) -> Step:
    def wrong(inputs: Any, state: Any, dialect: Any, ts: REAL) -> tuple[Any, Any]:
        return step(inputs, state, dialect, ts * REAL(1.25))

    return wrong


def _wide(values: Any) -> Any:
    """The same NamedTuple with every REAL as binary64."""
    return type(values)(*[np.float64(value) if isinstance(value, np.float32) else value for value in values])


def _narrow(values: Any, to_real: Callable[[Any], REAL]) -> Any:
    return type(values)(*[to_real(value) if isinstance(value, np.floating) else value for value in values])


def _truncated(value: Any) -> REAL:
    nearest = REAL(value)
    return np.nextafter(nearest, ZERO) if abs(np.float64(nearest)) > abs(value) else nearest


def _computed_wide(to_real: Callable[[Any], REAL]) -> Callable[[Step], Step]:
    """Make a fault out of computing in binary64 and coming back to REAL only at the end."""

    def wrap(step: Step) -> Step:
        def wrong(inputs: Any, state: Any, dialect: Any, ts: REAL) -> tuple[Any, Any]:
            after, terms = step(_wide(inputs), _wide(state), dialect, np.float64(ts))  # type: ignore[arg-type]
            return _narrow(after, to_real), _narrow(terms, to_real)

        return wrong

    return wrap


def _derivative_of_the_other(step: Step) -> Step:
    """D of PV where the law says E, and of E where it says PV."""

    def wrong(inputs: Any, state: Any, dialect: Any, ts: REAL) -> tuple[Any, Any]:
        if hasattr(inputs, "pid_de"):
            return step(inputs._replace(pid_de=not inputs.pid_de), state, dialect, ts)
        of_pv = dialect.derivative_of == DerivativeOf.PV
        return step(inputs, state, dialect._replace(derivative_of=DerivativeOf.ERROR if of_pv else DerivativeOf.PV), ts)

    return wrong


def _limits_before(step: Step) -> Step:
    """P + I is limited, D (and BIAS) come after and may leave the range."""

    def wrong(inputs: Any, state: Any, dialect: Any, ts: REAL) -> tuple[Any, Any]:
        after, terms = step(inputs, state, dialect, ts)
        if terms.flags & NOT_SUMMED:
            return after, terms
        low, high = _limits(inputs)
        used = state.i if dialect.integral_used else terms.i
        mv = limit(low, terms.p + _integral_term(inputs, dialect, used), high) + terms.d
        return _with_mv(inputs, after, terms, mv + terms.bias if hasattr(terms, "bias") else mv)

    return wrong


def _integral_term(inputs: Any, dialect: Any, i: REAL) -> REAL:
    """I as it stands in the sum; I_MV holds it or what it is computed from."""
    has_form = hasattr(inputs, "pid_eq")
    kc, k = (gain(inputs.kc_kp), gain(inputs.ti_ki)) if has_form else (gain(inputs.kp), gain(inputs.ki))
    if not k > ZERO:
        return terms_of.idle(dialect, i)[1]
    return terms_of.term(dialect, has_form and inputs.pid_eq, k, kc, i)


def _windup(step: Step) -> Step:
    """The integral runs on while MV is at a limit."""

    def wrong(inputs: Any, state: Any, dialect: Any, ts: REAL) -> tuple[Any, Any]:
        free = inputs._replace(mv_min=REAL(-inf), mv_max=REAL(inf))
        after, terms = step(free, state, dialect, ts)
        if terms.flags & NOT_COMPUTED:
            return after, terms
        low, high = _limits(inputs)
        return _with_mv(inputs, after, terms, limit(low, terms.mv, high))

    return wrong


def _no_bumpless(step: Step) -> Step:
    def wrong(inputs: Any, state: Any, dialect: Any, ts: REAL) -> tuple[Any, Any]:
        return step(inputs, state._replace(man1=False), dialect, ts)

    return wrong


def _bias_after(step: Step) -> Step:
    """BIAS joins behind the limiter, so that MV leaves its range by BIAS."""

    def wrong(inputs: Any, state: Any, dialect: Any, ts: REAL) -> tuple[Any, Any]:
        after, terms = step(inputs._replace(bias=ZERO), state, dialect, ts)
        if terms.flags & NOT_SUMMED:
            return after, terms._replace(bias=inputs.bias)
        return _with_mv(inputs, after, terms._replace(bias=inputs.bias), terms.mv + inputs.bias)

    return wrong


def _other_order(step: Step) -> Step:
    """P + (I + D) where the law says (P + I) + D."""

    def wrong(inputs: Any, state: Any, dialect: Any, ts: REAL) -> tuple[Any, Any]:
        return step(inputs, state, dialect._replace(sum_order=SumOrder.P_ID), ts)

    return wrong


def _integral_late(step: Step) -> Step:
    """MV is computed with the integral of the execution before (forward Euler)."""

    def wrong(inputs: Any, state: Any, dialect: Any, ts: REAL) -> tuple[Any, Any]:
        return step(inputs, state, dialect._replace(integral_used=IntegralUsed.OLD), ts)

    return wrong


def _unchanged(step: Step) -> Step:
    return step


inputs_changed, more = _inputs, _more

_BOTH = frozenset({"DPID", "DPIDE"})
_DPIDE = frozenset({"DPIDE"})

FAULTS: dict[str, Fault] = {
    each.name: each
    for each in (
        Fault("gain-1-percent", "proportional gain × 1.01 inside", _inputs(_more("kp", "kc_kp")), _BOTH),
        Fault("ki-1-percent", "integral gain or time × 1.01 inside", _inputs(_more("ki", "ti_ki")), _BOTH),
        Fault("binary64-inside", "binary64 between the operations, REAL only at the end", _computed_wide(REAL), _BOTH),
        Fault("truncation", "the result is cut off instead of rounded", _computed_wide(_truncated), _BOTH),
        Fault("other-order", "P + (I + D) instead of (P + I) + D", _other_order, _BOTH),
        Fault("derivative-of-the-other", "D of PV for E, and of E for PV", _derivative_of_the_other, _BOTH),
        Fault("direction-reversed", "PID_DIR is read inverted", _inputs(lambda i: {"pid_dir": not i.pid_dir}), _BOTH),
        Fault("dead-band-ignored", "ERR_DBW counts as 0", _inputs(lambda i: {"err_dbw": ZERO}), _BOTH),
        Fault("pv-one-scan-late", "PV of the scan before is used", _unchanged, _BOTH, is_pv_late=True),
        Fault("wrong-ts", "sampling time × 1.25 inside", _wrong_ts, _BOTH),
        Fault("limits-before-sum", "P + I is limited and D added after", _limits_before, _BOTH),
        Fault("windup", "the integral runs on while MV is limited", _windup, _BOTH),
        Fault("integral-late", "MV takes the integral of the execution before", _integral_late, _BOTH),
        Fault("no-bumpless", "the transfer from manual starts from the held integral", _no_bumpless, _BOTH),
        Fault("bias-after-limits", "BIAS is added behind the limiter", _bias_after, _DPIDE),
        Fault("filter-ignored", "Tf counts as 0", _inputs(lambda i: {"tf": ZERO}), _DPIDE),
    )
}
"""Every fault by name."""
