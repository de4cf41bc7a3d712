"""What hangs on a loop's terminals: a plant between MV and PV, with the noise of its sensor."""

from __future__ import annotations

import random
from math import isfinite
from typing import Any

from ahgateway.clock import SECOND
from ahgateway.codec.station import Loop, PlantSpec
from ahgateway.core.real import REAL
from ahgateway.errors import ProfileError
from ahgateway.fake.memory import real_view
from ahgateway.fake.wiring import Wiring
from ahgateway.plants.base import Plant
from ahgateway.plants.fopdt import Fopdt
from ahgateway.plants.integrating import Integrating

DEFAULT_PLANT = PlantSpec("fopdt", gain=1.0, tau_s=10.0, dead_time_s=0.5)
"""The process of a loop for which nobody described one."""


def make_plant(loop: Loop, spec: PlantSpec) -> Plant[Any]:
    """Build the plant of a loop; an integrating one stays within the loop's PV range where that is known.

    Raises:
        ProfileError: The description fits no plant.
    """
    key = f"loops.{loop.name}.fake.plant"
    try:
        if spec.kind == "fopdt":
            return Fopdt(spec.gain, spec.tau_s, spec.dead_time_s, spec.bias, spec.initial)
        if spec.kind == "integrating":
            bounds = loop.pv_range or (float("-inf"), float("inf"))
            return Integrating(spec.gain, spec.dead_time_s, spec.bias, spec.initial, *bounds)
    except ValueError as error:
        raise ProfileError(str(error), key=key) from error
    raise ProfileError(f"unknown kind `{spec.kind}`, known are `fopdt` and `integrating`", key=key)


class Process:
    """A plant wired to a loop's MV and PV.

    Attributes:
        pv: PV before noise, in binary64.
        u: What the actuator does, in the loop's output unit.
        is_frozen: The PV register keeps what it holds, as with a stuck sensor.
    """

    def __init__(self, wiring: Wiring, spec: PlantSpec, rng: random.Random) -> None:
        self._plant = make_plant(wiring.loop, spec)
        self._state = self._plant.rest()
        self._noise = spec.noise
        self._rng = rng
        self._pv = real_view(wiring.words("PV")) if wiring.is_register("PV") else None
        self._mv = real_view(wiring.words("MV"))
        self.pv = self._plant.output(self._state)
        self.u = 0.0
        self.is_frozen = False

    def advance(self, elapsed_ns: int) -> None:
        """Let time pass with the actuator where it is."""
        self._state, self.pv = self._plant.step(self._state, self.u, elapsed_ns / SECOND)

    def sense(self) -> None:
        """Write PV, with noise, into its register; nothing where PV is a constant of the program."""
        if self._pv is not None and not self.is_frozen:
            self._pv[0] = REAL(self.pv + self._rng.gauss(0.0, self._noise) if self._noise else self.pv)

    def drive(self) -> None:
        """Take MV to the actuator; it keeps its position while MV is no finite number."""
        mv = float(self._mv[0])
        if isfinite(mv):
            self.u = mv

    def release(self) -> None:
        """Let the actuator go to 0, as outputs do in STOP."""
        self.u = 0.0
