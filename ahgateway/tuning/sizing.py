"""How large a step of MV must be, from the noise and resolution of PV and from PV's answer to a small step.

This file alone decides what is enough and what is too little. It moves nothing: `apps.tune_experiment` asks it between
two samples. All steps are in MV and positive, all answers in PV.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from ahgateway.errors import StateError
from ahgateway.tuning.checks import SNR_MIN

FIRST_SHARE = 0.01
"""The first small step, as a share of what MV may move by."""
GROWTH = 4.0
"""By how much a small step that shows nothing grows."""
SNR_WANTED = 20.0
"""Answer of PV that is aimed at, in standard deviations of its noise; `checks.SNR_MIN` is the floor."""
STEPS_WANTED = 20.0
"""The same in steps of PV's resolution."""
STEPS_MIN = 5.0
SEEN = 5.0
"""An answer is one above so many standard deviations of its own mean."""
ROOM_MAX = 0.5
"""Largest answer as a share of PV's room to its nearer bound."""


@dataclass(frozen=True, slots=True)
class Quiet:
    """PV at rest.

    Attributes:
        noise: Standard deviation of its fast noise.
        resolution: Step of its converter, 0 where none is seen.
        room: How far it may move before its nearer bound.
    """

    noise: float
    resolution: float
    room: float

    @property
    def wanted(self) -> float:
        """Answer that is aimed at: clear of noise and resolution, but within the room."""
        return min(max(SNR_WANTED * self.noise, STEPS_WANTED * self.resolution, 1e-9), ROOM_MAX * self.room)

    @property
    def floor(self) -> float:
        """Smallest answer from which anything can be told."""
        return max(SNR_MIN * self.noise, STEPS_MIN * self.resolution, 1e-9)

    def seen(self, count: int) -> float:
        """Smallest mean of `count` samples that is an answer and no chance."""
        return max(SEEN * self.noise / math.sqrt(count), 1.5 * self.resolution, 1e-9)


def first(span: float, largest: float) -> float:
    """Return the first small step, for an MV that may move by `span` and at once by `largest`."""
    return min(FIRST_SHARE * span, largest)


def sized(quiet: Quiet, step: float, answer: float, largest: float, loop: str) -> float:
    """Return the step that makes PV answer as wanted, when `step` made it answer by `answer`.

    Args:
        quiet: PV at rest.
        step: What was tried, in MV.
        answer: How far PV went, in PV; nearly 0 where nothing was seen.
        largest: What profile and bounds allow.
        loop: Tag, for the message.

    Raises:
        StateError: Even the largest step stays below the floor; the message has the ratio.
    """
    slope = answer / step
    best = slope * largest
    if best < quiet.floor:
        unit = quiet.floor / (SNR_MIN if quiet.floor > STEPS_MIN * quiet.resolution else STEPS_MIN)
        what = "noise" if quiet.floor > STEPS_MIN * quiet.resolution else "resolution"
        raise StateError(
            f"loop {loop}: PV answers a step of {step:.4g} in MV by {answer:.3g}, and one of {largest:.4g}, "
            f"the largest allowed, would move it by {best:.3g}: {best / unit:.1f} times its {what} of {unit:.3g}, "
            f"at least {SNR_MIN:g} is needed; everything has been put back",
            hint="allow a larger step_max of MOUT or wider --mv-bounds, filter PV, or see whether the valve moves",
        )
    return min(quiet.wanted / slope, largest)


def check_room(quiet: Quiet, loop: str) -> None:
    """Make sure that PV may move far enough at all.

    Raises:
        StateError: Half of its room is below the floor.
    """
    if ROOM_MAX * quiet.room < quiet.floor:
        raise StateError(
            f"loop {loop}: PV may answer by {ROOM_MAX * quiet.room:.3g}, half of its room to its nearer bound; "
            f"with noise {quiet.noise:.3g} and resolution {quiet.resolution:.3g} at least {quiet.floor:.3g} is needed; "
            "nothing was written",
            hint="wider --pv-bounds, or filter PV",
        )
