"""What drives the actuator beside MV, controller by controller: pulses, heat and cool, increments, alarms.

A lane is one line of a time line that the PLC itself shows; DPID and DPIDE have none.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ahgateway.codec.station import Loop
from ahgateway.core.controllers import melsec_pid
from ahgateway.lockstep.picture import Picture


@dataclass(frozen=True, slots=True)
class Lane:
    """One line.

    Attributes:
        name: What stands before it.
        operand: Where it comes from, in the controller's spelling.
        unit: Engineering unit; `MV` for the loop's own, empty for a switch.
        is_switch: It is ON or OFF.
        bit: Mask within a whole number; 0 for the value itself.
        is_step: What it changed by since the picture before, not what it is.
    """

    name: str
    operand: str
    unit: str = ""
    is_switch: bool = True
    bit: int = 0
    is_step: bool = False

    def value(self, raw: float) -> float:
        """Return the lane's value from the operand's; ON is 1."""
        if self.bit:
            return float(bool(int(raw) & self.bit))
        return raw


LANES: dict[str, tuple[Lane, ...]] = {
    "PID_REG_CE": (
        Lane("OPEN", "OPEN_OUT"),
        Lane("CLOSE", "CLOSE_OUT"),
        Lane("stopped", "OSTANOV"),
    ),
    "PID_Temp": (
        Lane("heat", "OutputHeat", "%", is_switch=False),
        Lane("cool", "OutputCool", "%", is_switch=False),
        Lane("HEAT pulse", "OutputHeat_PWM"),
        Lane("COOL pulse", "OutputCool_PWM"),
        Lane("PV too high", "InputWarning_H"),
        Lane("PV too low", "InputWarning_L"),
    ),
    "MELSEC_PID": (
        Lane("velocity", "MV", "MV", is_switch=False, is_step=True),
        Lane("alarm PV up", "S24", bit=melsec_pid.ALARM_IN_INC),
        Lane("alarm PV down", "S24", bit=melsec_pid.ALARM_IN_DEC),
        Lane("alarm MV up", "S24", bit=melsec_pid.ALARM_OUT_INC),
        Lane("alarm MV down", "S24", bit=melsec_pid.ALARM_OUT_DEC),
    ),
}
"""By the controller's name; every operand is one that the controller leaves in memory."""


def lanes_of(loop: Loop) -> tuple[Lane, ...]:
    """Return the lanes of a loop's controller."""
    return LANES.get(loop.controller.name, ())


def lane_values(loop: Loop, picture: Picture, before: Picture | None) -> tuple[float, ...]:
    """Return the value of every lane; NaN for a step without a picture before."""
    return tuple(_value(lane, picture.seen, before.seen if before is not None else None) for lane in lanes_of(loop))


def _value(lane: Lane, seen: Any, before: Any) -> float:
    now = float(seen[lane.operand])
    if lane.is_step:
        return now - float(before[lane.operand]) if before is not None else float("nan")
    return lane.value(now)
