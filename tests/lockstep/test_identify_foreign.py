"""Ten arithmetics outside the family, for either instruction: none is named; the first execution is shown that none
explains."""

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


def is_automatic(inputs: Any, state: Any, after: Any) -> bool:
    """Tell whether this execution integrated and was no transfer."""
    return bool(inputs.pid_run and not inputs.pid_man and not state.man1 and after.i != state.i)


def fused(step: Step) -> Step:
    """The product of P is added to the integral without being rounded first."""

    def wrong(inputs: Any, state: Any, dialect: Any, ts: Any) -> tuple[Any, Any]:
        after, terms = step(inputs, state, dialect, ts)
        if not is_automatic(inputs, state, after):
            return after, terms
        gain = inputs.kp if hasattr(inputs, "kp") else inputs.kc_kp
        mv = REAL(float(gain) * float(terms.e) + float(terms.i)) + terms.d + getattr(inputs, "bias", REAL(0))
        mv = min(max(mv, inputs.mv_min), inputs.mv_max)
        return after._replace(mv=mv), terms._replace(mv=mv)

    return wrong


def velocity(step: Step) -> Step:
    """MV moves by what P, I and D changed since the last execution: another rounding of the same law."""
    last: list[Any] = []

    def wrong(inputs: Any, state: Any, dialect: Any, ts: Any) -> tuple[Any, Any]:
        after, terms = step(inputs, state, dialect, ts)
        before = last.pop() if last else None
        last.append(terms)
        if before is None or not is_automatic(inputs, state, after):
            return after, terms
        mv = state.mv + (((terms.p - before.p) + (terms.i - before.i)) + (terms.d - before.d))
        mv = min(max(mv, inputs.mv_min), inputs.mv_max)
        return after._replace(mv=mv), terms._replace(mv=mv)

    return wrong


def with_gain(names: tuple[str, str], change: Callable[[Any], Any]) -> Callable[[Step], Step]:
    """The law with another gain than it was given; its name in DPID and in DPIDE."""

    def make(step: Step) -> Step:
        def wrong(inputs: Any, state: Any, dialect: Any, ts: Any) -> tuple[Any, Any]:
            name = next(each for each in names if hasattr(inputs, each))
            return step(inputs._replace(**{name: change(getattr(inputs, name))}), state, dialect, ts)

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
    "velocity form": velocity,
    "Ts a quarter longer": with_ts(1.25),
    "Ki one per cent larger": with_gain(("ki", "ti_ki"), lambda gain: gain * REAL(1.01)),
    "Kp through an integer of hundredths": with_gain(
        ("kp", "kc_kp"), lambda gain: REAL(np.trunc(float(gain) * 100) / 100)
    ),
    "integrator that leaks": leaking,
    "integral with 22 bits": shortened,
}


CASES = [("DPID", 5, 150), ("DPID", 8, 150), ("DPIDE", 5, 60)]


@pytest.mark.parametrize(("name", "seed", "executions"), CASES)
@pytest.mark.parametrize("foreign", FOREIGN)
def test_arithmetic_outside_the_family_is_not_named(foreign: str, name: str, seed: int, executions: int) -> None:
    observations = trace(name, DEFAULT, seed, executions, FOREIGN[foreign](CONTROLLERS[name].step))
    found = identify(loop_of(name), observations)

    assert not found.is_named
    assert not found.is_crowded
    assert found.unexplained is not None
    # The PLC's words and the closest candidate's stand side by side, with every term of that.
    assert any(plc != ref for plc, ref in found.unexplained.words.values())
    assert {"e", "p", "i", "d", "raw"} <= set(found.unexplained.terms._fields)


@pytest.mark.parametrize(("name", "seed", "executions"), CASES)
def test_each_of_them_gives_other_bits_than_the_law(name: str, seed: int, executions: int) -> None:
    def words(step: Step | None) -> list[dict[str, Any]]:
        return [dict(each.after.seen) for each in trace(name, DEFAULT, seed, executions, step)]

    law = words(None)
    assert [] == [foreign for foreign, make in FOREIGN.items() if words(make(CONTROLLERS[name].step)) == law]


def test_the_law_itself_is_named_where_the_foreign_ones_are_not() -> None:
    assert 10 == len(FOREIGN)
    for name, seed, executions in CASES:
        assert identify(loop_of(name), trace(name, DEFAULT, seed, executions)).is_named, name
