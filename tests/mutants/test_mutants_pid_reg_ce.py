"""Every wrong PID_REG_CE is convicted by its bits and pulses on one excitation; the unchanged copy is not."""

from __future__ import annotations

from types import ModuleType
from typing import Any

import pytest
from core.controllers.pulse_runner import run
from mutants.mutate import first_difference, mutant

from ahgateway.core.controllers import pid_reg_ce

LOOP = {
    "D_ZONE": 1.0, "KP": 1.3, "TN": 7.0, "TV": 0.3, "PT_MIN_IMP": 0.3, "PT_LUFT": 0.7, "T_PERIOD": 9.0, "dt": 0.1,
    "SET_POINT": 60.0, "ACTUAL": 50.0,
}  # fmt: skip


def stay(count: int, **inputs: Any) -> list[dict[str, Any]]:
    return [inputs, *({} for _ in range(count - 1))]


WALK = [
    *stay(60), *stay(4, ACTUAL=53.17), *stay(7, ACTUAL=54.83), *stay(7, ACTUAL=51.29),
    *({"ACTUAL": 47.31 + 0.137 * k} for k in range(60)), *stay(40, ACTUAL=70.0),
    *stay(3, ACTUAL=60.5), *stay(12, ACTUAL=61.0),
    *stay(5, CONC_CLOSE=False), *stay(5, CONC_CLOSE=True), *stay(2, REG_AVT=False, IN_OPEN_R=True),
    *stay(2, IN_CLOSE_R=True), *stay(2, IN_OPEN_R=False), *stay(30, REG_AVT=True, ACTUAL=59.0),
    *stay(20, ACTION=True, ACTUAL=20.0), *stay(3, Y_OGR=10.0, ACTUAL=90.0), *stay(3, ACTUAL=float("nan")),
    *stay(15, ACTUAL=30.0), *stay(2, T_PERIOD=0.0), *stay(60, T_PERIOD=9.0, ACTUAL=58.9, KP=0.5),
    *stay(2, REG_AVT=False, IN_OPEN_R=False, IN_CLOSE_R=True), *stay(20, REG_AVT=True, ACTION=False, ACTUAL=52.2),
]  # fmt: skip

SMALL = LOOP | {"SET_POINT": 0.0, "D_ZONE": 0.0}
FLIPS = [{"ACTUAL": (-1) ** k * (1.17 + 0.0731 * k)} for k in range(30)]
"""A new series in every call: I is one increment, whose last bit nothing hides."""


def traces(law: ModuleType) -> list[Any]:
    return [*run(LOOP, WALK, law=law), *run(SMALL, FLIPS, law=law)]


MUTANTS = {
    "control: unchanged": ("", ""),
    "error reversed": ("error = operands.set_point - operands.actual", "error = operands.actual - operands.set_point"),
    "zone with its edges": ("bool(low < operands.actual < high)", "bool(low <= operands.actual <= high)"),
    "durations cut": ("np.floor((duration / ts) + HALF)", "np.floor(duration / ts)"),
    "I before e": ("tuning.kp * ((e + i) + d)", "tuning.kp * (e + (i + d))"),
    "integral scaled later": ("i = i + ((e * ts) / tuning.tn)", "i = i + (e * (ts / tuning.tn))"),
    "derivative not divided": ("(tuning.tv * (e - e1)) / ts", "tuning.tv * (e - e1)"),
    "pause from the minimum": ("ticks((tuning.minimum / t1) * tuning.period, ts)", "ticks(tuning.period, ts)"),
    "no backlash": ("pulse = pulse + tuning.luft", "pulse = pulse"),
    "backlash always": ("reversing = s.last not in (0, direction)", "reversing = True"),
    "backlash forgets manual": ("last, rest = (moving, 0) if moving else (state.last,", "last, rest = (state.last,"),
    "pulse not stretched": ("tuning.minimum if t1 < tuning.minimum else t1", "t1"),
    "one call too long": ("phase == IDLE or left > 0", "phase == IDLE or left >= 0"),
    "limit switch ignored": ("opens = closes = False\n        phase, left = IDLE, 0", "pass"),
    "series survives a change of sign": ("if s.phase != IDLE and sg != s.sgn:", "if False:"),
    "zone cuts a pulse": ("if s.phase != PULSE or dialect", "if True or dialect"),
    "both manual inputs open": ("operands.in_open_r and not operands.in_close_r and", "operands.in_open_r and"),
    "limit of Y ignored": ("y = limit(-tuning.y_ogr, y, tuning.y_ogr)", "y = y"),
    "motor runs on a bad signal": ("return _off(state, shown, state.e1, state.valid, flag.BAD_INPUT)", "e = state.e1"),
    "stopped in a pause": ("stopped = phase == IDLE\n", "stopped = phase != PULSE\n"),
}  # fmt: skip


@pytest.fixture(scope="module")
def right() -> list[Any]:
    return traces(pid_reg_ce)


@pytest.mark.parametrize("name", list(MUTANTS))
def test_wrong_pid_reg_ce_is_convicted(name: str, right: list[Any]) -> None:
    old, new = MUTANTS[name]
    wrong = traces(mutant(pid_reg_ce, old, new) if old else pid_reg_ce)
    assert name.startswith("control") != (first_difference(wrong, right) is not None)
