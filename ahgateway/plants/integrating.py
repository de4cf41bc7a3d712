"""Integrating with dead time: dy/dt = K·u(t − θ) + bias, between a floor and a ceiling. A level, a position."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import NamedTuple

from ahgateway.plants.base import DelayLine, delayed


class IntegratingState(NamedTuple):
    """PV now, and the input under way."""

    y: float
    line: DelayLine


@dataclass(frozen=True, slots=True)
class Integrating:
    """A plant whose PV runs as long as its input is off balance, and that overflows and runs dry.

    Attributes:
        gain: K in PV per MV and second.
        dead_time_s: θ, 0 or more; before the first input arrives, 0 acts.
        bias: PV per second at u = 0; negative is a steady draw.
        initial: PV at rest.
        minimum: Floor of PV; nothing is stored below it.
        maximum: Ceiling of PV.
    """

    gain: float
    dead_time_s: float = 0.0
    bias: float = 0.0
    initial: float = 0.0
    minimum: float = -inf
    maximum: float = inf

    def __post_init__(self) -> None:
        if not self.dead_time_s >= 0.0 or not self.minimum <= self.initial <= self.maximum:
            raise ValueError(
                f"dead_time_s must not be negative and initial must lie within the bounds: "
                f"{self.dead_time_s}, {self.minimum} <= {self.initial} <= {self.maximum}"
            )

    def rest(self) -> IntegratingState:
        return IntegratingState(self.initial, DelayLine())

    def output(self, state: IntegratingState) -> float:
        return state.y

    def step(self, state: IntegratingState, u: float, dt_s: float) -> tuple[IntegratingState, float]:
        line, pieces = delayed(state.line, u, dt_s, self.dead_time_s)
        y = state.y
        for duration_s, acting in pieces:
            y = y + (self.gain * acting + self.bias) * duration_s
            y = min(max(y, self.minimum), self.maximum)
        return IntegratingState(y, line), y
