"""A first-order plant with dead time that is heated and cooled: each side acts with its own gain."""

from __future__ import annotations

from dataclasses import dataclass

from ahgateway.plants.fopdt import Fopdt, FopdtState


@dataclass(frozen=True, slots=True)
class HeatCool:
    """A heater and a cooler on one first-order process; a positive input heats, a negative one cools.

    Pulses are inputs like any other: 100 while a pulse is on, 0 in the gap.

    Attributes:
        gain: PV per % of heating.
        cool_gain: PV per % of cooling, positive; 0 is no cooler.
        tau_s: Time constant, positive.
        dead_time_s: θ, 0 or more.
        bias: PV to which the plant settles by itself.
        initial: PV at rest.
    """

    gain: float
    cool_gain: float
    tau_s: float
    dead_time_s: float = 0.0
    bias: float = 0.0
    initial: float = 0.0

    def __post_init__(self) -> None:
        if not self.cool_gain >= 0.0:
            raise ValueError(f"cool_gain must not be negative: {self.cool_gain}")
        self._process()

    def _process(self) -> Fopdt:
        return Fopdt(1.0, self.tau_s, self.dead_time_s, self.bias, self.initial)

    def rest(self) -> FopdtState:
        return self._process().rest()

    def output(self, state: FopdtState) -> float:
        return state.y

    def step(self, state: FopdtState, u: float, dt_s: float) -> tuple[FopdtState, float]:
        return self._process().step(state, u * (self.gain if u >= 0.0 else self.cool_gain), dt_s)
