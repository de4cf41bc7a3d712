"""The axes of PID_Temp on which the manual is silent (spec E.3–E.8), each value named."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple


class DeadZone(IntEnum):
    """What an error outside the dead zone counts as (spec E.4)."""

    SHIFTED = 0
    JUMP = 1


class ZoneReturn(IntEnum):
    """The integral when PV comes back into the control zone (spec E.4)."""

    HELD = 0
    PRESET = 1


class Switching(IntEnum):
    """Whether an output of exactly 0 changes the parameter set (spec E.5)."""

    AT_ZERO = 0
    BEYOND_ZERO = 1


class ZoneAtTransfer(IntEnum):
    """What becomes of a bumpless preset when PV lies outside the control zone (spec E.7)."""

    DROPPED = 0
    KEPT = 1


class Resume(IntEnum):
    """How automatic mode goes on after the substitute output (spec E.7)."""

    PRESENT_OUTPUT = 0
    INTEGRAL_KEPT = 1


class InvalidGain(IntEnum):
    """The integral while a gain is not positive (spec E.7)."""

    STOPPED = 0
    CLEARED = 1


class WarningEdge(IntEnum):
    """Whether a warning limit that is just reached warns (spec E.7)."""

    EXCEEDED = 0
    REACHED = 1


class WarningLatch(IntEnum):
    """How long Warning shows what does not go away by itself (spec E.7)."""

    PRESENT = 0
    UNTIL_ACKNOWLEDGED = 1


class DisturbancePlace(IntEnum):
    """Where Disturbance joins the sum (spec E.8)."""

    BEFORE_FACTOR = 0
    AFTER_FACTOR = 1


class SamplingTime(IntEnum):
    """Which time the law takes when Cycle is no multiple of the call period (spec E.3)."""

    CONFIGURED = 0
    COUNTED = 1


class PerRounding(IntEnum):
    """How a peripheral output is rounded (spec E.6)."""

    HALF_EVEN = 0
    HALF_AWAY = 1


class PwmInactive(IntEnum):
    """What inactive mode does to carry and phase of the pulses (spec E.6)."""

    CLEARED = 0
    KEPT = 1


class PwmConflict(IntEnum):
    """Which rule wins when both minimum times do not fit into the period (spec E.6)."""

    ON_RULE = 0
    OFF_RULE = 1


class PidTempDialect(NamedTuple):
    """One way to read the manual.

    Attributes:
        dead_zone: Continuous (error less the zone), or the whole error outside.
        zone_return: Integral held over the time outside the control zone, or set for a bumpless return.
        switching: PidOutputSum of 0 counts as ready to switch, or does not.
        zone_at_transfer: Integral preset by manual → automatic or a switch of the set, outside the control zone.
        resume: After the substitute output bumpless from the present output, or with the integral as it was.
        invalid_gain: Integral while Gain or CoolFactor is not positive.
        warning_edge: Strict as in the manual's table, or reached as in its parameter list.
        warning_latch: As long as the cause, or until Reset or ErrorAck (text of the sibling PID_3Step).
        disturbance_place: Before or after CoolFactor; always before the limits.
        sampling_time: Cycle as configured, or calls × CycleTime.
        per_rounding: Of OutputHeat_PER and OutputCool_PER.
        pwm_inactive: Carry and phase in inactive mode.
        pwm_conflict: Minimum times longer than the period.
    """

    dead_zone: DeadZone = DeadZone.SHIFTED
    zone_return: ZoneReturn = ZoneReturn.HELD
    switching: Switching = Switching.AT_ZERO
    zone_at_transfer: ZoneAtTransfer = ZoneAtTransfer.DROPPED
    resume: Resume = Resume.PRESENT_OUTPUT
    invalid_gain: InvalidGain = InvalidGain.STOPPED
    warning_edge: WarningEdge = WarningEdge.EXCEEDED
    warning_latch: WarningLatch = WarningLatch.PRESENT
    disturbance_place: DisturbancePlace = DisturbancePlace.BEFORE_FACTOR
    sampling_time: SamplingTime = SamplingTime.CONFIGURED
    per_rounding: PerRounding = PerRounding.HALF_EVEN
    pwm_inactive: PwmInactive = PwmInactive.CLEARED
    pwm_conflict: PwmConflict = PwmConflict.ON_RULE


DEFAULT = PidTempDialect()

AXES: dict[str, type[IntEnum]] = {
    "dead_zone": DeadZone,
    "zone_return": ZoneReturn,
    "switching": Switching,
    "zone_at_transfer": ZoneAtTransfer,
    "resume": Resume,
    "invalid_gain": InvalidGain,
    "warning_edge": WarningEdge,
    "warning_latch": WarningLatch,
    "disturbance_place": DisturbancePlace,
    "sampling_time": SamplingTime,
    "per_rounding": PerRounding,
    "pwm_inactive": PwmInactive,
    "pwm_conflict": PwmConflict,
}
"""Axis name in a profile to its enum; a value is written in lower case, `dead_zone = "jump"`."""
