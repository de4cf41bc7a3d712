"""What hangs on a loop's terminals: a plant between output and PV, with the noise of its sensor.

This file alone decides which outputs of an instruction reach which actuator: MV, the two contacts of a motor valve, or
the pulses of a heater and a cooler; and as what the process value comes back.
"""

from __future__ import annotations

import random
from collections.abc import Callable
from functools import partial
from math import isfinite
from typing import Any

from ahgateway.clock import SECOND
from ahgateway.codec.station import Loop, PlantSpec
from ahgateway.core.controllers import PID_REG_CE, PID_TEMP
from ahgateway.core.operands import Kind
from ahgateway.core.real import REAL
from ahgateway.errors import ProfileError
from ahgateway.fake.memory import real_view
from ahgateway.fake.wiring import Wiring
from ahgateway.plants.base import Plant
from ahgateway.plants.fopdt import Fopdt
from ahgateway.plants.heat_cool import HeatCool
from ahgateway.plants.integrating import Integrating
from ahgateway.plants.motor_valve import FULL, MotorValve
from ahgateway.plants.sopdt import Sopdt

DEFAULT_PLANT = PlantSpec("fopdt", gain=1.0, tau_s=10.0, dead_time_s=0.5)
"""The process of a loop for which nobody described one."""

INT_MIN, INT_MAX = -32768, 32767
PWM = 1


def make_plant(loop: Loop, spec: PlantSpec) -> Plant[Any]:
    """Build the plant of a loop; an integrating one stays within the loop's PV range where that is known.

    Raises:
        ProfileError: The description fits no plant.
    """
    key = f"loops.{loop.name}.fake.plant"
    try:
        if spec.kind == "fopdt":
            return Fopdt(spec.gain, spec.tau_s, spec.dead_time_s, spec.bias, spec.initial)
        if spec.kind == "sopdt":
            return Sopdt(spec.gain, spec.tau_s, spec.tau2_s, spec.dead_time_s, spec.bias, spec.initial)
        if spec.kind == "heat_cool":
            return HeatCool(spec.gain, spec.cool_gain, spec.tau_s, spec.dead_time_s, spec.bias, spec.initial)
        if spec.kind == "integrating":
            bounds = loop.pv_range or (float("-inf"), float("inf"))
            return Integrating(spec.gain, spec.dead_time_s, spec.bias, spec.initial, *bounds)
    except ValueError as error:
        raise ProfileError(str(error), key=key) from error
    raise ProfileError(
        f"unknown kind `{spec.kind}`, known are `fopdt`, `sopdt`, `integrating` and `heat_cool`", key=key
    )


def make_valve(loop: Loop, spec: PlantSpec) -> MotorValve:
    """Build the motor valve in front of the plant.

    Raises:
        ProfileError: The description fits no valve.
    """
    try:
        return MotorValve(spec.stroke_s, spec.backlash, spec.stiction, spec.position)
    except ValueError as error:
        raise ProfileError(str(error), key=f"loops.{loop.name}.fake.plant") from error


class Process:
    """A plant wired to a loop's output and PV.

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
        self._wiring = wiring
        self._valve = Valve(wiring, make_valve(wiring.loop, spec)) if is_pulsed(wiring.loop) else None
        self._demand = _demand_of(wiring)
        self._put_pv = _pv_writer(wiring)
        self.pv = self._plant.output(self._state)
        self.u = 0.0
        self.is_frozen = False

    def advance(self, elapsed_ns: int) -> None:
        """Let time pass with the actuator where it is."""
        if self._valve is not None:
            self.u = self._valve.advance(elapsed_ns)
        self._state, self.pv = self._plant.step(self._state, self.u, elapsed_ns / SECOND)

    def sense(self) -> None:
        """Write PV, with noise, into its register; nothing where PV is a constant of the program."""
        if self._put_pv is not None and not self.is_frozen:
            self._put_pv(self.pv + self._rng.gauss(0.0, self._noise) if self._noise else self.pv)

    def drive(self) -> None:
        """Take the output to the actuator; it keeps its position while the output is no finite number."""
        if self._valve is not None:
            self._valve.drive()
            return
        mv = self._demand()
        if isfinite(mv):
            self.u = mv

    def release(self) -> None:
        """Let the actuator go to 0, as outputs do in STOP; a motor valve stops where it is."""
        if self._valve is not None:
            self._valve.direction = 0
        else:
            self.u = 0.0


class Valve:
    """A motor valve on OPEN_OUT and CLOSE_OUT, with its limit switches."""

    def __init__(self, wiring: Wiring, valve: MotorValve) -> None:
        self.direction = 0
        self._wiring = wiring
        self._valve = valve
        self._state = valve.rest()
        self._switches = [name for name in ("CONC_OPEN", "CONC_CLOSE") if wiring.is_register(name)]
        self._shown: dict[str, bool] = {}

    def advance(self, elapsed_ns: int) -> float:
        """Run the motor; return the position in % and move the limit switches."""
        self._state, position = self._valve.step(self._state, float(self.direction), elapsed_ns / SECOND)
        free = {"CONC_OPEN": position < FULL, "CONC_CLOSE": position > 0.0}
        for name in self._switches:
            if self._shown.get(name) != free[name]:
                self._shown[name] = free[name]
                self._wiring.put(name, free[name])
        return position

    def drive(self) -> None:
        """Read the two contacts."""
        self.direction = int(self._wiring.get("OPEN_OUT")) - int(self._wiring.get("CLOSE_OUT"))


def is_pulsed(loop: Loop) -> bool:
    """Tell whether the instruction drives a motor by two contacts."""
    return loop.controller is PID_REG_CE


def _demand_of(wiring: Wiring) -> Callable[[], float]:
    """What the actuator is asked for; heating counts positive and cooling negative."""
    loop = wiring.loop
    if loop.controller is not PID_TEMP:
        name = loop.controller.roles.mv
        return lambda: float(wiring.get(name))

    def side(name: str) -> float:
        if wiring.get(f"{name}_Select") == PWM:
            return 100.0 if wiring.get(f"Output{name}_PWM") else 0.0
        return float(wiring.get(f"Output{name}"))

    return lambda: side("Heat") - (side("Cool") if wiring.get("ActivateCooling") else 0.0)


def _pv_writer(wiring: Wiring) -> Callable[[float], None] | None:
    """Write PV as the instruction reads it; None where it is a constant of the program."""
    controller = wiring.loop.controller
    if controller is PID_TEMP:
        real, whole = _writer(wiring, "Input", _as_it_is), _writer(wiring, "Input_PER", partial(_peripheral, wiring))

        def put(pv: float) -> None:
            write = whole if wiring.get("InputPerOn") else real
            if write is not None:
                write(pv)

        return put
    return _writer(wiring, controller.roles.pvs[0], _as_it_is)


def _as_it_is(pv: float) -> float:
    return pv


def _peripheral(wiring: Wiring, pv: float) -> float:
    """PV as the analog input's whole number; 0 where the two points of the scaling are one."""
    low, high = (float(wiring.get(f"InputScaling_{side}PointOut")) for side in ("Lower", "Upper"))
    first, last = (float(wiring.get(f"InputScaling_{side}PointIn")) for side in ("Lower", "Upper"))
    return 0.0 if high == low else first + (pv - low) * (last - first) / (high - low)


def _writer(wiring: Wiring, name: str, scaled: Callable[[float], float]) -> Callable[[float], None] | None:
    if not wiring.is_register(name):
        return None
    words = wiring.words(name)
    if wiring.loop.controller.operand(name).kind is Kind.INT:
        whole = words.view("<i2")

        def put_whole(pv: float) -> None:
            whole[0] = min(max(round(scaled(pv)), INT_MIN), INT_MAX)

        return put_whole
    real = real_view(words)

    def put(pv: float) -> None:
        real[0] = REAL(scaled(pv))

    return put
