"""First order plus dead time: τ·dy/dt = bias + K·u(t − θ) − y. A heater, a flow, most of what a PID loop meets."""

from __future__ import annotations

from dataclasses import dataclass
from math import exp
from typing import NamedTuple

from ahgateway.plants.base import DelayLine, delayed


class FopdtState(NamedTuple):
    """PV now, and the input under way."""

    y: float
    line: DelayLine


@dataclass(frozen=True, slots=True)
class Fopdt:
    """A first-order plant with dead time, discretised exactly for an input that is held (zero-order hold).

    Attributes:
        gain: K in PV per MV.
        tau_s: Time constant, positive.
        dead_time_s: θ, 0 or more; before the first input arrives, 0 acts.
        bias: PV to which the plant settles at u = 0.
        initial: PV at rest.
    """

    gain: float
    tau_s: float
    dead_time_s: float = 0.0
    bias: float = 0.0
    initial: float = 0.0

    def __post_init__(self) -> None:
        if not self.tau_s > 0.0 or not self.dead_time_s >= 0.0:
            raise ValueError(f"tau_s must be above 0 and dead_time_s not below: {self.tau_s}, {self.dead_time_s}")

    def rest(self) -> FopdtState:
        return FopdtState(self.initial, DelayLine())

    def output(self, state: FopdtState) -> float:
        return state.y

    def step(self, state: FopdtState, u: float, dt_s: float) -> tuple[FopdtState, float]:
        line, pieces = delayed(state.line, u, dt_s, self.dead_time_s)
        y = state.y
        for duration_s, acting in pieces:
            settles = self.bias + self.gain * acting
            y = settles + (y - settles) * exp(-duration_s / self.tau_s)
        return FopdtState(y, line), y
