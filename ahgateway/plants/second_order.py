"""Second order plus dead time by damping: τ²·ÿ + 2ζτ·ẏ + y = bias + K·u(t − θ). Oscillates for ζ below 1."""

from __future__ import annotations

from cmath import exp, sqrt
from dataclasses import dataclass
from typing import NamedTuple

from ahgateway.plants.base import DelayLine, delayed


class SecondOrderState(NamedTuple):
    """PV, its rate per second, and the input under way."""

    y: float
    rate: float
    line: DelayLine


@dataclass(frozen=True, slots=True)
class SecondOrder:
    """A second-order plant with dead time, discretised exactly for an input that is held.

    Attributes:
        gain: K in PV per MV.
        tau_s: τ, the inverse of the natural frequency in rad/s, positive.
        zeta: ζ, damping, positive.
        dead_time_s: θ, 0 or more; before the first input arrives, 0 acts.
        bias: PV to which the plant settles at u = 0.
        initial: PV at rest.
    """

    gain: float
    tau_s: float
    zeta: float
    dead_time_s: float = 0.0
    bias: float = 0.0
    initial: float = 0.0

    def __post_init__(self) -> None:
        if not self.tau_s > 0.0 or not self.zeta > 0.0 or not self.dead_time_s >= 0.0:
            raise ValueError(
                f"tau_s and zeta must be above 0 and dead_time_s not below: "
                f"{self.tau_s}, {self.zeta}, {self.dead_time_s}"
            )

    def rest(self) -> SecondOrderState:
        return SecondOrderState(self.initial, 0.0, DelayLine())

    def output(self, state: SecondOrderState) -> float:
        return state.y

    def step(self, state: SecondOrderState, u: float, dt_s: float) -> tuple[SecondOrderState, float]:
        line, pieces = delayed(state.line, u, dt_s, self.dead_time_s)
        y, rate = state.y, state.rate
        damping = self.zeta / self.tau_s
        w = sqrt(self.zeta**2 - 1.0) / self.tau_s
        for duration_s, acting in pieces:
            settles = self.bias + self.gain * acting
            slow, fast = exp((w - damping) * duration_s), exp((-w - damping) * duration_s)
            even = ((slow + fast) / 2.0).real
            # At ζ = 1 both poles are one and the quotient is its limit.
            near = abs(w) * duration_s < 1e-6
            odd = duration_s * exp(-damping * duration_s).real if near else ((slow - fast) / (2.0 * w)).real
            away = y - settles
            y = settles + away * (even + damping * odd) + rate * odd
            rate = rate * (even - damping * odd) - away * odd / self.tau_s**2
        return SecondOrderState(y, rate, line), y
