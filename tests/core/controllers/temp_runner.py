"""Run PID_Temp over calls. Inputs are sticky, edges are given as levels, `set_mode` and `set_I` as in the vectors.

Without `CycleTime_Value` every call executes the law: the call period is Heat_Cycle.
"""

from __future__ import annotations

from collections.abc import Iterable
from types import ModuleType
from typing import Any

from ahgateway.core.controllers import pid_temp
from ahgateway.core.controllers.pid_temp_dialect import DEFAULT, PidTempDialect
from ahgateway.core.operands import Kind
from ahgateway.core.real import REAL, quiet

KINDS = {row.attr: row.kind for row in pid_temp.OPERANDS}


def typed(values: dict[str, Any]) -> dict[str, Any]:
    """Tags to the law's attributes; every number to the type of its row."""
    return {
        name.lower(): REAL(value) if KINDS[name.lower()] is Kind.REAL else value
        for name, value in values.items()
        if name not in ("set_mode", "set_I")
    }


def run(
    params: dict[str, Any],
    steps: Iterable[dict[str, Any]],
    dialect: PidTempDialect = DEFAULT,
    law: ModuleType = pid_temp,
) -> list[Any]:
    """Return the terms of every call."""
    sticky = typed({"InputPerOn": False} | params)
    if "cycletime_value" not in sticky:
        sticky["cycletime_value"] = sticky.get("heat_cycle", REAL(1))
    state = law.State()
    out = []
    with quiet(all="ignore"):
        for given in steps:
            sticky.update(typed(given))
            edges = {}
            if "set_mode" in given:
                edges = {"modeactivate": True, "mode": given["set_mode"]}
                state = state._replace(modeactivate1=False)
            if "set_I" in given:
                state = state._replace(core=state.core._replace(i=REAL(given["set_I"])))
            operands = law.Operands(**(sticky | edges))
            state, terms = law.step(operands, state, dialect, law.nominal_ts(operands))
            out.append(terms)
    return out
