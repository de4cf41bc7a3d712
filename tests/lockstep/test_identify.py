"""Learning a dialect from a trace: the true one survives, what is foreign to the family is not named."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from dialects import random_dialect
from lockstep.dialect_traces import loop_of, told, trace

from ahgateway.core.controllers import CONTROLLERS
from ahgateway.core.dialect import AXES, DEFAULT, Dialect
from ahgateway.core.real import REAL
from ahgateway.lockstep.identify import Identification, identify

SLOW_TO_TELL = ("ts_source", "filter_content", "pv_word")


def learned(name: str, dialect: Dialect, executions: int = 120, step: Any = None, seed: int = 5) -> Identification:
    return identify(loop_of(name), trace(name, dialect, seed, executions, step))


def chosen(**values: str) -> Any:
    return Dialect(**{axis: AXES[axis][value.upper()] for axis, value in values.items()})


@pytest.mark.parametrize("seed", range(12))
def test_the_true_dialect_of_a_dpid_survives(seed: int) -> None:
    dialect = told("DPID", random_dialect(seed, share=0.35, without=SLOW_TO_TELL))
    found = learned("DPID", dialect, 60, seed=seed)
    assert found.unexplained is None
    assert {} == {name: left for name, left in found.values.items() if int(getattr(dialect, name)) not in left}


@pytest.mark.parametrize(
    "values",
    [
        {"sum_order": "pd_i", "derivative_product": "slope_first"},
        {"ts_source": "ms", "integrator": "trapezoid"},
        {"direction": "inverted", "integral_store": "sum", "derivative_of": "pv"},
        {"ts_unit": "counts", "sum_order": "p_id"},
    ],
    ids=str,
)
def test_what_shows_in_every_execution_is_decided(values: dict[str, str]) -> None:
    found = learned("DPID", chosen(**values))
    assert found.is_named
    decided = found.decided()
    assert values == {axis: AXES[axis](decided[axis]).name.lower() for axis in values}


def wide(step: Any) -> Any:
    """Binary64 inside, REAL at the end."""

    def wrong(inputs: Any, state: Any, dialect: Any, ts: Any) -> Any:
        def widened(values: Any) -> Any:
            return type(values)(*[np.float64(x) if isinstance(x, np.float32) else x for x in values])

        after, terms = step(widened(inputs), widened(state), dialect, np.float64(ts))
        return tuple(
            type(values)(*[REAL(x) if isinstance(x, np.floating) else x for x in values]) for values in (after, terms)
        )

    return wrong


def slower(step: Any) -> Any:
    """Another Ts than any clock could give."""

    def wrong(inputs: Any, state: Any, dialect: Any, ts: Any) -> Any:
        return step(inputs, state, dialect, ts * REAL(1.25))

    return wrong


def stronger(step: Any) -> Any:
    """An integral gain that is one per cent off."""

    def wrong(inputs: Any, state: Any, dialect: Any, ts: Any) -> Any:
        return step(inputs._replace(ki=inputs.ki * REAL(1.01)), state, dialect, ts)

    return wrong


@pytest.mark.parametrize("make", [wide, slower, stronger])
def test_arithmetic_outside_the_family_is_not_named(make: Any) -> None:
    found = learned("DPID", DEFAULT, 120, make(CONTROLLERS["DPID"].step))
    assert not found.is_named


def test_a_trace_without_plain_executions_decides_nothing() -> None:
    found = identify(loop_of("DPID"), trace("DPID", DEFAULT, 1, 3))
    assert found.is_crowded
    assert not found.is_named
