"""The axes of PID_REG_CE on which its one page is silent (spec D.2, D.6, D.7), each value named."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

from ahgateway.core.real import REAL, ZERO


class IntegralSpan(IntEnum):
    """What the printed limits 0 and TN of the integral mean (spec D.2)."""

    RUNNING = 0
    FIRST_TN = 1


class PauseFrom(IntEnum):
    """Which T1 makes a pause (spec D.7/1)."""

    LATCHED = 0
    TRACKING = 1


class ShortPulse(IntEnum):
    """Which T1 the pause sees when the first pulse was stretched to PT_MIN_IMP (spec D.7/3)."""

    PAUSE_FROM_T1 = 0
    PAUSE_FROM_STRETCHED = 1


class BacklashPause(IntEnum):
    """Whether PT_LUFT lengthens the T1 that makes the pause (spec D.7/4)."""

    WITHOUT_LUFT = 0
    WITH_LUFT = 1


class FirstBacklash(IntEnum):
    """Whether the very first pulse is lengthened by PT_LUFT (spec D.7/5)."""

    NO = 0
    YES = 1


class ZonePulse(IntEnum):
    """What happens to a pulse that is running when the zone is reached (spec D.7/6)."""

    FINISHED = 0
    CUT = 1


class SeriesEnd(IntEnum):
    """What becomes of the integral when a series ends (spec D.7/8)."""

    CLEARED = 0
    KEPT = 1


class Stopped(IntEnum):
    """What OSTANOV means (spec D.7/9)."""

    NO_SERIES_OR_MANUAL = 0
    NO_OUTPUT = 1


class ErrorSign(IntEnum):
    """Whether ERROR follows ACTION (spec D.7/10)."""

    FIXED = 0
    BY_ACTION = 1


class IdleY(IntEnum):
    """What Y shows inside the zone and in manual (spec D.7/11)."""

    ZERO = 0
    HELD = 1


class NoMinimumPulse(IntEnum):
    """What PT_MIN_IMP of 0 or less is (spec D.6)."""

    FAULT = 0
    ONE_CALL = 1


class PulseDialect(NamedTuple):
    """One way to read the page.

    Attributes:
        integral_span: Running integral, or one that ends TN after the series began.
        pause_from: T1 of the series, or recomputed from the present |Y| at each pulse end.
        short_pulse: Pause after a stretched first pulse.
        backlash_pause: Pause after a pulse lengthened by PT_LUFT.
        first_backlash: PT_LUFT on the very first pulse.
        zone_pulse: A running pulse when the zone is reached.
        series_end: Integral after a series.
        stopped: Meaning of OSTANOV.
        error_sign: Sign of ERROR in reverse action.
        idle_y: Y without demand.
        no_minimum_pulse: PT_MIN_IMP of 0 or less.
        rearm_ratio: A new series starts from a pause when |Y| exceeds this multiple of its first |Y|; 0 is never
            (spec D.7/2).
        reverse_pause: Rest before the direction changes, in s; 0 is none (spec D.7/7).
    """

    integral_span: IntegralSpan = IntegralSpan.RUNNING
    pause_from: PauseFrom = PauseFrom.LATCHED
    short_pulse: ShortPulse = ShortPulse.PAUSE_FROM_T1
    backlash_pause: BacklashPause = BacklashPause.WITHOUT_LUFT
    first_backlash: FirstBacklash = FirstBacklash.NO
    zone_pulse: ZonePulse = ZonePulse.FINISHED
    series_end: SeriesEnd = SeriesEnd.CLEARED
    stopped: Stopped = Stopped.NO_SERIES_OR_MANUAL
    error_sign: ErrorSign = ErrorSign.FIXED
    idle_y: IdleY = IdleY.ZERO
    no_minimum_pulse: NoMinimumPulse = NoMinimumPulse.FAULT
    rearm_ratio: REAL = ZERO
    reverse_pause: REAL = ZERO


DEFAULT = PulseDialect()

AXES: dict[str, type[IntEnum]] = {
    "integral_span": IntegralSpan,
    "pause_from": PauseFrom,
    "short_pulse": ShortPulse,
    "backlash_pause": BacklashPause,
    "first_backlash": FirstBacklash,
    "zone_pulse": ZonePulse,
    "series_end": SeriesEnd,
    "stopped": Stopped,
    "error_sign": ErrorSign,
    "idle_y": IdleY,
    "no_minimum_pulse": NoMinimumPulse,
}
"""Axis name in a profile to its enum; a value is written in lower case. The two REAL axes are numbers."""

RATIO_AXES: tuple[str, ...] = ("rearm_ratio", "reverse_pause")
