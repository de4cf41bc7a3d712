"""A controller in its own arithmetic, standing still at an operating point, one execution at a time.

This file alone knows how each law of `core` is called and what state is rest for it. Inputs and outputs are binary64
in the block's own units; inside, everything is the law's.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ahgateway.core.controllers import dpid, dpide, melsec_pid, pid_reg_ce, pid_temp
from ahgateway.core.controllers.melsec_dialect import MelsecDialect, NumberFormat
from ahgateway.core.controllers.pid_reg_ce_dialect import DEFAULT as PULSES
from ahgateway.core.controllers.pid_temp_dialect import DEFAULT as TEMP
from ahgateway.core.dialect import DEFAULT, Dialect
from ahgateway.core.operands import Kind
from ahgateway.core.real import REAL, quiet

Given = Mapping[str, float | int | bool]
ZERO = REAL(0)


@dataclass
class Runner:
    """One controller that runs.

    Attributes:
        ts_s: Time between executions in s.
        execute: `execute(sv, pv)` gives MV of the next execution.
    """

    ts_s: float
    execute: Callable[[float, float], float]


def _typed(module: Any, settings: Given) -> dict[str, Any]:
    """Settings by attribute name, each in its operand's type; what the law does not read is left out."""
    rows = {row.name: row for row in module.OPERANDS}
    fields = set(module.Operands._fields)
    out: dict[str, Any] = {}
    for name, value in settings.items():
        row = rows[name]
        if row.attr not in fields:
            continue
        out[row.attr] = REAL(value) if row.kind is Kind.REAL else (bool(value) if row.kind is Kind.BOOL else int(value))
    return out


def delta(name: str, settings: Given, sv: float, pv: float, mv: float, dialect: Dialect = DEFAULT) -> Runner:
    """DPID or DPIDE at rest: no error, the integral holding MV."""
    module: Any = dpid if name == "DPID" else dpide
    operands = module.Operands(**_typed(module, settings))
    bias = getattr(operands, "bias", ZERO)
    state = module.State(i=REAL(mv) - bias, pv1=REAL(pv), mv=REAL(mv), valid=True)
    ts = module.nominal_ts(operands)

    def execute(sv: float, pv: float) -> float:
        nonlocal state
        with quiet(all="ignore"):
            state, terms = module.step(operands._replace(sv=REAL(sv), pv=REAL(pv)), state, dialect, ts)
        return float(terms.mv)

    return Runner(float(ts), execute)


def melsec(settings: Given, sv: float, pv: float, mv: float) -> Runner:
    """MELSEC PID at rest; SV, PV and MV pass through 16-bit registers as in the PLC."""
    dialect = MelsecDialect(number_format=NumberFormat.INTEGER_IO)
    operands = melsec_pid.Operands(**_typed(melsec_pid, settings), mv=REAL(np.rint(mv)))
    still = REAL(np.rint(pv))
    ev = melsec_pid.error(operands._replace(sv=REAL(np.rint(sv))), still)
    reverse = bool(operands.act & melsec_pid.ACT_REVERSE)
    state = melsec_pid.State(REAL(mv), ev, still, still, ZERO, still, REAL(np.rint(mv)), reverse, True)
    ts = melsec_pid.nominal_ts(operands)

    def execute(sv: float, pv: float) -> float:
        nonlocal state
        now = operands._replace(sv=REAL(np.rint(sv)), pv=REAL(np.rint(pv)), mv=state.out)
        with quiet(all="ignore"):
            state, terms = melsec_pid.step(now, state, dialect, ts)
        return float(terms.out)

    return Runner(float(ts), execute)


def siemens(settings: Given, sv: float, pv: float, mv: float) -> Runner:
    """PID_Temp at rest in automatic, called once a Cycle; its process value limits are taken away."""
    chosen = _typed(pid_temp, settings)
    cycle = chosen.get("heat_cycle", REAL(1))
    operands = pid_temp.Operands(
        **chosen
        | {
            "inputperon": False,
            "cycletime_value": cycle,
            "inputupperlimit": REAL(3.4e38),
            "inputlowerlimit": REAL(-3.4e38),
        }
    )
    weighted = operands.heat_gain * ((operands.heat_pweighting - REAL(1)) * REAL(sv))
    u1 = (operands.heat_dweighting - REAL(1)) * REAL(sv)
    core = pid_temp.Core(REAL(mv), (REAL(mv) - weighted) - operands.disturbance, ZERO, u1, True)
    state = pid_temp.State(core=core, state=pid_temp.AUTOMATIC)
    ts = pid_temp.nominal_ts(operands)

    def execute(sv: float, pv: float) -> float:
        nonlocal state
        with quiet(all="ignore"):
            state, terms = pid_temp.step(operands._replace(setpoint=REAL(sv), input=REAL(pv)), state, TEMP, ts)
        return float(terms.pidoutputsum)

    return Runner(float(ts), execute)


def pulses(settings: Given, mv: float, stroke_s: float | None) -> Runner:
    """PID_REG_CE with no series under way; MV is Y, or the position in % of a motor that runs while it is told to."""
    operands = pid_reg_ce.Operands(**_typed(pid_reg_ce, settings))
    state, position = pid_reg_ce.State(), mv
    ts = pid_reg_ce.nominal_ts(operands)

    def execute(sv: float, pv: float) -> float:
        nonlocal state, position
        now = operands._replace(
            set_point=REAL(sv), actual=REAL(pv), conc_open=position < 100.0, conc_close=position > 0.0
        )
        with quiet(all="ignore"):
            state, terms = pid_reg_ce.step(now, state, PULSES, ts)
        if stroke_s is None:
            return float(terms.y)
        moving = 1 if terms.open_out else (-1 if terms.close_out else 0)
        position = min(max(position + 100.0 * moving * float(ts) / stroke_s, 0.0), 100.0)
        return position

    return Runner(float(ts), execute)


def runner(name: str, settings: Given, sv: float, pv: float, mv: float, stroke_s: float | None = None) -> Runner | None:
    """Return the named block at rest at (sv, pv, mv), PV equal to SV; None for a block without a law of ours."""
    if name in ("DPID", "DPIDE"):
        return delta(name, settings, sv, pv, mv)
    if name == "MELSEC_PID":
        return melsec(settings, sv, pv, mv)
    if name == "PID_Temp":
        return siemens(settings, sv, pv, mv)
    if name == "PID_REG_CE":
        return pulses(settings, mv, stroke_s)
    return None


def at_rest(name: str, settings: Given, sv: float, pv: float, mv: float, dialect: Dialect = DEFAULT) -> Runner:
    """Return a block that has a law of ours at rest there; `dialect` is that of DPID and DPIDE."""
    if name in ("DPID", "DPIDE"):
        return delta(name, settings, sv, pv, mv, dialect)
    found = runner(name, settings, sv, pv, mv)
    assert found is not None
    return found
