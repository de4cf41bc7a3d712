"""A recorder's ring read over a link: every execution is seen; what was overwritten or torn is lost, not judged."""

from __future__ import annotations

from typing import Any

import pytest
from lockstep.soak import GAINS, soak
from lockstep.ways_world import ground

from ahgateway.codec.ways import Each, Way
from ahgateway.core.verdict import Verdict
from ahgateway.lockstep.judge import Execution


@pytest.mark.parametrize("each", list(Each))
@pytest.mark.parametrize("controller", ["DPID", "DPIDE"])
async def test_every_execution_is_seen_and_proven(controller: str, each: Each) -> None:
    world = ground(Way.RECORDED, controller, GAINS[controller], each=each)
    executions = await world.follow(30)

    counts = world.follower.summary()
    assert counts.proven >= len(executions) - 8
    assert counts.diverged == 0
    # The first record of all is where judging starts, and the last execution may be recorded behind the last drain.
    assert world.plc.executed("L1") - 2 <= counts.total <= world.plc.executed("L1")
    assert counts.link == 0


@pytest.mark.parametrize("each", list(Each))
@pytest.mark.parametrize("controller", ["DPID", "DPIDE"])
async def test_operators_who_meddle_convict_nobody(controller: str, each: Each) -> None:
    world = ground(Way.RECORDED, controller, GAINS[controller], each=each, seed=7)
    counts = await soak(world, 150, seed=7, share=0.3)

    assert world.follower.first_diverged is None
    assert counts.proven >= 0.9 * counts.total


@pytest.mark.parametrize("each", list(Each))
@pytest.mark.parametrize("controller", ["DPID", "DPIDE"])
async def test_a_gain_that_is_wrong_is_convicted(controller: str, each: Each) -> None:
    world = ground(Way.RECORDED, controller, GAINS[controller], each=each, seed=3)
    await world.follow(30)
    world.plc.fail("L1", "gain-1-percent")
    await world.follow(5)

    diverged = [event for _, event in world.events if is_diverged(event)]
    assert len(diverged) >= 3
    assert "gain" in {suspect.cause for suspect in diverged[0].blame.suspects}


def is_diverged(event: Any) -> bool:
    return isinstance(event, Execution) and event.verdict is Verdict.DIVERGED
