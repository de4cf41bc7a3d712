"""The controllers, each as one `Controller`: a table of operands, a pure step, and what of its state can be seen."""

from __future__ import annotations

from ahgateway.core.controllers import (
    begins,
    begins_temp,
    dpid,
    dpide,
    looks,
    melsec_dialect,
    melsec_pid,
    pid_reg_ce,
    pid_reg_ce_dialect,
    pid_temp,
    pid_temp_dialect,
)
from ahgateway.core.controllers.controller import Controller, Roles, Seen, replaced
from ahgateway.core.operands import Access, Kind

__all__ = [
    "CONTROLLERS",
    "DPID",
    "DPIDE",
    "MELSEC_PID",
    "PID_REG_CE",
    "PID_TEMP",
    "Controller",
    "Roles",
    "Seen",
    "replaced",
]

DPID = Controller(
    "DPID",
    dpid.OPERANDS,
    (
        Seen("I_MV+1", "I_MV", 1, "pv1"),
        Seen("I_MV", "I_MV", 0, "i"),
        Seen("MV", "MV", 0, "mv"),
        Seen("MOUT", "MOUT", 0, "mout"),
    ),
    dpid.Operands,
    dpid.State,
    dpid.Terms,
    dpid.step,
    dpid.nominal_ts,
    dpid.recall,
    dpid.law_ts,
    pv_dword=1,
)

DPIDE = Controller(
    "DPIDE",
    dpide.OPERANDS,
    (
        Seen("I_MV+6", "I_MV", 6, "pv1"),
        Seen("I_MV", "I_MV", 0, "i"),
        Seen("MV", "MV", 0, "mv"),
        Seen("MOUT", "MOUT", 0, "mout"),
    ),
    dpide.Operands,
    dpide.State,
    dpide.Terms,
    dpide.step,
    dpide.nominal_ts,
    dpide.recall,
    dpide.law_ts,
    pv_dword=6,
)

MELSEC_PID = Controller(
    "MELSEC_PID",
    melsec_pid.OPERANDS,
    (
        Seen("MV", "MV", 0, "out", Kind.INT, ""),
        Seen("S24", "S24", 0, "alarm", Kind.INT, ""),
    ),
    melsec_pid.Operands,
    melsec_pid.State,
    melsec_pid.Terms,
    melsec_pid.step,
    melsec_pid.nominal_ts,
    melsec_pid.recall,
    dialect=melsec_dialect.DEFAULT,
    axes=melsec_dialect.AXES,
    roles=Roles(
        integral="",
        computed=("MV",),
        writable=frozenset(),
        starts="known from the moment its contact EN is seen off, at once where filter and derivative are off",
        place="MV",
        modes=("EN",),
        manual="",
        mout="",
        follows="",
        gains=("KP", "TI", "KD", "TD"),
        dead_band="",
        together=(frozenset({"KP", "TI", "KD", "TD"}), frozenset({"S22", "S23"})),
    ),
    limits=looks.melsec_limits,
    rises=looks.melsec_rises,
    service=looks.melsec_service,
    computes=begins.melsec_computes,
    tunes=begins.melsec_tunes,
    begin=begins.melsec,
    rejoin=begins.melsec_rejoin,
)

PID_REG_CE = Controller(
    "PID_REG_CE",
    pid_reg_ce.OPERANDS,
    (
        Seen("ERROR", "ERROR", 0, "error", place=""),
        Seen("Y", "Y", 0, "y", place=""),
        Seen("OPEN_OUT", "OPEN_OUT", 0, "open_out", Kind.BOOL, ""),
        Seen("CLOSE_OUT", "CLOSE_OUT", 0, "close_out", Kind.BOOL, ""),
        Seen("OSTANOV", "OSTANOV", 0, "ostanov", Kind.BOOL, ""),
    ),
    pid_reg_ce.Operands,
    pid_reg_ce.State,
    pid_reg_ce.Terms,
    pid_reg_ce.step,
    pid_reg_ce.nominal_ts,
    pid_reg_ce.recall,
    dialect=pid_reg_ce_dialect.DEFAULT,
    axes=pid_reg_ce_dialect.AXES,
    numbers=pid_reg_ce_dialect.RATIO_AXES,
    roles=Roles(
        sv="SET_POINT",
        pvs=("ACTUAL",),
        mv="Y",
        integral="",
        computed=("Y", "OPEN_OUT", "CLOSE_OUT"),
        writable=frozenset(),
        held=True,
        starts="known from the moment OSTANOV is seen on: between two series, or in manual",
        place="Y",
        modes=("REG_AVT", "IN_OPEN_R", "IN_CLOSE_R"),
        manual="REG_AVT",
        is_manual_when=False,
        mout="",
        follows="",
        gains=("KP", "TN", "TV"),
        dead_band="D_ZONE",
        signals=("CONC_OPEN", "CONC_CLOSE"),
        together=(frozenset({"KP", "TN", "TV"}),),
    ),
    limits=looks.pid_reg_ce_limits,
    rises=looks.pid_reg_ce_rises,
    service=looks.pid_reg_ce_service,
    computes=begins.always,
    tunes=begins.never,
    begin=begins.pid_reg_ce_start,
    used=begins.pid_reg_ce_used,
)

_TEMP_PLACES = {"IntegralSum": "core.i", "PidOutputSum": "core.y"}
_TEMP_FIRST = {"ScaledInput": 0, "IntegralSum": 1, "PidOutputSum": 2}

PID_TEMP = Controller(
    "PID_Temp",
    pid_temp.OPERANDS,
    tuple(
        Seen(
            row.name,
            row.name,
            0,
            {"IntegralSum": "i"}.get(row.name, row.attr),
            row.kind,
            _TEMP_PLACES.get(row.name, ""),
        )
        for row in sorted(pid_temp.OPERANDS, key=lambda row: _TEMP_FIRST.get(row.name, len(_TEMP_FIRST)))
        if row.access is Access.OUT or row.name == "IntegralSum"
    ),
    pid_temp.Operands,
    pid_temp.State,
    pid_temp.Terms,
    pid_temp.step,
    pid_temp.nominal_ts,
    pid_temp.recall,
    dialect=pid_temp_dialect.DEFAULT,
    axes=pid_temp_dialect.AXES,
    roles=Roles(
        sv="Setpoint",
        pvs=("Input", "Input_PER"),
        mv="PidOutputSum",
        integral="IntegralSum",
        computed=("IntegralSum", "PidOutputSum", "OutputHeat_PWM", "OutputCool_PWM"),
        writable=frozenset({"IntegralSum"}),
        held=True,
        published_pv="ScaledInput",
        starts="known from State 0 or manual on, or from an execution of the law; pulses from State 0 on",
        place="PidOutputSum",
        modes=("Mode", "ModeActivate", "Reset", "ManualEnable"),
        manual="ManualEnable",
        mout="ManualValue",
        follows="",
        gains=tuple(f"{side}_{name}" for side in ("Heat", "Cool") for name in ("Gain", "Ti", "Td")),
        dead_band="Heat_DeadZone",
        together=tuple(
            frozenset(f"{side}_{name}" for name in names)
            for side in ("Heat", "Cool")
            for names in (("Gain", "Ti", "Td", "TdFiltRatio"), ("PidUpperLimit", "PidLowerLimit"))
        ),
    ),
    limits=looks.pid_temp_limits,
    rises=looks.pid_temp_rises,
    service=looks.pid_temp_service,
    comes_back=looks.pid_temp_comes_back,
    computes=begins.always,
    tunes=begins_temp.tunes,
    begin=begins_temp.start,
    used=begins_temp.used,
    veiled=begins_temp.veiled,
    veil=begins_temp.veil,
)

CONTROLLERS: dict[str, Controller] = {
    controller.name: controller for controller in (DPID, DPIDE, MELSEC_PID, PID_REG_CE, PID_TEMP)
}
