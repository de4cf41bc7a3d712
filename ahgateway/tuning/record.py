"""A trace of one loop: what stood on SV, PV and MV at which time, and how it is brought onto an even grid."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ahgateway.errors import ProfileError

Array = NDArray[np.float64]

SAMPLES_MIN = 20
"""Fewest samples that are looked at; below it no residual test means anything."""
SAMPLES_MAX = 1_000_000
"""Most samples on the even grid."""
JITTER_MAX = 0.02
"""Spread of the sampling interval, as a share of its median, that still counts as even."""


@dataclass(frozen=True, slots=True)
class Record:
    """Samples of one loop, all arrays of one length; MV is held from each sample to the next.

    Attributes:
        t_s: Time in s, strictly rising.
        sv: Setpoint in the loop's PV unit; NaN where it is not known.
        pv: Process value.
        mv: Output as it went to the actuator.
        name: Where it came from, for messages.
        mv_limits: Lowest and highest MV that the loop can give, None when nobody said.
        acted: Mean of MV from each sample to the next, where MV is known to have moved between samples; None is MV.
        timing_s: Half of the time within which each move of MV is known; it belongs to the dead time's interval.
    """

    t_s: Array
    sv: Array
    pv: Array
    mv: Array
    name: str = "record"
    mv_limits: tuple[float, float] | None = None
    acted: Array | None = None
    timing_s: float = 0.0

    @property
    def input(self) -> Array:
        """What moved the process from each sample to the next."""
        return self.mv if self.acted is None else self.acted

    @property
    def ts_s(self) -> float:
        """Median time from sample to sample in s."""
        return float(np.median(np.diff(self.t_s)))

    @property
    def is_even(self) -> bool:
        """Tell whether the samples stand on an even grid, but for jitter."""
        steps = np.diff(self.t_s)
        return bool(np.max(np.abs(steps - np.median(steps))) <= JITTER_MAX * float(np.median(steps)))


def checked(record: Record) -> Record:
    """Return the record without samples that are no number.

    Raises:
        ProfileError: Fewer samples than a fit can stand on, or time that does not rise.
    """
    good = np.isfinite(record.t_s) & np.isfinite(record.pv) & np.isfinite(record.mv)
    count = int(np.count_nonzero(good))
    if count < SAMPLES_MIN:
        raise ProfileError(
            f"holds {count} samples that are numbers, at least {SAMPLES_MIN} are needed", file=record.name
        )
    t_s = record.t_s[good]
    back = np.flatnonzero(np.diff(t_s) <= 0.0)
    if back.size:
        first = int(back[0])
        raise ProfileError(
            f"time does not rise: {t_s[first]:g} s is followed by {t_s[first + 1]:g} s at sample {first + 1}",
            file=record.name,
            hint="sort the file by time, and leave each time only once",
        )
    acted = None if record.acted is None else record.acted[good]
    return replace(record, t_s=t_s, sv=record.sv[good], pv=record.pv[good], mv=record.mv[good], acted=acted)


def even(record: Record) -> Record:
    """Return the record on an even grid with the median interval; MV and SV are held, PV is drawn straight between.

    What acted is the mean of the held MV over each interval of the grid, so that a move between two of its points
    keeps its time.

    Raises:
        ProfileError: The grid would have more than `SAMPLES_MAX` samples.
    """
    if record.is_even:
        return record
    ts = record.ts_s
    count = int(np.floor((record.t_s[-1] - record.t_s[0]) / ts)) + 1
    if count > SAMPLES_MAX:
        raise ProfileError(
            f"{count} samples of {ts:g} s between {record.t_s[0]:g} s and {record.t_s[-1]:g} s, "
            f"at most {SAMPLES_MAX} are taken",
            file=record.name,
            hint="cut the gap out of the file",
        )
    grid = record.t_s[0] + ts * np.arange(count)
    held = np.clip(np.searchsorted(record.t_s, grid + 1e-9 * ts, side="right") - 1, 0, record.t_s.size - 1)
    pv = np.interp(grid, record.t_s, record.pv)
    sums = np.concatenate([[0.0], np.cumsum(record.input[:-1] * np.diff(record.t_s))])
    edges = np.append(grid, grid[-1] + ts)
    ahead = sums[-1] + record.input[-1] * np.maximum(edges - record.t_s[-1], 0.0)
    acted = np.diff(np.where(edges > record.t_s[-1], ahead, np.interp(edges, record.t_s, sums))) / ts
    return replace(record, t_s=grid, sv=record.sv[held], pv=pv, mv=record.mv[held], acted=acted)


def polled(record: Record, stood_s: Array | None = None, sent_s: Array | None = None) -> Record:
    """Return a record whose samples were read out of a PLC: MV was already there when it was read.

    A move that stands in a sample came at some time since the sample before, and not before the request that asked
    for it; its middle is taken, and half of that time is what the dead time is uncertain by.

    Args:
        record: As read, time in s.
        stood_s: When each MV was read the first time; None is the record's time.
        sent_s: When requests left that wrote what MV follows, rising; None where the PLC alone moved MV.
    """
    t, mv = record.t_s, record.mv
    low, high = t[:-1].copy(), t[1:] if stood_s is None else np.minimum(stood_s[1:], t[1:])
    if sent_s is not None and sent_s.size:
        last = np.searchsorted(sent_s, high, side="right") - 1
        low = np.maximum(low, np.where(last >= 0, sent_s[np.maximum(last, 0)], -np.inf))
    low = np.minimum(low, high)
    share = (0.5 * (low + high) - t[:-1]) / np.diff(t)
    acted = np.append(mv[:-1] * share + mv[1:] * (1.0 - share), mv[-1])
    moves = np.abs(np.diff(mv))
    timing = float(0.5 * (high - low) @ moves / np.sum(moves)) if np.any(moves) else 0.0
    return replace(record, acted=acted, timing_s=timing)
