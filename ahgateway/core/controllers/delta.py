"""What Delta's DPID and DPIDE have in common: sanitising, limits, and the operands both instructions take.

This file decides what a gain, a pair of limits and a usable input are. It does not know either law.

Source:
    MANUAL AH500 programming manual, API 0707 and 0708 (spec A.1, A.3, B.1).
    ASSUMED non-finite input holds the step, a non-finite gain counts as 0 (spec §1).
    ASSUMED a sum that is no number, and a transfer whose integral would be none, hold the step like a bad input.
"""

from __future__ import annotations

import math

from ahgateway.core.operands import Access, Kind, Operand, Source
from ahgateway.core.real import REAL

ZERO = REAL(0)


finite = math.isfinite
"""Tell a number from NaN and infinity; the one test that is quick on a float32, never warns, and compiles."""


def gain(x: REAL) -> REAL:
    """Negative and non-finite gains count as 0: the branch is off."""
    if x >= ZERO and finite(x):
        return x
    return ZERO


def limit(low: REAL, x: REAL, high: REAL) -> REAL:
    """LIMIT(low, x, high) = MIN(MAX(x, low), high)."""
    y = low if x < low else x
    return high if y > high else y


def clamped_cycle(cycle: int, maximum: int) -> int:
    """CYCLE below 1 acts as 1, above the maximum as the maximum."""
    return min(max(cycle, 1), maximum)


def operand(
    name: str,
    kind: Kind,
    default: float | int | bool | None,
    text: str,
    *,
    unit: str = "",
    minimum: float | None = None,
    maximum: float | None = None,
    access: Access = Access.IN,
    source: Source = Source.MANUAL,
    words: int | None = None,
) -> Operand:
    """Make one row of an operand table; REAL and DINT take two words, BOOL none."""
    size = words if words is not None else {Kind.BOOL: 0, Kind.INT: 1}.get(kind, 2)
    return Operand(name, kind, unit, default, minimum, maximum, access, source, text, size)


PID_RUN = operand("PID_RUN", Kind.BOOL, True, "TRUE executes the algorithm; FALSE sets MV to 0 and does not execute it")
SV = operand("SV", Kind.REAL, 0.0, "target value", unit="PV")
PV = operand("PV", Kind.REAL, 0.0, "process value", unit="PV")
PID_MAN = operand("PID_MAN", Kind.BOOL, False, "TRUE: MV is MOUT within the limits; no effect while PID_MODE is 1")
MOUT_AUTO = operand("MOUT_AUTO", Kind.BOOL, False, "TRUE: MOUT follows MV in automatic; FALSE: MOUT is left alone")
PID_DIR = operand("PID_DIR", Kind.BOOL, True, "TRUE: E = SV - PV; FALSE: E = PV - SV")
MV_MAX = operand("MV_MAX", Kind.REAL, 100.0, "upper limit of MV; exchanged with MV_MIN when below it", unit="MV")
MV_MIN = operand("MV_MIN", Kind.REAL, 0.0, "lower limit of MV", unit="MV")
MOUT = operand("MOUT", Kind.REAL, 0.0, "manual value, limited like MV", unit="MV", access=Access.IN_OUT)
MV = operand(
    "MV", Kind.REAL, 0.0, "output, within the limits except the 0 of PID_RUN = FALSE", unit="MV", access=Access.OUT
)


def pid_mode(maximum: int, text: str) -> Operand:
    """PID_MODE with its largest legal value."""
    return operand("PID_MODE", Kind.DINT, 0, text, minimum=0, maximum=maximum, access=Access.IN_OUT)


def i_mv(words: int) -> Operand:
    """The instruction's memory; its first REAL is the integral."""
    return operand(
        "I_MV",
        Kind.BLOCK,
        None,
        "the instruction's memory; the first REAL is the integral, which the user may change",
        unit="MV",
        access=Access.STATE,
        words=words,
    )
