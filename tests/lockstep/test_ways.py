"""Each way of seeing executions proves what it promises and convicts at the first execution whose words differ."""

from __future__ import annotations

from typing import Any

import pytest
from lockstep.bench_world import World
from lockstep.soak import GAINS
from lockstep.ways_world import WAYS, ground

from ahgateway.codec.station import PlantSpec
from ahgateway.codec.ways import Each, Way
from ahgateway.core.real import bits, quiet
from ahgateway.core.verdict import Verdict
from ahgateway.lockstep.judge import Execution
from ahgateway.lockstep.picture import Picture

LAWS = ("DPID", "DPIDE")
CASES = [(way, Each.SCAN, law) for way in WAYS for law in LAWS]
CASES += [(way, Each.CALL, law) for way in (Way.STEPPED, Way.RECORDED) for law in LAWS]
FAULTS = ("gain-1-percent", "truncation", "direction-reversed", "integral-late")
STILL_MOVING = PlantSpec("fopdt", 1.2, 3.0, 0.2, 10.0, 0.05, 20.0)


def convicted(world: World) -> list[tuple[Picture, Execution]]:
    return [
        (picture, event)
        for picture, event in world.events
        if isinstance(event, Execution) and event.verdict is Verdict.DIVERGED
    ]


def wrong_words(world: World) -> list[tuple[int, int, int]]:
    """Time, I_MV and MV of the executions in the PLC's own log that differ from the law, which keeps D of its own."""
    law, hidden = world.loop.controller, None
    found = []
    for entry in world.plc.log("L1"):
        before = entry.before
        if hidden is not None and hasattr(before, "d"):
            before = before._replace(d=hidden)
        with quiet(all="ignore"):
            right, _ = law.step(entry.inputs, before, world.loop.dialect, entry.ts)
        hidden = getattr(right, "d", None)
        words = bits(entry.state.i), bits(entry.state.mv)
        if words != (bits(right.i), bits(right.mv)):
            found.append((entry.time_ns, *words))
    return found


@pytest.mark.parametrize(("way", "each", "law"), CASES)
async def test_what_a_way_can_prove_it_proves(way: Way, each: Each, law: str) -> None:
    world = ground(way, law, GAINS[law], each=each)
    await world.follow(60)

    counts = world.follower.summary()
    assert counts.diverged == 0
    assert counts.proven >= counts.total - 12
    assert world.plc.executed("L1") - 3 <= counts.total <= world.plc.executed("L1")


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize(("way", "each", "law"), CASES)
async def test_a_fault_is_convicted_at_the_first_words_that_differ(way: Way, each: Each, law: str, fault: str) -> None:
    world = ground(way, law, GAINS[law], each=each, seed=3)
    await world.follow(20)
    assert convicted(world) == []
    world.plc.fail("L1", fault)
    for _ in range(120):
        await world.poll()
        if convicted(world):
            break

    picture, execution = convicted(world)[0]
    wrong = wrong_words(world)
    assert execution.blame is not None
    seen = bits(picture.seen["I_MV"]), bits(picture.seen["MV"])
    if way is Way.COUNTED:  # several executions in one picture: the first wrong one is among those it stands for
        assert wrong[0][1:] in [(bits(each.state.i), bits(each.state.mv)) for each in behind(world, seen, execution)]
    else:
        assert wrong[0][1:] == seen


def behind(world: World, seen: tuple[int, int], execution: Execution) -> list[Any]:
    """The executions of the PLC's log that one judged picture stands for, at most three."""
    log = list(world.plc.log("L1"))
    last = max(at for at, entry in enumerate(log) if (bits(entry.state.i), bits(entry.state.mv)) == seen)
    return log[max(0, last - 2) : last + 1]


async def test_polling_slower_than_cycle_convicts_nobody_of_a_pv_that_it_did_not_see() -> None:
    world = ground(Way.COUNTED, "DPIDE", GAINS["DPIDE"], plant=STILL_MOVING)
    world.plc.fail("L1", "gain-1-percent")
    await world.follow(60)

    assert convicted(world) == []
    assert world.follower.summary().unobservable > 100


async def test_a_count_in_the_plc_tells_how_many_executions_there_were() -> None:
    world = ground(Way.STEPPED, "DPIDE", GAINS["DPIDE"], each=Each.CALL)
    await world.follow(30)

    assert 29 == world.plc.executed("L1")
    assert 29 == world.follower.counts.proven + world.follower.counts.unobservable
    journal = world.gate_of_steps.path.read_text(encoding="utf-8").splitlines()  # type: ignore[union-attr]
    assert 1 == sum('"stream"' in line and "TRIGGER" in line for line in journal)
    assert all(each.address in (50,) for each in world.plc.writes if each.who == "link")
