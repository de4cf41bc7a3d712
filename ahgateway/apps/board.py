"""What a screen of a run is made of: trails, events, changed operands, health; fed with reports, bounded in memory.

Screens, pages and metrics read it and the monitor; none of them can reach the PLC through it.
"""

from __future__ import annotations

from collections import deque
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

from ahgateway.apps.health import Health, health
from ahgateway.apps.health_process import Learner, Statement, statement
from ahgateway.apps.monitor import Monitor, Report, Sample, Watch
from ahgateway.apps.trail import CAPACITY, Trails
from ahgateway.clock import SECOND, Clock
from ahgateway.core.verdict import Verdict
from ahgateway.lockstep.events import Change
from ahgateway.lockstep.follow import verdict_now
from ahgateway.lockstep.judge import Execution
from ahgateway.transports.base import Frame

EVENTS_MAX = 2000
FRAMES_MAX = 200
TOLD_AGAIN_NS = 60 * SECOND
"""A loop that goes on to diverge for the same cause is an event once so often: it must not flood the log."""
STALE_NS = 2 * SECOND
STALE_POLLS = 3
"""A value is stale when it is older than both: two seconds, and three times what is asked between two pictures."""
HEALTH_NS = 5 * SECOND
"""How old figures of a loop's health may become."""


@dataclass(frozen=True, slots=True)
class Note:
    """What a person wrote, or a marker when the text is a number."""

    utc_ns: int
    text: str


@dataclass(frozen=True, slots=True)
class Freshness:
    """How far a loop's values may be trusted now; `age_ns` is None before the first picture."""

    age_ns: int | None
    is_stale: bool


class Board:
    """The state behind a screen."""

    def __init__(self, monitor: Monitor, clock: Clock, *, capacity: int = CAPACITY) -> None:
        """Begin empty.

        Args:
            monitor: Whose reports will come.
            clock: The clock of the run.
            capacity: Samples kept of each loop.
        """
        self.monitor = monitor
        self.clock = clock
        self.trails = Trails(monitor.station, capacity)
        self.watches = {watch.loop.name: watch for watch in monitor.watches}
        self.events: deque[Report | Note] = deque(maxlen=EVENTS_MAX)
        self.event_count = 0
        self.cut_count = 0
        self.changes: dict[str, dict[str, tuple[int, Change]]] = {name: {} for name in self.watches}
        self.frames: deque[Frame] = deque(maxlen=FRAMES_MAX)
        self._told: dict[str, tuple[str, int]] = {}
        self._health: dict[str, tuple[int, Health | None]] = {}
        self._learners: dict[str, Learner] = {}
        self._pool = ThreadPoolExecutor(1, "process")

    def take(self, report: Report) -> None:
        """Take in one report; what goes right is counted by the monitor and not kept as an event."""
        self.trails.take(report)
        event = report.event
        if isinstance(event, Sample):
            return
        if isinstance(event, Change) and report.loop in self.changes:
            self.changes[report.loop][event.operand] = (report.utc_ns, event)
        if not isinstance(event, Execution) or (event.verdict is Verdict.DIVERGED and self._is_news(report, event)):
            self._keep(report)

    def _is_news(self, report: Report, event: Execution) -> bool:
        cause = event.blame.suspects[0].cause if event.blame is not None else ""
        told, when_ns = self._told.get(report.loop, (None, 0))
        if cause == told and report.utc_ns - when_ns < TOLD_AGAIN_NS:
            return False
        self._told[report.loop] = (cause, report.utc_ns)
        return True

    def frame(self, frame: Frame) -> None:
        """Keep a frame of the link; a tap."""
        self.frames.append(frame)

    def note(self, text: str) -> Note:
        """Keep what a person wrote, with the time of now."""
        note = Note(self.clock.utc_ns(), text)
        self._keep(note)
        return note

    def cut(self, utc_ns: int) -> None:
        """Forget what is newer than a moment, but for notes: a recording goes on from there."""
        self.trails.cut(utc_ns / SECOND)
        kept = [event for event in self.events if isinstance(event, Note) or event.utc_ns <= utc_ns]
        if len(kept) < len(self.events):
            self.events = deque(kept, maxlen=EVENTS_MAX)
            self.cut_count += 1
        self.frames = deque((frame for frame in self.frames if frame.utc_ns <= utc_ns), maxlen=FRAMES_MAX)
        for changes in self.changes.values():
            for operand in [name for name, (when, _) in changes.items() if when > utc_ns]:
                del changes[operand]
        self._told.clear()
        self._health.clear()
        self._learners.clear()

    def _keep(self, event: Report | Note) -> None:
        self.events.append(event)
        self.event_count += 1

    def freshness(self, watch: Watch) -> Freshness:
        """Tell whether a loop's last picture still counts as live."""
        picture = watch.follower.picture
        if picture is None:
            return Freshness(None, True)
        age_ns = max(0, self.clock.now_ns() - picture.last_ns)
        limit_ns = max(STALE_NS, STALE_POLLS * watch.poll_ns(self.monitor.station))
        return Freshness(age_ns, age_ns > limit_ns)

    def word(self, watch: Watch) -> str:
        """One word for the loop as it stands: its verdict, or why there is none."""
        fresh = self.freshness(watch)
        if fresh.age_ns is None:
            if watch.refused:
                return "REFUSED"
            return "WAITING" if self.monitor.is_up else "LINK DOWN"
        if fresh.is_stale:
            return "STALE"
        verdict = verdict_now(watch.follower)
        return verdict.value if verdict else "WAITING"

    def health(self, name: str) -> Health | None:
        """Return the figures of a loop's whole trail, at most `HEALTH_NS` old; None for too few samples."""
        now_ns = self.clock.now_ns()
        known = self._health.get(name)
        if known is None or now_ns - known[0] > HEALTH_NS:
            known = (now_ns, health(self.trails.trails[name].trace().window()))
            self._health[name] = known
        return known[1]

    def known_health(self, name: str) -> Health | None:
        """Return the figures as they were last worked out, without working."""
        known = self._health.get(name)
        return known[1] if known else None

    def oldest_health(self) -> str:
        """Return the loop whose figures have waited longest; a screen works out one at a time."""
        return min(self.watches, key=lambda name: self._health[name][0] if name in self._health else -1)

    def statement(self, name: str) -> Statement | None:
        """Return what the shadow, the figures and a process learned on the way say together of a loop.

        The process is learned of loops that are asked for, in a thread of its own, so that no poll waits for it.
        """
        found = self.known_health(name)
        if found is None:
            return None
        if name not in self._learners:
            self._learners[name] = Learner(self._pool)
        residual = self._learners[name].look(self.trails.trails[name].trace().window())
        return statement(found, self.watches[name].follower.summary(), residual)
