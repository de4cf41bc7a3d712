"""What hangs on a loop's terminals: a plant between output and PV, with the noise of its sensor.

This file alone decides which outputs of an instruction reach which actuator: MV, the two contacts of a motor valve, or
the pulses of a heater and a cooler; and as what the process value comes back.
"""

from __future__ import annotations

import random
from collections.abc import Callable
from functools import partial

from ahgateway.codec.station import PlantSpec
from ahgateway.core.controllers import PID_TEMP
from ahgateway.core.operands import Kind
from ahgateway.fake.memory import real_view
from ahgateway.fake.rigs import is_pulsed, make_rig
from ahgateway.fake.wiring import Wiring
from ahgateway.plants.motor_valve import FULL

INT_MIN, INT_MAX = -32768, 32767
PWM = 1


class Process:
    """A process wired to a loop's output and PV.

    Attributes:
        rig: The process itself.
        is_frozen: The PV register keeps what it holds, as with a stuck sensor.
    """

    def __init__(self, wiring: Wiring, spec: PlantSpec, rng: random.Random) -> None:
        self.rig = make_rig(wiring.loop, spec, rng)
        self.is_frozen = False
        self._demand = _demand_of(wiring)
        self._put_pv = _pv_writer(wiring)
        self._switches = LimitSwitches(wiring) if is_pulsed(wiring.loop) else None

    @property
    def pv(self) -> float:
        """PV before the sensor, in binary64."""
        return self.rig.pv

    def advance(self, elapsed_ns: int) -> None:
        """Let time pass with the actuator asked for what it was."""
        self.rig.advance(elapsed_ns)
        if self._switches is not None:
            self._switches.show(self.rig.u)

    def sense(self) -> None:
        """Write PV as the sensor shows it into its register; nothing where PV is a constant of the program."""
        if self._put_pv is not None and not self.is_frozen:
            self._put_pv(self.rig.reading())

    def overlook(self) -> None:
        """Leave out a scan's PV: the sensor's noise goes on as if it had been written."""
        if self._put_pv is not None and not self.is_frozen:
            self.rig.overlook()

    def drive(self) -> None:
        """Take the output to the actuator."""
        self.rig.ask(self._demand())

    def release(self) -> None:
        """Let the outputs go to 0, as in STOP; a motor valve on contacts stops where it is."""
        self.rig.ask(0.0)


class LimitSwitches:
    """The switches at both ends of a motor valve: on while there is way left."""

    def __init__(self, wiring: Wiring) -> None:
        self._wiring = wiring
        self._names = [name for name in ("CONC_OPEN", "CONC_CLOSE") if wiring.is_register(name)]
        self._shown: dict[str, bool] = {}

    def show(self, position: float) -> None:
        """Move the switches that a valve at this position in % moves."""
        free = {"CONC_OPEN": position < FULL, "CONC_CLOSE": position > 0.0}
        for name in self._names:
            if self._shown.get(name) != free[name]:
                self._shown[name] = free[name]
                self._wiring.put(name, free[name])


def _demand_of(wiring: Wiring) -> Callable[[], float]:
    """What the actuator is asked for; heating counts positive and cooling negative, opening positive."""
    loop = wiring.loop
    if is_pulsed(loop):
        return lambda: float(int(wiring.get("OPEN_OUT")) - int(wiring.get("CLOSE_OUT")))
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
        real[0] = scaled(pv)

    return put
