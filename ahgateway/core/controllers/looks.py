"""What a person looks at on each controller: its limits, its direction, whether it is in service. Pure.

The laws do not need it; commissioning and the write gate do. Each function takes the controller's own inputs, and what
it shows by `Seen.name` where that matters.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ahgateway.core.controllers.melsec_pid import ACT_LIMITS, ACT_OUTPUT_ALARM, ACT_REVERSE, ACT_TUNE

Limit = tuple[str, Any]
"""Operand and what it holds."""

PID_TEMP_AUTOMATIC = 3


def delta_limits(inputs: Any) -> tuple[Limit, Limit] | None:
    """Return lower and upper limit of MV."""
    return ("MV_MIN", inputs.mv_min), ("MV_MAX", inputs.mv_max)


def delta_rises(inputs: Any) -> bool:
    """Tell whether MV rises while PV is below SV (spec ah500 §1.2: PID_DIR TRUE is E = SV - PV)."""
    return bool(inputs.pid_dir)


def delta_service(inputs: Any, seen: Mapping[str, Any]) -> tuple[str, ...]:
    """Return why the law does not move the output; nothing when it does."""
    found = []
    if not inputs.pid_run:
        found.append("PID_RUN is FALSE: MV is held at 0")
    if inputs.pid_mode == 1:
        found.append("PID_MODE is 1: auto-tuning")
    if inputs.pid_man:
        found.append("PID_MAN is TRUE: manual")
    return tuple(found)


def melsec_limits(inputs: Any) -> tuple[Limit, Limit] | None:
    """Return the output limits, None when ACT does not switch them on."""
    if not inputs.act & ACT_LIMITS or inputs.act & ACT_OUTPUT_ALARM:
        return None
    return ("S23", inputs.s23), ("S22", inputs.s22)


def melsec_rises(inputs: Any) -> bool:
    """Tell whether MV rises while PV is below SV: ACT bit 0, which the vendor calls reverse."""
    return bool(inputs.act & ACT_REVERSE)


def melsec_service(inputs: Any, seen: Mapping[str, Any]) -> tuple[str, ...]:
    """Return why the law does not move the output; nothing when it does."""
    found = [] if inputs.en else ["EN is off"]
    return (*found, "ACT bit 4 is on: auto-tuning") if inputs.act & ACT_TUNE else tuple(found)


def pid_reg_ce_limits(inputs: Any) -> tuple[Limit, Limit] | None:
    """Return the limit of Y on either side."""
    return ("Y_OGR", -inputs.y_ogr), ("Y_OGR", inputs.y_ogr)


def pid_reg_ce_rises(inputs: Any) -> bool:
    """Tell whether the valve opens while ACTUAL is below SET_POINT: ACTION FALSE, which the page calls direct."""
    return not inputs.action


def pid_reg_ce_service(inputs: Any, seen: Mapping[str, Any]) -> tuple[str, ...]:
    """Return why the law does not move the output; nothing when it does."""
    return () if inputs.reg_avt else ("REG_AVT is FALSE: manual",)


def pid_temp_limits(inputs: Any) -> tuple[Limit, Limit] | None:
    """Return the limits of PidOutputSum: of cooling below, where there is cooling."""
    low = "Cool_PidLowerLimit" if inputs.activatecooling else "Heat_PidLowerLimit"
    return (low, getattr(inputs, low.lower())), ("Heat_PidUpperLimit", inputs.heat_pidupperlimit)


def pid_temp_rises(inputs: Any) -> bool:
    """Tell whether the output rises while the process value is below the setpoint: it heats, always."""
    return True


def pid_temp_service(inputs: Any, seen: Mapping[str, Any]) -> tuple[str, ...]:
    """Return why the law does not move the output; nothing when it does."""
    state = int(seen.get("State", PID_TEMP_AUTOMATIC))
    return () if state == PID_TEMP_AUTOMATIC else (f"State is {state}, automatic is {PID_TEMP_AUTOMATIC}",)


def comes_back(inputs: Any, seen: Mapping[str, Any]) -> str:
    """Return nothing: out of manual the loop is where it was."""
    return ""


def pid_temp_comes_back(inputs: Any, seen: Mapping[str, Any]) -> str:
    """Return why the block would not be as found behind a manual time; empty when it would.

    Source:
        MANUAL the falling edge of ManualEnable takes Mode (spec controllers C).
    """
    state = int(seen.get("State", inputs.mode))
    if inputs.manualenable or state == inputs.mode:
        return ""
    return f"State is {state} but Mode is {inputs.mode}, which it takes when ManualEnable falls"
