"""Experiments on the fake PLC in virtual time: what is moved, what is put back, and when it is aborted."""

from __future__ import annotations

import pytest
from lockstep.gate.gate_world import WRITES, GateWorld

from ahgateway.apps.tune_experiment import Experiment, Kind, Wanted
from ahgateway.apps.tune_sitting import Envelope
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


def world_with(folder, plant, **changes):
    initial = INITIAL | changes.pop("initial_more", {})
    world = GateWorld(folder, initial, plant=plant, scan_ms=10, **{"writes": WRITES, **changes})
    world.clock.advance_ns(120_000_000_000)
    world.plc.answer(Read(1, Table.HOLDING, 100, 1))
    world.plc.writes.clear()
    said = []
    sampler = Sampler(world.loop, world.station, world.link, world.clock)
    return world, Experiment(world.loop, world.gate(), sampler, world.clock, WIDE, told=said.append), said


@pytest.mark.parametrize("kind", [Kind.STEP, Kind.DOUBLET, Kind.RELAY, Kind.SV])
async def test_a_dead_time_of_two_cycles_comes_out_within_its_stated_interval(tmp_path, kind):
    """0.4 s beside a CYCLE and a polling interval of 0.2 s: when MV moved is part of the interval."""
    _, experiment, _ = world_with(tmp_path, PlantSpec("fopdt", 1.5, 6.0, 0.4, 20.0, 0.02, 80.0))
    record, _ = await experiment.run(Wanted(kind, 4.0 if kind is Kind.SV else None))
    fit = identify(record, Process.FOPDT).fit
    assert 0.4 == pytest.approx(fit.model.dead_time_s, abs=fit.interval["dead_time_s"])
    assert fit.interval["dead_time_s"] < 0.15


async def test_a_slow_line_widens_the_interval_and_blames_no_valve(tmp_path):
    """30 ms for each exchange, five of them a picture: moves of MV are known to a third of a second."""
    world, experiment, _ = world_with(
        tmp_path, PlantSpec("fopdt", 1.5, 6.0, 0.4, 20.0, 0.02, 80.0), latency_ns=30_000_000
    )
    record, _ = await experiment.run(Wanted(Kind.DOUBLET, 2.5))
    found = identify(record, Process.FOPDT)
    assert 0.4 == pytest.approx(found.fit.model.dead_time_s, abs=found.fit.interval["dead_time_s"])
    assert not found.is_refused
    assert [False] == world.holds("PID_MAN")


async def test_a_step_grows_until_pv_answers_twenty_times_its_noise(tmp_path):
    """Gain 1.5, noise 0.1: the answer of 2 that is aimed at needs a step of 1.33, and 0.8 was tried first."""
    _, experiment, said = world_with(tmp_path, PlantSpec("fopdt", 1.5, 6.0, 1.0, 20.0, 0.1, 80.0))
    record, _ = await experiment.run(Wanted(Kind.STEP))
    assert said[1].startswith("PV answers 0.8 of MOUT by ")
    assert 1.0 < float(record.mv.max() - record.mv[-1]) < 2.0
    assert 14.0 < identify(record, Process.FOPDT).fit.snr < 30.0


async def test_a_resolution_counts_like_noise(tmp_path):
    """PV in steps of 0.2 with noise of 0.06: 20 steps, an answer of 4, are a step of 2.7."""
    _, experiment, said = world_with(tmp_path, PlantSpec("fopdt", 1.5, 6.0, 1.0, 20.0, 0.06, 80.0, resolution=0.2))
    record, _ = await experiment.run(Wanted(Kind.STEP))
    assert "resolution 0.2:" in said[0]
    assert 2.0 < float(record.mv.max() - record.mv[-1]) < 4.5


async def test_noise_that_no_allowed_step_overcomes_is_refused_with_the_ratio(tmp_path):
    world, experiment, _ = world_with(tmp_path, PlantSpec("fopdt", 0.05, 6.0, 1.0, 78.0, 0.3, 80.0))
    before = world.holds("PID_MAN", "SV")
    with pytest.raises(StateError, match=r"times its noise of 0\.3\d*, at least 5 is needed; everything") as caught:
        await experiment.run(Wanted(Kind.DOUBLET))
    assert "whether the valve moves" in caught.value.hint
    assert before == world.holds("PID_MAN", "SV")


async def test_bounds_too_near_for_the_noise_are_refused_before_anything_is_written(tmp_path):
    world, experiment, _ = world_with(tmp_path, PlantSpec("fopdt", 1.5, 6.0, 1.0, 20.0, 0.3, 80.0))
    experiment.envelope = Envelope((78.0, 82.0), (10.0, 90.0))
    with pytest.raises(StateError, match=r"PV may answer by 0\.9\d*, half of its room.*nothing was written"):
        await experiment.run(Wanted(Kind.STEP))
    assert [] == world.sent()


async def test_a_biased_relay_swings_more_to_one_side(tmp_path):
    _, experiment, _ = world_with(tmp_path, PlantSpec("fopdt", 1.5, 6.0, 1.0, 20.0, 0.02, 80.0))
    record, _ = await experiment.run(Wanted(Kind.RELAY, 2.0, hysteresis=0.5, bias=0.5))
    base = float(record.mv[:30].mean())
    assert (3.0, -1.0) == pytest.approx((float(record.mv.max()) - base, float(record.mv.min()) - base), abs=0.1)
    assert 0.5 < float(record.pv[:30].mean() - record.pv.min()) < 1.2


async def test_a_stuck_valve_is_refused_with_what_its_answer_was(tmp_path):
    """PV stands by itself and does not care for MV: even 40, the largest allowed, would not do."""
    writes = WRITES | {"MOUT": WriteLimit(0.0, 100.0, 100.0, 0.0)}
    world, experiment, _ = world_with(
        tmp_path, PlantSpec("fopdt", 1e-6, 6.0, 1.0, 80.0, 0.05, 80.0), writes=writes, initial_more={"BIAS": 40.0}
    )
    before = world.holds("PID_MAN", "SV", "MOUT")
    with pytest.raises(StateError, match=r"PV answers a step of .* in MV by 0\.0\d*.*at least 5 is needed") as caught:
        await experiment.run(Wanted(Kind.STEP))
    assert "whether the valve moves" in caught.value.hint
    assert before[:2] == world.holds("PID_MAN", "SV")


async def test_an_mv_at_its_limit_leaves_no_room_and_is_refused(tmp_path):
    """SV 80 needs MV 40, and MV_MAX is 40: a doublet has nowhere to go."""
    world, experiment, _ = world_with(
        tmp_path, PlantSpec("fopdt", 1.5, 6.0, 1.0, 20.0, 0.0, 80.0), initial_more={"MV_MAX": 40.0}
    )
    with pytest.raises(StateError, match="MV stands at 40 and may go from 10 to 40: saturated, there is no room"):
        await experiment.run(Wanted(Kind.DOUBLET))
    assert [False] == world.holds("PID_MAN")


async def test_an_integrating_process_never_settles_and_ends_in_time_all_the_same(tmp_path):
    """Each of three legs takes a quarter of the time at most; PV comes back to where it was."""
    world, experiment, _ = world_with(
        tmp_path, PlantSpec("integrating", 0.05, 0.0, 1.0, -2.0, 0.02, 80.0), initial_more={"Kc_Kp": 3.0, "Ti_Ki": 0.1}
    )
    world.clock.advance_ns(120_000_000_000)
    world.plc.answer(Read(1, Table.HOLDING, 100, 1))
    experiment.envelope = Envelope((40.0, 120.0), (10.0, 90.0), time_s=90.0)
    record, _ = await experiment.run(Wanted(Kind.DOUBLET))
    assert record.t_s[-1] < 110.0
    assert [False] == world.holds("PID_MAN")
    found = identify(record)
    assert Process.IPDT is found.fit.model.kind
    assert 0.05 == pytest.approx(found.fit.model.gain, rel=0.05)
    assert abs(float(record.pv[-1] - record.pv[0])) < 2.0
