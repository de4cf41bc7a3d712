"""A recording followed again, execution by execution, with the dialect and tolerances of then or others.

Pictures are put together from the raw words, so the same follower sees the same bits at the same times and comes to
the same verdicts. Nothing here reads a clock: time is what the recording says.
"""

from __future__ import annotations

import asyncio
import json
from collections import defaultdict, deque
from collections.abc import AsyncIterator, Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from difflib import get_close_matches
from typing import Any

import numpy as np

from ahgateway.apps.frame_tape import FrameTape, recorded_scheme
from ahgateway.apps.monitor import LinkChange, Monitor, Report, reports_of
from ahgateway.apps.player import Player
from ahgateway.apps.record import JUDGING, verdict_text, versions
from ahgateway.apps.report import as_json
from ahgateway.clock import Clock
from ahgateway.codec import block
from ahgateway.codec.station import Loop, Station, Tolerance
from ahgateway.codec.ways import Way
from ahgateway.core.real import REAL
from ahgateway.errors import StateError
from ahgateway.lockstep.follow import Follower
from ahgateway.lockstep.judge import Execution
from ahgateway.lockstep.picture import Picture
from ahgateway.lockstep.source import executions_told
from ahgateway.recording.reader import Event, Recording, Row
from ahgateway.recording.station_text import dialect_from, dialect_json
from ahgateway.transports.base import Link, Tap


@dataclass(frozen=True, slots=True)
class Changes:
    """What is judged otherwise than it was then.

    Attributes:
        dialect: Axis to value, for every loop, as a profile writes them.
        tolerance: None: that of then.
    """

    dialect: Mapping[str, str]
    tolerance: Tolerance | None = None

    @property
    def are_none(self) -> bool:
        """True when the same verdicts are to be expected."""
        return not self.dialect and self.tolerance is None


@dataclass(frozen=True, slots=True)
class Judges:
    """Which program judged then, and which judges now, by the names of the recording's facts.

    Attributes:
        then: `ahgateway`, `core` and `judge` as recorded; "" where the file does not say.
        now: The same of this program.
    """

    then: Mapping[str, str]
    now: Mapping[str, str]

    @property
    def are_same(self) -> bool:
        """True when nothing that makes a verdict has changed since."""
        return self.then == self.now


def judges(recording: Recording) -> Judges:
    """Return who judged the recording, and who does it now."""
    names = ("ahgateway", *JUDGING)
    now = versions()
    return Judges({name: recording.meta.get(name, "") for name in names}, {name: now[name] for name in names})


def picture_of(loop: Loop, row: Row) -> Picture:
    """Return the picture that was recorded as this row, bit for bit."""
    enabled = bool(row.words[block.EN][0]) if block.EN in row.words else None
    return Picture(
        tick=row.tick,
        inputs=block.inputs(loop, row.words),
        seen=block.seen(loop, row.words),
        words=row.words,
        enabled=None if loop.way is Way.STEPPED else enabled,
        running=row.running,
        sent_ns=row.sent_ns,
        last_ns=row.last_ns,
        utc_ns=row.utc_ns,
        aligned_since_ns=row.aligned_since_ns,
        executions=executions_told(loop, enabled=enabled),
        is_exact=loop.way is Way.RECORDED,
    )


def judged_again(station: Station, changes: Changes) -> Station:
    """Return the station with other dialects and tolerances.

    Raises:
        CodecError: An axis or value is not known.
    """
    loops = []
    for loop in station.loops:
        named = {**dialect_json(loop.controller, loop.dialect), **changes.dialect}
        tolerance = loop.tolerance if changes.tolerance is None else changes.tolerance
        loops.append(
            replace(loop, dialect=dialect_from(loop.controller, named, f"loop {loop.name}"), tolerance=tolerance)
        )
    return replace(station, loops=tuple(loops))


class Replay:
    """Follows the loops of a recording.

    Args:
        recording: Where the rows come from.
        station: The loops to follow, with the dialects to judge by; None: as they were recorded.
        loops: Names of the loops to follow; () for all.

    Raises:
        StateError: The recording has no such loop, records another instruction for it, or holds someone else's trend,
            which lacks what an instruction remembers.
    """

    def __init__(self, recording: Recording, station: Station | None = None, loops: tuple[str, ...] = ()) -> None:
        self.recording = recording
        self.station = station or recording.station
        known = {loop.name: loop for loop in recording.station.loops}
        wanted = loops or tuple(loop.name for loop in self.station.loops)
        for name in wanted:
            _require(recording, known, name)
        if recording.meta.get("origin") == "import":
            raise StateError(
                f"{recording.path}: was made from a trend, which lacks the words that the instruction remembers",
                hint="`ahgateway export` and `ahgateway tune` take it; judging needs a recording of a PLC",
            )
        own = {loop.name: loop for loop in self.station.loops if loop.name in wanted}
        for name, loop in own.items():
            if loop.controller.name != known[name].controller.name:
                raise StateError(
                    f"{recording.path}: loop {name} is {known[name].controller.name} in the recording, "
                    f"{loop.controller.name} in the profile"
                )
        self.followers = {name: Follower(loop) for name, loop in own.items()}
        self._lost = _lost_marks(recording)

    def reports(self) -> Iterator[Report]:
        """Yield what happened, as it was reported then, picture by picture."""
        for _, look in self.steps():
            yield from look()

    def steps(self, since_ns: int | None = None) -> Iterator[tuple[int, Callable[[], list[Report]]]]:
        """Yield when each picture was whole, in monotonic ns, and what follows it and returns what it reports.

        Args:
            since_ns: Begin at the first picture from this UTC on; None for the whole recording.
        """
        told = sorted(self.recording.events("link"), key=lambda event: event.utc_ns)
        at = 0
        if since_ns is not None:
            at = sum(event.utc_ns < since_ns for event in told)
            self._skip_lost(since_ns)
        last_ns = 0
        for row in self.recording.rows(set(self.followers), since_ns):
            if since_ns is not None and row.utc_ns < since_ns:
                continue
            last_ns = row.last_ns
            while at < len(told) and told[at].utc_ns <= row.utc_ns:
                event = told[at]
                yield last_ns, lambda event=event: [_link_report(event)]  # type: ignore[misc]
                at += 1
            yield last_ns, lambda row=row: self.see(row)  # type: ignore[misc]
        for name, marks in self._lost.items():
            while marks and name in self.followers:
                self.followers[name].lost(marks.popleft()[1])
        for event in told[at:]:
            yield last_ns, lambda event=event: [_link_report(event)]  # type: ignore[misc]

    def again(self) -> Replay:
        """Return a replay of the same loops that has seen nothing yet."""
        return Replay(self.recording, self.station, tuple(self.followers))

    def _skip_lost(self, since_ns: int) -> None:
        """What was lost with the link before a moment is not counted by whoever begins there."""
        lost = [event for event in self.recording.events("link") if event.found["up"] and event.utc_ns < since_ns]
        for event in lost:
            for name, _, _ in event.found.get("lost", ()):
                if self._lost[name]:
                    self._lost[name].popleft()

    def see(self, row: Row) -> list[Report]:
        """Show one row to its loop's follower and return what follows."""
        follower = self.followers[row.loop]
        marks = self._lost[row.loop]
        while marks and marks[0][0] < row.tick:
            follower.lost(marks.popleft()[1])
        picture = picture_of(follower.loop, row)
        return reports_of(row.loop, picture, follower.see(picture))


def as_polled(loop: Loop) -> Loop:
    """Return the loop as something that nothing needs to be armed for: a recording is only read."""
    return replace(loop, way=Way.POLLED)


class ReplayMonitor(Monitor):
    """A monitor whose pictures come from a recording, at the recording's own times on the clock handed in.

    With a player the recording can be paused and sought in, and stays open at its end until `stop` is set. What the run
    claims is then what its best pass found: one that diverged before all others, else the one that followed most.
    """

    def __init__(self, replay: Replay, link: Link, clock: Clock, player: Player | None = None) -> None:
        super().__init__(
            replace(replay.station, loops=tuple(as_polled(each.loop) for each in replay.followers.values())),
            link,
            clock,
        )
        self.player = player
        self.on_jump: Callable[[int], None] = lambda utc_ns: None
        self.on_frame: Tap | None = None
        self._frames: FrameTape | None = None
        self._replay = replay
        self._passes = [replay]
        self._take(replay)

    @property
    def scheme(self) -> str:
        """That of the link which was recorded."""
        return recorded_scheme(self.recording)

    @property
    def recording(self) -> Recording:
        """What is played."""
        return self._replay.recording

    def _take(self, replay: Replay) -> None:
        self._replay = replay
        for watch in self.watches:
            watch.follower = replay.followers[watch.loop.name]
            watch.loop = watch.follower.loop

    async def reports(
        self, *, duration_ns: int | None = None, stop: asyncio.Event | None = None
    ) -> AsyncIterator[Report]:
        """Yield what happened until the recording, the time or the patience of `stop` is over."""
        end_ns = None if duration_ns is None else self._started_ns + duration_ns
        since_ns: int | None = None
        self.is_up = True
        self._rewind(None)
        if self.player is not None:
            self.player.begin()
        while True:
            for due_ns, look in self._replay.steps(since_ns):
                if end_ns is not None and due_ns >= end_ns:
                    return
                if not await self._reaches(due_ns, stop):
                    break
                if self._frames is not None and self.on_frame is not None:
                    self._frames.play(due_ns, self.on_frame)
                for report in look():
                    if isinstance(report.event, LinkChange):
                        self.is_up = report.event.is_up
                        if self._frames is not None:
                            self._frames.changed(report.event)
                    yield report
            if self.player is None or (stop is not None and stop.is_set()):
                break
            since_ns = self.player.jump()
            if since_ns is None:
                if not await self.player.rests(stop):
                    break
                since_ns = self.player.jump()
            assert since_ns is not None
            since_ns = self._begin(since_ns)
        self._take(max(self._passes, key=_found))

    async def _reaches(self, due_ns: int, stop: asyncio.Event | None) -> bool:
        if self.player is not None:
            return await self.player.reaches(due_ns, stop)
        if stop is not None and stop.is_set():
            return False
        wait_ns = due_ns - self._clock.now_ns()
        if wait_ns > 0:
            await self._clock.sleep_ns(wait_ns)
        return True

    def _begin(self, now_ns: int) -> int:
        """Begin a new pass at a moment of the clock and return it in UTC; the best pass so far is kept."""
        utc_ns = now_ns + self._clock.utc_ns() - self._clock.now_ns()
        fresh = self._replay.again()
        self._passes = [max(self._passes, key=_found), fresh]
        self._take(fresh)
        self.is_up = True
        self._rewind(utc_ns)
        self.on_jump(utc_ns)
        return utc_ns

    def _rewind(self, since_ns: int | None) -> None:
        """Where somebody looks at frames, begin with those of a place."""
        if self.on_frame is not None:
            self._frames = FrameTape(self.recording, since_ns)
            self.link.figures = self._frames.figures


def _found(replay: Replay) -> tuple[bool, int]:
    """What a pass weighs: whether anything diverged, then how many executions were compared."""
    counts = [follower.summary() for follower in replay.followers.values()]
    return any(each.diverged for each in counts), sum(each.compared for each in counts)


@dataclass(slots=True)
class Agreement:
    """How the verdicts of now compare with those of then.

    Attributes:
        same: Executions with the same verdict, reason and cause.
        other: Executions with another one.
        only_now: Executions that were not judged then, or whose verdict was not kept.
        only_then: Verdicts of then that were not found again.
        first: (loop, tick, then, now) of the first that differs.
    """

    same: int = 0
    other: int = 0
    only_now: int = 0
    only_then: int = 0
    first: tuple[str, int, dict[str, Any], dict[str, Any]] | None = None

    @property
    def is_whole(self) -> bool:
        """True when every verdict of then was found again, and no other."""
        return not (self.other or self.only_now or self.only_then)


class Comparison:
    """Holds the verdicts of a replay against those in the recording."""

    def __init__(self, replay: Replay) -> None:
        self._then = {
            (loop, tick): found for loop, tick, found in replay.recording.verdicts() if loop in replay.followers
        }
        self._agreement = Agreement()

    def take(self, report: Report) -> None:
        """Take in a report of the replay."""
        if not isinstance(report.event, Execution):
            return
        whole = as_json(report)
        assert whole is not None
        now = json.loads(verdict_text(whole))
        then = self._then.pop((report.loop, report.tick), None)
        found = self._agreement
        if then is None:
            found.only_now += 1
        elif then == now:
            found.same += 1
        else:
            found.other += 1
            if found.first is None:
                found.first = (report.loop, report.tick, then, now)

    def result(self) -> Agreement:
        """Return the agreement once every report was taken."""
        self._agreement.only_then = len(self._then)
        return self._agreement


@dataclass(frozen=True, slots=True)
class TermLine:
    """One term of one execution: what stands in the PLC, None where it shows none, beside the reference."""

    term: str
    plc: REAL | None
    ref: REAL


def term_lines(loop: Loop, picture: Picture, execution: Execution) -> list[TermLine]:
    """Return every term of an execution, PLC beside reference, in the order in which the law computes them."""
    terms = execution.terms
    if terms is None:
        return []
    shown = {word.attr: picture.seen[word.name] for word in loop.controller.seen if word.name in picture.seen}
    lines = []
    if "pv1" in shown and execution.inputs is not None:
        lines.append(TermLine("PV", shown["pv1"], execution.inputs.pv))
    for name, value in zip(terms._fields, terms, strict=True):
        if isinstance(value, np.floating):
            lines.append(TermLine(name.upper(), shown.get(name), value))
    return lines


def _require(recording: Recording, known: Mapping[str, Loop], name: str) -> None:
    if name in known:
        return
    near = get_close_matches(name, known, 1, 0.5)
    raise StateError(
        f"{recording.path}: has no loop `{name}`, it has {', '.join(known)}",
        hint=f"did you mean `{near[0]}`?" if near else None,
    )


def _link_report(event: Event) -> Report:
    return Report(event.utc_ns, "", 0, LinkChange(event.found["up"], event.found["cause"]))


def _lost_marks(recording: Recording) -> defaultdict[str, deque[tuple[int, float]]]:
    """For every loop, the ticks behind which the link was lost, and how many executions with it."""
    found: defaultdict[str, deque[tuple[int, float]]] = defaultdict(deque)
    for event in recording.events("link"):
        for loop, tick, executions in event.found.get("lost", ()):
            found[loop].append((tick, executions))
    for event in recording.events("lost"):
        found[event.loop].append((event.tick, event.found["executions"]))
    return defaultdict(deque, {loop: deque(sorted(marks)) for loop, marks in found.items()})
