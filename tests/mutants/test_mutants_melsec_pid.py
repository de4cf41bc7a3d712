"""Every wrong MELSEC PID is convicted by its bits on one excitation; the unchanged copy is not."""

from __future__ import annotations

from typing import Any

import pytest
from core.controllers.melsec_runner import run
from mutants.mutate import first_difference, mutant

from ahgateway.core.controllers import melsec_pid

LOOP = {
    "TS": 300, "ACT": 33, "ALPHA": 30, "KP": 130, "TI": 70, "KD": 40, "TD": 90, "S22": 60, "S23": -20,
    "SV": 50, "MV": 7,
}  # fmt: skip
WATCHED = LOOP | {"ACT": 7, "S20": 3, "S21": 3, "S22": 4, "S23": 4}
WALK = [{"PV": pv} for pv in (40, 41, 43, 43, 47, 55, 54, 20, 90, 90, 52, 49)] + [{"SV": 30}, {"SV": 10, "ACT": 0}, {}]
OUTSIDE = [
    {"PV": 40, "TS": 0},
    {"TS": 300, "KD": 201},
    {"KD": 200},
    {"EN": False},
    {"EN": True, "PV": 45},
    {"SCAN": 300},
]

MUTANTS = {
    "control: unchanged": ("", ""),
    "binary64 inside": ("p = ev - before.ev1", "p = float(ev) * 1.0000001 - float(before.ev1)"),
    "P from the error alone": ("p = ev - before.ev1", "p = ev"),
    "direction reversed": ("sv - pvf if operands.act & ACT_REVERSE", "sv - pvf if not operands.act & ACT_REVERSE"),
    "sum in another order": ("((p + i) + d)", "(p + (i + d))"),
    "TS in ms": ("REAL(max(operands.ts, operands.scan, 1)) / THOUSAND", "REAL(max(operands.ts, operands.scan, 1))"),
    "KD as a derivative gain": ("den = ts + (kd * td)", "den = ts + (td / (kd + REAL(1)))"),
    "derivative of PV unfiltered": ("if warnings else filtered", "if warnings else REAL(operands.pv)"),
    "alpha the other way round": ("pv + ((REAL(operands.alpha) / HUNDRED) * (before.pvf1 - pv))",
                                  "before.pvf1 + ((REAL(operands.alpha) / HUNDRED) * (pv - before.pvf1))"),
    "unclamped sum kept": ("after = State(mv,", "after = State(raw,"),
    "first execution with P": ("return State(destination, seeded,", "return State(destination, ZERO,"),
    "sum from 0": ("return State(destination, seeded,", "return State(ZERO, seeded,"),
    "alarm at equality": ("set_value >= 0 and change > REAL", "set_value >= 0 and change >= REAL"),
    "alarm on the first execution": ("    if state.valid:\n        watched", "    if True:\n        watched"),
    "limits whatever the alarm bit": ("ACT_LIMITS and not operands.act & ACT_OUTPUT_ALARM:", "ACT_LIMITS:"),
    "KD of 201 legal": ("operands.kd >= 201", "operands.kd > 201"),
    "limits not exchanged": ("if high < low:", "if False:"),
    "TS of the scan time unnoticed": ("operands.ts <= operands.scan else 0", "operands.ts < operands.scan else 0"),
}  # fmt: skip
FIRST_ALARM = [{"PV": 100}, {"PV": 103}, {"PV": 107}]


def traces(law: Any) -> list[Any]:
    return [
        *run(LOOP, WALK, law=law),
        *run(LOOP, OUTSIDE, law=law),
        *run(WATCHED | {"ALPHA": 0, "TD": 0, "S20": 0, "S21": 0}, WALK, law=law),
        *run(WATCHED | {"ALPHA": 0}, FIRST_ALARM, law=law),
        *run(WATCHED | {"ACT": 5, "SV": 200, "MV": -9}, FIRST_ALARM, law=law),
        *run(LOOP | {"S22": -20, "S23": 60}, WALK, law=law),
        *run(LOOP | {"ACT": 37}, WALK, law=law),
    ]


@pytest.fixture(scope="module")
def right() -> list[Any]:
    return traces(melsec_pid)


@pytest.mark.parametrize("name", list(MUTANTS))
def test_wrong_melsec_pid_is_convicted(name: str, right: list[Any]) -> None:
    old, new = MUTANTS[name]
    convicted = first_difference(traces(mutant(melsec_pid, old, new) if old else melsec_pid), right) is not None
    assert name.startswith("control") != convicted
