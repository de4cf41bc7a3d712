"""A PLC that computes as the reference does is never convicted, and what can be proven is proven."""

from __future__ import annotations

import random
from typing import Any

import pytest
from lockstep.bench_world import World

from ahgateway.codec.station import PlantSpec
from ahgateway.core.real import bits
from ahgateway.core.verdict import Verdict, Weight
from ahgateway.fake.plc import FakePlc
from ahgateway.lockstep.judge import Execution

GAINS = {
    "DPIDE": {"Kc_Kp": 2.0, "Ti_Ki": 0.3, "Td_Kd": 0.4, "Tf": 0.5},
    "DPID": {"Kp": 2.0, "Ki": 0.3, "Kd": 0.1},
}

CASES: list[tuple[str, dict[str, Any], dict[str, Any]]] = [
    ("DPID", {}, {}),
    ("DPIDE", {}, {}),
    ("DPIDE", {"Td_Kd": 0.0}, {"mv": 160}),
    ("DPIDE", {"PID_EQ": True, "PID_DE": True, "Ti_Ki": 8.0}, {"is_restless": True}),
    ("DPIDE", {"ERR_DBW": 0.5}, {}),
    ("DPID", {"ERR_DBW": 0.05, "PID_DIR": False, "MV_MIN": -100.0, "MV_MAX": 0.0}, {}),
    ("DPIDE", {"PID_MAN": True, "MOUT": 30.0}, {}),
    ("DPIDE", {"MOUT_AUTO": True, "BIAS": 4.0}, {"consts": {"PID_MODE": 0, "ERR_DBW": 0.0}}),
]


@pytest.mark.parametrize(("controller", "initial", "world"), CASES)
async def test_what_can_be_proven_is_proven(controller: str, initial: dict[str, Any], world: dict[str, Any]) -> None:
    ground = World(controller, {**GAINS[controller], **initial}, **world)
    executions = await ground.follow(400)

    assert [event for event in executions if event.verdict is Verdict.DIVERGED] == []
    counts = ground.follower.summary()
    assert 0 <= ground.plc.executed("L1") - counts.total <= 1
    assert counts.proven >= 0.9 * counts.total


async def test_every_term_is_that_of_the_plc() -> None:
    ground = World("DPIDE", GAINS["DPIDE"])
    executions = [event for event in await ground.follow(200) if event.verdict is Verdict.MATCH]
    log = {bits(entry.state.mv): entry.terms for entry in ground.plc.log("L1")}

    assert executions
    for event in executions:
        inside = log[bits(event.terms.mv)]
        for term in {"p", "i", "d", "bias", "raw", "mv", "mout"} - set(event.open_terms):
            assert bits(getattr(inside, term)) == bits(getattr(event.terms, term)), term
    assert executions[-1].open_terms == ()


@pytest.mark.parametrize("controller", ["DPID", "DPIDE"])
@pytest.mark.parametrize("seed", range(4))
async def test_random_writes_by_others_convict_nobody(controller: str, seed: int) -> None:
    ground = World(controller, GAINS[controller], seed=seed)
    rng = random.Random(seed)
    for poll in range(700):
        if poll % 2 == 0 and rng.random() < 0.15:
            moment = ground.plc.now_ns + rng.randrange(ground.poll_ns)
            ground.plc.at(moment, lambda plc: write_something(plc, controller, rng))
        await ground.poll()

    executions = [event for _, event in ground.events if isinstance(event, Execution)]
    assert [event.blame for event in executions if event.verdict is Verdict.DIVERGED] == []
    counts = ground.follower.summary()
    assert counts.proven >= 0.85 * counts.total


def write_something(plc: FakePlc, controller: str, rng: random.Random) -> None:
    """Change one operand as an operator or another program would."""
    gains = list(GAINS[controller])
    switches = {"PID_MAN": 0.4, "MOUT_AUTO": 0.4, "PID_RUN": 0.8, "PID_DIR": 0.8}
    if controller == "DPIDE":
        switches |= {"PID_EQ": 0.4, "PID_DE": 0.4}
    cycle = [10, 12, 15] if controller == "DPID" else [100, 120, 150]
    choices: dict[str, Any] = {
        **{name: rng.random() < share for name, share in switches.items()},
        **{name: rng.choice([0.0, rng.uniform(0, 1), rng.uniform(0, 3)]) for name in gains},
        "SV": rng.uniform(20, 90),
        "MOUT": rng.uniform(-10, 110),
        "MV_MAX": rng.choice([100.0, 80.0, 60.0]),
        "MV_MIN": rng.choice([0.0, 10.0, 70.0]),
        "ERR_DBW": rng.choice([0.0, 1.0, 2.0]),
        "CYCLE": rng.choice(cycle),
        "PID_MODE": rng.choice([0, 0, 2]),
    }
    operand = rng.choice(sorted(choices))
    plc.write("L1", operand, choices[operand])


async def test_a_settled_loop_is_never_counted_as_informative() -> None:
    still = PlantSpec("fopdt", 1.0, 5.0, 0.0, 50.0, 0.0, 50.0)
    ground = World("DPID", {**GAINS["DPID"], "SV": 50.0}, plant=still)
    await ground.follow(200)

    counts = ground.follower.summary()
    assert counts.informative == 0
    assert counts.trivial + counts.unobservable == counts.total
    assert 40 <= counts.total <= 60


async def test_manual_and_saturated_executions_are_trivial() -> None:
    ground = World("DPIDE", {**GAINS["DPIDE"], "SV": 90.0, "MV_MAX": 20.0})
    executions = [event for event in await ground.follow(200) if event.verdict is Verdict.MATCH]

    assert executions
    assert {event.weight for event in executions[5:]} == {Weight.TRIVIAL}


async def test_auto_tuning_suspends_judgement_until_the_plc_sets_the_mode_back() -> None:
    ground = World("DPIDE", {**GAINS["DPIDE"], "SV": 40.0})
    await ground.follow(60)
    ground.plc.write("L1", "PID_MODE", 1)
    during = await ground.follow(40)
    ground.plc.write("L1", "PID_MODE", 0)
    behind = await ground.follow(80)

    assert {event.verdict for event in during} == {Verdict.UNOBSERVABLE}
    assert [event for event in behind if event.verdict is Verdict.DIVERGED] == []
    assert behind[-1].verdict is Verdict.MATCH


async def test_polling_slower_than_cycle_claims_nothing_it_cannot_know() -> None:
    ground = World("DPIDE", GAINS["DPIDE"], poll_ms=350)
    executions = await ground.follow(60)

    assert {event.verdict for event in executions} == {Verdict.UNOBSERVABLE}
    assert ground.follower.summary().proven == 0


async def test_an_integral_that_a_person_cleared_at_rest_is_a_change_and_no_difference() -> None:
    still = PlantSpec("fopdt", 1.0, 5.0, 0.0, 50.0, 0.0, 50.0)
    ground = World("DPID", {**GAINS["DPID"], "SV": 50.0, "PID_MAN": True, "MOUT": 0.0}, plant=still)
    await ground.follow(20)
    ground.plc.memory.write(ground.station.devices.ranges[0].table, 122, (0, 0x41C8))
    await ground.follow(20)

    changed = [(event.operand, float(event.new)) for _, event in ground.events if hasattr(event, "operand")]
    assert changed == [("I_MV", 25.0)]
    assert ground.follower.counts.diverged == 0
