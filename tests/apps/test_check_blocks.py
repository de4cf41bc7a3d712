"""Scenarios of MELSEC PID, PID_REG_CE and PID_Temp: in lockstep on the fake, and every wrong block convicted."""

from __future__ import annotations

from dataclasses import replace

import pytest
from apps.check_bench import BENCH, ran

from ahgateway.apps.check.result import Verdict
from ahgateway.core.controllers import CONTROLLERS
from ahgateway.fake.call_faults import CALL_FAULTS
from ahgateway.schema.scenario import Scenario, library, load

SECONDS = {"melsec_pid": 5.0, "pid_reg_ce": 12.0, "pid_temp": 4.0}
"""How much of each scenario runs here; a valve waits for its first pause. The whole runs in the bench program."""

SHIPPED = [(folder, each.stem) for folder in SECONDS for each in sorted((library() / folder).glob("*.toml"))]


def short(folder: str, name: str, until_s: float) -> Scenario:
    wanted = load(library() / folder / f"{name}.toml")
    return replace(
        wanted, duration_s=until_s, expect=wanted.expect.model_copy(update={"response": [], "coverage": 0.0})
    )  # fmt: skip


@pytest.mark.parametrize(("folder", "name"), SHIPPED)
def test_each_shipped_scenario_of_a_block_begins_in_lockstep(folder: str, name: str) -> None:
    result = ran(short(folder, name, SECONDS[folder]))

    assert (Verdict.PASS, 0) == (result.verdict, result.counts.diverged), result.reason


@pytest.mark.slow
def test_a_valve_is_led_to_its_flow_by_pulses_and_never_driven_both_ways() -> None:
    result = ran(load(library() / "pid_reg_ce" / "setpoint-step.toml"))

    assert (Verdict.PASS, "4 expectations met") == (result.verdict, result.reason)


CAUGHT_BY = {
    ("melsec_pid", "kp-1-percent"): ("setpoint-step", 1.0),
    ("melsec_pid", "interval-25-percent"): ("setpoint-step", 1.0),
    ("melsec_pid", "act-reversed"): ("direct", 1.0),
    ("melsec_pid", "input-filter-ignored"): ("filter-derivative", 3.0),
    ("pid_reg_ce", "kp-1-percent"): ("pulses", 7.0),
    ("pid_reg_ce", "pulse-one-call-long"): ("pulses", 8.0),
    ("pid_reg_ce", "luft-ignored"): ("pulses", 26.0),
    ("pid_reg_ce", "zone-ignored"): ("pulses", 2.0),
    ("pid_temp", "kp-1-percent"): ("setpoint-step", 2.0),
    ("pid_temp", "ti-1-percent"): ("setpoint-step", 2.0),
    ("pid_temp", "interval-25-percent"): ("setpoint-step", 2.0),
    ("pid_temp", "carry-lost"): ("small-pulses", 4.0),
}
"""Which shipped scenario convicts a fault, and by when."""


@pytest.mark.parametrize(("folder", "fault"), CAUGHT_BY)
def test_every_wrong_block_is_convicted_by_a_shipped_scenario(folder: str, fault: str) -> None:
    name, until_s = CAUGHT_BY[folder, fault]

    assert Verdict.FAIL is ran(short(folder, name, until_s), replace(BENCH, fault=fault)).verdict


def test_no_fault_is_left_out() -> None:
    known = {(name.lower(), each.name) for each in CALL_FAULTS.values() for name in each.controllers}

    assert known == set(CAUGHT_BY)
    assert {name.lower() for name in CONTROLLERS} == {"dpid", "dpide", *SECONDS}
