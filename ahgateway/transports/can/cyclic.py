"""The cyclic role as a `base.Link`: what travels in PDOs is answered from the last complete cycle, the rest by SDO.

Nothing is asked for a word that is in a PDO: the tick is the bus's own SYNC. Between an SDO answer and the next one
from PDOs a whole cycle must begin, so that a picture bracketed by PDO words never spans less than what SDO read inside.
On a bench the process value goes out in a PDO of its own, of which it is measured how far behind SYNC it leaves.
"""

from __future__ import annotations

from ahgateway.clock import MILLISECOND, Clock
from ahgateway.codec.access import Read, Request, Span, Write
from ahgateway.codec.can_cycle import MICROSECOND, Cycle, CycleAssembler
from ahgateway.codec.can_frame import CanFrame
from ahgateway.codec.can_objects import CanMap
from ahgateway.codec.station import Pacing
from ahgateway.errors import ReplyTimeoutError
from ahgateway.transports.base import LinkFigures, Reply
from ahgateway.transports.can.bus import CanBus
from ahgateway.transports.can.link import SdoLink
from ahgateway.transports.can.reader import Trouble

STALE_PERIODS = 3
"""A cycle older than so many periods is no longer shown as live."""


class CyclicLink:
    """A `base.Link` that listens to a PLC's PDOs.

    Args:
        sdo: Answers what is in no PDO; it owns the bus.
        bus: The interface.
        objects: SYNC, PDOs and objects of the profile.
        clock: Times of replies.
        pacing: Its reply time-out is the longest wait for a complete cycle.
    """

    def __init__(self, sdo: SdoLink, bus: CanBus, objects: CanMap, clock: Clock, pacing: Pacing | None = None) -> None:
        self.target = sdo.target
        self.figures: LinkFigures = sdo.figures
        self._sdo = sdo
        self._bus = bus
        self._clock = clock
        self._timeout_ns = (pacing or Pacing()).reply_timeout_ms * MILLISECOND
        self._objects = objects
        self._sync = objects.sync
        self._assembler = CycleAssembler(objects)
        self.figures.cycles = self._assembler.figures
        self._after_ns: int | None = None
        self._since_ns: int | None = None
        self._unsubscribe = bus.subscribe(self._frame, self._trouble)

    async def exchange(self, request: Request) -> Reply:
        """Answer from the last complete cycle, or by SDO; see `base.Link.exchange`.

        Raises:
            ReplyTimeoutError: No complete cycle came in time.
        """
        if not isinstance(request, Read):
            return await self._write(request)
        await self._bus.open()
        cycle = await self._cycle()
        values = cycle.values(Span(request.table, request.address, request.count))
        if values is None:
            return await self._by_sdo(request)
        self.figures.requests += 1
        self.figures.replies += 1
        assert self._since_ns is not None
        return Reply(request, values, cycle.sync_ns, cycle.sync_ns, cycle.last_ns, self._since_ns)

    async def close(self) -> None:
        """Release the interface."""
        self._unsubscribe()
        await self._sdo.close()

    async def _by_sdo(self, request: Request) -> Reply:
        reply = await self._sdo.exchange(request)
        self._after_ns = reply.last_ns
        return reply

    async def _write(self, request: Write) -> Reply:
        """Send what the PLC takes by PDO in one frame, all else by SDO.

        Nobody answers a PDO: its reply says when it left. What is read afterwards belongs to a cycle that began later.
        """
        pdo = self._objects.taking(Span(request.table, request.address, len(request.values)))
        if pdo is None:
            return await self._by_sdo(request)
        await self._bus.open()
        self.figures.requests += 1
        await self._bus.send(CanFrame(pdo.cob_id, pdo.encoded([request.values])))
        now_ns = self._clock.now_ns()
        self._assembler.sent(now_ns)
        self._after_ns = now_ns
        self.figures.replies += 1
        return Reply(request, (), now_ns, now_ns, now_ns, self._since_ns or now_ns)

    async def _cycle(self) -> Cycle:
        """Return the last complete cycle that is fresh and began behind the last SDO answer."""
        end_ns = self._clock.now_ns() + self._timeout_ns
        while True:
            now_ns = self._clock.now_ns()
            self._assembler.settle(now_ns)
            cycle = self._assembler.latest
            if cycle is not None and self._is_usable(cycle, now_ns):
                self._since_ns = self._since_ns or cycle.sync_ns
                return cycle
            if now_ns >= end_ns:
                break
            await self._clock.sleep_ns(min(self._sync.window_us * MICROSECOND // 4, 2 * MILLISECOND))
        self.figures.timeouts += 1
        self._since_ns = None
        figures = self._assembler.figures
        raise ReplyTimeoutError(
            f"{self.target}: no complete cycle within {self._timeout_ns // MILLISECOND} ms; {figures.syncs} SYNC, "
            f"{figures.complete} complete, {figures.incomplete} incomplete, {figures.late} PDOs outside the window",
            hint="is the node operational, does its master send SYNC, are COB-IDs and window as in the profile?",
        )

    def _is_usable(self, cycle: Cycle, now_ns: int) -> bool:
        if self._after_ns is not None and cycle.sync_ns <= self._after_ns:
            return False
        return now_ns - cycle.sync_ns <= STALE_PERIODS * self._sync.period_us * MICROSECOND

    def _frame(self, frame: CanFrame) -> None:
        self._assembler.feed(frame)

    def _trouble(self, trouble: Trouble) -> None:
        if trouble.name in ("lost", "bus-off"):
            self._since_ns = None
