"""MELSEC PID, PID_REG_CE and PID_Temp beside a second model of the paper: equal bits over any sequence of inputs."""

from __future__ import annotations

import random
from typing import Any

import pytest
from core.controllers import melsec_runner, pulse_runner, temp_runner
from second_model import single
from second_model_others import Melsec, Pulses, Temp

from ahgateway.core.real import REAL, same_bits

ROUNDS = 60


def same(found: Any, expected: Any) -> bool:
    """Equal bits; a zero's sign is not tested (spec controllers §1)."""
    if isinstance(expected, float):
        return bool(found == REAL(expected)) or same_bits(found, REAL(expected))
    return bool(found == expected)


def held(trace: list[dict[str, Any]], ran: list[Any], inputs: list[dict[str, Any]]) -> None:
    for number, (expected, terms) in enumerate(zip(trace, ran, strict=True)):
        for name, value in expected.items():
            assert same(getattr(terms, name), value), (number, name, getattr(terms, name), value, inputs[: number + 1])


def sticky(params: dict[str, Any], steps: list[dict[str, Any]]) -> list[dict[str, Any]]:
    now, every = dict(params), []
    for each in steps:
        now = now | {name: value for name, value in each.items() if not name.startswith("set_")}
        every.append(now)
    return every


def varied(rng: random.Random, choices: dict[str, Any], how_often: float) -> dict[str, Any]:
    return {name: choose(rng) for name, choose in choices.items() if rng.random() < how_often}


MELSEC = {
    "SV": lambda r: float(r.choice([r.randint(-500, 500), r.randint(-32768, 32767)])),
    "TS": lambda r: r.choice([1000, 500, 100, 37, 0, -3, 10]),
    "ACT": lambda r: r.choice([0, 1, 33, 3, 7, 2, 6, 37, 39, 35, 38]),
    "ALPHA": lambda r: r.choice([0, 0, 30, 50, 99, 100, -1]),
    "KP": lambda r: r.choice([0, 75, 100, 213, 3000, -1]),
    "TI": lambda r: r.choice([0, 7, 40, 300, -1]),
    "KD": lambda r: r.choice([0, 10, 33, 100, 200, 201]),
    "TD": lambda r: r.choice([0, 13, 100, 900, -1]),
    "S20": lambda r: r.choice([0, 5, 50, -1]),
    "S21": lambda r: r.choice([0, 5, 50, -1]),
    "S22": lambda r: r.choice([0, 50, 100, 3000, -20]),
    "S23": lambda r: r.choice([0, 50, -100, -3000]),
    "SCAN": lambda r: r.choice([0, 0, 10, 37, 600]),
}
MELSEC_START = {
    "SV": 0.0, "PV": 0.0, "TS": 1000, "ACT": 1, "ALPHA": 0, "KP": 100, "TI": 40, "KD": 0, "TD": 0, "S20": 0, "S21": 0,
    "S22": 0, "S23": 0, "SCAN": 0,
}  # fmt: skip


@pytest.mark.parametrize("seed", range(ROUNDS))
def test_melsec_pid_is_the_second_model(seed: int) -> None:
    rng = random.Random(seed)
    steps = []
    for _ in range(30):
        wild = rng.random() < 0.05
        pv = float(rng.randint(-32768, 32767)) if wild else float(rng.randint(-60, 60))
        steps.append(varied(rng, MELSEC, 0.08) | {"PV": pv})
    start = float(rng.randint(-100, 100))
    block = Melsec(start)
    trace = [block.execute(op) for op in sticky(MELSEC_START, steps)]
    held(trace, melsec_runner.run(MELSEC_START | {"MV": start}, steps), steps)


PULSES = {
    "SET_POINT": lambda r: single(r.uniform(-20, 20)),
    "D_ZONE": lambda r: r.choice([0.0, 1.0, single(2.3), -1.0]),
    "KP": lambda r: r.choice([single(0.7), 1.0, 3.0, 0.0, -1.0]),
    "TN": lambda r: r.choice([0.0, 5.0, single(1.7), -1.0]),
    "TV": lambda r: r.choice([0.0, single(0.3), 1.0]),
    "PT_MIN_IMP": lambda r: r.choice([0.5, single(0.3), 1.0, 1.0, 0.5, 0.0]),
    "PT_LUFT": lambda r: r.choice([0.0, 0.5, single(1.3)]),
    "Y_OGR": lambda r: r.choice([100.0, 40.0, 130.0, -5.0]),
    "ACTION": lambda r: r.random() < 0.3,
    "REG_AVT": lambda r: r.random() < 0.7,
    "IN_OPEN_R": lambda r: r.random() < 0.5,
    "IN_CLOSE_R": lambda r: r.random() < 0.5,
    "CONC_OPEN": lambda r: r.random() < 0.8,
    "CONC_CLOSE": lambda r: r.random() < 0.8,
    "T_PERIOD": lambda r: r.choice([10.0, single(6.7), 3.0, 10.0, 0.0]),
}
PULSES_START = {
    "SET_POINT": 0.0, "ACTUAL": 0.0, "D_ZONE": 1.0, "KP": 2.0, "TN": 0.0, "TV": 0.0, "PT_MIN_IMP": 0.5,
    "PT_LUFT": 0.0, "Y_OGR": 100.0, "ACTION": False, "REG_AVT": True, "IN_OPEN_R": False, "IN_CLOSE_R": False,
    "CONC_OPEN": True, "CONC_CLOSE": True, "T_PERIOD": 10.0,
}  # fmt: skip


@pytest.mark.parametrize("seed", range(ROUNDS))
def test_pid_reg_ce_is_the_second_model(seed: int) -> None:
    rng = random.Random(seed)
    dt = rng.choice([0.5, single(0.1), single(0.3)])
    steps, actual = [], 0.0
    for _ in range(80):
        if rng.random() < 0.3:
            actual = rng.choice([single(rng.uniform(-15, 15)), float(rng.randint(-9, 9))])
        bad = rng.random() < 0.01
        steps.append(varied(rng, PULSES, 0.02) | {"ACTUAL": float("nan") if bad else actual})
    block = Pulses()
    params = PULSES_START | {"dt": dt}
    trace = [block.execute(op) for op in sticky(params, steps)]
    for each in trace:
        each["error"] = each["error"] if each["error"] == each["error"] else float("nan")
    held(trace, pulse_runner.run(params, steps), steps)


def uniform(low: float, high: float) -> Any:
    return lambda r: single(r.uniform(low, high))


TEMP = {
    "Setpoint": lambda r: r.choice([single(r.uniform(10, 90)), float(r.randint(10, 90)), 200.0, float("inf")]),
    "Disturbance": lambda r: r.choice([0.0, single(2.3), -5.0, float("nan")]),
    "ManualValue": lambda r: r.choice([20.0, single(-33.3), 150.0, float("nan")]),
    "SubstituteOutput": lambda r: r.choice([0.0, 12.5, 400.0]),
    "SetSubstituteOutput": lambda r: r.random() < 0.6,
    "ActivateRecoverMode": lambda r: r.random() < 0.8,
    "IntegralResetMode": lambda r: r.randint(0, 4),
    "OverwriteInitialOutputValue": lambda r: r.choice([30.0, -20.0]),
    "ActivateCooling": lambda r: r.random() < 0.7,
    "AdvancedCooling": lambda r: r.random() < 0.5,
    "CoolFactor": lambda r: r.choice([1.0, single(1.7), 2.0, 0.0]),
    "Heat_Select": lambda r: r.choice([0, 2]),
    **{
        f"{side}_{name}": choose
        for side in ("Heat", "Cool")
        for name, choose in {
            "Gain": lambda r: r.choice([1.0, single(2.3), 5.0, single(0.3), -1.0]),
            "Ti": lambda r: r.choice([0.0, 4.0, single(7.7), 20.0]),
            "Td": lambda r: r.choice([0.0, 1.0, single(2.7)]),
            "TdFiltRatio": lambda r: r.choice([0.0, single(0.2), 1.0]),
            "PWeighting": lambda r: r.choice([0.0, single(0.4), 1.0]),
            "DWeighting": lambda r: r.choice([0.0, single(0.4), 1.0]),
            "DeadZone": lambda r: r.choice([0.0, 1.0, single(2.3)]),
            "ControlZone": lambda r: r.choice([10.0, 25.0, single(3.402822e38)]),
        }.items()
    },
    "Heat_PidLowerLimit": lambda r: r.choice([0.0, -40.0]),
    "Cool_PidLowerLimit": lambda r: r.choice([-100.0, -50.0]),
    "Heat_UpperScaling": lambda r: r.choice([100.0, single(10.7)]),
    "Heat_LowerScaling": lambda r: r.choice([0.0, 4.0]),
    "Cool_UpperScaling": lambda r: r.choice([100.0, 5.0]),
    "Cool_LowerScaling": lambda r: r.choice([0.0, 1.0]),
    "Heat_PerUpperScaling": lambda r: r.choice([27648.0, 5530.0]),
}
SIDE = {
    "Gain": 1.0, "Ti": 20.0, "Td": 0.0, "TdFiltRatio": single(0.2), "PWeighting": 1.0, "DWeighting": 1.0,
    "DeadZone": 0.0, "ControlZone": single(3.402822e38), "UpperScaling": 100.0, "LowerScaling": 0.0,
    "PerUpperScaling": 27648.0, "PerLowerScaling": 0.0,
}  # fmt: skip
TEMP_START = {
    "Setpoint": 50.0, "Input": 40.0, "Disturbance": 0.0, "ManualValue": 0.0, "SubstituteOutput": 0.0,
    "SetSubstituteOutput": True, "ActivateRecoverMode": True, "IntegralResetMode": 4,
    "OverwriteInitialOutputValue": 0.0, "ActivateCooling": False, "AdvancedCooling": True, "CoolFactor": 1.0,
    "Heat_Select": 2, "Cool_Select": 2, "Heat_PidLowerLimit": 0.0, "Heat_PidUpperLimit": 100.0,
    "Cool_PidLowerLimit": -100.0, "InputUpperLimit": 98.0, "InputLowerLimit": 2.0, "InputUpperWarning": 90.0,
    "InputLowerWarning": 10.0, "SetpointUpperLimit": 95.0, "SetpointLowerLimit": 15.0,
    **{f"{side}_{name}": value for side in ("Heat", "Cool") for name, value in SIDE.items()},
}  # fmt: skip


@pytest.mark.parametrize("seed", range(2 * ROUNDS))
def test_pid_temp_is_the_second_model(seed: int) -> None:
    rng = random.Random(seed)
    ts = rng.choice([1.0, single(0.1), 0.5])
    params = TEMP_START | {"Heat_Cycle": ts, "Cool_Cycle": ts}
    steps: list[dict[str, Any]] = [{"set_mode": 3}]
    for _ in range(40):
        step = varied(rng, TEMP, 0.03)
        if rng.random() < 0.7:
            step["Input"] = rng.choice([single(rng.uniform(35, 65)), float(rng.randint(40, 60)), 50.0])
        if rng.random() < 0.04:
            step["Input"] = rng.choice([1.0, 99.0, 95.0, float("nan")])
        if rng.random() < 0.1:
            step["set_mode"] = rng.choice([0, 3, 3, 4])
        steps.append(step)
    block = Temp()
    ops = sticky(params, steps)
    trace = [block.execute(op, step.get("set_mode")) for op, step in zip(ops, steps, strict=True)]
    held(trace, temp_runner.run(params, steps), steps)
