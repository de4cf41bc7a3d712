"""Wrong arithmetic inside the PLC is convicted at the first execution whose bits differ, and its cause is named."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest
from lockstep.bench_world import World

from ahgateway.core.real import REAL, bits, quiet
from ahgateway.core.verdict import Verdict
from ahgateway.fake.faults import FAULTS
from ahgateway.lockstep.follow import Finding
from ahgateway.lockstep.judge import Execution
from ahgateway.lockstep.picture import Picture, predicted

GAINS: dict[str, dict[str, Any]] = {
    "DPIDE": {"Kc_Kp": 2.0, "Ti_Ki": 0.3, "Td_Kd": 0.4, "Tf": 0.5, "BIAS": 3.0},
    "DPID": {"Kp": 2.0, "Ki": 0.3, "Kd": 0.1},
}
STIR: dict[str, list[tuple[int, str, Any]]] = {
    "dead-band-ignored": [(0, "ERR_DBW", 3.0), (1000, "SV", 51.0)],
    "no-bumpless": [(2, "PID_MAN", True), (3, "MOUT", 35.0), (20, "PID_MAN", False)],
    "windup": [(2, "SV", 120.0)],
    "limits-before-sum": [(2, "SV", 120.0)],
    "bias-after-limits": [(2, "SV", 120.0)],
}
"""What an operator does, poll by poll, where ordinary control would not show the fault."""

CASES = [
    (name, law)
    for name, fault in FAULTS.items()
    for law in sorted(fault.controllers & {"DPID", "DPIDE"})
    if not fault.is_pv_late
]


async def provoke(name: str, law: str, *, polls: int = 1700) -> tuple[World, list[tuple[Picture, Execution]]]:
    """Let a loop run well, switch the fault on, stir, and return the divergences."""
    ground = World(law, GAINS[law], seed=3)
    await ground.follow(120)
    assert ground.follower.counts.diverged == 0
    ground.plc.fail("L1", name)
    stir = {poll: (operand, value) for poll, operand, value in STIR.get(name, [(10, "SV", 55.0)])}
    for poll in range(polls):
        if poll in stir:
            ground.plc.write("L1", *stir[poll])
        await ground.poll()
        if ground.follower.counts.diverged:
            break
    return ground, [
        (picture, event)
        for picture, event in ground.events
        if isinstance(event, Execution) and event.verdict is Verdict.DIVERGED
    ]


def first_wrong(ground: World) -> dict[str, int]:
    """Bits of the words behind the first execution in the PLC's own log that differs from the law."""
    law = ground.loop.controller
    for entry in ground.plc.log("L1"):
        with quiet(all="ignore"):
            right, terms = law.step(entry.inputs, entry.before, ground.loop.dialect, entry.ts)
        wanted = {name: bits(value) for name, value in predicted(law, right, terms).items()}
        found = {name: bits(value) for name, value in predicted(law, entry.state, entry.terms).items()}
        if wanted != found:
            return found
    raise AssertionError("the fault changed no bit")


@pytest.mark.parametrize(("name", "law"), CASES)
async def test_a_fault_is_convicted_at_the_first_execution_whose_bits_differ(name: str, law: str) -> None:
    ground, diverged = await provoke(name, law)

    assert diverged, "not convicted"
    picture, execution = diverged[0]
    assert {word: bits(value) for word, value in picture.seen.items()} == first_wrong(ground)
    assert execution.blame is not None
    assert execution.blame.suspects


@pytest.mark.parametrize(
    ("name", "law", "cause", "operand", "ratio"),
    [
        ("gain-1-percent", "DPID", "gain", "Kp", 1.01),
        ("gain-1-percent", "DPIDE", "gain", "Kc_Kp", 1.01),
        ("ki-1-percent", "DPID", "gain", "Ki", 1.01),
        ("ki-1-percent", "DPIDE", "gain", "Ti_Ki", 1.01),
        ("direction-reversed", "DPID", "direction", "PID_DIR", 1.0),
        ("direction-reversed", "DPIDE", "direction", "PID_DIR", 1.0),
    ],
)
async def test_the_cause_is_among_the_suspects(name: str, law: str, cause: str, operand: str, ratio: float) -> None:
    _, diverged = await provoke(name, law)

    assert diverged[0][1].blame is not None
    found = {(suspect.cause, suspect.operand): suspect.ratio for suspect in diverged[0][1].blame.suspects}
    assert (cause, operand) in found
    assert math.isclose(found[cause, operand], ratio, rel_tol=2e-3)


async def test_a_gain_that_stays_wrong_is_convicted_again_and_again_with_one_cause() -> None:
    ground = World("DPIDE", GAINS["DPIDE"], seed=5)
    await ground.follow(120)
    ground.plc.fail("L1", "gain-1-percent")
    ground.plc.write("L1", "SV", 60.0)
    behind = await ground.follow(200)

    diverged = [event for event in behind if event.verdict is Verdict.DIVERGED]
    assert len(diverged) >= 0.8 * len(behind)
    suspect = ground.follower.suspects[0]
    assert (suspect.cause, suspect.operand) == ("gain", "Kc_Kp")
    assert math.isclose(suspect.ratio, 1.01, rel_tol=1e-3)


async def test_a_loop_that_computes_rightly_again_is_proven_again() -> None:
    ground = World("DPIDE", GAINS["DPIDE"], seed=5)
    await ground.follow(120)
    ground.plc.fail("L1", "gain-1-percent")
    await ground.follow(40)
    ground.plc.fail("L1", None)
    behind = await ground.follow(160)

    assert {event.verdict for event in behind[-10:]} == {Verdict.MATCH}


async def test_an_mv_that_somebody_overwrites_is_no_execution_of_the_law() -> None:
    ground = World("DPID", GAINS["DPID"], seed=2)
    await ground.follow(100)
    await ground.poll()
    ground.plc.write("L1", "MV", 77.0)
    behind = await ground.follow(4)

    assert behind[0].verdict is Verdict.DIVERGED
    assert behind[0].blame is not None
    assert "operand-written" in {suspect.cause for suspect in behind[0].blame.suspects}


@pytest.mark.parametrize("law", ["DPID", "DPIDE"])
async def test_a_late_pv_is_recorded_as_it_was_used_and_convicts_nobody(law: str) -> None:
    ground, diverged = await provoke("pv-one-scan-late", law, polls=200)

    assert diverged == []
    assert ground.follower.summary().proven > 0


async def test_a_recorded_pv_that_the_register_did_not_hold_is_a_finding() -> None:
    ground = World("DPID", GAINS["DPID"], seed=2)
    await ground.follow(20)
    before = ground.follower.picture
    assert before is not None
    stale = dict(before.seen) | {"I_MV+1": REAL(12.0), "MV": REAL(40.0)}
    found = ground.follower.see(replace(before, tick=before.tick + 1, seen=stale))

    assert "stale-pv" in [event.name for event in found if isinstance(event, Finding)]


async def test_a_tolerance_reports_apart_and_never_as_proven() -> None:
    from ahgateway.codec.station import Tolerance

    ground = World("DPID", GAINS["DPID"], seed=3, loop_changes={"tolerance": Tolerance(ulp_max=4)})
    await ground.follow(120)
    ground.plc.fail("L1", "binary64-inside")
    await ground.follow(200)

    counts = ground.follower.summary()
    assert counts.diverged == 0
    assert counts.ulp > 0
    assert counts.proven + counts.ulp <= counts.total
