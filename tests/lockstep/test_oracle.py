"""What is called unobservable really is: enumeration finds both possible, and never where a verdict was claimed."""

from __future__ import annotations

import random
from collections import Counter
from typing import Any

import pytest
from lockstep.bench_world import World
from lockstep.oracle import Oracle
from lockstep.ways_world import ground

from ahgateway.codec.ways import Each, Way
from ahgateway.core.dialect import DEFAULT, Dialect, ManualHistory, ManualIntegral, PresetMv, RunOffManual, TsSource
from ahgateway.core.verdict import Verdict
from ahgateway.lockstep.judge import SEEDING, UNRECORDED_PV, Execution
from ahgateway.lockstep.picture import Picture

QUIET_D = {"DPID": {"Kp": 1.3, "Ki": 0.37, "Kd": 0.0}, "DPIDE": {"Kc_Kp": 1.3, "Ti_Ki": 0.37, "Td_Kd": 0.0}}
MS = DEFAULT._replace(ts_source=TsSource.MS)
TRACKED = DEFAULT._replace(run_off_manual=RunOffManual.TRACKED, preset_mv=PresetMv.MOUT)
FORGOTTEN = DEFAULT._replace(run_off_manual=RunOffManual.FORGOTTEN)
CLAIM = {Verdict.MATCH: "PROVEN", Verdict.DIVERGED: "BROKEN", Verdict.UNOBSERVABLE: "OPEN"}


def meddle(world: World, chance: random.Random) -> None:
    """At most one write: into the band and out of it, to manual and back, another SV."""
    kind = chance.randrange(12)
    if kind == 0:
        world.plc.write("L1", "ERR_DBW", chance.choice([0.0, 3.0, 40.0]))
    elif kind == 1:
        world.plc.write("L1", "PID_MAN", not world.plc.read("L1", "PID_MAN"))
    elif kind == 2:
        world.plc.write("L1", "SV", round(chance.uniform(20.0, 60.0), 1))
    elif kind == 3:
        world.plc.write("L1", "PID_DIR", not world.plc.read("L1", "PID_DIR"))


@pytest.mark.parametrize("fault", ["", "gain-1-percent", "dead-band-ignored"])
@pytest.mark.parametrize(("law", "dialect"), [("DPID", DEFAULT), ("DPIDE", DEFAULT), ("DPIDE", MS)])
@pytest.mark.parametrize("seed", range(3))
async def test_a_verdict_is_claimed_where_enumeration_finds_one_possibility_alone(
    law: str, dialect: Dialect, fault: str, seed: int
) -> None:
    initial: dict[str, Any] = {**QUIET_D[law], "ERR_DBW": 40.0, "SV": 40.0}
    changes = {"dialect": dialect, "scan_ms_max": 5}
    world = World(law, initial, seed=seed, loop_changes=changes)
    chance = random.Random(f"oracle {law} {fault} {seed}")
    oracle = Oracle(world.loop, range(95, 106) if dialect is MS else None)
    if fault:
        world.plc.fail("L1", fault)
    claims: Counter[tuple[str, str]] = Counter()
    is_known = False
    for poll in range(160):
        if poll % 4 == 0:
            meddle(world, chance)
        before = world.follower.picture
        executions = [event for event in await world.poll() if isinstance(event, Execution)]
        after = world.follower.picture
        for execution in executions:
            assert before is not None
            assert after is not None
            if execution.reason == SEEDING or not is_known:
                oracle.begin(after)
                is_known = True
                continue
            said = oracle.says(before, after)
            claims[said, CLAIM[execution.verdict]] += 1
            claim = CLAIM[execution.verdict]
            # Behind the first one a standing cause convicts again, though a memory of another kind would excuse it.
            is_again = claims["BROKEN", "BROKEN"] > 0 and claim == "BROKEN"
            assert said == claim or (is_again and said == "OPEN"), (poll, execution.reason)
            if claim == "BROKEN":
                oracle.begin(after)

    assert sum(claims.values()) > 30
    if not fault:
        assert not claims["BROKEN", "BROKEN"]


@pytest.mark.parametrize("fault", ["", "ki-1-percent", "dead-band-ignored"])
@pytest.mark.parametrize("law", ["DPID", "DPIDE"])
@pytest.mark.parametrize(
    ("dialect", "way"),
    [(DEFAULT, Way.RECORDED), (DEFAULT, Way.STEPPED), (TRACKED, Way.RECORDED), (FORGOTTEN, Way.STEPPED)],
    ids=["recorded", "stepped", "tracked", "forgotten"],
)
async def test_what_the_plc_shows_of_each_execution_is_claimed_as_enumeration_finds_it(
    dialect: Dialect, way: Way, law: str, fault: str
) -> None:
    changes = {"dialect": dialect}
    world = ground(
        way, law, {**QUIET_D[law], "ERR_DBW": 40.0, "SV": 40.0}, each=Each.CALL, loop_changes=changes, seed=4
    )
    chance = random.Random(f"oracle {way} {law} {fault}")
    oracle = Oracle(world.loop)
    if fault:
        world.plc.fail("L1", fault)
    claims: Counter[tuple[str, str]] = Counter()
    last: Picture | None = None
    is_known = False
    for poll in range(60):
        if poll % 3 == 0:
            meddle(world, chance)
        if poll % 8 in (3, 6):
            # In turn, so that manual begins and ends while the block is stopped, and the other way round.
            switch = "PID_RUN" if poll % 8 == 6 else "PID_MAN"
            world.plc.write("L1", switch, not world.plc.read("L1", switch))
        begun = len(world.events)
        await world.poll()
        for picture, event in world.events[begun:]:
            if not isinstance(event, Execution):
                continue
            if last is None or event.reason == SEEDING or not is_known:
                oracle.begin(picture)
                is_known = True
            else:
                said, claim = oracle.says(last, picture), CLAIM[event.verdict]
                claims[said, claim] += 1
                is_again = claims["BROKEN", "BROKEN"] > 0 and claim == "BROKEN"
                assert said == claim or (is_again and said == "OPEN"), (poll, event.reason)
                if claim == "BROKEN":
                    oracle.begin(picture)
            last = picture

    assert sum(claims.values()) > 40
    assert bool(fault) or not claims["BROKEN", "BROKEN"]


@pytest.mark.parametrize("fault", ["", "gain-1-percent", "dead-band-ignored"])
@pytest.mark.parametrize("law", ["DPID", "DPIDE"])
async def test_several_executions_are_claimed_where_enumeration_finds_one_number_of_them_alone(
    law: str, fault: str
) -> None:
    world = ground(Way.COUNTED, law, {**QUIET_D[law], "ERR_DBW": 3.0, "SV": 52.0}, seed=4)
    chance = random.Random(f"oracle counted {law} {fault}")
    oracle = Oracle(world.loop)
    claims: Counter[tuple[str, str]] = Counter()
    is_known = False
    for poll in range(70):
        if poll == 30 and fault:
            world.plc.fail("L1", fault)
        if poll % 5 == 0:
            world.plc.write("L1", "SV", round(chance.uniform(44.0, 56.0), 1))
        before = world.follower.picture
        executions = [event for event in await world.poll() if isinstance(event, Execution)]
        after = world.follower.picture
        for execution in executions:
            assert before is not None
            assert after is not None
            if not is_known:
                oracle.begin(after)
                is_known = True
                continue
            said, claim = oracle.says_of_several(before, after, 3), CLAIM[execution.verdict]
            claims[said, claim] += 1
            # A match may also be claimed of the last execution alone, where several numbers of them fit.
            assert (said, claim) in {
                ("PROVEN", "PROVEN"),
                ("OPEN", "PROVEN"),
                ("OPEN", "OPEN"),
                ("BROKEN", "BROKEN"),
            } or (claims["BROKEN", "BROKEN"] > 0 and claim in ("BROKEN", "OPEN")), (poll, execution.reason)
            if claim == "BROKEN":
                oracle.begin(after)

    assert claims["PROVEN", "PROVEN"] > 8
    assert bool(claims["BROKEN", "BROKEN"]) == bool(fault)


@pytest.mark.parametrize("law", ["DPID", "DPIDE"])
async def test_what_follows_from_an_unrecorded_pv_is_open_because_some_pv_leaves_the_words(law: str) -> None:
    dialect = DEFAULT._replace(manual_history=ManualHistory.HELD, manual_integral=ManualIntegral.RUNS)
    world = World(law, {**QUIET_D[law], "SV": 40.0}, seed=4, loop_changes={"dialect": dialect})
    await world.follow(40)
    world.plc.write("L1", "PID_MAN", True)
    oracle, found = Oracle(world.loop), 0
    for _ in range(40):
        before = world.follower.picture
        shadow = world.follower._shadow
        for execution in [event for event in await world.poll() if isinstance(event, Execution)]:
            if execution.reason == UNRECORDED_PV:
                oracle.states = {bound.low for bound in shadow}
                assert before is not None
                assert world.follower.picture is not None
                assert oracle.says(before, world.follower.picture) == "BROKEN"
                oracle.states = {bound.low for bound in shadow}
                assert oracle.explains_unrecorded(before, world.follower.picture)
                found += 1

    assert found > 4
