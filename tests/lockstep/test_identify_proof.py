"""Random dialects over all axes: the true one survives, and what else survives is told apart by an axis named as open.

Where numba is installed the law is compiled, and 2 000 executions of each dialect are searched; the walk is the same
source as the interpreted one, which a smaller sample shows to decide the same.
"""

from __future__ import annotations

from typing import Any

import pytest
from dialects import random_dialect
from lockstep.dialect_traces import loop_of, told, trace

from ahgateway.core.dialect import AXES, Dialect
from ahgateway.lockstep.identify import Identification, identify

pytestmark = pytest.mark.timeout(600)
"""Compiling takes half a minute of a free core, and a block of dialects about as long."""

SEEDS = 10
NOT_IN_A_TRACE = ("pv_word", "ts_source")
"""Where PV stands is found before the search; clocks have a test of their own."""


def lost(found: Identification, dialect: Dialect) -> set[str]:
    """Axes of which the true value did not survive."""
    return {axis for axis, left in found.values.items() if int(getattr(dialect, axis)) not in left}


def wrong_and_closed(name: str, found: Identification, dialect: Dialect) -> list[Dialect]:
    """Survivors that differ from the truth in an axis that is not named as open."""
    is_open = {axis.name for axis in found.open_axes(name)}
    asked = [each for each in AXES if len(found.values[each]) < len(AXES[each])]
    return [
        survivor
        for survivor in found.survivors
        if any(getattr(survivor, axis) != getattr(dialect, axis) for axis in asked if axis not in is_open)
    ]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["DPID"])
@pytest.mark.parametrize("block", range(4))
def test_the_true_dialect_survives_two_thousand_executions(name: str, block: int) -> None:
    """Four blocks of ten dialects."""
    explained = 0
    for seed in range(SEEDS * block, SEEDS * (block + 1)):
        dialect = told(name, random_dialect(seed, without=NOT_IN_A_TRACE))
        found = identify(loop_of(name), trace(name, dialect, seed, 2000), compiled=True)
        if found.is_crowded:
            continue
        assert found.unexplained is None, seed
        assert set() == lost(found, dialect), seed
        assert [] == wrong_and_closed(name, found, dialect), seed
        explained += found.executions
    assert explained > 8 * 1900


@pytest.mark.parametrize("name", ["DPID"])
@pytest.mark.parametrize("seed", [3, 5])
def test_the_interpreted_walk_decides_the_same(name: str, seed: int) -> None:
    dialect = told(name, random_dialect(seed, without=NOT_IN_A_TRACE))
    observations = trace(name, dialect, seed, 120)
    compiled, interpreted = (identify(loop_of(name), observations, compiled=each) for each in (True, False))

    assert compiled.values == interpreted.values
    assert set(compiled.survivors) == set(interpreted.survivors)
    assert (compiled.executions, compiled.informative) == (interpreted.executions, interpreted.informative)


@pytest.mark.slow
@pytest.mark.parametrize("source", ["MS", "TENTH_MS"])
@pytest.mark.parametrize("name", ["DPID"])
def test_a_measured_interval_is_an_unknown_on_its_grid(name: str, source: str) -> None:
    for seed in (3, 5, 6):
        drawn = told(name, random_dialect(seed, without=NOT_IN_A_TRACE))
        dialect: Any = drawn._replace(ts_source=AXES["ts_source"][source])
        found = identify(loop_of(name), trace(name, dialect, seed, 600), compiled=True)

        assert found.unexplained is None, seed
        assert set() == lost(found, dialect), seed
