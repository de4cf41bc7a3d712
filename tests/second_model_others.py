"""MELSEC PID, PID_REG_CE and PID_Temp a second time: Python doubles, rounded to binary32 after every operation.

Written from spec controllers C, D and E alone, as mutable blocks, in the default readings, so that it shares nothing
with the laws in the package but the paper.
"""

from __future__ import annotations

import math
from typing import Any

from second_model import add, div, mul, sub, usable


def clamp(low: float, x: float, high: float) -> float:
    return min(max(x, low), high)


def word(x: float) -> float:
    return clamp(-32768.0, x, 32767.0)


class Melsec:
    """Spec C.2 to C.6; `valid` is FALSE until the first execution after the contact turned on."""

    def __init__(self, mv: float) -> None:
        self.mv, self.valid = mv, False
        self.ev1 = self.pvf1 = self.pvf2 = self.d = 0.0

    def execute(self, op: dict[str, Any]) -> dict[str, Any]:
        code = self.refused(op)
        if code:
            return {"mv": self.mv, "error": code, "alarm": 0}
        reverse = op["ACT"] & 1
        ts = div(float(max(op["TS"], op["SCAN"])), 1000.0)
        alpha, kp, kd = (div(float(op[name]), 100.0) for name in ("ALPHA", "KP", "KD"))
        ti, td = div(float(op["TI"]), 10.0), div(float(op["TD"]), 100.0)
        pv, sv = op["PV"], op["SV"]
        pvf = add(pv, mul(alpha, sub(self.pvf1, pv))) if self.valid else pv
        ev = word(sub(sv, pvf) if reverse else sub(pvf, sv))
        first = not self.valid
        if first:
            self.ev1, self.pvf1, self.pvf2, self.d = ev, pv, pv, 0.0
        self.d = self.difference(pvf, ts, kd, td, -1.0 if reverse else 1.0) if td > 0 else 0.0
        i = word(mul(div(ts, ti), ev)) if ti > 0 else 0.0
        before = self.mv
        self.mv = add(self.mv, mul(kp, add(add(sub(ev, self.ev1), i), self.d)))
        if op["ACT"] & 32 and not op["ACT"] & 4:
            low, high = sorted((float(op["S22"]), float(op["S23"])))
            self.mv = clamp(low, self.mv, high)
        self.mv = word(self.mv)
        alarm = 0 if first else self.alarms(op, sub(pvf, self.pvf1), sub(self.mv, before))
        self.ev1, self.pvf2, self.pvf1, self.valid = ev, self.pvf1, pvf, True
        return {"mv": self.mv, "error": 0x11A6 if op["TS"] <= op["SCAN"] else 0, "alarm": alarm}

    def refused(self, op: dict[str, Any]) -> int:
        bad = (
            op["TS"] <= 0, not 0 <= op["ALPHA"] < 100, op["KP"] < 0, op["TI"] < 0, not 0 <= op["KD"] < 201,
            op["TD"] < 0,
        )  # fmt: skip
        return next((0x11A0 + number for number, is_bad in enumerate(bad) if is_bad), 0)

    def difference(self, pvf: float, ts: float, kd: float, td: float, sign: float) -> float:
        den = add(ts, mul(kd, td))
        second = add(add(mul(-sign * 2.0, self.pvf1), sign * pvf), sign * self.pvf2)
        return word(add(mul(div(td, den), second), mul(div(mul(kd, td), den), self.d)))

    def alarms(self, op: dict[str, Any], moved: float, driven: float) -> int:
        watched = []
        if op["ACT"] & 2:
            watched += [(moved, op["S20"], 1), (-moved, op["S21"], 2)]
        if op["ACT"] & 4 and not op["ACT"] & 32:
            watched += [(driven, op["S22"], 4), (-driven, op["S23"], 8)]
        return sum(bit for change, most, bit in watched if most >= 0 and change > most)


class Pulses:
    """Spec D.3 to D.6."""

    def __init__(self) -> None:
        self.phase, self.counter, self.sgn, self.direction, self.last = "IDLE", 0, 0, 0, 0
        self.T1 = self.I = self.Y = 0.0
        self.e1: float | None = None

    def idle(self) -> None:
        self.phase, self.I, self.Y = "IDLE", 0.0, 0.0

    def execute(self, op: dict[str, Any]) -> dict[str, Any]:
        error = sub(op["SET_POINT"], op["ACTUAL"])
        e = -error if op["ACTION"] else error
        if not usable(error):
            self.idle()
            return self.result(error, False, False, True)
        before = e if self.e1 is None else self.e1
        self.e1 = e
        if op["T_PERIOD"] <= 0 or op["PT_MIN_IMP"] <= 0:
            self.idle()
            return self.result(error, False, False, True)
        if not op["REG_AVT"]:
            self.idle()
            opens = op["IN_OPEN_R"] and not op["IN_CLOSE_R"] and op["CONC_OPEN"]
            closes = op["IN_CLOSE_R"] and not op["IN_OPEN_R"] and op["CONC_CLOSE"]
            self.last = 1 if opens else -1 if closes else self.last
            return self.result(error, opens, closes, True)
        self.series(op, e, before)
        running = self.phase == "PULSE"
        allowed = op["CONC_OPEN"] if self.direction > 0 else op["CONC_CLOSE"]
        self.counter -= 1
        if running and not allowed:
            self.phase, running = "IDLE", False
        if running:
            self.last = self.direction
        moves = self.direction if running else 0
        return self.result(error, moves > 0, moves < 0, self.phase == "IDLE")

    def result(self, error: float, opens: bool, closes: bool, stopped: bool) -> dict[str, Any]:
        return {"error": error, "y": self.Y, "open_out": opens, "close_out": closes, "ostanov": stopped}

    def series(self, op: dict[str, Any], e: float, before: float) -> None:
        actual, sp, zone, dt = op["ACTUAL"], op["SET_POINT"], op["D_ZONE"], op["dt"]
        inside = sub(sp, zone) < actual < add(sp, zone)
        sg = 0 if inside else (e > 0) - (e < 0)
        if sg == 0 and self.phase != "PULSE":
            self.idle()
        if sg != 0:
            if self.phase != "IDLE" and sg != self.sgn:
                self.idle()
            self.I = 0.0 if self.phase == "IDLE" else self.I
            if op["TN"] > 0:
                self.I = add(self.I, div(mul(e, dt), op["TN"]))
            slope = div(mul(op["TV"], sub(e, before)), dt) if op["TV"] > 0 else 0.0
            top = clamp(0.0, op["Y_OGR"], 100.0)
            self.Y = clamp(-top, mul(max(op["KP"], 0.0), add(add(e, self.I), slope)), top)
        if self.phase != "IDLE" and self.counter <= 0:
            if sg == 0:
                self.idle()
            elif self.phase == "PAUSE":
                self.phase, self.counter = "PULSE", self.ticks(op["PT_MIN_IMP"], dt)
            else:
                pause = mul(div(op["PT_MIN_IMP"], self.T1), op["T_PERIOD"])
                self.phase, self.counter = "PAUSE", self.ticks(pause, dt)
        ways = {1: op["CONC_OPEN"], -1: op["CONC_CLOSE"], 0: False}
        direction = (self.Y > 0) - (self.Y < 0)
        if self.phase == "IDLE" and sg != 0 and ways[direction]:
            self.phase, self.sgn, self.direction = "PULSE", sg, direction
            self.T1 = mul(div(op["T_PERIOD"], 100.0), abs(self.Y))
            first = max(self.T1, op["PT_MIN_IMP"])
            if self.last not in (0, direction):
                first = add(first, op["PT_LUFT"])
            self.counter = self.ticks(first, dt)

    def ticks(self, t: float, dt: float) -> int:
        return max(1, math.floor(add(div(t, dt), 0.5)))


class Temp:
    """Spec E.3 to E.7 with the law in every call; modes are set, not edged."""

    def __init__(self) -> None:
        self.state, self.y, self.I, self.d, self.u1 = 0, 0.0, 0.0, 0.0, 0.0
        self.cooling, self.valid = False, False
        self.bits = 0

    def execute(self, op: dict[str, Any], mode: int | None) -> dict[str, Any]:
        came_from = self.state
        wanted = self.state if mode is None else mode
        if wanted == 3 and came_from == 5:
            wanted = 5
        pending, warning = 0, 0
        w, x = op["Setpoint"], op["Input"]
        if not usable(x):
            pending |= 0x200
        elif x > op["InputUpperLimit"] or x < op["InputLowerLimit"]:
            pending |= 0x1
        if usable(x) and not op["InputLowerWarning"] <= x <= op["InputUpperWarning"]:
            warning |= 0x40
        if not usable(w):
            pending |= 0x1000
        else:
            w = clamp(op["SetpointLowerLimit"], w, op["SetpointUpperLimit"])
            warning |= 4 if w != op["Setpoint"] else 0
        dist = op["Disturbance"]
        if wanted == 4 and not usable(op["ManualValue"]):
            pending |= 0x10000
        if wanted in (3, 5) and not usable(dist):
            pending |= 0x40000
            dist = 0.0
        low, high = self.span(op)
        if wanted == 0 or (pending and not op["ActivateRecoverMode"]):
            self.rest(0, 0.0)
            self.cooling = False
        elif wanted == 4:
            manual = op["ManualValue"]
            if usable(manual):
                y = clamp(low, manual, high)
                warning |= 0x100 if y != manual else 0
                self.rest(4, y)
            else:
                warning |= self.substitute(op, 4)
        elif pending & 0x1200:
            warning |= self.substitute(op, 5) if op["SetSubstituteOutput"] else self.rest(5, self.y)
        else:
            entry = "start" if came_from == 0 else "transfer" if came_from in (4, 5) else ""
            self.state = 3
            if not self.law(op, w, x, dist, entry):
                warning |= 0x40000
        self.bits |= pending
        out = {"pidoutputsum": self.y, "i": self.I, "state": self.state, "errorbits": self.bits, "warning": warning}
        return out | self.outputs(op)

    def rest(self, state: int, y: float) -> int:
        self.state, self.y, self.d, self.valid = state, y, 0.0, False
        return 0

    def substitute(self, op: dict[str, Any], state: int) -> int:
        low, high = self.span(op)
        y = clamp(low, op["SubstituteOutput"], high)
        self.rest(state, y)
        return 0x1000 if y != op["SubstituteOutput"] else 0

    def span(self, op: dict[str, Any]) -> tuple[float, float]:
        low = op["Cool_PidLowerLimit"] if op["ActivateCooling"] else op["Heat_PidLowerLimit"]
        return low, op["Heat_PidUpperLimit"]

    def law(self, op: dict[str, Any], w: float, x: float, dist: float, entry: str) -> bool:
        e = sub(w, x)
        two = op["ActivateCooling"] and op["AdvancedCooling"]
        factor = op["CoolFactor"] if op["ActivateCooling"] and not op["AdvancedCooling"] else 1.0
        was = self.cooling
        if not two or (was and self.y >= 0 and e > 0):
            self.cooling = False
        elif not was and self.y <= 0 and e < 0:
            self.cooling = True
        side = "Cool_" if self.cooling else "Heat_"
        kp, ti, td, a, b, c, ts = (
            op[side + name] for name in ("Gain", "Ti", "Td", "TdFiltRatio", "PWeighting", "DWeighting", "Cycle")
        )
        if op["Heat_Gain"] <= 0 or (two and op["Cool_Gain"] <= 0) or factor <= 0:
            self.y, self.d, self.valid = 0.0, 0.0, False
            return False
        zone = op["Cool_DeadZone" if two and e < 0 else "Heat_DeadZone"]
        ez = 0.0 if abs(e) <= zone else sub(e, zone) if e > 0 else add(e, zone)
        u = sub(ez, mul(sub(1.0, c), w))
        preset = (was != self.cooling and not entry) or entry == "transfer"
        if not self.valid or (was != self.cooling and not entry):
            self.d, self.u1 = 0.0, u
        lag = mul(a, td)
        self.d = div(add(mul(lag, self.d), mul(mul(kp, td), sub(u, self.u1))), add(lag, ts)) if td > 0 else 0.0
        self.u1, self.valid = u, True
        p = mul(kp, sub(ez, mul(sub(1.0, b), w)))
        held, start_y = self.I, self.y
        if ti <= 0:
            self.I = held = 0.0
            preset = False
        elif entry == "start":
            reset = op["IntegralResetMode"]
            self.I = {1: 0.0, 4: mul(mul(kp, sub(1.0, b)), x)}.get(reset, self.I)
            start_y = {0: 0.0, 3: op["OverwriteInitialOutputValue"]}.get(reset, 0.0)
            preset = reset in (0, 3)
        if preset:
            yl = div(start_y, factor) if start_y < 0 and factor != 1.0 else start_y
            self.I = sub(sub(sub(yl, p), self.d), dist)
        low, high = self.span(op)
        above_zone = op["Cool_ControlZone" if two else "Heat_ControlZone"]
        if x < sub(w, op["Heat_ControlZone"]) or x > add(w, above_zone):
            self.y = high if x < w else low
            self.I = held if preset and entry != "start" else self.I
        elif preset:
            self.y = clamp(low, start_y, high)
        else:
            inc = mul(div(mul(kp, ts), ti), ez) if ti > 0 else 0.0
            raw = add(add(add(p, add(self.I, inc)), self.d), dist)
            raw = mul(raw, factor) if raw < 0 else raw
            if not ((raw > high and inc > 0) or (raw < low and inc < 0)):
                self.I = add(self.I, inc)
            self.y = clamp(low, raw, high)
        return True

    def outputs(self, op: dict[str, Any]) -> dict[str, Any]:
        cools = op["ActivateCooling"]
        zero = {"outputheat": 0.0, "outputcool": 0.0, "outputheat_per": 0, "outputheat_pwm": False}
        if self.state == 0:
            return zero
        begin = 0.0 if cools else op["Heat_PidLowerLimit"]
        end = op["Heat_PidUpperLimit"]

        def heat(low: float, high: float) -> float:
            yh = clamp(begin, self.y, end)
            return add(low, div(mul(sub(yh, begin), sub(high, low)), sub(end, begin)))

        out = zero | {"outputheat": heat(op["Heat_LowerScaling"], op["Heat_UpperScaling"])}
        if cools:
            yc = clamp(op["Cool_PidLowerLimit"], self.y, 0.0)
            width = sub(op["Cool_UpperScaling"], op["Cool_LowerScaling"])
            out["outputcool"] = add(op["Cool_LowerScaling"], div(mul(yc, width), op["Cool_PidLowerLimit"]))
        if op["Heat_Select"] == 2:
            out["outputheat_per"] = round(heat(op["Heat_PerLowerScaling"], op["Heat_PerUpperScaling"]))
        return out
