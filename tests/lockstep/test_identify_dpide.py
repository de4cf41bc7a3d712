"""DPIDE's dialect from pictures of the fake in virtual time: the open filter D does not cost the search its way."""

from __future__ import annotations

from typing import Any

import pytest
from dialects import random_dialect
from lockstep.bench_world import World
from lockstep.dialect_traces import loop_of, trace

from ahgateway.codec.station import PlantSpec
from ahgateway.core.dialect import (
    DEFAULT,
    Dialect,
    Filter,
    FilterContent,
    Freeze,
    IntegralStore,
    IntegralUsed,
    ManualHistory,
    ManualIntegral,
)
from ahgateway.lockstep.anchor import anchored, is_anchor
from ahgateway.lockstep.identify import Identification, identify, observed

pytestmark = pytest.mark.timeout(600)
"""The law is compiled once, which takes half a minute of a free core."""

REACTOR = PlantSpec("fopdt", 1.5, 40.0, 4.0, 20.0, 0.02, 20.0)
"""Plant of the demo's TIC-101: MV begins at its limit and comes down from it."""

GAINS: dict[str, Any] = {"SV": 80.0, "Kc_Kp": 2.0, "Ti_Ki": 0.05, "Td_Kd": 4.0, "Tf": 1.0, "PID_DE": True}


async def learned(dialect: Dialect, initial: dict[str, Any] | None = None, polls: int = 240) -> Identification:
    """Watch TIC-101 in this dialect, a picture every 50 ms, and search."""
    world = World(
        "DPIDE",
        GAINS | (initial or {}),
        plant=REACTOR,
        cycle_ms=200,
        poll_ms=50,
        loop_changes={"dialect": dialect, "scan_ms_max": 10},
    )
    await world.poll()
    pictures = [world.follower.picture]
    for _ in range(polls):
        await world.poll()
        pictures.append(world.follower.picture)
    return identify(world.loop, observed([picture for picture in pictures if picture is not None], world.loop))


def lost(found: Identification, dialect: Dialect) -> set[str]:
    """Axes of which the true value did not survive."""
    return {name for name, left in found.values.items() if int(getattr(dialect, name)) not in left}


BACKWARD_OR_ALPHA = (0, 3)
"""The two differ in the last bit of D alone, which the last bit of a large MV swallows."""


@pytest.mark.parametrize(
    ("dialect", "filters"),
    [
        (DEFAULT, (0,)),
        (DEFAULT._replace(freeze=Freeze.OUTWARD, filter=Filter.ALPHA), BACKWARD_OR_ALPHA),
        (DEFAULT._replace(filter=Filter.TUSTIN, filter_content=FilterContent.SLOPE), (2,)),
        (
            DEFAULT._replace(filter=Filter.EXACT, integral_store=IntegralStore.SUM, integral_used=IntegralUsed.OLD),
            (4,),
        ),
        (DEFAULT._replace(filter=Filter.IGNORED), (5,)),
    ],
    ids=["default", "alpha", "tustin", "exact", "ignored"],
)
async def test_the_filter_of_a_running_loop_is_learned(dialect: Dialect, filters: tuple[int, ...]) -> None:
    found = await learned(dialect)

    assert found.is_named
    assert not found.is_cut
    assert found.executions >= 20
    assert filters == found.values["filter"]
    assert (0,) == found.values["direction"]
    assert set() == lost(found, dialect)


async def test_the_dependent_form_is_learned_too() -> None:
    found = await learned(DEFAULT, {"PID_EQ": True, "Ti_Ki": 40.0, "PID_DE": False})

    assert found.is_named
    assert (0,) == found.values["tf_unit"]
    assert set() == lost(found, DEFAULT)


@pytest.mark.parametrize("seed", [0, 2, 10])
def test_the_true_dialect_of_a_dpide_survives_operators_who_meddle(seed: int) -> None:
    dialect = random_dialect(seed, share=0.35, without=("ts_source", "filter_content", "pv_word"))
    found = identify(loop_of("DPIDE"), trace("DPIDE", dialect, seed, 40))

    assert found.unexplained is None
    assert set() == lost(found, dialect)


def test_manual_that_records_no_pv_excludes_nothing() -> None:
    dialect = DEFAULT._replace(manual_history=ManualHistory.HELD, manual_integral=ManualIntegral.TRACKS)
    found = identify(loop_of("DPIDE"), trace("DPIDE", dialect, 6, 60))

    assert found.unexplained is None
    assert set() == lost(found, dialect)


def test_a_search_that_runs_out_of_steps_names_what_is_left() -> None:
    dialect = random_dialect(4, share=0.35, without=("ts_source", "filter_content", "pv_word"))
    found = identify(loop_of("DPIDE"), trace("DPIDE", dialect, 4, 60), steps_max=0)

    assert found.is_cut
    assert set() == lost(found, dialect)


@pytest.mark.parametrize(("seed", "share", "executions"), [(0, 0.35, 60), (2, 0.35, 60), (5, 0.35, 60), (4, 1.0, 700)])
def test_an_anchor_encloses_the_content_of_the_filter(seed: int, share: float, executions: int) -> None:
    """The content is read from the law that made the trace; nothing else knows it.

    In the last one the form changes on the run, and an integral that is used late is rescaled before that.
    """
    dialect = random_dialect(seed, share=share, without=("ts_source", "pv_word"))
    loop = loop_of("DPIDE", dialect)
    contents: list[float] = []

    def step(inputs: Any, state: Any, chosen: Any, ts: Any) -> Any:
        after, terms = loop.controller.step(inputs, state, chosen, ts)
        contents.append(float(after.d))
        return after, terms

    observations = trace("DPIDE", dialect, seed, executions, step)
    pairs = [(each.before, each.after) for each in observations]
    anchors = [n for n, each in enumerate(observations) if is_anchor(loop, pairs, n, is_next=each.is_next)]
    enclosed = [
        float(bound.low.d) <= contents[n] <= float(bound.high.d) for n in anchors for bound in anchored(loop, *pairs[n])
    ]

    assert len(enclosed) >= 3
    assert all(enclosed)
