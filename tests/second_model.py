"""DPID and DPIDE a second time, in another technique: Python doubles, rounded to binary32 after every operation.

Written from spec controllers A.3 and B.3 alone, as a mutable block in the manual's names, so that it shares nothing
with the laws in the package but the paper. Rounding a double result to binary32 equals one binary32 operation for
+ - x and / because 53 bits are more than twice 24 and two.
"""

from __future__ import annotations

import math
import struct
from typing import Any


def single(x: float) -> float:
    """Round to the nearest binary32, ties to even; beyond the largest lies infinity."""
    try:
        rounded: float = struct.unpack("<f", struct.pack("<f", x))[0]
    except OverflowError:
        return math.copysign(math.inf, x)
    return rounded


def add(a: float, b: float) -> float:
    return single(a + b)


def sub(a: float, b: float) -> float:
    return single(a - b)


def mul(a: float, b: float) -> float:
    return single(a * b)


def div(a: float, b: float) -> float:
    return single(a / b)


def usable(*values: float) -> bool:
    return all(math.isfinite(value) for value in values)


class Block:
    """One instance of either instruction, with its memory."""

    def __init__(self, *, extended: bool, directional: bool = False, clear_on_stop: bool = False) -> None:
        self.extended = extended
        self.directional = directional
        self.clear_on_stop = clear_on_stop
        self.I = self.E1 = self.Er1 = self.PV1 = self.MV = self.d = 0.0
        self.cross = self.man1 = self.valid = False

    def execute(self, **given: Any) -> dict[str, float]:
        """Run once; REAL operands as doubles that hold binary32 values. Returns MV, I and MOUT."""
        op = {name.upper(): value for name, value in given.items()}
        if not op["PID_RUN"]:
            self.MV, self.valid, self.d, self.cross = 0.0, False, 0.0, False
            self.I = 0.0 if self.clear_on_stop else self.I
            return self.result(op["MOUT"])
        er = sub(op["SV"], op["PV"]) if op["PID_DIR"] else sub(op["PV"], op["SV"])
        inputs = [er, op.get("BIAS", 0.0)] + ([op["MOUT"]] if op["PID_MAN"] else [])
        if op["PID_MODE"] == 1 or not usable(*inputs):
            return self.result(op["MOUT"])
        before = dict(vars(self))
        if not self.valid:
            self.Er1 = er
        error = self.dead_band(er, op["ERR_DBW"])
        if not self.valid:
            self.E1, self.PV1 = error, op["PV"]
        if not self.decide(op, error):
            vars(self).update(before)
            return self.result(op["MOUT"])
        self.E1, self.Er1, self.PV1, self.valid = error, er, op["PV"], True
        if not usable(self.d):
            self.d = 0.0
        self.man1 = bool(op["PID_MAN"])
        return self.result(self.MV if op["MOUT_AUTO"] and not op["PID_MAN"] else op["MOUT"])

    def result(self, mout: float) -> dict[str, float]:
        return {"mv": self.MV, "i": self.I, "mout": mout}

    def dead_band(self, er: float, width: float) -> float:
        """Return E; DPIDE's depends on whether PV has passed SV since it entered."""
        if not self.extended:
            return 0.0 if width != 0 and abs(er) <= abs(width) else er
        sign = (er > 0) - (er < 0)
        last = (self.Er1 > 0) - (self.Er1 < 0)
        if width == 0 or not abs(er) < abs(width):
            self.cross = False
        elif er == 0 or sign != last:
            self.cross = True
        return 0.0 if self.cross else er

    def decide(self, op: dict[str, Any], error: float) -> bool:
        """Set MV and I; False when the sum is no number and nothing may change."""
        names = ("KC_KP", "TI_KI", "TD_KD", "TF") if self.extended else ("KP", "KI", "KD")
        kp, ki, kd, *tf = (op[name] if usable(op[name]) and op[name] > 0 else 0.0 for name in names)
        low, high = min(op["MV_MIN"], op["MV_MAX"]), max(op["MV_MIN"], op["MV_MAX"])
        dependent = self.extended and op["PID_EQ"]
        ts = self.sampling_time(op["CYCLE"])
        bias = op.get("BIAS", 0.0)
        p = mul(kp, error)
        integral_on = ki > 0 and not (dependent and kp == 0)
        derivative_on = kd > 0 and not (dependent and kp == 0)
        self.d = self.derivative(op, error, mul(kp, kd) if dependent else kd, tf[0] if tf else 0.0, ts, derivative_on)
        if op["PID_MAN"]:
            self.MV = min(max(op["MOUT"], low), high)
            return True
        if self.man1 and integral_on and (self.extended or op["PID_MODE"] != 2):
            self.I = sub(sub(sub(self.MV, p), self.d), bias) if self.extended else sub(sub(self.MV, p), self.d)
            self.MV = min(max(self.MV, low), high)
            return usable(self.I)
        return self.automatic(p, bias, low, high, self.increment(error, p, ki, ts, dependent) if integral_on else None)

    def sampling_time(self, cycle: int) -> float:
        most, per_second = (40000, 1000.0) if self.extended else (2000, 100.0)
        return div(float(max(1, min(cycle, most))), per_second)

    def increment(self, error: float, p: float, ki: float, ts: float, dependent: bool) -> float:
        return div(mul(p, ts), ki) if dependent else mul(mul(ki, error), ts)

    def derivative(self, op: dict[str, Any], error: float, kd: float, tf: float, ts: float, on: bool) -> float:
        if not on:
            return 0.0
        if not self.extended:
            return div(mul(kd, sub(error, self.E1)), ts)
        if op["PID_DE"]:
            moved = 0.0 if self.cross else sub(op["PV"], self.PV1)
            delta = -moved if op["PID_DIR"] else moved
        else:
            delta = sub(error, self.E1)
        return div(add(mul(tf, self.d), mul(kd, delta)), add(tf, ts))

    def automatic(self, p: float, bias: float, low: float, high: float, increment: float | None) -> bool:
        candidate = 0.0 if increment is None else add(self.I, increment)
        raw = add(add(p, candidate), self.d)
        raw = add(raw, bias) if self.extended else raw
        if math.isnan(raw):
            return False
        inward = increment is not None and ((raw > high and increment < 0) or (raw < low and increment > 0))
        self.MV = min(max(raw, low), high)
        if low <= raw <= high or (self.directional and inward):
            self.I = candidate
        if increment is None:
            self.I = 0.0
        return True
