"""What stands between an output and a plant: nothing, pulses on a heater, a valve with its positioner.

An actuator is a pure function like a plant. It gives what it does as pieces of duration in s and value, because a
pulse may begin and end between two steps.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from ahgateway.plants.motor_valve import FULL, MotorValve, ValveState

Pieces = tuple[tuple[float, float], ...]


class PulseState(NamedTuple):
    """Time since the running period began, and the demand that it was begun with."""

    into_s: float = 0.0
    demand: float = 0.0
    is_running: bool = False


@dataclass(frozen=True, slots=True)
class Pulses:
    """A contact that is on for a share of each period: 100 % of its side while on, 0 in the gap.

    The demand is taken over at the beginning of a period; a negative one pulses the other side, the cooler.

    Attributes:
        period_s: Length of one period, positive.
    """

    period_s: float

    def __post_init__(self) -> None:
        if not self.period_s > 0.0:
            raise ValueError(f"the period of pulses must be above 0: {self.period_s}")

    def rest(self) -> PulseState:
        return PulseState()

    def step(self, state: PulseState, u: float, dt_s: float) -> tuple[PulseState, Pieces]:
        """Ask for `u` in % for `dt_s` seconds; return the state and what the contact did."""
        pieces: list[tuple[float, float]] = []
        into_s, demand, is_running = state
        left_s = dt_s
        while left_s > 0.0:
            if not is_running or into_s >= self.period_s:
                into_s, demand, is_running = 0.0, min(max(u, -FULL), FULL), True
            on_s = abs(demand) / FULL * self.period_s
            ends_s = on_s if into_s < on_s else self.period_s
            lasts_s = min(ends_s - into_s, left_s)
            side = FULL if demand > 0.0 else -FULL
            pieces.append((lasts_s, side if into_s < on_s else 0.0))
            # Exactly at its end, or the next piece would last a rounding error.
            into_s = ends_s if lasts_s == ends_s - into_s else into_s + lasts_s
            left_s -= lasts_s
        return PulseState(into_s, demand, is_running), tuple(pieces)


@dataclass(frozen=True, slots=True)
class Positioner:
    """A motor valve that follows a position in %, as far as its motor's end of the gear tells."""

    valve: MotorValve

    def rest(self) -> ValveState:
        return self.valve.rest()

    def step(self, state: ValveState, u: float, dt_s: float) -> tuple[ValveState, Pieces]:
        """Run towards `u` for `dt_s` seconds at the motor's speed; return the state and where the stem stands then."""
        reach = FULL / self.valve.stroke_s * dt_s
        way = (min(max(u, 0.0), FULL) - state.motor) / reach if reach > 0.0 else 0.0
        state, stem = self.valve.step(state, min(max(way, -1.0), 1.0), dt_s)
        return state, ((dt_s, stem),)


@dataclass(frozen=True, slots=True)
class Contacts:
    """A motor valve on two contacts: 1 opens, -1 closes, 0 stands."""

    valve: MotorValve

    def rest(self) -> ValveState:
        return self.valve.rest()

    def step(self, state: ValveState, u: float, dt_s: float) -> tuple[ValveState, Pieces]:
        """Drive the motor for `dt_s` seconds; return the state and where the stem stands then."""
        state, stem = self.valve.step(state, u, dt_s)
        return state, ((dt_s, stem),)
