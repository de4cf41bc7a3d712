"""Random dialects over all axes: the true one survives, and what else survives is told apart by an axis named as open.

Where numba is installed the law is compiled, and 2 000 executions of each dialect are searched; the walk is the same
source as the interpreted one, which a smaller sample shows to decide the same.
"""

from __future__ import annotations

from typing import Any

import pytest
from dialects import random_dialect
from lockstep.dialect_traces import loop_of, told, trace

from ahgateway.core.dialect import AXES, Dialect, Integrator, TsUnit
from ahgateway.lockstep import thinning
from ahgateway.lockstep.identify import Identification, identify

pytestmark = pytest.mark.timeout(600)
"""Compiling takes half a minute of a free core, and a block of dialects about as long."""

NOT_IN_A_TRACE = ("pv_word", "ts_source")
"""Where PV stands is found before the search; clocks have a test of their own."""

BLOCKS = [("DPID", range(10), 1900), ("DPID", range(10, 20), 1900), ("DPIDE", range(3, 9), 1500)]
"""How many executions of each are explained on average at least: where a filter cannot be followed, some are not.

100 dialects of each law, clocks included, are searched by `bench/bench_survivors.py`.
"""


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
@pytest.mark.parametrize(("name", "seeds", "least"), BLOCKS)
def test_the_true_dialect_survives_two_thousand_executions(name: str, seeds: range, least: int) -> None:
    explained = refused = 0
    for seed in seeds:
        dialect = told(name, random_dialect(seed, without=NOT_IN_A_TRACE))
        found = identify(loop_of(name), trace(name, dialect, seed, 2000), compiled=True)
        if dialect.integrator is Integrator.DVP and dialect.ts_unit is not TsUnit.SECONDS and not found.is_named:
            # Times a number of counts at each execution, its integral drives MV to a limit for good: nothing is plain.
            assert found.plain < thinning.PLAIN_MIN, seed
            refused += 1
            continue
        assert found.is_named, seed
        assert set() == lost(found, dialect), seed
        assert [] == wrong_and_closed(name, found, dialect), seed
        explained += found.executions
    assert refused <= 1
    assert explained > least * (len(seeds) - refused)


@pytest.mark.parametrize("name", ["DPID", "DPIDE"])
def test_what_is_proof_that_no_way_to_integrate_fits_never_speaks_against_the_true_one(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where the first pass leaves nothing, by an accuracy that no way can have, the strict one still lets it stand."""
    monkeypatch.setattr(thinning, "SHARE_MIN", 2.0)
    for seed in range(40, 60):
        dialect = told(name, random_dialect(seed, without=NOT_IN_A_TRACE))
        observations = trace(name, dialect, seed, 250)
        pairs = [(each.before, each.after) for each in observations]
        found = thinning.thinned(loop_of(name), pairs, [each.is_next for each in observations])

        assert ([], None) == (found.left, found.fell), seed


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


@pytest.mark.parametrize(
    ("name", "seed", "first", "last"),
    [
        # I_MV is computed back from MV, in which D stands twice: it is not monotone in the interval.
        ("DPID", 55, 0, 120),
        # E is 0 while the content of the filter is open: MV puts other ticks right for each content.
        ("DPIDE", 31, 180, 280),
        # E was 0, so that MV alone puts ticks right: a content of 67 that moves by a third is rounded at each of them.
        ("DPIDE", 58, 280, 305),
    ],
)
def test_ticks_are_cut_down_only_where_it_is_proof(name: str, seed: int, first: int, last: int) -> None:
    dialect = told(name, random_dialect(seed, without=("pv_word",)))
    observations = trace(name, dialect, seed, last)[first:]
    whole = {axis: int(value) for axis, value in dialect._asdict().items()}
    found = identify(loop_of(name), observations, compiled=False, starts=[whole])

    assert found.unexplained is None
    assert found.executions > 0
