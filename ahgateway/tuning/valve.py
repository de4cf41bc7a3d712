"""What a worn valve makes of MV: backlash and stiction, one parameter each."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def backlash(mv: Array, play: float, start: float = 0.0) -> Array:
    """Return the valve's position when it follows MV with this play: it moves only when pushed from one side.

    Args:
        mv: What it is told.
        play: Between the two sides, in MV.
        start: Where it stands within its play at first: −½ where it was opened last, ½ where it was closed.
    """
    half = play / 2.0
    position = float(mv[0]) + start * play
    out = np.empty_like(mv)
    for index, wanted in enumerate(mv.tolist()):
        position = min(max(position, wanted - half), wanted + half)
        out[index] = position
    return out


def stiction(mv: Array, band: float) -> Array:
    """Return the valve's position when it stands until MV is more than `band` away, and then jumps to MV.

    The one-parameter form of the data-driven stiction models (He, Wang, Pottmann and Qin 2007, with equal static and
    kinetic bands).
    """
    position = float(mv[0])
    out = np.empty_like(mv)
    for index, wanted in enumerate(mv.tolist()):
        if abs(wanted - position) > band:
            position = wanted
        out[index] = position
    return out
