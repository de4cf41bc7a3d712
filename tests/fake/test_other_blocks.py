"""The three other blocks as items of the fake PLC: their shipped examples run, and drive what hangs on them."""

from __future__ import annotations

import pytest

from ahgateway.clock import MILLISECOND, SECOND
from ahgateway.core.controllers import CONTROLLERS
from ahgateway.errors import StateError
from ahgateway.fake.faults import fault
from ahgateway.fake.plc import FakePlc
from ahgateway.schema import profile


def plc_of(name: str) -> FakePlc:
    loaded = profile.load(name)
    return FakePlc(loaded.station(), loaded.fake_setup(), seed=2, scan_ns=20 * MILLISECOND)


def test_pid_temp_heats_its_zone_to_the_setpoint_by_pulses() -> None:
    plc = plc_of("pid_temp")
    plc.advance(300 * SECOND)
    assert abs(plc.processes["TIC-401"].pv - 180.0) < 3.0
    shares = [entry.terms.outputheat_pwm for entry in plc.log("TIC-401")[-1000:]]
    assert 0 < sum(shares) < 1000


def test_pid_reg_ce_moves_its_valve_until_the_flow_is_in_the_zone() -> None:
    plc = plc_of("pid_reg_ce")
    plc.advance(120 * SECOND)
    assert abs(plc.processes["FIC-301"].pv - 55.0) < 3.0
    assert {(entry.terms.open_out, entry.terms.close_out) for entry in plc.log("FIC-301")} >= {
        (True, False),
        (False, False),
    }


def test_limit_switches_follow_the_valve() -> None:
    plc = plc_of("pid_reg_ce")
    plc.write("FIC-301", "SET_POINT", 300.0)
    plc.advance(90 * SECOND)
    assert not plc.read("FIC-301", "CONC_OPEN")
    assert plc.read("FIC-301", "CONC_CLOSE")
    assert not plc.read("FIC-301", "OPEN_OUT")


def test_melsec_controls_in_whole_numbers_and_its_contact_starts_it_afresh() -> None:
    plc = plc_of("melsec_pid")
    plc.advance(60 * SECOND)
    assert abs(plc.read("PIC-501", "PV") - 500) <= 8
    plc.write("PIC-501", "EN", False)
    plc.advance(SECOND)
    held = plc.executed("PIC-501")
    plc.write("PIC-501", "MV", 100)
    plc.advance(SECOND)
    assert held == plc.executed("PIC-501")
    plc.write("PIC-501", "EN", True)
    plc.scan()
    last = plc.log("PIC-501")[-1]
    assert (held + 1, False) == (plc.executed("PIC-501"), last.before.valid)
    assert abs(plc.read("PIC-501", "MV") - 100) <= 5


def test_the_counter_counts_calls() -> None:
    plc = plc_of("melsec_pid")
    plc.advance(10 * SECOND)
    place = plc.station.devices.address(plc.station.loops[0].counter)
    assert (plc.executed("PIC-501"),) == plc.memory.read(place.table, place.address, 1)


def test_faults_of_the_three_are_known_by_name_and_of_no_use_elsewhere() -> None:
    assert "PT_LUFT counts as 0" == fault("luft-ignored", CONTROLLERS["PID_REG_CE"]).text
    with pytest.raises(StateError, match="means nothing for DPID"):
        fault("luft-ignored", CONTROLLERS["DPID"])
