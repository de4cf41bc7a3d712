"""Drains the ring in which the PLC records its scans or calls, and makes a picture of every record.

This file alone decides which records are whole. A record counts when its number is the one that is due and, where
the program writes it twice, both ends agree; everything else is lost, never judged. It does not know what a controller
would make of a record.

Theory of operation: the head tells how many slots have been filled since it was read last; they are read in order, as
many whole records in a request as fit. A slot with a later number was overwritten before it was read; one whose two
numbers differ was being written, and is read once more. A ring that filled up further than it can be read is left
until its newer half, since records help only in a row. Records in which something stands that no record holds (the
layout's `unrecorded`) count only while that stands still before and behind them.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from ahgateway.clock import MILLISECOND, SECOND, Clock
from ahgateway.codec import block
from ahgateway.codec.access import Read, Span
from ahgateway.codec.plan import plan
from ahgateway.codec.station import Loop, Station
from ahgateway.codec.ways import Each, Record, Recorder, record
from ahgateway.lockstep.events import Lost
from ahgateway.lockstep.picture import Picture, Sees, device_span
from ahgateway.transports.base import Link, Reply

FULL_SHARE = 0.75
"""A ring filled further than this is given up to its newer half."""

DRAINS_PER_RING = 4
DRAIN_MIN_NS = 20 * MILLISECOND
DRAIN_MAX_NS = SECOND
SILENT_NS = SECOND
"""Nothing was recorded for so long, or for so many records: the PLC stands, and may have forgotten."""
SILENT_RECORDS = 20
CLOCK_SLACK_NS = SECOND // 4
"""The PLC's clock may run apart from ours by so much before its time is set anew."""

OVERRUN = "the ring was overwritten before it was read: the line is too slow for it, or was away"
TORN = "a record was being written each time it was read"
RESTARTED = "the ring began anew"
STARTED = "the PLC went to RUN: what the instruction remembers of before is not known"
SILENT = "nothing was recorded for a while: what the instruction remembers of before is not known"
MOVED = "an operand that no record holds changed meanwhile"


@dataclass(frozen=True, slots=True)
class DrainPlan:
    """What one drain sends.

    Attributes:
        head: The request for the head.
        slots: Slots in one request.
        beside: Requests for what no record holds, once per drain.
    """

    head: Read
    slots: int
    beside: tuple[Read, ...]


def drain_plan(loop: Loop, station: Station) -> DrainPlan:
    """Plan the requests that empty the loop's ring."""
    layout = loop.recorder
    assert layout is not None
    place = station.devices.address(layout.head)
    spans = block.spans(loop, station.devices)
    kept = {name: span for name, span in spans.items() if name in layout.unrecorded}
    if block.EN in spans and block.EN not in layout.fields:
        kept[block.EN] = spans[block.EN]
    if station.running is not None and kept:
        kept["RUNNING"] = device_span(station)
    beside = plan(
        kept.values(),
        unit=station.unit,
        words_max=station.pacing.words_per_request_max,
        gap_max=station.pacing.gap_words_max,
        exists=station.devices.covers,
    )
    slots = max(1, station.pacing.words_per_request_max // layout.length)
    return DrainPlan(Read(station.unit, place.table, place.address, 1), min(slots, layout.records), beside)


class Ring:
    """Reads one loop's ring over a link, and shows each picture to `sees`.

    Attributes:
        torn_count: Records that were being written while they were read, at least once.
        lost_count: Records that were not read whole.
        record_count: Records read.
        full_share: How full the ring was at the last drain, 0…1.
    """

    def __init__(self, loop: Loop, station: Station, link: Link, clock: Clock, sees: Sees | None = None) -> None:
        assert loop.recorder is not None
        self.loop = loop
        self.plan = drain_plan(loop, station)
        self.torn_count = 0
        self.lost_count = 0
        self.record_count = 0
        self.full_share = 0.0
        self._layout: Recorder = loop.recorder
        self._place = station.devices.address(self._layout.ring)
        self._lengths = {name: block.field_words(loop, name) for name in self._layout.fields}
        self._station, self._link, self._clock, self._sees = station, link, clock, sees
        self._tick = 0
        self._next: int | None = None
        self._last: Record | None = None
        self._beside: dict[str, tuple[int, ...]] | None = None
        self._doubtful = 0
        self._time = _Time(loop, self._layout)
        self._drained_ns = clock.now_ns()
        self._silent_since_ns: int | None = None
        self._is_silent = False

    def poll_ns(self, cycle_ns: int) -> int:
        """How long to wait between two drains: a quarter of the time in which the ring fills."""
        return min(max(self._layout.records * self.record_ns // DRAINS_PER_RING, DRAIN_MIN_NS), DRAIN_MAX_NS)

    @property
    def record_ns(self) -> int:
        """Time from one record to the next: that of the interval task, as measured, or as the profile expects it."""
        if self.loop.interval_ms is not None:
            return self.loop.interval_ms * MILLISECOND
        return self._time.record_ns or self.loop.scan_ms_max * MILLISECOND

    @property
    def words_per_s(self) -> float:
        """Words that the ring takes in a second, as far as that is known: what the line must carry."""
        return self._layout.length * SECOND / self.record_ns

    async def picture(self) -> Picture | None:
        """Drain, and return the newest picture; None when there is none."""
        found = [each for each in await self.pictures() if isinstance(each, Picture)]
        return found[-1] if found else None

    async def pictures(self) -> list[Picture | Lost]:
        """Read what was recorded since the last call, oldest first.

        Raises:
            TransportError: The link failed; what was recorded meanwhile is read by the next call or lost.
            PlcRefusedError: The PLC refused one of the requests.
        """
        head = await self._link.exchange(self.plan.head)
        found = await self._filled(head)
        beside = await self._read_beside() if found or self._beside is None else self._beside
        is_moved = self._beside is not None and beside != self._beside
        # Those made between the head and the words beside it of the last drain may have had the older ones.
        self._doubtful = 2 if is_moved else max(0, self._doubtful - 1)
        self._beside = beside
        if self._doubtful:
            found = _given_up(found)
        made = list(self._developed(found, head))
        self._drained_ns = head.last_ns
        return made

    async def _filled(self, head: Reply) -> list[Record | Lost | Reply]:
        """Read every slot that was filled since the last drain; the first drain takes the newest alone."""
        layout = self._layout
        newest = (head.values[0] + layout.is_last) % layout.records
        if self._next is None or self._last is None:
            self._next = newest
            record_, reply = await self._one(newest - 1)
            if not record_.is_whole:
                self._next = None
                return []
            self._last = record_
            return [reply, record_]
        count = (newest - self._next) % layout.records
        self.full_share = count / layout.records
        if not count:
            return await self._unmoved()
        found: list[Record | Lost | Reply] = []
        expected = (self._last.sequence + 1) % layout.sequences
        first, left = self._next, 0
        if self.full_share > FULL_SHARE:
            left = count - layout.records // 2
            first, count = (first + left) % layout.records, count - left
            expected = (expected + left) % layout.sequences
        read, overtaken = await self._slots(first, count, expected)
        if left:
            found.append(self._lost(left, OVERRUN))
        found += read
        if self._next is None:
            return found
        if overtaken is not None:
            found.append(self._lost(overtaken, OVERRUN))
        self._next = newest
        self._number_from(found, (expected + count - 1 + (overtaken or 0)) % layout.sequences)
        return found

    async def _slots(self, first: int, count: int, expected: int) -> tuple[list[Record | Lost | Reply], int | None]:
        """Read `count` slots from `first` on; also tell how many further records fell off when the ring was lapped."""
        found: list[Record | Lost | Reply] = []
        laps = None
        for start, length in _runs(first, count, self.plan.slots, self._layout.records):
            records, reply = await self._read(start, length)
            found.append(reply)
            for offset, each in enumerate(records):
                got = each
                if not got.is_whole:
                    self.torn_count += 1
                    got, reply = await self._one(start + offset)
                ahead = (got.sequence - expected) % self._layout.sequences
                if got.is_whole and not ahead:
                    found.append(got)
                elif not got.is_whole:
                    found.append(self._lost(1, TORN))
                elif ahead >= self._layout.sequences // 2:
                    self._next = None
                    return [*found, self._lost(0, RESTARTED)], None
                else:
                    found.append(self._lost(1, OVERRUN))
                    laps = ahead
                expected = (expected + 1) % self._layout.sequences
            # Only a slot that was lapped before the head was read shows that more is gone than the head says.
        return found, laps if laps and isinstance(found[-1], Lost) else None

    async def _unmoved(self) -> list[Record | Lost | Reply]:
        """The head stands where it stood: nothing was recorded, or exactly whole rings were."""
        assert self._last is not None
        assert self._next is not None
        got, reply = await self._one(self._next - 1)
        ahead = (got.sequence - self._last.sequence) % self._layout.sequences
        if not ahead or not got.is_whole:
            return []
        if ahead >= self._layout.sequences // 2:
            self._next = None
            return [reply, self._lost(0, RESTARTED)]
        self._last = got
        return [reply, self._lost(ahead - 1, OVERRUN), got]

    def _lost(self, records: int, why: str) -> Lost:
        self.lost_count += records
        return Lost(self._executions(records), records, why)

    def _executions(self, records: int) -> float:
        """How many executions so many records stand for."""
        if self.loop.is_called or self._layout.each is Each.CHANGE or self._last is None:
            return float(records)
        words = block.from_fields(self.loop, self._last.fields, self._beside or block.defaults(self.loop.controller))
        cycle_ns = float(self.loop.controller.nominal_ts(block.inputs(self.loop, words))) * SECOND
        return min(float(records), records * self.record_ns / max(1.0, cycle_ns))

    def _number_from(self, found: list[Record | Lost | Reply], sequence: int) -> None:
        """Go on behind the number that the newest slot has or must have had."""
        whole = [each for each in found if isinstance(each, Record)]
        newest = whole[-1] if whole else self._last
        assert newest is not None
        if self._next is not None:
            self._last = Record(sequence, True, newest.time_ns, False, newest.fields)

    async def _one(self, slot: int) -> tuple[Record, Reply]:
        records, reply = await self._read(slot % self._layout.records, 1)
        return records[0], reply

    async def _read(self, slot: int, count: int) -> tuple[list[Record], Reply]:
        layout = self._layout
        address = self._place.address + layout.slot(slot)
        reply = await self._link.exchange(Read(self._station.unit, self._place.table, address, count * layout.length))
        self.record_count += count
        parts = (reply.values[at * layout.length : (at + 1) * layout.length] for at in range(count))
        return [record(layout, self._lengths, part) for part in parts], reply

    async def _read_beside(self) -> dict[str, tuple[int, ...]]:
        image = block.Image()
        for read in self.plan.beside:
            image.put(read, (await self._link.exchange(read)).values)
        found: dict[str, tuple[int, ...]] = {}
        spans = block.spans(self.loop, self._station.devices)
        for name in (*self._layout.unrecorded, block.EN):
            if name in spans and name not in self._layout.fields:
                found[name] = _raw(image, spans[name], self._station, self.loop, name)
        return found

    def _developed(self, found: list[Record | Lost | Reply], head: Reply) -> Iterator[Picture | Lost]:
        reply = head
        self._time.drained(found, head.last_ns)
        for each in found:
            if isinstance(each, Lost):
                yield each
            elif isinstance(each, Reply):
                reply = each
            else:
                if each.is_first:
                    yield Lost(0.0, 0, STARTED)
                yield self._develop(each, reply)
        yield from self._silence(any(isinstance(each, Record) for each in found), head.last_ns)

    def _silence(self, is_moving: bool, now_ns: int) -> Iterator[Lost]:
        """Say once that nothing comes any more; with it goes what the instruction remembered."""
        if is_moving or self._silent_since_ns is None:
            self._silent_since_ns, self._is_silent = now_ns, False
            return
        limit_ns = max(SILENT_NS, SILENT_RECORDS * self.record_ns)
        if self._layout.each is not Each.CHANGE and not self._is_silent and now_ns - self._silent_since_ns > limit_ns:
            self._is_silent = True
            yield Lost(0.0, 0, SILENT)

    def _develop(self, each: Record, reply: Reply) -> Picture:
        words = block.from_fields(self.loop, each.fields, self._beside or {})
        earliest_ns, latest_ns = self._time.of(each, self._drained_ns, reply.last_ns)
        tick, self._tick = self._tick, self._tick + 1
        enabled = bool(words[block.EN][0]) if block.EN in words else None
        picture = Picture(
            tick=tick,
            inputs=block.inputs(self.loop, words),
            seen=block.seen(self.loop, words),
            words=words,
            enabled=enabled,
            running=True,
            sent_ns=earliest_ns,
            last_ns=latest_ns,
            utc_ns=self._clock.utc_ns() - (self._clock.now_ns() - latest_ns),
            aligned_since_ns=reply.aligned_since_ns,
            executions=executions_in(self.loop, enabled=enabled),
            is_exact=True,
        )
        if self._sees is not None:
            self._sees(picture)
        return picture


def executions_in(loop: Loop, *, enabled: bool | None) -> tuple[int, int]:
    """Least and most executions from one record to the next, whose contact EN is as given."""
    if enabled is False:
        return 0, 0
    return (1, 1) if loop.is_called else (0, 1)


def _runs(first: int, count: int, most: int, records: int) -> Iterator[tuple[int, int]]:
    """Cut `count` slots from `first` on into runs of up to `most` that do not go over the ring's end."""
    while count > 0:
        length = min(count, most, records - first)
        yield first, length
        first, count = (first + length) % records, count - length


def _given_up(found: list[Record | Lost | Reply]) -> list[Record | Lost | Reply]:
    """Give up the records of a drain whose other operands are not known."""
    records = sum(isinstance(each, Record) for each in found)
    rest: list[Record | Lost | Reply] = [each for each in found if not isinstance(each, Record)]
    return [*rest, Lost(float(records), records, MOVED)] if records else rest


def _raw(image: block.Image, span: Span, station: Station, loop: Loop, name: str) -> tuple[int, ...]:
    """Raw words of what stands beside the records; a bit as one 0 or 1."""
    place = block.address(loop, station.devices, name)
    return (int(image.bit(place)),) if place.is_bit else image.words(span)


class _Time:
    """The PLC's time of a record on our clock."""

    def __init__(self, loop: Loop, layout: Recorder) -> None:
        self.record_ns = 0
        self._is_sparse = layout.each is Each.CHANGE
        self._is_bounding = True
        self._taken_ns = 0
        if loop.is_called and loop.interval_ms is not None:
            # Each record is one period further, which no clock of the program can tell better.
            self._unit_ns, ticks, self._is_counting = loop.interval_ms * MILLISECOND, layout.sequences, True
        else:
            self._unit_ns, ticks, self._is_counting = layout.time_unit_ns, layout.times, False
        self._range_ns = self._unit_ns * ticks
        self._last_raw_ns: int | None = None
        self._plc_ns = 0
        self._origin_ns: int | None = None
        self._times: dict[int, int] = {}

    def drained(self, found: list[Record | Lost | Reply], now_ns: int) -> None:
        """Take in the records of one drain; the newest of them was made about now."""
        records = [each for each in found if isinstance(each, Record)]
        raw = [
            (each.sequence, each.sequence * self._unit_ns if self._is_counting else each.time_ns) for each in records
        ]
        timed = [(sequence, time_ns) for sequence, time_ns in raw if time_ns is not None]
        self._times = {}
        if not timed:
            return
        # Where records are made at changes alone, the time may have begun anew any number of times between two.
        self._is_bounding = not self._is_sparse or now_ns - self._taken_ns < self._range_ns
        self._taken_ns = now_ns
        started_ns = self._plc_ns
        for sequence, time_ns in timed:
            if self._last_raw_ns is not None:
                self._plc_ns += (time_ns - self._last_raw_ns) % self._range_ns
            self._last_raw_ns = time_ns
            self._times[sequence] = self._plc_ns
        if len(timed) > 1:
            steps = len(timed) - 1
            self.record_ns = (self._plc_ns - self._times[timed[0][0]]) // steps or self.record_ns
        elif self._plc_ns > started_ns and not self.record_ns:
            self.record_ns = self._plc_ns - started_ns
        seen_ns = now_ns - self._plc_ns
        if self._origin_ns is None or abs(seen_ns - self._origin_ns) > CLOCK_SLACK_NS:
            self._origin_ns = seen_ns

    def of(self, each: Record, earliest_ns: int, latest_ns: int) -> tuple[int, int]:
        """Earliest and latest moment at which the record can have been made."""
        if self._origin_ns is None or each.sequence not in self._times or not self._is_bounding:
            return earliest_ns, latest_ns
        moment_ns = self._origin_ns + self._times[each.sequence]
        until_ns = moment_ns + (0 if self._is_counting else self._unit_ns)
        return moment_ns, max(moment_ns, min(until_ns, latest_ns))
