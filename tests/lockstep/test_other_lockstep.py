"""PID_Temp, PID_REG_CE and MELSEC PID in lockstep: a right block is proven and never convicted, a wrong one is."""

from __future__ import annotations

import random
from typing import Any

import pytest
from lockstep.other_world import OtherWorld

from ahgateway.core.controllers import CONTROLLERS
from ahgateway.core.verdict import Verdict, Weight
from ahgateway.lockstep.judge import Execution

BLOCKS = ["PID_Temp", "PID_REG_CE", "MELSEC_PID"]


async def begun(name: str, initial: dict[str, Any] | None = None, **arguments: Any) -> OtherWorld:
    """A world whose block is known."""
    ground = OtherWorld(name, initial, **arguments)
    await begun_in(ground, name)
    return ground


async def begun_in(ground: OtherWorld, name: str) -> None:
    """Inactive to automatic, a contact that was off, a pulse controller that was in manual."""
    await ground.follow(8)
    if name == "PID_Temp":
        ground.plc.write("L1", "ModeActivate", True)
    if name == "MELSEC_PID":
        ground.plc.write("L1", "EN", False)
        await ground.follow(4)
        ground.plc.write("L1", "EN", True)
    if name == "PID_REG_CE":
        ground.plc.write("L1", "REG_AVT", False)
        await ground.follow(8)
        ground.plc.write("L1", "REG_AVT", True)


def diverged(ground: OtherWorld) -> list[Any]:
    return [
        (picture.tick, event.blame)
        for picture, event in ground.events
        if isinstance(event, Execution) and event.verdict is Verdict.DIVERGED
    ]


@pytest.mark.parametrize("counter", [False, True])
@pytest.mark.parametrize("name", BLOCKS)
async def test_a_right_block_is_proven_and_not_convicted(name: str, counter: bool) -> None:
    initial = {"ALPHA": 20, "TD": 30, "KD": 20} if name == "MELSEC_PID" else {"Heat_Td": 0.5, "Heat_PwmPeriode": 0.0}
    ground = await begun(name, initial if name != "PID_REG_CE" else None, counter=counter)
    await ground.follow(400)

    assert diverged(ground) == []
    counts = ground.follower.summary()
    assert abs(ground.plc.executed("L1") - counts.total) <= 3
    assert counts.informative >= (0.8 if counter or name != "MELSEC_PID" else 0.4) * counts.total


@pytest.mark.parametrize("name", BLOCKS)
async def test_terms_are_those_inside_the_plc(name: str) -> None:
    ground = await begun(name, counter=True)
    matched = [event for event in await ground.follow(120) if event.verdict is Verdict.MATCH]
    inside = ground.plc.log("L1")[-1].terms

    assert matched[-1].terms._replace() == inside or matched[-1].terms == ground.plc.log("L1")[-2].terms


MEDDLING: dict[str, list[tuple[str, Any]]] = {
    "PID_Temp": [
        ("Setpoint", 45.0), ("ManualEnable", True), ("ManualValue", 33.0), ("ManualEnable", False),
        ("ActivateCooling", True), ("Setpoint", 25.0), ("Heat_DeadZone", 0.2), ("Reset", True), ("Reset", False),
        ("Disturbance", 3.0), ("Heat_Cycle", 0.5), ("Heat_ControlZone", 5.0), ("Setpoint", 70.0),
    ],
    "PID_REG_CE": [
        ("SET_POINT", 35.0), ("REG_AVT", False), ("IN_OPEN_R", True), ("REG_AVT", True), ("KP", 1.5), ("D_ZONE", 1.0),
        ("SET_POINT", 60.0), ("TN", 0.0), ("PT_LUFT", 0.0), ("Y_OGR", 40.0), ("SET_POINT", 20.0), ("T_PERIOD", 4.0),
    ],
    "MELSEC_PID": [
        ("SV", 450), ("KP", 90), ("EN", False), ("MV", 300), ("EN", True), ("TI", 0), ("ALPHA", 30), ("TD", 20),
        ("ACT", 35), ("S22", 700), ("TI", 20), ("ACT", 33), ("SV", 800),
    ],
}  # fmt: skip


@pytest.mark.parametrize("counter", [False, True])
@pytest.mark.parametrize("name", BLOCKS)
async def test_meddling_convicts_nobody(name: str, counter: bool) -> None:
    rng = random.Random(7)
    ground = await begun(name, counter=counter, seed=7)
    for operand, value in MEDDLING[name]:
        moment = ground.plc.now_ns + rng.randrange(3 * ground.poll_ns)
        ground.plc.at(moment, lambda plc, operand=operand, value=value: plc.write("L1", operand, value))
        await ground.follow(30)

    assert diverged(ground) == []
    assert ground.follower.summary().proven > 40


FAULTS = [
    ("PID_Temp", "kp-1-percent", {}),
    ("PID_Temp", "ti-1-percent", {}),
    ("PID_Temp", "interval-25-percent", {"Heat_MinimumOnTime": 0.3}),
    ("PID_Temp", "carry-lost", {"Heat_Cycle": 0.7}),
    ("PID_REG_CE", "kp-1-percent", {}),
    ("PID_REG_CE", "pulse-one-call-long", {}),
    ("PID_REG_CE", "luft-ignored", {}),
    ("PID_REG_CE", "zone-ignored", {}),
    ("MELSEC_PID", "kp-1-percent", {}),
    ("MELSEC_PID", "interval-25-percent", {}),
    ("MELSEC_PID", "act-reversed", {}),
    ("MELSEC_PID", "input-filter-ignored", {"ALPHA": 40}),
]


STEPS = {"PID_Temp": (55.0, 60.0), "PID_REG_CE": (50.0, 53.0), "MELSEC_PID": (400, 520)}


@pytest.mark.parametrize(("name", "fault", "initial"), FAULTS)
async def test_a_wrong_block_is_convicted(name: str, fault: str, initial: dict[str, Any]) -> None:
    ground = await begun(name, initial, counter=True)
    await ground.follow(60)
    assert diverged(ground) == []
    ground.plc.fail("L1", fault)
    sv = CONTROLLERS[name].roles.sv
    for turn in range(40):
        if turn % 5 == 0:
            ground.plc.write("L1", sv, STEPS[name][turn // 5 % 2])
        await ground.follow(20)
        if diverged(ground):
            break

    assert diverged(ground)
    assert diverged(ground)[0][1].suspects


async def test_the_cause_of_a_wrong_gain_is_named() -> None:
    ground = await begun("PID_Temp", counter=True)
    await ground.follow(40)
    ground.plc.fail("L1", "kp-1-percent")
    await ground.follow(60)

    named = [{(each.cause, each.operand) for each in blame.suspects} for _, blame in diverged(ground)]
    assert sum(("gain", "Heat_Gain") in each for each in named) > 0.5 * len(named)


async def test_melsec_claims_nothing_where_pv_may_move_at_any_time() -> None:
    ground = await begun("MELSEC_PID", loop_changes={"pv_held": False})
    executions = await ground.follow(100)

    assert {event.verdict for event in executions} == {Verdict.UNOBSERVABLE}
    assert "pv_held" in executions[-1].reason


async def test_what_a_block_publishes_of_its_pv_is_enough() -> None:
    for name in ("PID_REG_CE", "PID_Temp"):
        ground = await begun(name, counter=True, loop_changes={"pv_held": False})
        await ground.follow(200)
        assert diverged(ground) == []
        assert ground.follower.summary().proven > 30


async def test_a_block_met_in_automatic_is_judged_but_for_its_pulses() -> None:
    ground = OtherWorld("PID_Temp", {"ModeActivate": True, "Heat_Td": 0.4}, counter=True)
    await ground.follow(300)

    counts = ground.follower.summary()
    assert counts.diverged == 0
    assert counts.informative > 40


async def test_polling_slower_than_the_calls_claims_nothing() -> None:
    ground = await begun("PID_REG_CE", counter=True, poll_ms=350)
    executions = await ground.follow(40)

    assert {event.verdict for event in executions} == {Verdict.UNOBSERVABLE}


async def test_calls_that_change_nothing_are_counted_where_something_counts() -> None:
    from ahgateway.codec.station import PlantSpec

    still = PlantSpec("fopdt", 0.0, 6.0, 0.0, 40.0, 0.0, 40.0)
    ground = await begun("PID_REG_CE", {"SET_POINT": 60.0, "PT_LUFT": 0.0, "TN": 0.0}, counter=True, plant=still)
    executions = await ground.follow(400)

    assert {event.verdict for event in executions[3:]} == {Verdict.MATCH}
    assert {event.weight for event in executions} >= {Weight.TRIVIAL, Weight.INFORMATIVE}


@pytest.mark.parametrize("counter", [False, True])
async def test_a_value_written_into_d_while_running_is_named_and_the_sum_goes_on(counter: bool) -> None:
    """Spec C.7/4: it is ignored. With a counter it is no call; without one it looks like a wrong call, once."""
    ground = await begun("MELSEC_PID", {"ALPHA": 30, "TD": 20, "KD": 20}, counter=counter)
    await ground.follow(80)
    ground.plc.write("L1", "MV", 777)
    after = [event for event in await ground.follow(60) if isinstance(event, Execution)]

    causes = [suspect.cause for _, blame in diverged(ground) for suspect in blame.suspects]
    assert causes == ([] if counter else ["operand-written"])
    assert Verdict.MATCH is after[-1].verdict


async def test_a_value_written_into_d_with_the_contact_off_starts_the_sum() -> None:
    """Spec C.3: MV(n-1) of the first execution is the present content of (d)."""
    ground = await begun("MELSEC_PID", {"KP": 1, "TI": 0}, counter=True)
    await ground.follow(20)
    for name, value in (("EN", False), ("MV", 300), ("EN", True)):
        ground.plc.write("L1", name, value)
        await ground.follow(8)

    assert diverged(ground) == []
    assert 5 > abs(ground.plc.read("L1", "MV") - 300)
    assert Verdict.MATCH is [event for _, event in ground.events if isinstance(event, Execution)][-1].verdict
