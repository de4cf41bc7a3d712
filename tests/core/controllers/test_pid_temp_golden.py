"""PID_Temp and its pulses against the vectors worked out by hand: bits, integers, errors, warnings, ticks and carry."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from core.controllers.temp_runner import run

from ahgateway.core.controllers.pid_temp_dialect import PwmConflict
from ahgateway.core.controllers.pid_temp_pwm import Pulse, Timing, advance
from ahgateway.core.real import REAL, bits

GOLDEN = Path(__file__).parents[2] / "golden"
VECTORS = json.loads((GOLDEN / "pid_temp.json").read_text(encoding="utf-8"))
TRAINS = json.loads((GOLDEN / "pid_temp_pwm.json").read_text(encoding="utf-8"))

TAG = {
    **{name: f"Heat_{name}" for name in ("Gain", "Ti", "Td", "TdFiltRatio", "PWeighting", "DWeighting", "Cycle")},
    "HeatPidLower": "Heat_PidLowerLimit",
    "CoolPidLower": "Cool_PidLowerLimit",
    "HeatUpper": "Heat_UpperScaling",
    "HeatLower": "Heat_LowerScaling",
    "CoolUpper": "Cool_UpperScaling",
    "CoolLower": "Cool_LowerScaling",
    "CoolPerLower": "Cool_PerLowerScaling",
}
TERM = {"Heat_PER": "outputheat_per", "Cool_PER": "outputcool_per", "Integral": "i"}


@pytest.mark.parametrize("vector", VECTORS, ids=[vector["id"] for vector in VECTORS])
def test_pid_temp_is_bit_equal_to_the_golden_vector(vector: dict[str, Any]) -> None:
    params = {TAG.get(name, name): value for name, value in vector["params"].items()}
    ran = run({"Heat_Select": 2, "Cool_Select": 2} | params, [step["in"] for step in vector["steps"]])
    for index, (step, terms) in enumerate(zip(vector["steps"], ran, strict=True)):
        for name, pattern in step["hex"].items():
            assert int(pattern, 16) == bits(getattr(terms, TERM.get(name, name.lower()))), (index, name)
        for name, value in step["out"].items():
            if name not in step["hex"]:
                assert value == getattr(terms, TERM.get(name, name.lower())), (index, name)


@pytest.mark.parametrize("train", TRAINS, ids=[train["id"] for train in TRAINS])
def test_pulse_train_is_the_golden_one(train: dict[str, Any]) -> None:
    timing = Timing(train["period_ticks"], train["min_on_ticks"], train["min_off_ticks"])
    pulse, given, on_ticks, carries = Pulse(), "", [], []
    for _ in range(len(train["pulse_train"])):
        pulse, level = advance(pulse, REAL(train["percent"]), timing, PwmConflict.ON_RULE)
        given += "1" if level else "0"
        if pulse.tick == 0:
            on_ticks.append(pulse.on)
            carries.append(float(pulse.carry))
    assert train["pulse_train"] == given
    assert train["on_ticks_per_period"] == on_ticks
    assert train["carry_after_period_ticks"] == carries
