"""Ten arithmetics outside the family: none is named, and the first execution that none explains is shown."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from lockstep.dialect_traces import loop_of, trace

from ahgateway.core.controllers import CONTROLLERS
from ahgateway.core.dialect import DEFAULT
from ahgateway.core.real import REAL
from ahgateway.lockstep.identify import identify

Step = Callable[[Any, Any, Any, Any], tuple[Any, Any]]

pytestmark = pytest.mark.xdist_group("compiled-search")


def widened(step: Step) -> Step:
    """Binary64 inside, REAL at the end."""

    def wide(values: Any) -> Any:
        return type(values)(*[np.float64(x) if isinstance(x, np.float32) else x for x in values])

    def narrow(values: Any) -> Any:
        return type(values)(*[REAL(x) if isinstance(x, np.floating) else x for x in values])

    def wrong(inputs: Any, state: Any, dialect: Any, ts: Any) -> tuple[Any, Any]:
        after, terms = step(wide(inputs), wide(state), dialect, np.float64(ts))
        return narrow(after), narrow(terms)

    return wrong


def fused(step: Step) -> Step:
    """The product of P is added to the integral without being rounded first."""

    def wrong(inputs: Any, state: Any, dialect: Any, ts: Any) -> tuple[Any, Any]:
        after, terms = step(inputs, state, dialect, ts)
        if inputs.pid_man or not inputs.pid_run or after.i == state.i or state.man1:
            return after, terms
        mv = REAL(float(inputs.kp) * float(terms.e) + float(after.i)) + terms.d
        mv = min(max(mv, inputs.mv_min), inputs.mv_max)
        return after._replace(mv=mv), terms._replace(mv=mv)

    return wrong


def with_inputs(change: Callable[[Any], Any]) -> Callable[[Step], Step]:
    """The law on other inputs than it was given."""

    def make(step: Step) -> Step:
        def wrong(inputs: Any, state: Any, dialect: Any, ts: Any) -> tuple[Any, Any]:
            after, terms = step(change(inputs), state, dialect, ts)
            return after, terms

        return wrong

    return make


def with_ts(factor: float) -> Callable[[Step], Step]:
    """The law with another Ts than any clock could give."""

    def make(step: Step) -> Step:
        return lambda inputs, state, dialect, ts: step(inputs, state, dialect, ts * REAL(factor))

    return make


def with_mv(change: Callable[[Any, Any, Any], Any]) -> Callable[[Step], Step]:
    """The law, its MV changed behind it."""

    def make(step: Step) -> Step:
        def wrong(inputs: Any, state: Any, dialect: Any, ts: Any) -> tuple[Any, Any]:
            after, terms = step(inputs, state, dialect, ts)
            mv = REAL(change(after.mv, state, inputs))
            return after._replace(mv=mv), terms._replace(mv=mv)

        return wrong

    return make


def leaking(step: Step) -> Step:
    """An integrator that forgets one part in a thousand at each execution."""
    return lambda inputs, state, dialect, ts: step(inputs, state._replace(i=state.i * REAL(0.999)), dialect, ts)


def short(x: Any) -> Any:
    """A REAL with two bits less."""
    return (np.array([x], np.float32).view(np.uint32) & np.uint32(0xFFFFFFFC)).view(np.float32)[0]


def shortened(step: Step) -> Step:
    """I_MV is kept with two bits less."""

    def wrong(inputs: Any, state: Any, dialect: Any, ts: Any) -> tuple[Any, Any]:
        after, terms = step(inputs, state, dialect, ts)
        return after._replace(i=short(after.i)), terms

    return wrong


FOREIGN: dict[str, Callable[[Step], Step]] = {
    "binary64 inside": widened,
    "fused multiply-add": fused,
    "extra filter on MV": with_mv(lambda mv, state, inputs: state.mv + REAL(0.7) * (mv - state.mv)),
    "MV in steps of a hundredth": with_mv(lambda mv, state, inputs: np.rint(float(mv) * 100) / 100),
    "MV cut to whole numbers": with_mv(lambda mv, state, inputs: np.trunc(float(mv))),
    "Ts a quarter longer": with_ts(1.25),
    "Ki one per cent larger": with_inputs(lambda inputs: inputs._replace(ki=inputs.ki * REAL(1.01))),
    "Kp through an integer of hundredths": with_inputs(
        lambda inputs: inputs._replace(kp=REAL(np.trunc(float(inputs.kp) * 100) / 100))
    ),
    "integrator that leaks": leaking,
    "integral with 22 bits": shortened,
}


@pytest.mark.parametrize("seed", [5, 8])
@pytest.mark.parametrize("foreign", FOREIGN)
def test_arithmetic_outside_the_family_is_not_named(foreign: str, seed: int) -> None:
    step = FOREIGN[foreign](CONTROLLERS["DPID"].step)
    found = identify(loop_of("DPID"), trace("DPID", DEFAULT, seed, 150, step))

    assert not found.is_named or found.is_crowded
    if found.unexplained is not None:
        # The PLC's words and the closest candidate's stand side by side, with every term of that.
        assert any(plc != ref for plc, ref in found.unexplained.words.values())
        assert {"e", "p", "i", "d", "raw"} <= set(found.unexplained.terms._fields)


def test_the_law_itself_is_named_where_the_foreign_ones_are_not() -> None:
    assert identify(loop_of("DPID"), trace("DPID", DEFAULT, 5, 150)).is_named
