"""A run looked back on: any stretch of any loop, from the trails in memory or, further back, from its recording.

The recording may still be written. Each question opens it anew and reads no more than it needs, minute by minute and
in a thread of its own, so that a day takes time but neither memory nor pictures.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path

import numpy as np

from ahgateway.apps.board import Board
from ahgateway.apps.health import Array
from ahgateway.apps.lanes import Lane, lanes_of
from ahgateway.apps.marks import Mark, mark_recorded
from ahgateway.apps.stretch import Stretch, joined, of_trace, thinned
from ahgateway.clock import SECOND
from ahgateway.codec.station import Loop
from ahgateway.recording.packing import Block
from ahgateway.recording.parts import opened
from ahgateway.recording.reader import Recording
from ahgateway.recording.values import Field, column, fields

WIDENED_NS = 2 * SECOND
"""A verdict may have been kept in the second behind its picture."""

SLICES_MAX = 4000


class History:
    """What can be looked back on.

    Args:
        board: The run.
        path: Its recording; None when nothing is recorded.
        is_replay: The recording is being played: it knows what is to come.
    """

    def __init__(self, board: Board, path: Callable[[], Path | None], *, is_replay: bool = False) -> None:
        self._board = board
        self._path = path
        self._is_replay = is_replay
        self._known: tuple[Path, tuple[float, float]] | None = None

    def reach(self) -> tuple[float, float] | None:
        """Return from when to when there is something to look at, UTC in s; None before the first sample."""
        found: list[float] = []
        for trail in self._board.trails.trails.values():
            ends = trail.ends()
            found.extend(ends or ())
        found.extend(self._ends() or ())
        return (min(found), max(found)) if found else None

    def _ends(self) -> tuple[float, float] | None:
        """When the recording began and, unless it is still written, ended; looked up once for each file."""
        path = self._path()
        if path is None:
            return None
        if self._known is None or self._known[0] != path:
            with opened(path) as recording:
                _, first, last = recording.totals()
            if first is None or last is None:
                return None
            self._known = (path, (first / SECOND, last / SECOND))
        return self._known[1]

    async def stretch(self, name: str, since_s: float, until_s: float, slices: int) -> Stretch:
        """Return a loop's samples between two moments, with what stands out in each slice.

        Args:
            name: The loop.
            since_s: UTC in s.
            until_s: UTC in s, behind `since_s`.
            slices: How many slices of time the reader can tell apart, 1…`SLICES_MAX`.

        Raises:
            ValueError: The moments or the number of slices are none.
            CodecError: The recording is damaged.
        """
        if not 1 <= slices <= SLICES_MAX:
            raise ValueError(f"slices must lie within 1 to {SLICES_MAX}: {slices}")
        path = self._path()
        trail = self._board.trails.trails[name]
        ends = trail.ends()
        now_s = self._board.clock.utc_ns() / SECOND
        is_kept = ends is not None and ends[0] <= since_s and (not self._is_replay or until_s <= now_s)
        if path is None or is_kept:
            return thinned(of_trace(trail.trace(since_s), until_s), since_s, until_s, slices)
        return await asyncio.to_thread(_read, path, name, since_s, until_s, slices)


def _read(path: Path, name: str, since_s: float, until_s: float, slices: int) -> Stretch:
    with opened(path) as recording:
        return recorded(recording, name, since_s, until_s, slices)


def recorded(recording: Recording, name: str, since_s: float, until_s: float, slices: int) -> Stretch:
    """Return a stretch of a recording, thinned minute by minute and once more as a whole."""
    if not since_s < until_s:
        raise ValueError(f"no time between {since_s} and {until_s} s")
    loop = next(loop for loop in recording.station.loops if loop.name == name)
    since_ns, until_ns = round(since_s * SECOND), round(until_s * SECOND)
    said = _said(recording, loop, since_ns - WIDENED_NS, until_ns + WIDENED_NS)
    parts = []
    before: Array | None = None
    for block in recording.blocks(name, since_ns, until_ns):
        part, before = _of_block(loop, block, said, before)
        inside = np.flatnonzero((block.utc_ns >= since_ns) & (block.utc_ns <= until_ns))
        kept = thinned(part.taken(inside, is_whole=True), since_s, until_s, slices)
        if kept.t_s.size:
            parts.append(kept)
    return _with_gaps(thinned(joined(parts, len(lanes_of(loop))), since_s, until_s, slices), recording)


def _said(recording: Recording, loop: Loop, since_ns: int, until_ns: int) -> dict[int, tuple[Mark, float]]:
    """Mark of each tick, and the reference's MV where the verdict tells it."""
    found: dict[int, tuple[Mark, float]] = {}
    for name, tick, verdict in recording.verdicts(since_ns, until_ns):
        if name == loop.name:
            ref = verdict["ref"] if verdict["term"] == loop.controller.roles.mv else None
            value = float(ref) if isinstance(ref, int | float) else float("nan")
            found[tick] = (mark_recorded(verdict), value)
    return found


def _of_block(
    loop: Loop, block: Block, said: dict[int, tuple[Mark, float]], before: Array | None
) -> tuple[Stretch, Array]:
    """Columns of one block, and its last row of steps for the next."""
    places = {field.name: field for field in fields(loop)}
    roles = loop.controller.roles
    sv, pv, mv = (_values(block, places[name]) for name in (roles.sv, roles.published_pv or roles.pvs[0], roles.mv))
    known = [said.get(tick, (Mark.NONE, float("nan"))) for tick in block.ticks.tolist()]
    mark = np.array([each[0] for each in known], np.float64)
    ref = np.array([each[1] for each in known], np.float64)
    ref = np.where((mark == Mark.PROVEN) | (mark == Mark.TRIVIAL), mv, ref)
    raw = np.array([_values(block, places[lane.operand]) for lane in lanes_of(loop)])
    raw = raw.reshape(len(lanes_of(loop)), block.ticks.size)
    last = raw[:, 0] * np.nan if before is None else before
    drawn = [_lane(*each) for each in zip(lanes_of(loop), raw, last.tolist(), strict=True)]
    lanes = np.array(drawn).reshape(raw.shape)
    # In two parts, because a number of ns since 1970 has more digits than a float.
    t_s = block.utc_ns // SECOND + block.utc_ns % SECOND / SECOND
    return Stretch(t_s, np.array([sv, pv, mv, ref]), mark, lanes), raw[:, -1]


def _values(block: Block, field: Field) -> Array:
    return np.asarray(column(block.words, field.kind, field.first, field.length), np.float64)


def _lane(lane: Lane, raw: Array, before: float) -> Array:
    if lane.is_step:
        return np.diff(raw, prepend=before)
    if lane.bit:
        return np.asarray(raw.astype(np.int64) & lane.bit != 0, np.float64)
    return raw


def _with_gaps(stretch: Stretch, recording: Recording) -> Stretch:
    """Break the curves where the link was lost: behind the last sample before it nothing is known."""
    lost = [event.utc_ns / SECOND for event in recording.events("link") if not event.found["up"]]
    inside = [moment for moment in lost if stretch.t_s.size and stretch.t_s[0] < moment <= stretch.t_s[-1]]
    if not inside:
        return stretch
    at = np.searchsorted(stretch.t_s, inside)
    return Stretch(
        np.insert(stretch.t_s, at, inside),
        np.insert(stretch.curves, at, np.nan, axis=1),
        np.insert(stretch.mark, at, float(Mark.LINK)),
        np.insert(stretch.lanes, at, np.nan, axis=1),
        stretch.is_whole,
    )
