"""Every wrong PID_Temp is convicted by its bits on one excitation, in whichever file the fault lies."""

from __future__ import annotations

from types import ModuleType
from typing import Any

import pytest
from core.controllers.temp_runner import run
from mutants.mutate import first_difference, mutant

from ahgateway.core.controllers import pid_temp, pid_temp_law, pid_temp_output, pid_temp_pwm

LOOP = {
    "Heat_Gain": 1.3, "Heat_Ti": 7, "Heat_Td": 0.9, "Heat_TdFiltRatio": 0.3, "Heat_PWeighting": 0.7,
    "Heat_DWeighting": 0.4, "Heat_Cycle": 0.7, "CycleTime_Value": 0.1, "Heat_DeadZone": 0.6, "Heat_ControlZone": 30,
    "ActivateCooling": True, "Cool_Gain": 2.1, "Cool_Ti": 3, "Cool_Cycle": 0.5, "Cool_DeadZone": 0.9,
    "Cool_ControlZone": 25, "Heat_MinimumOnTime": 0.2,
    "Cool_MinimumOffTime": 0.2, "Setpoint": 50, "Input": 41.3,
    "InputUpperWarning": 90, "SubstituteOutput": 11.1,
}  # fmt: skip
FACTOR = LOOP | {
    "AdvancedCooling": False,
    "CoolFactor": 1.7,
    "Heat_Select": 2,
    "Cool_Select": 2,
    "Heat_LowerScaling": 3,
}


def stay(count: int, **inputs: Any) -> list[dict[str, Any]]:
    return [inputs, *({} for _ in range(count - 1))]


WALK = [
    *stay(9, set_mode=3), *stay(8, Input=47.7), *stay(8, Input=49.7), *stay(8, Setpoint=52.1), *stay(16, Input=58.9),
    *stay(16, Input=55.1), *stay(8, Input=80.0), *stay(4, Input=91.0, Disturbance=7.7), *stay(8, Input=121.5),
    *stay(4, Input=float("nan")), *stay(8, Input=49.0), *stay(4, set_mode=4, ManualValue=33.3),
    *stay(8, set_mode=3), *stay(3, set_mode=0), *stay(9, set_mode=3, IntegralResetMode=0), *stay(8, Input=10.0),
    *stay(16, Input=33.0, Disturbance=90.0), *stay(2, ErrorAck=True), *stay(8, Heat_Ti=0), *stay(3, Reset=True, Mode=3),
    *stay(8, Reset=False, Heat_Ti=7), *stay(8, Disturbance=-400.0, Input=53.0), *stay(8, Input=47.0),
    *stay(8, Disturbance=0.3), *(call for k in range(20) for call in stay(8, Input=41.17 + 0.331 * k)),
    *stay(30, set_mode=4, ManualValue=25.0),
]  # fmt: skip

PLAIN = {"Heat_Gain": 1.3, "Heat_Ti": 7, "Heat_Cycle": 0.7, "Setpoint": 50}
STARTS = [{"set_mode": 3 * (k % 2), "Input": 41.17 + 0.331 * k, "IntegralResetMode": 1} for k in range(30)]
"""Every second call starts from inactive: the integral is one increment, whose last bit nothing hides."""

MUTANTS: dict[str, tuple[ModuleType, str, str]] = {
    "P on the bare error": (pid_temp_law, "p = ps.kp * (ez - ((ONE - ps.b) * w))", "p = ps.kp * ez"),
    "P in another order": (pid_temp_law, "ps.kp * (ez - ((ONE - ps.b) * w))", "ps.kp * ((ez - w) + (ps.b * w))"),
    "D on the bare error": (pid_temp_law, "u = ez - ((ONE - ps.c) * w)", "u = ez"),
    "filter forgotten": (pid_temp_law, "filtered = ps.a * ps.td", "filtered = ZERO"),
    "call period for Cycle": (pid_temp_law, "else cycle\n    return Set", "else ts\n    return Set"),
    "increment divided last": (pid_temp_law, "((ps.kp * ps.ts) / ps.ti) * ez", "(ps.kp * ps.ts) * (ez / ps.ti)"),
    "sum in another order": (pid_temp_law, "raw = (p + (i + inc)) + d", "raw = p + ((i + inc) + d)"),
    "integral never stopped": (pid_temp_law, "if raw > high and inc > ZERO:", "if False:"),
    "integral stopped either way": (pid_temp_law, "if raw < low and inc < ZERO:", "if raw < low:"),
    "dead zone jumps": (pid_temp_law, "return e - zone if e > ZERO else e + zone", "return e"),
    "dead zone ignored": (pid_temp_law, "if abs(e) <= zone:", "if False:"),
    "one width for both sides": (pid_temp_law, "if two_sets(operands) and e < ZERO else", "if False else"),
    "control zone ignored": (pid_temp_law, "x < w - below", "False"),
    "set switched with a bump": (pid_temp_law, "== TRANSFER or switched or returned", "== TRANSFER or returned"),
    "transfer with a bump": (pid_temp_law, "if entry == TRANSFER or switched or returned", "if switched or returned"),
    "factor on the heating side": (pid_temp_law, "(operands) and raw < ZERO", "(operands) and raw > ZERO"),
    "disturbance forgotten": (pid_temp_law, "raw + disturbance\n    if with_", "raw\n    if with_"),
    "start mode ignored": (pid_temp_law, "mode = operands.integralresetmode", "mode = 1"),
    "integral deleted in manual": (pid_temp, "return Core(y, core.i, ZERO,", "return Core(y, ZERO, ZERO,"),
    "law every call": (pid_temp, "if state.state == AUTOMATIC and state.calls > 0:", "if False:"),
    "error bits not kept": (pid_temp, "(0 if acknowledged else state.errorbits)", "0"),
    "error bits never cleared": (pid_temp, "(0 if acknowledged else state.errorbits)", "state.errorbits"),
    "mode by level": (pid_temp, "operands.modeactivate and not state.modeactivate1", "state.state == 0"),
    "substitute forgotten": (pid_temp, "if operands.setsubstituteoutput:", "if False:"),
    "warning at the limit of error": (pid_temp, "above = bool(x > high", "above = bool(x > operands.inputupperlimit"),
    "output scaled from 0": (pid_temp_output, "return low + (((limit(start", "return (((limit(start"),
    "rounded towards zero": (pid_temp_output, "return int(np.rint(held))", "return int(held)"),
    "carry forgotten": (pid_temp_pwm, "/ HUNDRED) + carry", "/ HUNDRED)"),
    "rounded before the minimum": (pid_temp_pwm, "(want < REAL(timing.on_min", "(np.rint(want) < REAL(timing.on_min"),
    "off first": (pid_temp_pwm, "pulse.tick < on", "pulse.tick >= count - on"),
}  # fmt: skip


def assembled(module: ModuleType, old: str, new: str) -> ModuleType:
    """PID_Temp with the mutated file in the place of the right one."""
    wrong = mutant(module, old, new)
    if module is pid_temp:
        return wrong
    block = mutant(pid_temp, "INACTIVE = 0\n", "INACTIVE = 0 \n")
    if module is pid_temp_law:
        block.law = wrong
    elif module is pid_temp_output:
        block.output = wrong
    else:
        output = mutant(pid_temp_output, "PWM = 1\n", "PWM = 1 \n")
        output.pwm = wrong
        block.output = output
    return block


def traces(law: ModuleType) -> list[Any]:
    return [*run(LOOP, WALK, law=law), *run(FACTOR, WALK, law=law), *run(PLAIN, STARTS, law=law)]


@pytest.fixture(scope="module")
def right() -> list[Any]:
    return traces(pid_temp)


def test_unchanged_copy_is_acquitted(right: list[Any]) -> None:
    assert (
        first_difference(traces(assembled(pid_temp_pwm, "MARGIN = REAL(0.001)", "MARGIN = REAL(0.001) ")), right)
        is None
    )


@pytest.mark.parametrize("name", list(MUTANTS))
def test_wrong_pid_temp_is_convicted(name: str, right: list[Any]) -> None:
    assert first_difference(traces(assembled(*MUTANTS[name])), right) is not None
