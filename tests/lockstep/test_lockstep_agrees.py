"""A PLC that computes as the reference does is never convicted, and what can be proven is proven."""

from __future__ import annotations

from typing import Any

import pytest
from lockstep.bench_world import World
from lockstep.soak import GAINS, Timed, soak

from ahgateway.codec.station import PlantSpec
from ahgateway.core.real import bits
from ahgateway.core.verdict import Verdict, Weight
from ahgateway.lockstep.picture import Sampler
from ahgateway.transports.server import serve_tcp
from ahgateway.transports.tcp import TcpLink

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
    counts = await soak(ground, 300, seed=seed)

    assert ground.follower.first_diverged is None
    assert counts.proven >= 0.85 * counts.total


@pytest.mark.slow
@pytest.mark.parametrize("controller", ["DPID", "DPIDE"])
async def test_five_thousand_executions_over_a_socket_with_meddling_convict_nobody(controller: str) -> None:
    ground = World(controller, GAINS[controller], seed=11, poll_ms=45)
    server = await serve_tcp(ground.plc)
    link = TcpLink("127.0.0.1", server.port, clock=ground.clock)
    try:
        ground.sampler = Sampler(ground.loop, ground.station, Timed(link, ground.clock), ground.clock)
        counts = await soak(ground, 5_000, seed=11)
    finally:
        await link.close()
        await server.close()

    assert ground.follower.first_diverged is None
    assert counts.proven >= 0.85 * counts.total
    assert counts.total <= ground.plc.executed("L1")


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
