"""What trends and loop health look back on: the last samples of every loop in a ring, so that memory stays flat."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ahgateway.apps.health import Array, Window
from ahgateway.apps.lanes import lane_values, lanes_of
from ahgateway.apps.marks import Mark, mark_of
from ahgateway.apps.monitor import LinkChange, Report, Sample
from ahgateway.clock import SECOND
from ahgateway.codec.station import Station
from ahgateway.lockstep.follow import cycle_ns, is_automatic, output_of, process_value_of, reference_of, target_of
from ahgateway.lockstep.judge import Execution
from ahgateway.lockstep.picture import Picture

CAPACITY = 4096
"""Samples kept of a loop: a bit over an hour at CYCLE 1 s."""
COLUMNS = ("sv", "pv", "mv", "ref_mv", "mv_min", "mv_max", "auto", "mark")


@dataclass(frozen=True, slots=True)
class Trace:
    """The last samples of one loop, oldest first; a row of NaN is a gap. REALs keep their value exactly.

    Attributes:
        t_s: Time in s, UTC.
        ref_mv: MV of the reference at the last execution, NaN where there was none.
        mark: The worst of what was said since the sample before, as a number of `Mark`.
        lanes: What drives the actuator, shape (lanes, samples).
    """

    t_s: Array
    sv: Array
    pv: Array
    mv: Array
    ref_mv: Array
    mv_min: Array
    mv_max: Array
    auto: Array
    mark: Array
    lanes: Array

    def window(self) -> Window:
        """Return what is whole of it for loop health."""
        whole = np.isfinite(self.sv) & np.isfinite(self.pv) & np.isfinite(self.mv)
        rising = np.diff(self.t_s[whole], prepend=-np.inf) > 0.0
        kept = np.flatnonzero(whole)[rising]
        return Window(
            t_s=self.t_s[kept],
            sv=self.sv[kept],
            pv=self.pv[kept],
            mv=self.mv[kept],
            auto=self.auto[kept] > 0.0,
            mv_min=self.mv_min[kept],
            mv_max=self.mv_max[kept],
        )


class Trail:
    """A ring of one loop's samples, with so many lanes beside its columns."""

    def __init__(self, capacity: int = CAPACITY, lanes: int = 0) -> None:
        # Filled, not zeros: the memory is taken now, and does not grow hour by hour until the ring is full.
        self._times = np.full(capacity, np.nan)
        self._values = np.full((capacity, len(COLUMNS) + lanes), np.nan, np.float32)
        self._next = 0
        self._count = 0

    def __len__(self) -> int:
        return self._count

    def add(self, t_s: float, row: tuple[float, ...]) -> None:
        """Keep one sample: SV, PV, MV, MV of the reference, MV_MIN, MV_MAX, 1 in automatic, mark, then the lanes."""
        self._times[self._next] = t_s
        self._values[self._next] = row
        self._next = (self._next + 1) % self._times.size
        self._count = min(self._count + 1, self._times.size)

    def ends(self) -> tuple[float, float] | None:
        """Return the times of the oldest and the newest sample in s; None when there is none."""
        if not self._count:
            return None
        size = self._times.size
        return float(self._times[(self._next - self._count) % size]), float(self._times[(self._next - 1) % size])

    def cut(self, t_s: float) -> None:
        """Forget what is newer than a time, and mark that nothing is known from then on."""
        newest = self._times[(self._next - 1 - np.arange(self._count)) % self._times.size]
        newer = int(np.count_nonzero(newest > t_s))
        self._next = (self._next - newer) % self._times.size
        self._count -= newer
        if self._count:
            self.gap(t_s)

    def gap(self, t_s: float) -> None:
        """Mark that nothing is known from now on."""
        row = [float("nan")] * self._values.shape[1]
        row[COLUMNS.index("mark")] = float(Mark.LINK)
        self.add(t_s, tuple(row))

    def trace(self, since_s: float = -np.inf) -> Trace:
        """Return the samples from a time on as arrays of their own."""
        order = (self._next - self._count + np.arange(self._count)) % self._times.size
        order = order[self._times[order] >= since_s]
        columns = self._values[order].astype(np.float64).T
        named = dict(zip(COLUMNS, columns[: len(COLUMNS)], strict=True))
        return Trace(t_s=self._times[order], lanes=columns[len(COLUMNS) :], **named)


class Trails:
    """The trail of every loop of a station, fed with the monitor's reports.

    Not every picture is kept: one for each execution, and one for each CYCLE without.
    """

    def __init__(self, station: Station, capacity: int = CAPACITY) -> None:
        self._loops = {loop.name: loop for loop in station.loops}
        self.trails = {name: Trail(capacity, len(lanes_of(loop))) for name, loop in self._loops.items()}
        self._ref_mv = dict.fromkeys(self._loops, float("nan"))
        self._executed = dict.fromkeys(self._loops, False)
        self._mark = dict.fromkeys(self._loops, Mark.NONE)
        self._before: dict[str, Picture | None] = dict.fromkeys(self._loops)
        self._kept_ns = dict.fromkeys(self._loops, 0)

    def take(self, report: Report) -> None:
        """Take in one report."""
        event = report.event
        if isinstance(event, LinkChange):
            if not event.is_up:
                for trail in self.trails.values():
                    trail.gap(report.utc_ns / SECOND)
                self._ref_mv = dict.fromkeys(self._loops, float("nan"))
                self._before = dict.fromkeys(self._loops)
        elif report.loop not in self.trails:
            return
        elif isinstance(event, Execution):
            self._executed[report.loop] = True
            self._mark[report.loop] = max(self._mark[report.loop], mark_of(event))
            if event.terms is not None:
                self._ref_mv[report.loop] = float(reference_of(self._loops[report.loop], event.terms))
        elif isinstance(event, Sample):
            self._sample(report.loop, event.picture)

    def cut(self, t_s: float) -> None:
        """Forget what is newer than a time: a recording goes on from there."""
        for trail in self.trails.values():
            trail.cut(t_s)
        self._ref_mv = dict.fromkeys(self._loops, float("nan"))
        self._before = dict.fromkeys(self._loops)
        self._kept_ns = dict.fromkeys(self._loops, 0)

    def _sample(self, name: str, picture: Picture) -> None:
        loop = self._loops[name]
        cycle = cycle_ns(loop, picture)
        if not self._executed[name] and picture.utc_ns - self._kept_ns[name] < cycle:
            return
        self._executed[name] = False
        self._kept_ns[name] = picture.utc_ns
        inputs = picture.inputs
        self.trails[name].add(
            picture.utc_ns / SECOND,
            (
                float(target_of(loop, picture)),
                float(process_value_of(loop, picture)),
                float(output_of(loop, picture)),
                self._ref_mv[name],
                float(getattr(inputs, "mv_min", "nan")),
                float(getattr(inputs, "mv_max", "nan")),
                float(is_automatic(loop, picture)),
                float(self._mark[name]),
                *lane_values(loop, picture, self._before[name]),
            ),
        )
        self._mark[name] = Mark.NONE
        self._before[name] = picture
