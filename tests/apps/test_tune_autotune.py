"""PID_MODE = 1 under supervision, on the fake PLC in virtual time: judged, put back, aborted, killed."""

from __future__ import annotations

import pytest
from lockstep.gate.gate_world import WRITES, Cut, FailingLink, GateWorld, is_write

from ahgateway.apps.tune import as_json, tune
from ahgateway.apps.tune_autotune import NAME
from ahgateway.apps.tune_experiment import Experiment, Kind, Wanted
from ahgateway.apps.tune_page import page
from ahgateway.apps.tune_session import Gains, Session
from ahgateway.apps.tune_sitting import Envelope
from ahgateway.codec.access import Read, Table
from ahgateway.codec.station import PlantSpec, WriteLimit
from ahgateway.core.controllers import CONTROLLERS
from ahgateway.errors import StateError
from ahgateway.lockstep.gate.session import Session as State
from ahgateway.lockstep.gate.session import decide
from ahgateway.lockstep.picture import Sampler
from ahgateway.tuning.findings import Weight
from ahgateway.tuning.models import Kind as Process
from ahgateway.tuning.rules import RULES

INITIAL = {
    "SV": 80.0, "CYCLE": 200, "Kc_Kp": 1.0, "Ti_Ki": 0.15, "Td_Kd": 0.0, "MV_MAX": 100.0, "MV_MIN": 0.0,
}  # fmt: skip
HELD = ("PID_MODE", "Kc_Kp", "Ti_Ki", "Td_Kd", "Tf", "MV_MAX", "MV_MIN", "SV", "PID_MAN")
LISTED = WRITES | {"PID_MODE": WriteLimit(0, 1, 1, 0.0)}
WIDE = Envelope((40.0, 120.0), (20.0, 60.0))


def bench(folder, writes=LISTED, **initial):
    plant = PlantSpec("fopdt", 1.5, 6.0, 1.0, 20.0, 0.02, 80.0)
    world = GateWorld(folder, INITIAL | initial, plant=plant, scan_ms=20, writes=writes)
    world.clock.advance_ns(120_000_000_000)
    world.plc.answer(Read(1, Table.HOLDING, 100, 1))
    world.plc.writes.clear()
    return world


def experiment(world, link=None, bounds=WIDE):
    line = link or world.link
    sampler = Sampler(world.loop, world.station, line, world.clock)
    return Experiment(world.loop, world.gate(line), sampler, world.clock, bounds)


def judged(record, name, known):
    return tune(record, name, known, kind=Process.FOPDT, rules=RULES[:1])


async def test_the_plc_s_gains_are_one_proposal_among_others_and_the_loop_is_as_before(tmp_path):
    world = bench(tmp_path)
    before = world.holds(*HELD)
    session = Session(world.station, world.loop, world.link, world.clock, world.folder, WIDE)
    live = await session.excited(Wanted(Kind.AUTOTUNE), judged)
    assert before == world.holds(*HELD)
    own = live.result.found[0]
    assert (NAME, "SIMC PI") == (own.name, live.result.found[1].name)
    # The limit-cycle formulas give far too much gain for dead time: robust is up to 1.7.
    assert own.margins.ms > 1.7
    assert "SIMC PI" == live.result.chosen.name
    said = next(each for each in live.result.findings if each.name == "plc-tuning")
    assert Weight.WARNING is said.weight
    assert "Kc_Kp 1 to " in said.text
    assert NAME == as_json(live.result)["proposals"][0]["rule"]
    assert NAME in page(live.result)


async def test_the_plc_s_gains_can_be_tried_like_any_other_and_what_it_wrote_is_what_is_tried(tmp_path):
    wide = {name: WriteLimit(0.0, 50.0, 50.0, 0.0) for name in ("Kc_Kp", "Ti_Ki", "Td_Kd", "Tf")}
    world = bench(tmp_path, LISTED | wide)
    session = Session(world.station, world.loop, world.link, world.clock, world.folder, Envelope((40, 120), (0, 100)))
    live = await session.excited(Wanted(Kind.AUTOTUNE), judged, 1, Gains(NAME, 2.0, 15.0))
    assert live.proof is not None
    assert NAME == live.proof.rule
    assert ("Kc_Kp D108: 1.0 -> ") == live.proof.lines[0][:19]


async def test_mv_is_held_within_the_envelope_by_the_plc_s_own_limits(tmp_path):
    world = bench(tmp_path)
    record, _ = await experiment(world).run(Wanted(Kind.AUTOTUNE))
    assert (20.0, 60.0) == (float(record.mv.min()), float(record.mv.max()))
    # MV_MAX and MV_MIN first, then PID_MODE; then gains and limits back.
    assert [(118, 4), (104, 2)] == [(address, len(words)) for _, address, words in world.sent()[:2]]


async def test_limits_that_may_not_be_written_keep_the_plc_from_tuning(tmp_path):
    writes = {name: limit for name, limit in LISTED.items() if name not in ("MV_MAX", "MV_MIN")}
    world = bench(tmp_path, writes)
    with pytest.raises(StateError, match="MV_MAX is not on the list of what may be written"):
        await experiment(world).run(Wanted(Kind.AUTOTUNE))
    assert [] == world.sent()


async def test_pv_beyond_its_bounds_ends_it(tmp_path):
    world = bench(tmp_path)
    before = world.holds(*HELD)
    with pytest.raises(StateError, match=r"PV is \d+\.\d+, outside the envelope 79…81; aborted"):
        await experiment(world, bounds=Envelope((79.0, 81.0), (20.0, 60.0))).run(Wanted(Kind.AUTOTUNE))
    assert before == world.holds(*HELD)


async def test_a_tuning_that_never_ends_ends_with_its_time(tmp_path):
    """Within a dead band of 1000 the fake's relay never turns."""
    world = bench(tmp_path, ERR_DBW=1000.0)
    before = world.holds(*HELD)
    with pytest.raises(StateError, match="the time for which it was armed is over"):
        await experiment(world, bounds=Envelope((-1000.0, 1000.0), (20.0, 60.0), time_s=60.0)).run(
            Wanted(Kind.AUTOTUNE)
        )
    assert before == world.holds(*HELD)


@pytest.mark.parametrize(("place", "number"), [("before", 2), ("behind", 2), ("behind", 1)])
async def test_the_next_start_puts_back_what_a_killed_supervision_left(tmp_path, place, number):
    """Killed around the write of PID_MODE; the PLC goes on, ends, and writes its gains with nobody watching."""
    world = bench(tmp_path)
    before = world.holds(*HELD)
    seen = []

    def at(where, request):
        if seen and seen[-1] == "dead":
            raise Cut
        if is_write(request) and where == place:
            seen.append(request)
            if len(seen) == number:
                seen.append("dead")
                raise Cut

    with pytest.raises(Cut):
        await experiment(world, FailingLink(world.link, at)).run(Wanted(Kind.AUTOTUNE))
    world.clock.advance_ns(60_000_000_000)
    world.plc.answer(Read(1, Table.HOLDING, 100, 1))
    restored = await world.gate().recover()
    assert restored.is_clean
    assert before == world.holds(*HELD)


async def test_gains_that_a_person_changed_behind_the_tuning_are_left_alone(tmp_path):
    world = bench(tmp_path)
    made = experiment(world)
    tuned = made.gate.tuned

    def meddle(picture):
        tuned(picture)
        world.plc.write("L1", "Kc_Kp", 7.0)

    made.gate.tuned = meddle
    with pytest.raises(StateError, match="Kc_Kp"):
        await made.run(Wanted(Kind.AUTOTUNE))
    assert 7.0 == float(world.plc.read("L1", "Kc_Kp"))


def test_pid_mode_goes_back_before_the_gains_wherever_it_stands():
    """A tuner that still runs would write its gains behind ours."""
    roles = CONTROLLERS["DPIDE"].roles
    found = {"Kc_Kp": (0, 1), "PID_MODE": (0, 0), "PID_MAN": (0,), "MOUT": (0, 0), "MOUT_AUTO": (0,), "PID_RUN": (1,)}
    session = State("L1", found)
    session.intend("PID_MODE", (0, 0), (1, 0))
    decision = decide(session, roles, found | {"Kc_Kp": (7, 7), "PID_MODE": (1, 0)})
    assert [{"PID_MODE": (0, 0)}, {"Kc_Kp": (0, 1)}] == [dict(stage) for stage in decision.stages]
    assert () == decision.conflicts
