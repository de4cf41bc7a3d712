"""Follow every loop of a station on a live PLC: pictures in, reports out, no printing.

Pictures of all loops are taken in turn over one link, each loop at a quarter of its CYCLE unless the profile paces
the line. When the link breaks, what was missed is counted, never guessed.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Iterable, Mapping
from dataclasses import dataclass

from ahgateway.clock import MILLISECOND, SECOND, Clock
from ahgateway.codec.station import Loop, Station
from ahgateway.codec.ways import Way
from ahgateway.core.verdict import Counts, Exit, run_outcome
from ahgateway.errors import CodecError, PlcRefusedError, TransportError
from ahgateway.lockstep.events import Finding, Lost
from ahgateway.lockstep.follow import Event, Follower, cycle_ns
from ahgateway.lockstep.picture import POLL_MIN_NS, Picture
from ahgateway.lockstep.ring import OVERRUN, Ring
from ahgateway.lockstep.source import source
from ahgateway.lockstep.stepper import Step
from ahgateway.transports.base import Link

CLEAN_DRAINS = 20
"""After so many drains without loss a ring no longer runs over."""

SMOOTHING = 4
"""One look counts for so much less than all before it."""
RETRY_NS = 200 * MILLISECOND
REFUSED_RETRY_NS = 2 * SECOND
TORN_MAX = 3
"""After so many rounds without a whole picture it is said."""

GIVE_UP_NS = 10 * SECOND
"""A target that never answered for this long is given up, unless the caller set a duration."""


@dataclass(frozen=True, slots=True)
class LinkChange:
    """The link went away (`is_up` false, with its cause) or came back.

    Attributes:
        is_up: What it is now.
        cause: Why it went away.
        lost: When it came back or the run ended, for every loop that had been seen: its name, its last tick, executions
            lost.
    """

    is_up: bool
    cause: str = ""
    lost: tuple[tuple[str, int, float], ...] = ()


@dataclass(frozen=True, slots=True)
class Sample:
    """A picture was taken; what is shown live comes from here."""

    picture: Picture


@dataclass(frozen=True, slots=True)
class Report:
    """One thing that happened: to a loop, or to the link when `loop` is empty.

    `aligned_ns` is since when, in UTC, the line of its picture had been aligned; None without a picture.
    """

    utc_ns: int
    loop: str
    tick: int
    event: Event | LinkChange | Sample
    aligned_ns: int | None = None


def reports_of(loop: str, picture: Picture, events: Iterable[Event]) -> list[Report]:
    """Return what is reported of a picture: the events that it ends, and itself."""
    utc_ns, tick, aligned_ns = picture.utc_ns, picture.tick, picture.aligned_utc_ns
    return [Report(utc_ns, loop, tick, event, aligned_ns) for event in (*events, Sample(picture))]


class Watch:
    """One loop under observation."""

    def __init__(self, loop: Loop, station: Station, link: Link, clock: Clock, step: Step | None = None) -> None:
        self.loop = loop
        self.follower = Follower(loop)
        self.sampler = source(loop, station, link, clock, step=step)
        self.due_ns = clock.now_ns()
        self.refused = ""
        self.torn_in_a_row = 0
        self.looked_ns = 0
        self.is_overrun = False
        self.clean_drains = 0
        self._last_ns: int | None = None

    def saw(self, picture: Picture) -> None:
        """Note how long ago the picture before was, as a running mean."""
        if self._last_ns is not None:
            apart_ns = picture.last_ns - self._last_ns
            self.looked_ns += (apart_ns - self.looked_ns) // SMOOTHING if self.looked_ns else apart_ns
        self._last_ns = picture.last_ns

    def poll_ns(self, station: Station) -> int:
        """How long to wait between two pictures of this loop."""
        if station.pacing.poll_ms:
            return station.pacing.poll_ms * MILLISECOND
        picture = self.follower.picture
        if picture is None:
            return POLL_MIN_NS
        return self.sampler.poll_ns(cycle_ns(self.loop, picture))

    def way(self, station: Station) -> Way:
        """How this loop's executions are seen now; to poll more rarely than CYCLE is to count."""
        picture, before = self.follower.picture, self.looked_ns
        if self.loop.way is not Way.POLLED or picture is None:
            return self.loop.way
        apart_ns = max(self.poll_ns(station), before)
        return Way.COUNTED if apart_ns >= cycle_ns(self.loop, picture) else Way.POLLED


class Monitor:
    """Every loop of a station, followed over one link."""

    def __init__(self, station: Station, link: Link, clock: Clock, steps: Mapping[str, Step] | None = None) -> None:
        self.station = station
        self.link = link
        self.watches = [Watch(loop, station, link, clock, (steps or {}).get(loop.name)) for loop in station.loops]
        self.is_up = False
        self._clock = clock
        self._started_ns = clock.now_ns()
        self._down_since_ns: int | None = None
        self._reported_down = False

    @property
    def scheme(self) -> str:
        """Scheme of the link's target; it says how its frames are read."""
        return self.station.target.partition(":")[0]

    def way(self, loop: str) -> Way:
        """How the loop's executions are seen now."""
        return next(watch for watch in self.watches if watch.loop.name == loop).way(self.station)

    def summaries(self) -> dict[str, Counts]:
        """Counts of every loop by name, unseen executions included."""
        return {watch.loop.name: watch.follower.summary() for watch in self.watches}

    def outcome(self, coverage_min: float) -> Exit:
        """What the run may claim so far."""
        return run_outcome(self.summaries().values(), coverage_min)

    async def reports(
        self, *, duration_ns: int | None = None, stop: asyncio.Event | None = None
    ) -> AsyncIterator[Report]:
        """Yield what happens until the time is over or `stop` is set.

        Args:
            duration_ns: How long to follow on this clock; None for ever.
            stop: Ends it between two pictures.

        Raises:
            TransportError: No duration was asked for and the target never answered for `GIVE_UP_NS`.
        """
        end_ns = None if duration_ns is None else self._started_ns + duration_ns
        while not (stop is not None and stop.is_set()):
            now_ns = self._clock.now_ns()
            if end_ns is not None and now_ns >= end_ns:
                break
            watch = min(self.watches, key=lambda each: each.due_ns)
            if watch.due_ns > now_ns:
                wait_ns = watch.due_ns - now_ns
                await self._clock.sleep_ns(wait_ns if end_ns is None else min(wait_ns, end_ns - now_ns))
                continue
            for report in await self._turn(watch, patient=end_ns is not None):
                yield report
        if self._down_since_ns is not None:
            lost = self._count_lost()
            yield Report(self._clock.utc_ns(), "", 0, LinkChange(False, "it did not come back before the end", lost))

    async def _turn(self, watch: Watch, *, patient: bool) -> list[Report]:
        """Take one picture of one loop and schedule the next."""
        started_ns = self._clock.now_ns()
        try:
            found = await watch.sampler.pictures()
        except TransportError as error:
            reports = self._link_down(error)
            never = not self.link.figures.replies
            if never and not patient and self._clock.now_ns() - self._started_ns > GIVE_UP_NS:
                raise
            self._postpone(RETRY_NS)
            return reports
        except (PlcRefusedError, CodecError) as error:
            watch.due_ns = self._clock.now_ns() + REFUSED_RETRY_NS
            return self._refused(watch, error)
        reports = self._link_up()
        if watch.refused:
            watch.refused = ""
        reports += self._torn(watch, not found and watch.loop.way is not Way.RECORDED)
        reports += self._overrun(watch, found)
        for each in found:
            reports += self._seen(watch, each)
        watch.due_ns = max(started_ns + watch.poll_ns(self.station), self._clock.now_ns())
        return reports

    def _overrun(self, watch: Watch, found: list[Picture | Lost]) -> list[Report]:
        """Say it when a ring is overwritten faster than it is emptied, and when that is over."""
        if not isinstance(watch.sampler, Ring) or not found:
            return []
        is_lost = any(isinstance(each, Lost) and each.why == OVERRUN for each in found)
        watch.clean_drains = 0 if is_lost else watch.clean_drains + 1
        is_now = is_lost or (watch.is_overrun and watch.clean_drains < CLEAN_DRAINS)
        if is_now == watch.is_overrun:
            return []
        watch.is_overrun = is_now
        text = f"the ring makes {watch.sampler.words_per_s:.0f} words/s, more than this line empties"
        hint = "`--plan` says what the line carries: record calls or changes, leave operands out, or take a faster line"
        finding = Finding("ring-overrun", text, hint, is_over=not is_now)
        return [Report(self._clock.utc_ns(), watch.loop.name, 0, finding)]

    def _seen(self, watch: Watch, found: Picture | Lost) -> list[Report]:
        """Show the follower what was seen, and report what it makes of it."""
        last = watch.follower.picture
        events = watch.follower.take(found)
        if isinstance(found, Picture):
            watch.saw(found)
            return reports_of(watch.loop.name, found, events)
        tick = last.tick if last is not None else 0
        return [Report(self._clock.utc_ns(), watch.loop.name, tick, event) for event in events]

    def _torn(self, watch: Watch, is_torn: bool) -> list[Report]:
        """Say it when no picture succeeds any more: the line is too slow for this loop's CYCLE."""
        was_many = watch.torn_in_a_row >= TORN_MAX
        watch.torn_in_a_row = watch.torn_in_a_row + 1 if is_torn else 0
        if was_many == (watch.torn_in_a_row >= TORN_MAX):
            return []
        text = "an execution falls into every picture: the line is too slow for this loop's CYCLE"
        hint = "bring MV and the flags within one request of the block, or bind what never changes as const"
        finding = Finding("torn-pictures", text, hint, is_over=was_many)
        return [Report(self._clock.utc_ns(), watch.loop.name, 0, finding)]

    def _postpone(self, wait_ns: int) -> None:
        due_ns = self._clock.now_ns() + wait_ns
        for watch in self.watches:
            watch.due_ns = max(watch.due_ns, due_ns)

    def _link_down(self, error: TransportError) -> list[Report]:
        if self._down_since_ns is None:
            self._down_since_ns = self._clock.now_ns()
        self.is_up = False
        if self._reported_down:
            return []
        self._reported_down = True
        cause = f"{error.message}; hint: {error.hint}" if error.hint else error.message
        return [Report(self._clock.utc_ns(), "", 0, LinkChange(False, cause))]

    def _link_up(self) -> list[Report]:
        was_up, self.is_up = self.is_up, True
        lost = self._count_lost() if self._down_since_ns is not None else ()
        self._down_since_ns = None
        self._reported_down = False
        return [] if was_up and not lost else [Report(self._clock.utc_ns(), "", 0, LinkChange(True, "", lost))]

    def _count_lost(self) -> tuple[tuple[str, int, float], ...]:
        """Count what each loop must have executed since its last picture as lost with the link; say it loop by loop.

        What a recorder keeps is not lost with the link; its ring tells what was overwritten.
        """
        found = []
        for watch in self.watches:
            last = watch.follower.picture
            if last is not None and watch.loop.way is not Way.RECORDED:
                executions = (self._clock.now_ns() - last.last_ns) / cycle_ns(watch.loop, last)
                watch.follower.lost(executions)
                found.append((watch.loop.name, last.tick, executions))
        return tuple(found)

    def _refused(self, watch: Watch, error: PlcRefusedError | CodecError) -> list[Report]:
        """The PLC is there but refuses this loop's addresses: said once, asked again now and then."""
        self.is_up = True
        if watch.refused == error.message:
            return []
        watch.refused = error.message
        finding = Finding("refused", error.message, error.hint or "")
        return [Report(self._clock.utc_ns(), watch.loop.name, 0, finding)]
