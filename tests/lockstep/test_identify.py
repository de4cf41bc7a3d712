"""Learning a dialect from a trace: the true one survives; what is foreign stands in `test_identify_foreign`."""

from __future__ import annotations

from typing import Any

import pytest
from dialects import random_dialect
from lockstep.dialect_traces import loop_of, told, trace

from ahgateway.core.dialect import AXES, DEFAULT, Dialect
from ahgateway.lockstep.identify import Identification, identify

SLOW_TO_TELL = ("ts_source", "filter_content", "pv_word")


def learned(name: str, dialect: Dialect, executions: int = 120, seed: int = 5) -> Identification:
    return identify(loop_of(name), trace(name, dialect, seed, executions))


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


def test_a_trace_without_plain_executions_decides_nothing() -> None:
    found = identify(loop_of("DPID"), trace("DPID", DEFAULT, 1, 3))
    assert found.is_crowded
    assert not found.is_named
    assert found.plain < 4
