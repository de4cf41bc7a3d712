"""Second order plus dead time: two lags in a row, τ1·dx/dt = bias + K·u(t − θ) − x and τ2·dy/dt = x − y."""

from __future__ import annotations

from dataclasses import dataclass
from math import exp
from typing import NamedTuple

from ahgateway.plants.base import DelayLine, delayed


class SopdtState(NamedTuple):
    """Content of the first lag, PV, and the input under way."""

    x: float
    y: float
    line: DelayLine


@dataclass(frozen=True, slots=True)
class Sopdt:
    """Two lags and dead time, discretised exactly for an input that is held.

    Attributes:
        gain: K in PV per MV.
        tau1_s: First time constant, positive.
        tau2_s: Second time constant, positive; may equal the first.
        dead_time_s: θ, 0 or more; before the first input arrives, 0 acts.
        bias: PV to which the plant settles at u = 0.
        initial: PV, and content of the first lag, at rest.
    """

    gain: float
    tau1_s: float
    tau2_s: float
    dead_time_s: float = 0.0
    bias: float = 0.0
    initial: float = 0.0

    def __post_init__(self) -> None:
        if not self.tau1_s > 0.0 or not self.tau2_s > 0.0 or not self.dead_time_s >= 0.0:
            raise ValueError(
                f"tau1_s and tau2_s must be above 0 and dead_time_s not below: "
                f"{self.tau1_s}, {self.tau2_s}, {self.dead_time_s}"
            )

    def rest(self) -> SopdtState:
        return SopdtState(self.initial, self.initial, DelayLine())

    def output(self, state: SopdtState) -> float:
        return state.y

    def step(self, state: SopdtState, u: float, dt_s: float) -> tuple[SopdtState, float]:
        line, pieces = delayed(state.line, u, dt_s, self.dead_time_s)
        x, y = state.x, state.y
        for duration_s, acting in pieces:
            settles = self.bias + self.gain * acting
            first, second = exp(-duration_s / self.tau1_s), exp(-duration_s / self.tau2_s)
            away = x - settles
            if abs(self.tau1_s - self.tau2_s) <= 1e-9 * self.tau1_s:
                # The limit of the formula below, which divides by the difference of the two.
                carried = duration_s / self.tau2_s * second
            else:
                carried = self.tau1_s / (self.tau1_s - self.tau2_s) * (first - second)
            y = settles + (y - settles) * second + away * carried
            x = settles + away * first
        return SopdtState(x, y, line), y
