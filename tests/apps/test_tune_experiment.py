"""Experiments on the fake PLC in virtual time: what is moved, what is put back, and when it is aborted."""

from __future__ import annotations

import math

import pytest
from lockstep.gate.gate_world import WRITES, GateWorld

from ahgateway.apps.tune_experiment import Envelope, Experiment, Kind, Wanted
from ahgateway.codec.access import Read, Table
from ahgateway.codec.station import PlantSpec, WriteLimit
from ahgateway.errors import StateError
from ahgateway.lockstep.picture import Sampler
from ahgateway.tuning.identify import identify
from ahgateway.tuning.models import Kind as Process

PLANT = PlantSpec("fopdt", 1.5, 6.0, 1.0, 20.0, 0.02, 80.0)
INITIAL = {
    "SV": 80.0, "CYCLE": 200, "Kc_Kp": 1.0, "Ti_Ki": 0.15, "Td_Kd": 0.0, "MV_MAX": 100.0, "MV_MIN": 0.0,
}  # fmt: skip
PACED = WRITES | {"MOUT": WriteLimit(0.0, 100.0, 5.0, 1.0)}
WIDE = Envelope((40.0, 120.0), (10.0, 90.0), time_s=600.0)


def bench(folder, envelope=WIDE, plant=PLANT, link=None):
    world = GateWorld(folder, INITIAL, plant=plant, scan_ms=20, writes=PACED)
    world.clock.advance_ns(120_000_000_000)
    world.plc.answer(Read(1, Table.HOLDING, 100, 1))
    world.plc.writes.clear()
    line = link(world) if link else world.link
    sampler = Sampler(world.loop, world.station, line, world.clock)
    return world, Experiment(world.loop, world.gate(line), sampler, world.clock, envelope)


@pytest.mark.parametrize("kind", [Kind.STEP, Kind.DOUBLET, Kind.RELAY, Kind.SV])
async def test_an_experiment_finds_the_process_and_leaves_the_loop_as_it_was(tmp_path, kind):
    world, experiment = bench(tmp_path)
    before = world.holds("PID_MAN", "SV", "Kc_Kp")
    record, settings = await experiment.run(Wanted(kind, 2.5 if kind is not Kind.SV else 4.0))
    assert before == world.holds("PID_MAN", "SV", "Kc_Kp")
    assert 200 == settings["CYCLE"]
    found = identify(record)
    assert not found.is_refused
    model = found.fit.model
    if kind is Kind.RELAY:
        # A relay swings so fast that the lag looks like an integrator: its slope is K/τ = 0.25.
        assert 0.25 == pytest.approx(model.gain if model.kind is Process.IPDT else model.gain / model.tau_s, rel=0.1)
        return
    assert 1.5 == pytest.approx(model.gain, rel=0.1)
    assert 6.0 == pytest.approx(model.tau_s, rel=0.15)


async def test_leaving_the_envelope_aborts_and_puts_back(tmp_path):
    world, experiment = bench(tmp_path, Envelope((78.0, 82.0), (10.0, 90.0)))
    with pytest.raises(StateError, match=r"PV is 82\.\d+, outside the envelope 78…82; aborted"):
        await experiment.run(Wanted(Kind.STEP, 4.0, hold_s=60.0))
    assert [False] == world.holds("PID_MAN")


async def test_a_stop_at_any_moment_leaves_nothing_changed(tmp_path):
    for moment in (5, 45, 90):
        world, experiment = bench(tmp_path / str(moment))

        def told(experiment=experiment, moment=moment):
            if len(experiment.rows) >= moment:
                experiment.stop.set()

        original = experiment._judge
        experiment._judge = lambda told=told, original=original: (original(), told())
        before = world.holds("PID_MAN", "SV")
        with pytest.raises(StateError, match="stopped"):
            await experiment.run(Wanted(Kind.DOUBLET, 2.0, hold_s=8.0))
        assert before == world.holds("PID_MAN", "SV")


async def test_somebody_else_who_writes_ends_it(tmp_path):
    world, experiment = bench(tmp_path)
    original = experiment._judge

    def meddle():
        original()
        if len(experiment.rows) == 60:
            world.plc.write("L1", "MOUT", 33.0)

    experiment._judge = meddle
    with pytest.raises(StateError, match="MOUT"):
        await experiment.run(Wanted(Kind.STEP, 2.0, hold_s=20.0))


async def test_a_loop_that_is_not_at_rest_is_refused_and_nothing_is_written(tmp_path):
    world, experiment = bench(tmp_path)
    world.plc.write("L1", "SV", 95.0)
    world.clock.advance_ns(1_500_000_000)
    with pytest.raises(StateError, match="PV is not at rest"):
        await experiment.run(Wanted(Kind.STEP))
    assert [] == world.sent()


def test_without_a_size_the_profile_and_the_envelope_give_one(tmp_path):
    _, experiment = bench(tmp_path)
    assert 4.0 == experiment._sized(Kind.STEP, 0.02, 0.0)
    assert 2.5 == experiment._sized(Kind.RELAY, 0.02, 0.0)
    assert 4.0 == experiment._sized(Kind.SV, 0.02, 0.0)
    assert math.isfinite(experiment._sized(Kind.DOUBLET, 0.0, 0.0))
