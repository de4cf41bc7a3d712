"""PID_MODE = 1 as a relay experiment: a model, not the vendor's algorithm, which is not published.

MV swings between MV_MIN and MV_MAX around SV with a hysteresis. After two full cycles the gains follow from the
swing of PV and the period by the formulas of the limit-cycle method (spec C.8), and PID_MODE returns to 0.

Source:
    MANUAL AH500 programming manual: MV is the tuner's, gains are written, PID_MODE returns to 0 (spec A.5, A.7).
    ASSUMED everything else; an experiment that never swings never ends.
"""

from __future__ import annotations

from typing import NamedTuple

CYCLES = 2


class Relay(NamedTuple):
    """How far the experiment is; times in s since it began, PV in the loop's unit.

    Attributes:
        time_s: Now.
        is_high: MV is at the upper end.
        ups_s: When MV went up, each time.
        on_s: How long MV was up in the cycles that count.
        low: Smallest PV since the first cycle began.
        high: Largest PV since then.
    """

    time_s: float
    is_high: bool
    ups_s: tuple[float, ...] = ()
    on_s: float = 0.0
    low: float = 0.0
    high: float = 0.0

    @property
    def is_done(self) -> bool:
        """True after two full cycles."""
        return len(self.ups_s) > CYCLES


class Gains(NamedTuple):
    """Result in the dependent form: KP in MV/PV, times in s."""

    kp: float
    ti_s: float
    td_s: float
    tf_s: float


def begin(error: float) -> Relay:
    """Start with MV on the side that reduces the error."""
    return Relay(0.0, error >= 0.0)


def swing(relay: Relay, error: float, pv: float, hysteresis: float, dt_s: float) -> Relay:
    """Go on by `dt_s`: turn MV where the error has left the hysteresis on the far side."""
    now = relay.time_s + dt_s
    counts = bool(relay.ups_s)
    low = min(relay.low, pv) if counts else pv
    high = max(relay.high, pv) if counts else pv
    on_s = relay.on_s + (dt_s if counts and relay.is_high else 0.0)
    if relay.is_high and error < -hysteresis:
        return Relay(now, False, relay.ups_s, on_s, low, high)
    if not relay.is_high and error > hysteresis:
        return Relay(now, True, (*relay.ups_s, now), on_s, low, high)
    return Relay(now, relay.is_high, relay.ups_s, on_s, low, high)


def gains(relay: Relay, mv_span: float) -> Gains:
    """Return the gains that a finished experiment gives, for an MV that swung by `mv_span` (spec A.7, C.8)."""
    period_s = (relay.ups_s[-1] - relay.ups_s[0]) / CYCLES
    on_s = relay.on_s / CYCLES
    lag_s = on_s * (1.0 - on_s / period_s)
    kp = 1.2 * mv_span / (relay.high - relay.low)
    return Gains(kp, 2.0 * lag_s, lag_s / 2.0, lag_s / 16.0)


def as_operands(found: Gains, names: frozenset[str], is_dependent: bool) -> dict[str, float]:
    """Spell the gains in the operands that the instruction has; DPID and PID_EQ = FALSE take Ki and Kd."""
    second = found.ti_s if is_dependent else found.kp / found.ti_s
    third = found.td_s if is_dependent else found.kp * found.td_s
    spelled = {
        "Kp": found.kp,
        "Kc_Kp": found.kp,
        "Ki": second,
        "Ti_Ki": second,
        "Kd": third,
        "Td_Kd": third,
        "Tf": found.tf_s,
    }
    return {name: value for name, value in spelled.items() if name in names}
