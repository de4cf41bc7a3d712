"""What MELSEC's auto-tuning writes when it ends: KP, TI and TD from a limit cycle or a step response.

Only the published tables; how the tuner drives MV until then is not modelled. Engineering binary64: the vendor's
rounding into the integer registers is unknown.

Source:
    MANUAL FX5 user's manual (analog) pp. 69, 71, 82: both tables and the waiting time (spec C.8).
    ASSUMED amplitude is peak to peak: only then are both tables one rule for an integrating response.
    ASSUMED the parameters as REAL, not yet rounded to the register's unit.
"""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple


class Law(IntEnum):
    """Which terms the tuned controller has."""

    P = 0
    PI = 1
    PID = 2


class Tuned(NamedTuple):
    """Parameters in register units: `kp` in %, `ti` in 100 ms, `td` in 10 ms; 0 where the law has no such term."""

    kp: float
    ti: float
    td: float


_KP = {Law.P: 1.0, Law.PI: 0.9, Law.PID: 1.2}
_TI = {Law.P: 0.0, Law.PI: 33.0, Law.PID: 20.0}
_TD = {Law.P: 0.0, Law.PI: 0.0, Law.PID: 50.0}

KW_MIN = -50
KW_MAX = 32717


def limit_cycle(law: Law, amplitude: float, period_s: float, on_s: float, ulv: float, llv: float) -> Tuned:
    """Tune from a two-position oscillation between LLV and ULV.

    Args:
        law: Terms wanted.
        amplitude: Peak to peak, in PV units, positive.
        period_s: Period τ in s, positive.
        on_s: Time τon at ULV within a period, 0…`period_s`.
        ulv: Output while on.
        llv: Output while off.

    Returns:
        KP in %, TI in 100 ms, TD in 10 ms.
    """
    _positive(amplitude=amplitude, period_s=period_s)
    if not 0.0 <= on_s <= period_s:
        raise ValueError(f"on_s is {on_s}, allowed 0 to the period {period_s}")
    dead_s = on_s * (1.0 - on_s / period_s)
    return Tuned(_KP[law] / amplitude * (ulv - llv) * 100.0, _TI[law] * dead_s, _TD[law] * dead_s)


def step_response(law: Law, dead_s: float, slope: float, mv: float) -> Tuned:
    """Tune from the response to an output step of `mv`: dead time L in s and steepest slope R in PV units per s."""
    _positive(dead_s=dead_s, slope=slope)
    return Tuned(_KP[law] / (slope * dead_s) * mv * 100.0, _TI[law] * dead_s, _TD[law] * dead_s)


def wait_s(kw: int, period_s: float, on_s: float) -> float:
    """Return how long MV stays at LLV after the limit cycle; a KW outside −50…32717 % gives 0."""
    if not KW_MIN <= kw <= KW_MAX:
        return 0.0
    return (50 + kw) / 100 * (period_s - on_s)


def _positive(**values: float) -> None:
    for name, value in values.items():
        if not value > 0.0:
            raise ValueError(f"{name} is {value}, allowed above 0")
