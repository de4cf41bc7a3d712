"""From the description of a process to the process: which plant, actuator and sensor a `PlantSpec` means.

The fake hangs them on its memory; a bench hangs them on a real PLC.
"""

from __future__ import annotations

import random
from collections.abc import Callable
from math import inf
from typing import Any

from ahgateway.codec.station import Loop, PlantSpec
from ahgateway.core.controllers import PID_REG_CE
from ahgateway.errors import ProfileError
from ahgateway.plants.actuators import Contacts, Positioner, Pulses
from ahgateway.plants.base import Plant
from ahgateway.plants.fopdt import Fopdt
from ahgateway.plants.heat_cool import HeatCool
from ahgateway.plants.integrating import Integrating
from ahgateway.plants.motor_valve import MotorValve
from ahgateway.plants.rig import Actuator, Load, Rig, Sensor
from ahgateway.plants.second_order import SecondOrder
from ahgateway.plants.sopdt import Sopdt
from ahgateway.plants.tank import Tank

DEFAULT_PLANT = PlantSpec("fopdt", gain=1.0, tau_s=10.0, dead_time_s=0.5)
"""The process of a loop for which nobody described one."""

STROKE_S = 60.0
"""Of a motor valve for which nobody said how fast it is."""


def make_rig(loop: Loop, spec: PlantSpec, rng: random.Random) -> Rig:
    """Build the process of a loop; an integrating one stays within the loop's PV range where that is known.

    Raises:
        ProfileError: The description fits no process.
    """
    key = f"loops.{loop.name}.fake.plant"
    if spec.kind not in PLANTS:
        known = ", ".join(f"`{kind}`" for kind in PLANTS)
        raise ProfileError(f"unknown kind `{spec.kind}`, known are {known}", key=key)
    try:
        low, high = spec.span or (-inf, inf)
        sensor = Sensor(spec.noise, spec.filter_s, spec.resolution, low, high)
        load = Load(spec.load_noise, spec.load_tau_s)
        return Rig(PLANTS[spec.kind](loop, spec), rng.gauss, sensor, load, _actuator(loop, spec))
    except ValueError as error:
        raise ProfileError(str(error), key=key) from error


def is_pulsed(loop: Loop) -> bool:
    """Tell whether the instruction drives a motor by two contacts."""
    return loop.controller is PID_REG_CE


def _actuator(loop: Loop, spec: PlantSpec) -> Actuator | None:
    if is_pulsed(loop) or spec.stroke_s is not None:
        stroke_s = STROKE_S if spec.stroke_s is None else spec.stroke_s
        valve = MotorValve(stroke_s, spec.backlash, spec.stiction, spec.position)
        return Contacts(valve) if is_pulsed(loop) else Positioner(valve)
    return Pulses(spec.pwm_s) if spec.pwm_s else None


def _integrating(loop: Loop, spec: PlantSpec) -> Plant[Any]:
    return Integrating(spec.gain, spec.dead_time_s, spec.bias, spec.initial, *(loop.pv_range or (-inf, inf)))


def _tank(loop: Loop, spec: PlantSpec) -> Plant[Any]:
    full = inf if loop.pv_range is None else loop.pv_range[1]
    return Tank(spec.gain, spec.outflow, spec.dead_time_s, spec.bias, spec.initial, full)


PLANTS: dict[str, Callable[[Loop, PlantSpec], Plant[Any]]] = {
    "fopdt": lambda _, spec: Fopdt(spec.gain, spec.tau_s, spec.dead_time_s, spec.bias, spec.initial),
    "sopdt": lambda _, spec: Sopdt(spec.gain, spec.tau_s, spec.tau2_s, spec.dead_time_s, spec.bias, spec.initial),
    "second_order": lambda _, spec: SecondOrder(
        spec.gain, spec.tau_s, spec.zeta, spec.dead_time_s, spec.bias, spec.initial
    ),
    "integrating": _integrating,
    "tank": _tank,
    "heat_cool": lambda _, spec: HeatCool(
        spec.gain, spec.cool_gain, spec.tau_s, spec.dead_time_s, spec.bias, spec.initial
    ),
}
"""Kind of plant to what builds it."""
