"""One picture of one loop: every operand of a PID instruction as the PLC held it at one moment.

A picture usually needs several requests, and an execution may fall between them. So it is bracketed: the words that
the instruction writes are read first and last, and only when both readings agree is it one picture. Everything in one
request is one picture by itself, because the PLC serves a request between two scans (ASSUMED, spec A28).
This file decides what a picture is; it does not know what a controller would make of it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from ahgateway.clock import MILLISECOND, SECOND, Clock
from ahgateway.codec import block
from ahgateway.codec.access import Read, Span
from ahgateway.codec.can_objects import CanMap
from ahgateway.codec.devices import DeviceMap
from ahgateway.codec.plan import plan
from ahgateway.codec.station import Loop, Station
from ahgateway.core.controllers import Controller
from ahgateway.core.operands import Kind
from ahgateway.lockstep.events import Lost
from ahgateway.transports.base import Link, Reply

TRIES_MAX = 4
"""How often a torn picture is taken again before the loop is left for this round."""


@dataclass(frozen=True, slots=True)
class Picture:
    """Every operand of one loop at one moment.

    Attributes:
        tick: Number of this picture in its loop, from 0.
        inputs: The controller's inputs as a NamedTuple; REALs keep their bits.
        seen: Values that the instruction writes, by `Seen.name`.
        words: Raw words by operand; a BOOL is one 0 or 1.
        enabled: The EN contact, None when the profile does not name it.
        running: The PLC is in RUN, None when the profile names no device for it.
        sent_ns: When the first request left.
        last_ns: When the last reply was complete.
        utc_ns: UTC of `last_ns`.
        aligned_since_ns: Since when the line has been proven aligned; 0 where nobody knows, as in an import.
        executions: Least and most executions since the picture before, where something in the PLC tells; None where
            only time bounds them.
        is_exact: The PLC made it directly behind the instruction: its inputs are what an execution in it read.
    """

    tick: int
    inputs: Any
    seen: Mapping[str, Any]
    words: Mapping[str, tuple[int, ...]]
    enabled: bool | None
    running: bool | None
    sent_ns: int
    last_ns: int
    utc_ns: int
    aligned_since_ns: int
    executions: tuple[int, int] | None = None
    is_exact: bool = False

    @property
    def count(self) -> int | None:
        """What the program's counter of executions holds; None where there is none."""
        return self.words[block.COUNTER][0] if block.COUNTER in self.words else None

    @property
    def aligned_utc_ns(self) -> int | None:
        """`aligned_since_ns` in UTC; None where nobody knows."""
        return self.utc_ns - (self.last_ns - self.aligned_since_ns) if self.aligned_since_ns else None


POLLS_PER_CYCLE = 4
POLL_MIN_NS = 5 * MILLISECOND
POLL_MAX_NS = SECOND

Sees = Callable[[Picture], None]
"""Shown every picture as soon as it is whole."""


@dataclass(frozen=True, slots=True)
class PicturePlan:
    """Which requests make a picture: `bracket` is read first and, unless it is all there is, again after `inner`."""

    bracket: tuple[Read, ...]
    inner: tuple[Read, ...]
    is_snapshot: bool = True

    @property
    def is_atomic(self) -> bool:
        """True when one request holds everything, and a request is one moment on this wire."""
        return self.is_snapshot and len(self.bracket) == 1 and not self.inner

    def as_command(self) -> PicturePlan:
        """Return the same requests as part of a write: they go before the polls that wait on the line."""
        bracket, inner = (
            tuple(replace(read, is_command=True) for read in reads) for reads in (self.bracket, self.inner)
        )
        return PicturePlan(bracket, inner, self.is_snapshot)

    @property
    def requests(self) -> tuple[Read, ...]:
        """Every request of one picture in the order in which it is sent."""
        return self.bracket if self.is_atomic else self.bracket + self.inner + self.bracket


def picture_plan(loop: Loop, station: Station) -> PicturePlan:
    """Plan the requests of one loop's picture within the station's pacing."""
    spans = block.spans(loop, station.devices)
    if station.running is not None:
        spans = {**spans, "RUNNING": device_span(station)}
    if station.can is not None and not station.is_snapshot:
        own = {row.name for row in loop.controller.operands if row.kind is Kind.BLOCK}
        wanted = [span for name, span in spans.items() if name not in own]
        watched = seen_spans(loop, station.devices) + [spans[name] for name in spans if name == block.COUNTER]
        return _object_plan(wanted, watched, station.can, station)
    limits = station.pacing
    reads = plan(
        spans.values(),
        unit=station.unit,
        words_max=limits.words_per_request_max,
        gap_max=limits.gap_words_max,
        exists=station.devices.covers,
    )
    written = {seen.operand for seen in loop.controller.seen}
    watched = [span for name, span in spans.items() if name in written or name == block.COUNTER]
    bracket = tuple(read for read in reads if any(_covers(read, span) for span in watched))
    return PicturePlan(bracket, tuple(read for read in reads if read not in bracket))


def _object_plan(wanted: Iterable[Span], watched: Iterable[Span], can: CanMap, station: Station) -> PicturePlan:
    """Plan for a wire that reads each object by itself: only the objects that show an execution are read twice.

    The words of the instruction's memory that are the system's are not asked for: junk that costs a transfer each.
    """
    bracket = {held.span for span in watched for held in can.holding(span)}
    inner = {held.span for span in wanted for held in can.holding(span)} - bracket
    first, second = (
        plan(spans, unit=station.unit, words_max=station.pacing.words_per_request_max, gap_max=0)
        for spans in (bracket, inner)
    )
    return PicturePlan(first, second, is_snapshot=False)


def device_span(station: Station) -> Span:
    """Where the station's RUN flag stands."""
    assert station.running is not None
    address = station.devices.address(station.running)
    return Span(address.table, address.address, 1)


def _covers(read: Read, span: Span) -> bool:
    return read.table is span.table and read.address <= span.address and span.end <= read.address + read.count


class Sampler:
    """Takes pictures of one loop over a link, and shows each to `sees`."""

    def __init__(self, loop: Loop, station: Station, link: Link, clock: Clock, sees: Sees | None = None) -> None:
        self.loop = loop
        self._sees = sees
        self.plan = picture_plan(loop, station)
        self.torn_count = 0
        self._layout = block.Layout(loop, station.devices)
        self._watched = seen_spans(loop, station.devices)
        self._unasked = [] if station.is_snapshot else _memory_spans(loop, station.devices)
        self._station = station
        self._link = link
        self._clock = clock
        self._tick = 0

    async def pictures(self) -> list[Picture | Lost]:
        """Take one picture; none when it is torn; see `picture`."""
        found = await self.picture()
        return [] if found is None else [found]

    def poll_ns(self, cycle_ns: int) -> int:
        """How long to wait between two pictures of a loop with this CYCLE."""
        return min(max(cycle_ns // POLLS_PER_CYCLE, POLL_MIN_NS), POLL_MAX_NS)

    async def picture(self) -> Picture | None:
        """Take one picture; None when an execution fell into each of `TRIES_MAX` attempts.

        Raises:
            TransportError: The link failed.
            PlcRefusedError: The PLC refused one of the requests.
        """
        first = await self._read(self.plan.bracket)
        if self.plan.is_atomic:
            return self._develop(first)
        for _ in range(TRIES_MAX):
            inner = await self._read(self.plan.inner)
            last = await self._read(self.plan.bracket)
            if _values(first) == _values(last) or self._fingerprint(first) == self._fingerprint(last):
                return self._develop([first[0], *inner, *last])
            self.torn_count += 1
            first = last
        return None

    async def glimpse(self) -> Picture:
        """Look once without proof that it is one moment: for operands that no execution changes.

        Raises:
            TransportError: The link failed.
            PlcRefusedError: The PLC refused one of the requests.
        """
        return self._develop(await self._read((*self.plan.bracket, *self.plan.inner)))

    async def _read(self, reads: Iterable[Read]) -> list[Reply]:
        return [await self._link.exchange(read) for read in reads]

    def _image(self, replies: Iterable[Reply]) -> block.Image:
        image = block.Image()
        for span in self._unasked:
            image.put(Read(self._station.unit, span.table, span.address, span.count), (0,) * span.count)
        for reply in replies:
            assert isinstance(reply.request, Read)
            image.put(reply.request, reply.values)
        return image

    def _fingerprint(self, replies: list[Reply]) -> tuple[tuple[int, ...], ...]:
        """The words that the instruction is known to write; the rest of I_MV may change at any time."""
        image = self._image(replies)
        return tuple(image.words(span) for span in self._watched)

    def _develop(self, replies: list[Reply]) -> Picture:
        image = self._image(replies)
        words = self._layout.raw(image)
        tick, self._tick = self._tick, self._tick + 1
        last_ns = max(reply.last_ns for reply in replies)
        picture = Picture(
            tick=tick,
            inputs=block.inputs(self.loop, words),
            seen=block.seen(self.loop, words),
            words=words,
            enabled=bool(words["EN"][0]) if "EN" in words else None,
            running=self._running(image),
            sent_ns=min(reply.sent_ns for reply in replies),
            last_ns=last_ns,
            utc_ns=self._clock.utc_ns() - (self._clock.now_ns() - last_ns),
            aligned_since_ns=max(reply.aligned_since_ns for reply in replies),
        )
        if self._sees is not None:
            self._sees(picture)
        return picture

    def _running(self, image: block.Image) -> bool | None:
        if self._station.running is None:
            return None
        return bool(image.bit(self._station.devices.address(self._station.running)))


def _values(replies: list[Reply]) -> list[tuple[int, ...]]:
    return [reply.values for reply in replies]


def seen_spans(loop: Loop, devices: DeviceMap) -> list[Span]:
    """Where the words stand that the instruction is known to write, in the order of `Controller.seen`."""
    spans = block.spans(loop, devices)
    found = []
    for seen in loop.controller.seen:
        if seen.operand in spans:
            span = spans[seen.operand]
            found.append(Span(span.table, span.address + 2 * seen.dword, min(2, span.count)))
    if block.COUNTER in spans:
        found.append(spans[block.COUNTER])
    return found


def _memory_spans(loop: Loop, devices: DeviceMap) -> list[Span]:
    """Where the instruction's own memory stands; over objects its system words are not read and shown as 0."""
    spans = block.spans(loop, devices)
    return [spans[row.name] for row in loop.controller.operands if row.kind is Kind.BLOCK and row.name in spans]


def predicted(controller: Controller, state: Any, terms: Any) -> dict[str, Any]:
    """What an execution leaves in the words that can be seen, by `Seen.name`, as it is stored there."""
    return {seen.name: seen.stored(state, terms) for seen in controller.seen}
