"""A valve on a motor of constant speed: opens and closes while it is driven, with backlash and stiction in its gear."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

FULL = 100.0
"""Position of a fully open valve, in %."""


class ValveState(NamedTuple):
    """Position of the motor's end of the gear and of the stem, both in %; the way in which the stem is moving, or 0."""

    motor: float
    stem: float
    moving: int = 0


@dataclass(frozen=True, slots=True)
class MotorValve:
    """A motor valve whose input is a direction: 1 opens, -1 closes, 0 stands.

    Attributes:
        stroke_s: Time from closed to open, positive.
        backlash: How far the motor turns after a reversal before it meets the stem again, in %, 0 or more.
        stiction: How much further it must turn before a resting stem breaks loose and jumps after it, in %, 0 or more.
        initial: Position at rest, 0…100 %.
    """

    stroke_s: float
    backlash: float = 0.0
    stiction: float = 0.0
    initial: float = 0.0

    def __post_init__(self) -> None:
        if not self.stroke_s > 0.0 or not self.backlash >= 0.0 or not self.stiction >= 0.0:
            raise ValueError(
                f"stroke_s must be above 0, backlash and stiction not below: "
                f"{self.stroke_s}, {self.backlash}, {self.stiction}"
            )
        if not 0.0 <= self.initial <= FULL:
            raise ValueError(f"the initial position of a valve lies within 0 to 100 %: {self.initial}")

    def rest(self) -> ValveState:
        return ValveState(self.initial, self.initial)

    def output(self, state: ValveState) -> float:
        return state.stem

    def step(self, state: ValveState, u: float, dt_s: float) -> tuple[ValveState, float]:
        if dt_s < 0.0 or u != u:
            raise ValueError(f"a plant steps forward on a number: u = {u}, dt_s = {dt_s}")
        half = self.backlash / 2.0
        slack = half + self.stiction
        way = (u > 0.0) - (u < 0.0)
        motor = state.motor + u * FULL / self.stroke_s * dt_s
        # The motor runs on until the stem stands at its end.
        is_at_end = not -slack < motor < FULL + slack
        motor = min(max(motor, -slack), FULL + slack)
        away = motor - state.stem
        loose = state.moving == way or is_at_end
        if way == 0 or abs(away) <= (half if loose else slack):
            return ValveState(motor, state.stem, state.moving if way else 0), state.stem
        stem = min(max(motor - half if away > 0.0 else motor + half, 0.0), FULL)
        return ValveState(motor, stem, way), stem
