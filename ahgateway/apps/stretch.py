"""A stretch of a loop's time with no more samples than a screen can show; nothing that stands out is lost.

This file alone decides which samples may be left out. Every sample that stays is one that was seen, at its own time:
of each slice of time the first, the last, and where any of the curves is lowest and highest; a gap stays a gap, and of
the marks of a slice the worst. It is pure.

Source:
    First, last, minimum and maximum of each pixel column draw the same picture as all samples: Jugel and others, M4,
    Proc. VLDB Endowment 7 (2014) 797-808.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ahgateway.apps.health import Array
from ahgateway.apps.trail import Trace

CURVES = ("sv", "pv", "mv", "ref_mv")
"""Rows of `Stretch.curves`: setpoint, process value, output, output of the reference (NaN where it is not known)."""


@dataclass(frozen=True, slots=True)
class Stretch:
    """Samples of one loop, oldest first; NaN where nothing is known.

    Attributes:
        t_s: Time in s, UTC; shape (samples).
        curves: Shape (4, samples), in the order of `CURVES`.
        mark: What was said of the executions, as numbers of `Mark`; shape (samples).
        lanes: What drives the actuator, shape (lanes, samples).
        is_whole: No sample was left out.
    """

    t_s: Array
    curves: Array
    mark: Array
    lanes: Array
    is_whole: bool = True

    def curve(self, name: str) -> Array:
        """Return one of `CURVES`."""
        found: Array = self.curves[CURVES.index(name)]
        return found

    def taken(self, index: NDArray[np.intp], *, is_whole: bool) -> Stretch:
        """Return some of the samples."""
        return Stretch(self.t_s[index], self.curves[:, index], self.mark[index], self.lanes[:, index], is_whole)


def of_trace(trace: Trace, until_s: float = np.inf) -> Stretch:
    """Return a trail's samples up to a time as a stretch."""
    curves = np.array([trace.sv, trace.pv, trace.mv, trace.ref_mv])
    whole = Stretch(trace.t_s, curves, trace.mark, trace.lanes)
    return whole.taken(np.flatnonzero(trace.t_s <= until_s), is_whole=True)


def joined(stretches: list[Stretch], lanes: int) -> Stretch:
    """Return stretches one behind the other; an empty one for none."""
    if not stretches:
        return Stretch(np.zeros(0), np.zeros((len(CURVES), 0)), np.zeros(0), np.zeros((lanes, 0)))
    return Stretch(
        np.concatenate([each.t_s for each in stretches]),
        np.concatenate([each.curves for each in stretches], axis=1),
        np.concatenate([each.mark for each in stretches]),
        np.concatenate([each.lanes for each in stretches], axis=1),
        all(each.is_whole for each in stretches),
    )


def thinned(stretch: Stretch, since_s: float, until_s: float, slices: int) -> Stretch:
    """Return a stretch with what stands out in each of so many slices of time between two moments.

    A stretch with no more than four samples in each slice that has any comes back as it is.

    Raises:
        ValueError: There are no slices, or no time between the moments.
    """
    if slices < 1 or not since_s < until_s:
        raise ValueError(f"{slices} slices between {since_s} and {until_s} s")
    size = stretch.t_s.size
    place = np.clip(((stretch.t_s - since_s) / (until_s - since_s) * slices).astype(np.int64), 0, slices - 1)
    starts = np.flatnonzero(np.diff(place, prepend=-1))
    if size <= 4 * starts.size:
        return stretch
    ends = np.append(starts[1:], size) - 1
    chosen = [starts, ends]
    for curve in (*stretch.curves, *stretch.lanes):
        known = np.isfinite(curve)
        chosen += [_lowest(np.where(known, side * curve, np.inf), starts) for side in (1.0, -1.0)]
    # The first moment of a gap, so that it stays one.
    chosen.append(_lowest(np.where(np.isfinite(stretch.curve("pv")), 1.0, 0.0), starts))
    index = np.unique(np.concatenate(chosen))
    worst = np.maximum.reduceat(stretch.mark, starts)
    kept = stretch.taken(index, is_whole=False)
    return replace(kept, mark=worst[np.searchsorted(starts, index, side="right") - 1])


def _lowest(values: Array, starts: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return where each slice has its lowest value, the first of equals."""
    lowest = np.minimum.reduceat(values, starts)
    groups = np.repeat(np.arange(starts.size), np.diff(starts, append=values.size))
    hits = np.flatnonzero(values == lowest[groups])
    _, first = np.unique(groups[hits], return_index=True)
    found: NDArray[np.intp] = hits[first]
    return found


def runs(stretch: Stretch) -> list[tuple[float, float, int]]:
    """Return (from s, to s, mark) of each run of equal marks; a moment without a verdict belongs to the one before.

    A run ends where the next begins; the last one ends at the last sample.
    """
    judged = np.flatnonzero(stretch.mark > 0)
    if not judged.size:
        return []
    marks = stretch.mark[judged].astype(np.int64)
    firsts = np.flatnonzero(np.diff(marks, prepend=-1))
    begins = stretch.t_s[judged[firsts]]
    ends = np.append(begins[1:], stretch.t_s[-1])
    return list(zip(begins.tolist(), ends.tolist(), marks[firsts].tolist(), strict=True))
