"""A link to what a recording saw: reads are answered from the raw words of the time, writes are refused.

`replay://FILE` lets every command that only reads run on a recording: the memory is that of the newest picture at the
time on the clock. Where each operand stood is in the recording itself.
"""

from __future__ import annotations

from collections.abc import Iterator

from ahgateway.clock import MILLISECOND, SECOND, Clock
from ahgateway.codec import block
from ahgateway.codec.access import Read, Request, Table
from ahgateway.codec.devices import Device
from ahgateway.codec.station import Const, Station
from ahgateway.core.operands import Kind
from ahgateway.errors import LinkError, PlcRefusedError
from ahgateway.recording.reader import Recording, Row
from ahgateway.transports.base import LinkFigures, Reply

ILLEGAL_FUNCTION, ILLEGAL_ADDRESS = 1, 2
SLICE_NS = 50 * MILLISECOND


class RecordedClock:
    """The clock of a recording: it starts when the recording starts and runs `speed` times as fast as `inner`.

    It can be stopped, made faster or slower, and set to another time; whoever sleeps on it wakes within `SLICE_NS` of
    the inner clock to see that.
    """

    def __init__(self, inner: Clock, start_ns: int, utc_start_ns: int, speed: float) -> None:
        if speed <= 0.0:
            raise ValueError(f"speed must be above 0: {speed}")
        self._inner = inner
        self._begun_ns = inner.now_ns()
        self._start_ns = start_ns
        self._utc_offset_ns = utc_start_ns - start_ns
        self._speed = speed

    def now_ns(self) -> int:
        return self._start_ns + round((self._inner.now_ns() - self._begun_ns) * self._speed)

    def utc_ns(self) -> int:
        return self.now_ns() + self._utc_offset_ns

    @property
    def utc_offset_ns(self) -> int:
        """What its UTC is ahead of its monotonic time."""
        return self._utc_offset_ns

    def run(self, speed: float) -> None:
        """Go on at another speed; 0 stands still."""
        self.jump(self.now_ns())
        self._speed = speed

    def jump(self, now_ns: int) -> None:
        """Stand at another time, earlier or later."""
        self._start_ns, self._begun_ns = now_ns, self._inner.now_ns()

    async def sleep_ns(self, duration_ns: int) -> None:
        """Return when so much of its time is over; it may have been set to another time meanwhile."""
        due_ns = self.now_ns() + max(0, duration_ns)
        while True:
            left_ns = due_ns - self.now_ns()
            wall_ns = SLICE_NS if self._speed <= 0.0 else round(max(0, left_ns) / self._speed)
            await self._inner.sleep_ns(min(wall_ns, SLICE_NS))
            if left_ns <= 0 or self.now_ns() >= due_ns:
                return

    async def slice(self) -> None:
        """Let `SLICE_NS` of the inner clock pass."""
        await self._inner.sleep_ns(SLICE_NS)


class ReplayLink:
    """Answers reads from a recording as the PLC's memory stood then; a `Link`.

    The recording begins when the link is made and runs `speed` times as fast as the clock. Times in replies are those
    of the clock, so that whoever reads sees memory that is `now`.
    """

    def __init__(self, recording: Recording, clock: Clock, speed: float = 1.0) -> None:
        self.target = f"replay://{recording.path}"
        self.figures = LinkFigures()
        self._recording = recording
        self._clock = clock
        self._begun_ns = clock.now_ns()
        self._cells: dict[Table, dict[int, int]] = {table: {} for table in Table}
        self._rows: Iterator[Row] = recording.rows()
        self._next: Row | None = next(self._rows, None)
        self._newest: Row | None = None
        self._is_closed = False
        first_ns = self._next.last_ns if self._next is not None else 0
        self._recorded = RecordedClock(clock, first_ns, 0, speed)

    async def exchange(self, request: Request) -> Reply:
        """Answer one read from the newest picture.

        Raises:
            LinkError: The recording is over, or the link has been closed.
            PlcRefusedError: It is a write, or these addresses were not recorded.
        """
        if self._is_closed:
            raise LinkError(f"{self.target}: the link has been closed")
        self.figures.requests += 1
        if not isinstance(request, Read):
            self.figures.refused += 1
            raise PlcRefusedError(f"{self.target}: a recording takes no writes", code=ILLEGAL_FUNCTION)
        self._advance(self._recorded.now_ns())
        cells = self._cells[request.table]
        wanted = range(request.address, request.address + request.count)
        missing = [address for address in wanted if address not in cells]
        if missing and len(missing) == request.count:
            self.figures.refused += 1
            raise PlcRefusedError(
                f"{self.target}: {request.table.value} {missing[0]:#06x} was not recorded", code=ILLEGAL_ADDRESS
            )
        self.figures.replies += 1
        now_ns = self._clock.now_ns()
        # What was read in vain to fill a gap stands in no operand; nobody looks at it.
        values = tuple(cells.get(address, 0) for address in wanted)
        return Reply(request, values, now_ns, now_ns, now_ns, self._begun_ns)

    async def close(self) -> None:
        """Release the recording. May be called twice."""
        self._is_closed = True
        self._recording.close()

    def _advance(self, now_ns: int) -> None:
        while self._next is not None and (self._next.last_ns <= now_ns or self._newest is None):
            self._newest = self._next
            lay_out(self._recording.station, self._newest, self._cells)
            self._next = next(self._rows, None)
        if self._next is None and (self._newest is None or now_ns > self._newest.last_ns + SECOND):
            raise LinkError(f"{self.target}: the recording is over")


def lay_out(station: Station, row: Row, cells: dict[Table, dict[int, int]]) -> None:
    """Put a row's words where they stood in the PLC's memory; constants stood nowhere."""
    loop = next(loop for loop in station.loops if loop.name == row.loop)
    for operand in loop.controller.operands:
        binding = loop.bindings[operand.name]
        if not isinstance(binding, Const):
            _put(station, binding, operand.kind is Kind.BOOL, row.words[operand.name], cells)
    if loop.en is not None:
        _put(station, loop.en, True, row.words[block.EN], cells)
    if station.running is not None and row.running is not None:
        _put(station, station.running, True, (int(row.running),), cells)


def _put(
    station: Station, device: Device, is_bit: bool, words: tuple[int, ...], cells: dict[Table, dict[int, int]]
) -> None:
    place = station.devices.address(device, bits=is_bit)
    table = cells[place.table]
    if place.bit is not None and not place.table.is_bits:
        word = table.get(place.address, 0) & ~(1 << place.bit)
        table[place.address] = word | (words[0] & 1) << place.bit
        return
    table.update(zip(range(place.address, place.address + len(words)), words, strict=True))
