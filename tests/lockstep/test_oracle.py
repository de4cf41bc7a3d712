"""What is called unobservable really is: enumeration finds both possible, and never where a verdict was claimed."""

from __future__ import annotations

import random
from collections import Counter
from typing import Any

import pytest
from lockstep.bench_world import World
from lockstep.oracle import Oracle

from ahgateway.core.dialect import DEFAULT, Dialect, TsSource
from ahgateway.core.verdict import Verdict
from ahgateway.lockstep.judge import SEEDING, Execution

QUIET_D = {"DPID": {"Kp": 1.3, "Ki": 0.37, "Kd": 0.0}, "DPIDE": {"Kc_Kp": 1.3, "Ti_Ki": 0.37, "Td_Kd": 0.0}}
MS = DEFAULT._replace(ts_source=TsSource.MS)
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
