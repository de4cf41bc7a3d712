"""A trace of one loop: what stood on SV, PV and MV at which time, and how it is brought onto an even grid."""

from __future__ import annotations

from dataclasses import dataclass

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
    """

    t_s: Array
    sv: Array
    pv: Array
    mv: Array
    name: str = "record"
    mv_limits: tuple[float, float] | None = None

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
    return Record(t_s, record.sv[good], record.pv[good], record.mv[good], record.name, record.mv_limits)


def even(record: Record) -> Record:
    """Return the record on an even grid with the median interval; MV and SV are held, PV is drawn straight between.

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
    return Record(grid, record.sv[held], pv, record.mv[held], record.name, record.mv_limits)
