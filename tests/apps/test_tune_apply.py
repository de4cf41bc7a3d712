"""Gains applied to a loop of the fake PLC in virtual time: kept when proven, else put back; or by command."""

from __future__ import annotations

import numpy as np
import pytest
from lockstep.gate.gate_world import WRITES, GateWorld
from tuning_data import answered

from ahgateway.apps.tune import tune
from ahgateway.apps.tune_apply import Trial, as_json, as_text
from ahgateway.apps.tune_sitting import Envelope
from ahgateway.codec.access import Read, Table
from ahgateway.codec.station import PlantSpec, WriteLimit
from ahgateway.core.real import REAL, bits
from ahgateway.errors import ProfileError, StateError
from ahgateway.lockstep.picture import Sampler
from ahgateway.tuning.models import Kind, Model
from ahgateway.tuning.record import Record
from ahgateway.tuning.rules import RULES

PLANT = PlantSpec("fopdt", 1.5, 6.0, 1.0, 20.0, 0.02, 80.0)
INITIAL = {
    "SV": 80.0, "CYCLE": 200, "Kc_Kp": 1.0, "Ti_Ki": 0.15, "Td_Kd": 0.0, "MV_MAX": 100.0, "MV_MIN": 0.0,
}  # fmt: skip
HELD = ("SV", "Kc_Kp", "Ti_Ki", "Td_Kd", "Tf", "PID_MAN")
LISTED = WRITES | {"Ti_Ki": WriteLimit(0.0, 2.0, 1.0, 0.0)}
WIDE = Envelope((60.0, 100.0), (5.0, 95.0), time_s=600.0)


def tuned(gain=1.5, **changes):
    """A tuning from a doublet of a process with this gain; the loop's is 1.5, its lag 6 s, its dead time 1 s."""
    mv = np.full(400, 40.0)
    mv[50:150] += 5.0
    mv[150:250] -= 5.0
    record = answered(Model(Kind.FOPDT, gain, 1.0, 6.0), mv, ts_s=0.2, noise=0.02)
    settings = {name: value for name, value in INITIAL.items() if name != "SV"} | {"PID_DIR": True, **changes}
    return tune(Record(record.t_s, record.sv, record.pv, record.mv), "DPIDE", settings, rules=RULES[:2])


def bench(folder, envelope=WIDE, plant=PLANT, writes=LISTED, **initial):
    world = GateWorld(folder, INITIAL | initial, plant=plant, scan_ms=20, writes=writes)
    world.clock.advance_ns(120_000_000_000)
    world.plc.answer(Read(1, Table.HOLDING, 100, 1))
    world.plc.writes.clear()
    sampler = Sampler(world.loop, world.station, world.link, world.clock)
    return world, Trial(world.loop, world.gate(), sampler, world.clock, envelope)


async def test_gains_that_do_what_was_predicted_stay_and_are_put_back_by_command(tmp_path):
    world, trial = bench(tmp_path)
    before, result = world.holds(*HELD), tuned()
    found = await trial.apply(result, "SIMC PI", 4.0, 25.0)
    assert (True, "SIMC PI", 4.0) == (found.is_kept, found.rule, found.step)
    assert found.fit_percent > 90.0
    gains = result.found[0].settings
    assert [bits(REAL(gains[name])) for name in ("Kc_Kp", "Ti_Ki")] == world.holds("Kc_Kp", "Ti_Ki")
    assert bits(REAL(80.0)) == world.holds("SV")[0]
    assert found.lines[0].startswith("Kc_Kp D")
    restored = await world.gate().recover("rolled back")
    assert (True, ("Kc_Kp", "Ti_Ki")) == (restored.is_clean, restored.operands)
    assert before == world.holds(*HELD)


async def test_the_gains_leave_in_one_request(tmp_path):
    world, trial = bench(tmp_path)
    await trial.apply(tuned(), "recommended", 4.0, 5.0)
    first = world.sent()[0]
    assert 4 == len(first[2])


async def test_gains_from_a_wrong_model_are_put_back_by_themselves(tmp_path):
    """The process is taken for three times as strong as it is, so that PV stays behind its prediction."""
    world, trial = bench(tmp_path)
    before = world.holds(*HELD)
    found = await trial.apply(tuned(gain=4.5), "SIMC PI", 4.0, 25.0)
    assert not found.is_kept
    assert "predicted was" in found.reason
    assert before == world.holds(*HELD)
    assert (False, found.reason) == (as_json(found)["kept"], as_json(found)["reason"])
    assert "put back" in as_text(found)
    assert found.pv.size == found.predicted_pv.size > 10


async def test_leaving_the_bounds_puts_back(tmp_path):
    world, trial = bench(tmp_path, Envelope((79.0, 84.2), (5.0, 95.0)))
    before = world.holds(*HELD)
    trial._check_ahead = lambda *given: None
    found = await trial.apply(tuned(), "SIMC PI", 4.5, 25.0)
    assert "outside the envelope 79…84.2" in found.reason
    assert before == world.holds(*HELD)


async def test_a_step_that_is_predicted_to_leave_the_envelope_is_refused_before_anything_is_written(tmp_path):
    world, trial = bench(tmp_path, Envelope((79.0, 82.0), (5.0, 95.0)))
    with pytest.raises(StateError, match=r"PV would be 82\.\d*, outside the envelope 79…82; nothing was written"):
        await trial.apply(tuned(), "SIMC PI", 4.0, 25.0)
    with pytest.raises(StateError, match=r"SV must stand 400 s on each side, the whole may take 600 s"):
        await trial.apply(tuned(), "SIMC PI", 1.0, 400.0)
    assert [] == world.sent()


async def test_what_the_proposal_does_not_fit_is_refused(tmp_path):
    world, trial = bench(tmp_path)
    with pytest.raises(StateError, match="CYCLE is 200, taken was 100") as caught:
        await trial.apply(tuned(CYCLE=100), "SIMC PI")
    assert "--set CYCLE=200" == caught.value.hint
    with pytest.raises(ProfileError, match="`SIMC PIX` has no proposal here, there are SIMC PI") as caught:
        await trial.apply(tuned(), "SIMC PIX")
    assert "did you mean `SIMC PI`?" == caught.value.hint
    assert [] == world.sent()


async def test_a_loop_in_manual_and_a_wrong_direction_are_refused(tmp_path):
    anywhere = Envelope((0.0, 100.0), (-5.0, 105.0))
    world, trial = bench(tmp_path, anywhere, PID_MAN=True)
    with pytest.raises(StateError, match="not in automatic"):
        await trial.apply(tuned(), "SIMC PI")
    world, trial = bench(tmp_path / "other", anywhere, PID_DIR=False)
    with pytest.raises(StateError, match="PID_DIR is FALSE, which does not fit the process"):
        await trial.apply(tuned(PID_DIR=False), "SIMC PI")
    assert [] == world.sent()


async def test_a_dry_run_names_old_new_and_words_and_writes_nothing(tmp_path):
    world, trial = bench(tmp_path)
    result = tuned()
    plan = await trial.dry_run(result, result.found[0])
    assert plan.lines[0].startswith("Kc_Kp D")
    assert ": 1.0 -> " in plan.lines[0]
    assert "[0000 3F80 -> " in plan.lines[0]
    assert (1, []) == (len(plan.steps), world.sent())
