"""Each controller's settings to the canonical set and back (spec 7.2), by the manual's names.

This file alone knows which operand of which block means what. It judges nothing: what is lost on the way stands in
`conversion`, by comparing the canonical set before with the one that the target's settings give back.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from difflib import get_close_matches
from enum import Enum

from ahgateway.core.controllers import dpid, dpide, melsec_pid, pid_reg_ce
from ahgateway.core.controllers import pid_temp_operands as pid_temp
from ahgateway.core.operands import Operand
from ahgateway.errors import ProfileError
from ahgateway.tuning.canonical import Band, Canonical, standard

Params = dict[str, float | int | bool]
Given = Mapping[str, float | int | bool]

INT_MIN, INT_MAX = -32768, 32767
WHOLE = ("MELSEC_PID", "PIDINIT")
"""Blocks of 16-bit registers, SV, PV and MV among them."""
PIDINIT_OFF = 30000
"""Times and derivative gains above it are infinite in the PIDINIT family (spec C.9)."""
PIDINIT_FAR = 32767


class Family(Enum):
    """Delta CPU families differ in what PID_DIR = TRUE means (spec B.5, polarity trap)."""

    AH500 = "ah500"
    AS = "as"


@dataclass(frozen=True, slots=True)
class Use:
    """How a block stands in its plant, where its settings do not say it.

    Attributes:
        family: CPU family of a Delta block.
        stroke_s: Full stroke time of the motor behind PID_REG_CE, None when Y is used as an analog output.
        dependent: Form of a DPIDE that is written; None takes the dependent one where there is one.
        travel: Typical |Y| in % in pulse use.
        process_gain: PV per % of stroke, 0 when not known; sizes D_ZONE in pulse use.
    """

    family: Family = Family.AH500
    stroke_s: float | None = None
    dependent: bool | None = None
    travel: float = 0.0
    process_gain: float = 0.0


@dataclass(frozen=True, slots=True)
class Block:
    """One controller as conversion sees it.

    Attributes:
        name: As in profiles and on the command line.
        defaults: Setting to its default; the names that are known.
        windup: What its integral does beyond a limit; blocks with one word agree there.
        read: Settings to canonical.
        write: Canonical to settings.
    """

    name: str
    defaults: Params
    windup: str
    read: Callable[[Params, Use], Canonical]
    write: Callable[[Canonical, Use], Params]

    def settings(self, given: Given, file: str = "") -> Params:
        """Return every setting, defaults filled in.

        Raises:
            ProfileError: A name that the block does not have, or a value that is no number.
        """
        known = {name.lower(): name for name in self.defaults}
        out = dict(self.defaults)
        for key, value in given.items():
            name = known.get(key.lower())
            if name is None:
                near = get_close_matches(key.lower(), known, 1)
                raise ProfileError(
                    f"{self.name} has no setting of that name, it has {', '.join(self.defaults)}",
                    file=file or None,
                    key=key,
                    hint=f"did you mean `{known[near[0]]}`?" if near else None,
                )
            if not isinstance(value, bool | int | float) or not math.isfinite(value):
                raise ProfileError(f"{value!r} is no number", file=file or None, key=key)
            out[name] = bool(value) if isinstance(self.defaults[name], bool) else value
            if type(self.defaults[name]) is int:
                self._whole(key, value, file)
        return out

    def _whole(self, key: str, value: float, file: str) -> None:
        low, high = (INT_MIN, INT_MAX) if self.name in WHOLE else (-(2**31), 2**31 - 1)
        if value != int(value) or not low <= value <= high:
            raise ProfileError(
                f"{value:g} does not fit its register, a whole number of {low}…{high}", file=file or None, key=key
            )


def _table(rows: tuple[Operand, ...], names: str) -> Params:
    """Defaults of these operands of a table."""
    by_name = {row.name: row for row in rows}
    out: Params = {}
    for name in names.split():
        default = by_name[name].default
        assert default is not None, name
        out[name] = default
    return out


def _positive(value: float) -> float:
    return value if value > 0.0 else 0.0


def _sign(is_set: bool | float, use: Use) -> int:
    return (1 if is_set else -1) * (-1 if use.family is Family.AS else 1)


def _direction(sign: int, use: Use) -> bool:
    return (sign > 0) != (use.family is Family.AS)


def _limits(one: float, other: float) -> tuple[float, float]:
    return min(one, other), max(one, other)


def _held(value: float, low: int, high: int) -> int:
    return int(min(max(math.floor(value + 0.5), low), high)) if math.isfinite(value) else high


def _far(value: float) -> float:
    """A limit as a REAL register can hold it."""
    return value if math.isfinite(value) else math.copysign(3.402823e38, value)


def read_dpid(p: Params, use: Use) -> Canonical:
    low, high = _limits(p["MV_MIN"], p["MV_MAX"])
    band = abs(p["ERR_DBW"])
    return Canonical(
        _positive(p["Kp"]), _positive(p["Ki"]), _positive(p["Kd"]), sign=_sign(p["PID_DIR"], use),
        ts_s=min(max(int(p["CYCLE"]), 1), dpid.CYCLE_MAX) / 100, umin=low, umax=high,
        band=band, band_kind=Band.PLAIN if band else Band.NONE,
    )  # fmt: skip


def write_dpid(c: Canonical, use: Use) -> Params:
    return {
        "PID_MODE": 0, "CYCLE": _held(c.ts_s * 100, 1, dpid.CYCLE_MAX), "Kp": c.kp, "Ki": c.ki, "Kd": c.kd,
        "PID_DIR": _direction(c.sign, use), "ERR_DBW": c.band, "MV_MAX": _far(c.umax), "MV_MIN": _far(c.umin),
    }  # fmt: skip


def read_dpide(p: Params, use: Use) -> Canonical:
    kc, ti_ki, td_kd = _positive(p["Kc_Kp"]), _positive(p["Ti_Ki"]), _positive(p["Td_Kd"])
    kp, ki, kd = kc, ti_ki, td_kd
    if p["PID_EQ"]:
        ki, kd = (kc / ti_ki if ti_ki else 0.0), kc * td_kd
    low, high = _limits(p["MV_MIN"], p["MV_MAX"])
    band = abs(p["ERR_DBW"])
    return Canonical(
        kp, ki, kd, _positive(p["Tf"]), c=0.0 if p["PID_DE"] else 1.0, sign=_sign(p["PID_DIR"], use),
        ts_s=min(max(int(p["CYCLE"]), 1), dpide.CYCLE_MAX) / 1000, umin=low, umax=high, bias=p["BIAS"],
        band=band, band_kind=Band.ZERO_CROSS if band else Band.NONE,
    )  # fmt: skip


def write_dpide(c: Canonical, use: Use) -> Params:
    # The dependent form has nothing where Kc is 0.
    dependent = c.kp > 0.0 and use.dependent is not False
    ti = c.ti_s if math.isfinite(c.ti_s) else 0.0
    return {
        "PID_MODE": 0, "CYCLE": _held(c.ts_s * 1000, 1, dpide.CYCLE_MAX), "Kc_Kp": c.kp,
        "Ti_Ki": ti if dependent else c.ki, "Td_Kd": c.td_s if dependent else c.kd, "Tf": c.tf_s,
        "PID_EQ": dependent, "PID_DE": c.c < 0.5, "PID_DIR": _direction(c.sign, use), "ERR_DBW": c.band,
        "MV_MAX": _far(c.umax), "MV_MIN": _far(c.umin), "BIAS": c.bias,
    }  # fmt: skip


def _alpha_to_s(alpha: float, ts_s: float) -> float:
    share = min(max(alpha, 0.0), 99.0) / 100
    return ts_s * share / (1.0 - share)


def _s_to_alpha(tau_s: float, ts_s: float) -> int:
    return _held(100 * tau_s / (tau_s + ts_s), 0, 99)


def read_melsec(p: Params, use: Use) -> Canonical:
    act = int(p["ACT"])
    limited = bool(act & 0x20) and not act & 0x04
    low, high = _limits(p["S23"], p["S22"]) if limited else (INT_MIN, INT_MAX)
    ts, td = p["TS"] / 1000, p["TD"] / 100
    return standard(
        p["KP"] / 100, p["TI"] / 10 if p["TI"] > 0 else math.inf, td, tf_s=p["KD"] / 100 * td, c=0.0,
        sign=1 if act & 1 else -1, ts_s=ts, umin=low, umax=high, tau_pv_s=_alpha_to_s(p["ALPHA"], ts),
    )  # fmt: skip


def write_melsec(c: Canonical, use: Use) -> Params:
    limited = c.umin > INT_MIN or c.umax < INT_MAX
    ts = _held(c.ts_s * 1000, 1, INT_MAX)
    act = (1 if c.sign > 0 else 0) | (0x20 if limited else 0)
    # A time that rounds to 0 would switch its branch off.
    return {
        "TS": ts, "ACT": act, "ALPHA": _s_to_alpha(c.tau_pv_s, ts / 1000),
        "KP": _held(100 * c.kp, 0, INT_MAX), "TI": _held(10 * c.ti_s, 1, INT_MAX) if c.ki > 0.0 else 0,
        "KD": _held(100 * c.tf_s / c.td_s, 0, 100) if c.td_s > 0.0 else 0,
        "TD": _held(100 * c.td_s, 1, INT_MAX) if c.td_s > 0.0 else 0,
        "S22": _held(c.umax, INT_MIN, INT_MAX) if limited else 0,
        "S23": _held(c.umin, INT_MIN, INT_MAX) if limited else 0,
    }  # fmt: skip


def read_pidinit(p: Params, use: Use) -> Canonical:
    ts, td = p["TS"] / 100, p["TD"] / 100
    tf = td / (p["KD"] / 100) if 0 < p["KD"] <= PIDINIT_OFF else 0.0
    return standard(
        p["KP"] / 100, p["TI"] / 10 if 0 < p["TI"] <= PIDINIT_OFF else math.inf, td, tf_s=tf, c=0.0,
        sign=1 if p["DIR"] else -1, ts_s=ts, umin=p["MVLL"], umax=p["MVHL"], tau_pv_s=_alpha_to_s(p["ALPHA"], ts),
    )  # fmt: skip


def write_pidinit(c: Canonical, use: Use) -> Params:
    ts = _held(c.ts_s * 100, 1, 6000)
    return {
        "DIR": 1 if c.sign > 0 else 0, "TS": ts, "KP": _held(100 * c.kp, 0, 10000),
        "TI": _held(10 * c.ti_s, 1, PIDINIT_OFF) if c.ki > 0.0 else PIDINIT_FAR,
        "TD": _held(100 * c.td_s, 0, PIDINIT_OFF), "ALPHA": _s_to_alpha(c.tau_pv_s, ts / 100),
        "MVLL": _held(c.umin, -50, 2050), "MVHL": _held(c.umax, -50, 2050), "DMVL": 2050, "DPVL": 2050,
        "KD": _held(100 * c.td_s / c.tf_s, 1, PIDINIT_OFF) if c.td_s > 0.0 and c.tf_s > 0.0 else
        (PIDINIT_FAR if c.td_s > 0.0 else 800),
    }  # fmt: skip


def read_pid_temp(p: Params, use: Use) -> Canonical:
    cooling = bool(p["ActivateCooling"])
    band = _positive(p["Heat_DeadZone"])
    low = p["Cool_PidLowerLimit"] if cooling else p["Heat_PidLowerLimit"]
    td = _positive(p["Heat_Td"])
    return standard(
        _positive(p["Heat_Gain"]), p["Heat_Ti"] if p["Heat_Ti"] > 0.0 else math.inf, td,
        tf_s=_positive(p["Heat_TdFiltRatio"]) * td, b=p["Heat_PWeighting"], c=p["Heat_DWeighting"],
        ts_s=p["Heat_Cycle"], umin=low, umax=p["Heat_PidUpperLimit"], bias=p["Disturbance"], band=band,
        kind=Band.SHIFTED,
    )  # fmt: skip


def write_pid_temp(c: Canonical, use: Use) -> Params:
    ti = min(c.ti_s, 100000.0) if math.isfinite(c.ti_s) else 0.0
    return {
        "Heat_Gain": c.kp, "Heat_Ti": ti, "Heat_Td": min(c.td_s, 100000.0),
        "Heat_TdFiltRatio": c.tf_s / c.td_s if c.td_s > 0.0 else 0.2, "Heat_PWeighting": min(max(c.b, 0.0), 1.0),
        "Heat_DWeighting": min(max(c.c, 0.0), 1.0), "Heat_Cycle": c.ts_s, "CycleTime_Value": c.ts_s,
        "Heat_DeadZone": c.band, "Heat_PidUpperLimit": _far(c.umax), "Heat_PidLowerLimit": _far(c.umin),
        "Disturbance": c.bias, "ActivateCooling": False,
    }  # fmt: skip


def read_pulse(p: Params, use: Use) -> Canonical:
    band = _positive(p["D_ZONE"])
    sign = -1 if p["ACTION"] else 1
    kind = Band.ZONE if band else Band.NONE
    if use.stroke_s is None:
        limit = min(max(p["Y_OGR"], 0.0), 100.0)
        tn = p["TN"] if p["TN"] > 0.0 else math.inf
        found = standard(_positive(p["KP"]), tn, _positive(p["TV"]), umin=-limit, umax=limit)
        return replace(found, sign=sign, ts_s=p["DT"], band=band, band_kind=kind)
    period = p["T_PERIOD"]
    gain = _positive(p["KP"]) * period / use.stroke_s
    found = standard(gain, period * (1.0 + use.travel / 100), _positive(p["TV"]), umin=0.0, umax=100.0)
    return replace(found, sign=sign, ts_s=p["DT"], band=band, band_kind=kind)


def write_pulse(c: Canonical, use: Use) -> Params:
    ti = c.ti_s if math.isfinite(c.ti_s) else 0.0
    out: Params = {
        "KP": c.kp, "TN": ti, "TV": c.td_s, "D_ZONE": c.band, "ACTION": c.sign < 0, "DT": c.ts_s,
        "Y_OGR": min(100.0, max(abs(c.umin), abs(c.umax))),
    }  # fmt: skip
    if use.stroke_s is None:
        return out
    period = ti / (1.0 + use.travel / 100) if ti else float(pid_reg_ce.Operands().t_period)
    shortest = 0.01 * use.stroke_s
    return out | {
        "T_PERIOD": period, "KP": c.kp * use.stroke_s / period, "PT_MIN_IMP": shortest,
        "DT": min(c.ts_s, shortest / 5.0), "Y_OGR": min(100.0, c.umax - c.umin),
        # One minimum pulse moves 1 % of the stroke.
        "D_ZONE": max(c.band, 0.5 * abs(use.process_gain)),
    }  # fmt: skip


BLOCKS: dict[str, Block] = {
    block.name: block
    for block in (
        Block(
            "DPID",
            _table(dpid.OPERANDS, "PID_MODE CYCLE Kp Ki Kd PID_DIR ERR_DBW MV_MAX MV_MIN"),
            "freezes in both directions",
            read_dpid,
            write_dpid,
        ),
        Block(
            "DPIDE",
            _table(
                dpide.OPERANDS,
                "PID_MODE CYCLE Kc_Kp Ti_Ki Td_Kd Tf PID_EQ PID_DE PID_DIR ERR_DBW MV_MAX MV_MIN BIAS",
            ),
            "freezes in both directions",
            read_dpide,
            write_dpide,
        ),
        Block(
            "MELSEC_PID",
            _table(melsec_pid.OPERANDS, "TS ACT ALPHA KP TI KD TD S22 S23"),
            "sums the limited MV",
            read_melsec,
            write_melsec,
        ),
        Block(
            "PIDINIT",
            {
                "DIR": 1, "TS": 100, "KP": 100, "TI": PIDINIT_FAR, "TD": 0, "ALPHA": 0, "MVLL": 0, "MVHL": 2000,
                "DMVL": 2050, "DPVL": 2050, "KD": 800,
            },
            "sums the limited MV",
            read_pidinit,
            write_pidinit,
        ),
        Block(
            "PID_Temp",
            _table(
                pid_temp.OPERANDS,
                "Heat_Gain Heat_Ti Heat_Td Heat_TdFiltRatio Heat_PWeighting Heat_DWeighting Heat_Cycle "
                "CycleTime_Value Heat_DeadZone Heat_ControlZone Heat_PidUpperLimit Heat_PidLowerLimit "
                "Cool_PidLowerLimit Disturbance ActivateCooling AdvancedCooling CoolFactor Mode",
            ),
            "stops only outward",
            read_pid_temp,
            write_pid_temp,
        ),
        Block(
            "PID_REG_CE",
            _table(pid_reg_ce.OPERANDS, "D_ZONE KP TN TV PT_MIN_IMP PT_LUFT Y_OGR ACTION T_PERIOD DT"),
            "has no integral beyond one series",
            read_pulse,
            write_pulse,
        ),
    )
}  # fmt: skip
"""By name; MELSEC_PID is the iQ-R/FX PID instruction, PIDINIT the S(P).PIDINIT family."""
