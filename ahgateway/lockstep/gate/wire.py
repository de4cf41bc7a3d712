"""What the gate asks of the wire: a picture, a request sent once, a fresh read compared word by word."""

from __future__ import annotations

from ahgateway.clock import MILLISECOND, Clock
from ahgateway.codec.access import Read, Span, Write
from ahgateway.codec.station import Loop, Station
from ahgateway.codec.words import decode
from ahgateway.errors import PlcRefusedError, StateError
from ahgateway.lockstep.gate.change import Item, Step, shown
from ahgateway.lockstep.picture import Picture, Sampler, Sees
from ahgateway.transports.base import Link

SETTLE_SCANS = 2
"""A write stands in memory behind the scan in which it came; a program that overwrites it does so within the next."""
READ_BACK_TRIES = 4
BUSY = 6
BUSY_TRIES = 5
PICTURE_TRIES = 5


class Wire:
    """One loop's wire, as the gate uses it.

    Attributes:
        settle_ns: How long a write is given before it is read back, and a busy PLC before it is asked again.
    """

    def __init__(self, station: Station, loop: Loop, link: Link, clock: Clock, sees: Sees | None = None) -> None:
        self.settle_ns = max(20, SETTLE_SCANS * loop.scan_ms_max) * MILLISECOND
        self._station, self._loop, self._link, self._clock = station, loop, link, clock
        self._sampler = Sampler(loop, station, link, clock, sees)
        self._sampler.plan = self._sampler.plan.as_command()

    async def picture(self) -> Picture:
        """Return one picture; it is a read, so that a busy PLC or a torn picture is simply asked again."""
        for tried in range(1, PICTURE_TRIES + 1):
            try:
                picture = await self._sampler.picture()
            except PlcRefusedError as error:
                if error.code != BUSY or tried == PICTURE_TRIES:
                    raise
                picture = None
            if picture is not None:
                return picture
            await self._clock.sleep_ns(self.settle_ns)
        raise StateError(f"loop {self._loop.name}: no picture of the loop without an execution inside it")

    async def send(self, request: Write) -> None:
        """Send a request; only a PLC that answered *busy* is asked again.

        Raises:
            TransportError: The link failed; nobody knows whether it arrived.
            PlcRefusedError: The PLC refused it.
        """
        for tried in range(1, BUSY_TRIES + 1):
            try:
                await self._link.exchange(request)
            except PlcRefusedError as error:
                # Busy is an answer: it was not carried out, so that asking again is no blind repeat.
                if error.code != BUSY or tried == BUSY_TRIES:
                    raise
                await self._clock.sleep_ns(self.settle_ns)
            else:
                return

    async def read_back(self, step: Step) -> str:
        """Wait out the settle window and compare a fresh read, after rounding, word by word.

        Returns:
            What stands there instead, empty when it is what was written.
        """
        found: tuple[int, ...] = ()
        request = step.request
        for _ in range(READ_BACK_TRIES):
            await self._clock.sleep_ns(self.settle_ns)
            found = await self.read(Span(request.table, request.address, len(request.values)))
            if found == request.values:
                return ""
        texts = []
        for item in step.items:
            at = item.span.address - request.address
            stands = found[at : at + item.span.count]
            if stands != item.new:
                back = " again" if stands == item.old else ""
                texts.append(
                    f"{item.operand} {item.device} holds {_shown(item, stands)}{back}, not {shown(item.new_value)}"
                )
        return "; ".join(texts)

    async def read(self, span: Span) -> tuple[int, ...]:
        """Read afresh; a busy PLC is asked again."""
        request = Read(self._station.unit, span.table, span.address, span.count, is_command=True)
        for tried in range(1, BUSY_TRIES + 1):
            try:
                reply = await self._link.exchange(request)
            except PlcRefusedError as error:
                if error.code != BUSY or tried == BUSY_TRIES:
                    raise
                await self._clock.sleep_ns(self.settle_ns)
            else:
                return reply.values
        raise AssertionError("the last try returned or raised")


def _shown(item: Item, words: tuple[int, ...]) -> str:
    return shown(decode(item.kind, words))
