"""What the gate asks of the wire: a picture, a request sent once, a fresh read compared word by word."""

from __future__ import annotations

from ahgateway.clock import MILLISECOND, Clock
from ahgateway.codec.access import Read, Span, Write
from ahgateway.codec.station import Loop, Station
from ahgateway.codec.words import decode
from ahgateway.errors import TransportError
from ahgateway.lockstep.gate.change import Item, Step, shown
from ahgateway.lockstep.patient import Patient
from ahgateway.lockstep.picture import Picture, Sampler, Sees
from ahgateway.transports.base import Link

SETTLE_SCANS = 2
"""A write stands in memory behind the scan in which it came; a program that overwrites it does so within the next."""
READ_BACK_TRIES = 4
PICTURE_TRIES = 16


class Wire:
    """One loop's wire, as the gate uses it.

    Attributes:
        settle_ns: How long a write is given before it is read back, and a busy PLC before it is asked again.
        link: The link, patient with a busy PLC.
    """

    def __init__(self, station: Station, loop: Loop, link: Link, clock: Clock, sees: Sees | None = None) -> None:
        self.settle_ns = max(20, SETTLE_SCANS * loop.scan_ms_max) * MILLISECOND
        self.link = Patient(link, clock, self.settle_ns)
        self._station, self._loop, self._clock = station, loop, clock
        self._sampler = Sampler(loop, station, self.link, clock, sees)
        self._sampler.plan = self._sampler.plan.as_command()

    async def picture(self) -> Picture:
        """Return one picture; it is a read, so that a torn one is simply taken again.

        Raises:
            TransportError: An execution fell into each of them, or the link failed.
        """
        for tries in range(PICTURE_TRIES):
            picture = await self._sampler.picture()
            if picture is not None:
                return picture
            # Never the same time twice: together with the picture it could be CYCLE itself.
            await self._clock.sleep_ns(self.settle_ns * (3 + tries % 4) // 3)
        raise TransportError(
            f"loop {self._loop.name}: no picture without an execution inside it, {PICTURE_TRIES} were taken",
            hint="the line is too slow for this CYCLE; `ahgateway doctor` says how long a picture takes",
        )

    async def send(self, request: Write) -> None:
        """Send a request; only a PLC that answered *busy* is asked again.

        Raises:
            TransportError: The link failed; nobody knows whether it arrived.
            PlcRefusedError: The PLC refused it.
        """
        await self.link.exchange(request)

    async def read(self, span: Span) -> tuple[int, ...]:
        """Read afresh."""
        request = Read(self._station.unit, span.table, span.address, span.count, is_command=True)
        return (await self.link.exchange(request)).values

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


def _shown(item: Item, words: tuple[int, ...]) -> str:
    return shown(decode(item.kind, words))
