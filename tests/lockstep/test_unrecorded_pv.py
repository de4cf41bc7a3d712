"""Dialects in which manual records no PV: what follows from a PV that nobody saw convicts nobody."""

from __future__ import annotations

from typing import Any

import pytest
from lockstep.bench_world import World

from ahgateway.clock import MILLISECOND
from ahgateway.core.dialect import DEFAULT, Dialect, ManualFilter, ManualHistory, ManualIntegral
from ahgateway.core.verdict import Verdict
from ahgateway.lockstep.judge import UNRECORDED_PV, Execution

GAINS: dict[str, dict[str, Any]] = {
    "DPID": {"Kp": 1.3, "Ki": 0.37, "Kd": 0.11},
    "DPIDE": {"Kc_Kp": 1.3, "Ti_Ki": 0.7, "Td_Kd": 0.4, "Tf": 0.21},
}


async def back_and_forth(name: str, dialect: Dialect, **initial: Any) -> tuple[World, list[Execution]]:
    """Automatic, manual and automatic again, PV read seven times between two pictures."""
    world = World(name, GAINS[name] | initial, cycle_ms=90, poll_ms=50, scan_ms=7, loop_changes={"dialect": dialect})
    found = await world.follow(60)
    for _ in range(3):
        world.plc.write("L1", "MOUT", 30.0)
        world.plc.write("L1", "PID_MAN", True)
        found += await world.follow(20)
        world.plc.write("L1", "PID_MAN", False)
        found += await world.follow(20)
    return world, found


@pytest.mark.parametrize("name", ["DPID", "DPIDE"])
@pytest.mark.parametrize("integral", [ManualIntegral.RUNS, ManualIntegral.TRACKS])
async def test_an_integral_that_follows_an_unrecorded_pv_is_unobservable(name: str, integral: ManualIntegral) -> None:
    dialect = DEFAULT._replace(manual_history=ManualHistory.HELD, manual_integral=integral)
    world, executions = await back_and_forth(name, dialect)

    assert world.follower.counts.diverged == 0
    assert UNRECORDED_PV in {event.reason for event in executions}
    assert executions[-1].verdict is not Verdict.UNOBSERVABLE


@pytest.mark.parametrize("content", list(ManualFilter))
@pytest.mark.parametrize("band", [0.0, 4.0])
async def test_a_filter_that_runs_on_an_unrecorded_pv_convicts_nobody(content: ManualFilter, band: float) -> None:
    dialect = DEFAULT._replace(manual_history=ManualHistory.HELD, manual_filter=content)
    world, executions = await back_and_forth("DPIDE", dialect, ERR_DBW=band)

    assert world.follower.counts.diverged == 0
    assert executions[-1].verdict is not Verdict.UNOBSERVABLE


async def test_a_wrong_output_is_convicted_though_no_pv_is_recorded() -> None:
    dialect = DEFAULT._replace(manual_history=ManualHistory.HELD, manual_integral=ManualIntegral.RUNS)
    world, _ = await back_and_forth("DPID", dialect)
    world.plc.write("L1", "PID_MAN", True)
    await world.follow(10)
    world.poll_ns = 2 * MILLISECOND
    world.plc.write("L1", "MV", 77.0)
    await world.follow(1)

    assert world.follower.counts.diverged == 1
