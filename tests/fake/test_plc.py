"""The PLC as a whole: the order of a scan, modes, answers, and how it misbehaves."""

from __future__ import annotations

import numpy as np
import pytest

from ahgateway.clock import MILLISECOND, VirtualClock
from ahgateway.codec.access import Read, Table, Write
from ahgateway.codec.devices import parse_device
from ahgateway.codec.station import FakeLoop, PlantSpec, Station
from ahgateway.errors import CodecError, PlcRefusedError, ProfileError, StateError
from ahgateway.fake.plc import FakePlc, Written

REAL = np.float32
LOOP = "LIC-201"
STILL = FakeLoop({"SV": 10.0, "PV": 8.0, "CYCLE": 1, "Kp": 2.0})
RAMP = FakeLoop({"SV": 10.0, "CYCLE": 1, "Kp": 1.0}, PlantSpec("integrating", gain=1.0, initial=2.0))


def test_a_scan_is_inputs_then_program_then_outputs(make_plc):
    plc = make_plc(setups={LOOP: RAMP}, scan_ns=1_000_000_000)
    plc.scan()
    # The actuator stood at 0 during the first scan: PV is still 2, MV becomes 8, and acts in the second: PV 10, MV 0.
    assert (plc.read(LOOP, "PV"), plc.read(LOOP, "MV")) == (REAL(2), REAL(8))
    plc.scan()
    assert (plc.read(LOOP, "PV"), plc.read(LOOP, "MV")) == (REAL(10), REAL(0))


@pytest.mark.parametrize("setups", [None, {LOOP: FakeLoop()}])
def test_a_loop_without_a_setup_runs_on_defaults_and_a_plant(make_plc, setups):
    plc = make_plc(setups=setups)
    plc.write(LOOP, "SV", 30.0)
    plc.advance(60_000 * MILLISECOND)
    # Kp 1, Ki 0, plant gain 1: PV settles at 15.
    assert plc.read(LOOP, "PV") == pytest.approx(15.0, abs=0.1)


def test_a_process_without_plant_leaves_pv_to_others(make_plc):
    plc = make_plc(setups={LOOP: STILL})
    plc.advance(1000 * MILLISECOND)
    assert plc.read(LOOP, "PV") == REAL(8)


def test_noise_comes_from_the_seed(make_plc):
    noisy = {LOOP: FakeLoop({}, PlantSpec("fopdt", 1.0, tau_s=1.0, noise=0.5))}

    def pvs(seed):
        plc = make_plc(setups=noisy, seed=seed)
        found = []
        for _ in range(20):
            plc.scan()
            found.append(float(plc.read(LOOP, "PV")))
        return found

    assert pvs(1) == pvs(1)
    assert pvs(1) != pvs(2)


def test_an_integrating_process_overflows_at_the_end_of_the_pv_range(make_plc, make_dpid):
    plc = make_plc([make_dpid(pv_range=(0.0, 5.0))], {LOOP: RAMP})
    plc.advance(5000 * MILLISECOND)
    assert plc.read(LOOP, "PV") == REAL(5)


def test_advance_runs_the_scans_that_fit_and_keeps_the_rest(make_plc):
    plc = make_plc(scan_ns=10 * MILLISECOND)
    plc.advance(35 * MILLISECOND)
    assert (plc.scans, plc.now_ns) == (3, 30 * MILLISECOND)
    plc.advance(5 * MILLISECOND)
    assert (plc.scans, plc.now_ns) == (4, 40 * MILLISECOND)


def test_in_stop_the_program_stands_and_the_outputs_are_off(make_plc):
    plc = make_plc(setups={LOOP: RAMP}, scan_ns=1_000_000_000)
    plc.scan()
    plc.stop()
    plc.scan()
    assert (plc.executed(LOOP), plc.read(LOOP, "PV"), plc.read(LOOP, "MV")) == (1, REAL(2), REAL(8))
    plc.run()
    plc.scan()
    # Nothing flowed while stopped, and MV = 8 had not acted yet.
    assert (plc.executed(LOOP), plc.read(LOOP, "PV")) == (2, REAL(2))


def test_the_mode_flags_tell_run_stop_and_the_first_scan(make_plc):
    plc = make_plc()

    def flags():
        return plc.answer(Read(1, Table.COIL, 0x4000 + 400, 4))

    assert flags() == (1, 0, 1, 0)
    plc.scan()
    assert flags() == (1, 0, 0, 1)
    plc.stop()
    assert flags() == (0, 0, 0, 0)
    plc.run()
    assert flags() == (1, 0, 1, 0)


def test_the_running_device_of_the_station_follows_the_mode(make_plc, make_dpid, small_map):
    station = Station("Small", "memory://", 1, small_map, (make_dpid(),), running=parse_device("M90"))
    plc = FakePlc(station)
    assert plc.answer(Read(1, Table.COIL, 90, 1)) == (1,)
    plc.stop()
    assert plc.answer(Read(1, Table.COIL, 90, 1)) == (0,)


def test_a_restart_with_retained_operands_loses_only_the_hidden_state(make_plc):
    plc = make_plc(setups={LOOP: FakeLoop({"SV": 10.0, "PV": 8.0, "Kp": 0.0, "Ki": 1.0, "CYCLE": 1})})
    plc.advance(100 * MILLISECOND)
    held = plc.read(LOOP, "MV")
    assert plc.log(LOOP)[-1].before.valid
    plc.restart(is_retained=True)
    assert (plc.read(LOOP, "MV"), plc.executed(LOOP)) == (held, 0)
    plc.scan()
    assert not plc.log(LOOP)[-1].before.valid
    assert plc.log(LOOP)[-1].before.i == held


def test_a_restart_with_lost_operands_comes_back_with_zeros(make_plc):
    plc = make_plc(setups={LOOP: STILL})
    plc.advance(100 * MILLISECOND)
    plc.restart(is_retained=False)
    assert plc.answer(Read(1, Table.HOLDING, 100, 110)) == (0,) * 110
    assert plc.answer(Read(1, Table.COIL, 0x4000 + 400, 1)) == (1,)


def test_another_station_is_silent(make_plc):
    assert make_plc().answer(Read(2, Table.HOLDING, 0, 1)) is None


def test_a_busy_plc_refuses_with_code_6_and_then_answers(make_plc):
    plc = make_plc()
    plc.busy = 2
    for _ in range(2):
        with pytest.raises(PlcRefusedError) as refused:
            plc.answer(Read(1, Table.HOLDING, 0, 1))
        assert refused.value.code == 6
    assert plc.answer(Read(1, Table.HOLDING, 0, 1)) == (0,)


def test_a_refused_range_refuses_what_touches_it_as_often_as_asked(make_plc):
    plc = make_plc()
    plc.refuse(Table.HOLDING, 10, 12, 4, count=2)
    assert plc.answer(Read(1, Table.HOLDING, 13, 1)) == (0,)
    assert plc.answer(Read(1, Table.HOLDING, 8, 2)) == (0, 0)
    for request in (Read(1, Table.HOLDING, 8, 3), Write(1, Table.HOLDING, 12, (1,))):
        with pytest.raises(PlcRefusedError) as refused:
            plc.answer(request)
        assert refused.value.code == 4
    assert plc.answer(Read(1, Table.HOLDING, 12, 1)) == (0,)


def test_more_words_than_the_plc_takes_is_code_3(make_plc):
    plc = make_plc(words_max=64)
    assert len(plc.answer(Read(1, Table.HOLDING, 0, 64))) == 64
    with pytest.raises(PlcRefusedError) as refused:
        plc.answer(Read(1, Table.HOLDING, 0, 65))
    assert refused.value.code == 3


def test_writes_are_logged_with_who_wrote_what_where_and_when(make_plc):
    plc = make_plc(setups={LOOP: STILL})
    plc.advance(10 * MILLISECOND)
    plc.answer(Write(1, Table.HOLDING, 100, (0, 0x4120)))
    plc.write(LOOP, "PID_MAN", True, who="another master")
    plc.write(LOOP, "Kp", 1.0)
    assert list(plc.writes) == [
        Written(10_000_000, "link", Table.HOLDING, 100, (0, 0x4120)),
        Written(10_000_000, "another master", Table.COIL, 2, (1,)),
        Written(10_000_000, "program", Table.HOLDING, 108, (0, 0x3F80)),
    ]


def test_a_refused_write_is_not_logged(make_plc):
    plc = make_plc()
    with pytest.raises(PlcRefusedError):
        plc.answer(Write(1, Table.HOLDING, 5000, (1,)))
    assert not plc.writes


def test_a_slow_scan_delays_one_execution_and_the_schedule_stays(make_plc):
    plc = make_plc(setups={LOOP: FakeLoop({"CYCLE": 2})})
    plc.advance(10 * MILLISECOND)
    plc.slow_down(30 * MILLISECOND, 1)
    plc.advance(60 * MILLISECOND)
    assert [execution.time_ns // MILLISECOND for execution in plc.log(LOOP)] == [5, 40, 45, 65]
    assert plc.now_ns == 70 * MILLISECOND


def test_a_missed_execution_leaves_the_schedule_as_it_was(make_plc):
    plc = make_plc(setups={LOOP: FakeLoop({"CYCLE": 2})})
    plc.scan()
    plc.miss(LOOP)
    plc.advance(60 * MILLISECOND)
    assert [execution.time_ns // MILLISECOND for execution in plc.log(LOOP)] == [5, 45, 65]


def test_a_frozen_pv_stands_still_while_the_process_goes_on(make_plc):
    plc = make_plc(setups={LOOP: RAMP})
    plc.scan()
    plc.freeze_pv(LOOP)
    plc.advance(1000 * MILLISECOND)
    assert plc.read(LOOP, "PV") == REAL(2)
    plc.freeze_pv(LOOP, False)
    plc.scan()
    assert plc.read(LOOP, "PV") > REAL(5)


def test_a_script_acts_in_the_scan_that_reaches_its_time(make_plc):
    plc = make_plc(setups={LOOP: STILL}, scan_ns=10 * MILLISECOND)
    plc.at(25 * MILLISECOND, lambda plc: plc.write(LOOP, "SV", 20.0))
    plc.advance(20 * MILLISECOND)
    assert plc.read(LOOP, "SV") == REAL(10)
    plc.advance(10 * MILLISECOND)
    assert plc.log(LOOP)[-1].inputs.sv == REAL(20)


def test_with_a_clock_the_plc_catches_up_before_it_answers(make_plc):
    clock = VirtualClock(start_ns=77)
    plc = make_plc(setups={LOOP: STILL}, clock=clock)
    clock.advance_ns(52 * MILLISECOND)
    plc.answer(Read(1, Table.HOLDING, 0, 1))
    assert plc.now_ns == 50 * MILLISECOND
    clock.advance_ns(3 * MILLISECOND)
    plc.answer(Read(1, Table.HOLDING, 0, 1))
    assert plc.now_ns == 55 * MILLISECOND


def test_mv_that_is_no_number_leaves_the_actuator_where_it_is(make_plc):
    plc = make_plc(setups={LOOP: FakeLoop({"PID_RUN": True}, PlantSpec("integrating", 1.0))})
    plc.write(LOOP, "MV", float("nan"))
    plc.write(LOOP, "PV", float("nan"))
    plc.freeze_pv(LOOP)
    plc.advance(50 * MILLISECOND)
    assert plc.processes[LOOP].rig.asked == 0.0


def test_wrong_names_are_refused_with_the_nearest_one(make_plc):
    plc = make_plc()
    with pytest.raises(StateError, match="no loop `LIC-202`") as refused:
        plc.read("LIC-202", "SV")
    assert refused.value.hint == "did you mean `LIC-201`?"
    with pytest.raises(StateError, match="no operand `Kq`"):
        plc.read(LOOP, "Kq")
    with pytest.raises(StateError, match="no loop `nobody`"):
        make_plc(setups={"nobody": STILL})
    with pytest.raises(CodecError):
        plc.write(LOOP, "CYCLE", 1.5)


@pytest.mark.parametrize("plant", [PlantSpec("fopdt", 1.0, tau_s=0.0), PlantSpec("vessel", 1.0)])
def test_a_process_that_cannot_be_names_its_key(make_plc, plant):
    with pytest.raises(ProfileError, match=r"loops\.LIC-201\.fake\.plant"):
        make_plc(setups={LOOP: FakeLoop({}, plant)})


def test_two_loops_share_a_device_and_see_the_same_value(make_plc, make_dpid, make_dpide):
    second = make_dpide()
    shared = {**second.bindings, "PID_RUN": parse_device("M1")}
    plc = make_plc([make_dpid(), type(second)("TIC-101", second.controller, shared)])
    plc.write("TIC-101", "PID_RUN", False)
    assert plc.read(LOOP, "PID_RUN") is False


@pytest.mark.slow
def test_a_hundred_thousand_executions_lose_none(make_plc, make_dpid):
    plc = make_plc([make_dpid()], {LOOP: RAMP}, scan_ns=10 * MILLISECOND, log_max=10)
    plc.advance(1_000_000 * MILLISECOND)
    assert plc.executed(LOOP) == 100_000
