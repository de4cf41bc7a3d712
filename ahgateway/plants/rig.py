"""A whole process: actuator, load, plant, sensor, one behind the other, from an output to what the PLC reads as PV.

This file alone decides their order: the actuator follows the output, the load joins at the plant's input, the sensor
lags, adds its noise, rounds to its resolution and ends at its span. Chance is handed in, so that equal seeds give equal
processes, on the fake and on a bench.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import exp, inf, isfinite, sqrt
from typing import Any, Protocol

from ahgateway.plants.actuators import Pieces
from ahgateway.plants.base import Plant

Gauss = Callable[[float, float], float]
"""Draws from a normal distribution of this mean and standard deviation."""


class Actuator(Protocol):
    """What follows an output; see `actuators`."""

    def rest(self) -> Any:
        """Return the state before the first step."""

    def step(self, state: Any, u: float, dt_s: float) -> tuple[Any, Pieces]:
        """Ask for `u` for `dt_s` seconds; return the state and what was done."""


@dataclass(frozen=True, slots=True)
class Sensor:
    """What is between PV and its register.

    Attributes:
        noise: Standard deviation, in PV's unit.
        filter_s: Time constant of its lag; 0 is none.
        resolution: Smallest step that it shows; 0 is none.
        low: Where it ends below.
        high: Where it ends above.
    """

    noise: float = 0.0
    filter_s: float = 0.0
    resolution: float = 0.0
    low: float = -inf
    high: float = inf

    def __post_init__(self) -> None:
        if min(self.noise, self.filter_s, self.resolution) < 0.0 or not self.low < self.high:
            raise ValueError(
                f"noise, filter_s and resolution must not be negative and span must be a range: "
                f"{self.noise}, {self.filter_s}, {self.resolution}, {self.low} < {self.high}"
            )


@dataclass(frozen=True, slots=True)
class Load:
    """A random load at the plant's input: first-order noise, exact for any step (Ornstein and Uhlenbeck).

    Attributes:
        deviation: Standard deviation in the long run, in MV's unit.
        tau_s: Its time constant, positive.
    """

    deviation: float = 0.0
    tau_s: float = 10.0

    def __post_init__(self) -> None:
        if not self.deviation >= 0.0 or not self.tau_s > 0.0:
            raise ValueError(f"load_noise must not be negative and load_tau_s above 0: {self.deviation}, {self.tau_s}")

    def step(self, x: float, dt_s: float, gauss: Gauss) -> float:
        """Return the load `dt_s` seconds behind `x`."""
        kept = exp(-dt_s / self.tau_s)
        return kept * x + gauss(0.0, self.deviation * sqrt(1.0 - kept * kept))


NS_PER_S = 1e9


class Rig:
    """A process under way.

    Plants are solved exactly for an input that stands still, so that nothing is computed before somebody looks: PV is
    the same however often time was told to pass. Only an actuator, a random load and a lag go step by step.

    Attributes:
        u: What the actuator did last.
        asked: What it is asked for.
        load: A load that somebody set, in MV's unit; the random one comes on top.
        is_stepped: PV depends on how often time is told to pass.
    """

    def __init__(
        self, plant: Plant[Any], gauss: Gauss, sensor: Sensor, load: Load, actuator: Actuator | None = None
    ) -> None:
        self._plant, self._gauss, self._sensor, self._random, self._actuator = plant, gauss, sensor, load, actuator
        self._state = plant.rest()
        self._at = None if actuator is None else actuator.rest()
        self._drift = 0.0
        self._pv: float | None = plant.output(self._state)
        self._lagged = self.pv
        self._acting = 0.0
        self._since_ns = 0
        self.u = self.asked = self.load = 0.0
        self.is_stepped = actuator is not None or load.deviation > 0.0 or sensor.filter_s > 0.0

    @property
    def pv(self) -> float:
        """PV before the sensor, in binary64."""
        if self._pv is None:
            self._pv = self._plant.step(self._state, self._acting, self._since_ns / NS_PER_S)[1]
        return self._pv

    def ask(self, output: float) -> None:
        """Take an output to the actuator; it keeps what it has while the output is no finite number."""
        if isfinite(output):
            self.asked = output

    def advance(self, elapsed_ns: int) -> None:
        """Let time pass, in ns."""
        if self.is_stepped:
            self._step(elapsed_ns / NS_PER_S)
            return
        self.u = self.asked
        self._hold(self.u + self.load)
        self._since_ns += elapsed_ns
        self._pv = None

    def _hold(self, acting: float) -> None:
        """Go on with this input from now on."""
        if acting != self._acting:
            if self._since_ns:
                self._state, self._pv = self._plant.step(self._state, self._acting, self._since_ns / NS_PER_S)
            self._acting, self._since_ns = acting, 0

    def _step(self, dt_s: float) -> None:
        if self._random.deviation:
            self._drift = self._random.step(self._drift, dt_s, self._gauss)
        load = self.load + self._drift
        if self._actuator is None:
            self.u = self.asked
            pieces: Pieces = ((dt_s, self.u),)
        else:
            self._at, pieces = self._actuator.step(self._at, self.asked, dt_s)
        for duration_s, self.u in pieces:
            self._state, self._pv = self._plant.step(self._state, self.u + load, duration_s)
        if self._sensor.filter_s:
            self._lagged += (self.pv - self._lagged) * (1.0 - exp(-dt_s / self._sensor.filter_s))

    def reading(self) -> float:
        """Return what the sensor shows now; each call draws its noise anew."""
        sensor = self._sensor
        shown = self._lagged if sensor.filter_s else self.pv
        if sensor.noise:
            shown += self._gauss(0.0, sensor.noise)
        if sensor.resolution:
            shown = round(shown / sensor.resolution) * sensor.resolution
        return min(max(shown, sensor.low), sensor.high)

    def overlook(self) -> None:
        """Draw the noise of a reading that nobody takes."""
        if self._sensor.noise:
            self._gauss(0.0, self._sensor.noise)
