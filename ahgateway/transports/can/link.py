"""The SDO client as a `base.Link`: reads and writes of devices become transfers of the objects that hold them.

This file alone decides when a reply may be believed. An SDO reply carries no number: initiate replies echo index and
sub-index, segments only a toggle bit, and a late answer about the same object looks like the answer to a new question.
So the channel is proven before it is used and after every doubt: a read of a sub-index that nothing else asks for is
sent, a different one each time, and all that comes before its echo is dropped (replies of one server keep their order
on CAN). Requests of somebody else to the same server are heard and end the transfer under way.

An SDO picture is no snapshot: each object is read at its own time. `Station.is_snapshot` says so to lockstep.
"""

from __future__ import annotations

import asyncio
from dataclasses import dataclass

from ahgateway.clock import MILLISECOND, Clock
from ahgateway.codec.access import Read, Request, Span, Write
from ahgateway.codec.can_frame import SDO_REPLY, SDO_REQUEST, CanFrame
from ahgateway.codec.can_objects import CanMap, CanObject, span_bytes, span_values
from ahgateway.codec.can_sdo import TIMED_OUT, Transfer, abort_frame, refusal
from ahgateway.codec.station import Pacing
from ahgateway.errors import CodecError, FrameError, LinkError, PlcRefusedError, ReplyTimeoutError
from ahgateway.transports.base import LinkFigures, Reply
from ahgateway.transports.can.bus import CanBus
from ahgateway.transports.can.reader import Trouble
from ahgateway.transports.can.turns import Turns
from ahgateway.transports.pdu import describe

PROBE_INDEX = 0x1018
PROBE_SUBS = 250
"""Sub-indices of the identity object that probes take in turn; an abort echoes one that is not there as well."""
PROBES_MAX = 3
_STOLEN = "another SDO client speaks to this node"


@dataclass(frozen=True, slots=True)
class _Got:
    """A reply's data field and when it was taken from the adapter."""

    data: bytes
    now_ns: int


class SdoLink:
    """A `base.Link` to one CANopen node.

    Args:
        bus: The interface; opened on first use and closed with the link.
        node: Node-ID 1…127 of the SDO server.
        objects: Which object holds which devices.
        clock: Times of replies.
        pacing: Reply time-out of each frame, and the pause between requests.
    """

    def __init__(self, bus: CanBus, node: int, objects: CanMap, clock: Clock, pacing: Pacing | None = None) -> None:
        self.target = bus.target
        self.bus = bus
        self.figures = LinkFigures()
        self._node = node
        self._objects = objects
        self._clock = clock
        self._pacing = pacing or Pacing()
        self._turns = Turns(self._pacing.request_wait_max_ms / 1000)
        self._replies: asyncio.Queue[_Got | LinkError | FrameError] = asyncio.Queue(maxsize=64)
        self._is_asking = False
        self._aligned_ns: int | None = None
        self._probe = 0
        self._last_ns = 0
        self._is_closed = False
        self._opens_seen = 0
        self._unsubscribe = bus.subscribe(self._frame, self._trouble)

    async def exchange(self, request: Request) -> Reply:
        """Carry one request out, object by object; see `base.Link.exchange`.

        Raises:
            CodecError: A device stands in no object, or a write needs more than one object or a part of one.
            ReplyTimeoutError: Also when its turn did not come in time; then nothing was sent.
        """
        objects = self._objects_of(request)
        is_mine = False
        try:
            async with self._turns.turn(is_command=not isinstance(request, Read) or request.is_command):
                is_mine = True
                return await self._speak(request, objects)
        except TimeoutError as error:
            if is_mine:
                raise
            raise ReplyTimeoutError(
                f"{self.target}: waited {self._pacing.request_wait_max_ms} ms for its turn and was not sent: "
                f"{describe(request)}",
                hint="SDO is slower than what is asked of it: raise poll_ms, or request_wait_max_ms",
            ) from error

    async def _speak(self, request: Request, objects: tuple[CanObject, ...]) -> Reply:
        await self._ready()
        self.figures.requests += 1
        try:
            return await self._exchange(request, objects)
        except PlcRefusedError:
            self.figures.refused += 1
            raise
        except ReplyTimeoutError:
            self.figures.timeouts += 1
            raise

    async def close(self) -> None:
        """Release the interface; a request under way fails. May be called twice."""
        self._is_closed = True
        self._tell(LinkError(f"{self.target}: the link has been closed"))
        self._unsubscribe()
        await self.bus.close()

    def _objects_of(self, request: Request) -> tuple[CanObject, ...]:
        count = request.count if isinstance(request, Read) else len(request.values)
        span = Span(request.table, request.address, count)
        objects = self._objects.holding(span)
        if isinstance(request, Write) and [each.span for each in objects] != [span]:
            held = ", ".join(f"{each} with {each.span.count}" for each in objects)
            raise CodecError(
                f"{self.target}: a write of {count} × {span.table.value} from {span.address:#06x} is not exactly one "
                f"object, there stand {held}",
                hint="SDO writes each object by itself; values that must land together need one object",
            )
        return objects

    async def _ready(self) -> None:
        if self._is_closed:
            raise LinkError(f"{self.target}: the link has been closed")
        if self.bus.is_listen_only:
            raise LinkError(f"{self.target}: listen-only, and SDO needs questions", hint="leave out --listen-only")
        try:
            await self.bus.open()
        except LinkError as error:
            self.figures.first_cause = self.figures.first_cause or error.message
            raise
        pause_ns = self._last_ns + self._pacing.pause_between_requests_ms * MILLISECOND - self._clock.now_ns()
        if self._last_ns and self._pacing.pause_between_requests_ms and pause_ns > 0:
            await self._clock.sleep_ns(pause_ns)
        if self._aligned_ns is None:
            await self._align()

    async def _exchange(self, request: Request, objects: tuple[CanObject, ...]) -> Reply:
        sent_ns = self._clock.now_ns()
        first_ns, values = 0, list[int]()
        for each in objects:
            written = span_bytes(each.span, request.values) if isinstance(request, Write) else None
            transfer, begun_ns, last_ns = await self._transfer(each.index, each.sub, written)
            first_ns = first_ns or begun_ns
            if isinstance(request, Read):
                values += self._part(request, each, transfer)
        self._last_ns = last_ns
        self.figures.answered(last_ns - sent_ns)
        assert self._aligned_ns is not None
        return Reply(request, tuple(values), sent_ns, first_ns, last_ns, self._aligned_ns)

    def _part(self, request: Read, each: CanObject, transfer: Transfer) -> tuple[int, ...]:
        value = transfer.value if transfer.is_sized else transfer.value[: each.size]
        if len(value) != each.size:
            raise CodecError(
                f"{self.target}: node {self._node} holds {len(value)} bytes in object {each}, the profile says "
                f"{each.size}",
                hint="compare `length` in [[station.can.objects]] with the EDS of the module",
            )
        skip = max(0, request.address - each.span.address)
        return span_values(each.span, value)[skip : request.address + request.count - each.span.address]

    async def _transfer(self, index: int, sub: int, written: bytes | None) -> tuple[Transfer, int, int]:
        """Run one transfer; return it with the times of its first and its last reply."""
        transfer = Transfer(index, sub, written)
        first_ns = 0
        self._clear()
        self._is_asking = True
        try:
            while True:
                await self._send(transfer.request)
                got = await self._answer(transfer)
                first_ns = first_ns or got.now_ns
                if transfer.is_done:
                    return transfer, first_ns, got.now_ns
        except PlcRefusedError as error:
            raise refusal(f"{self.target}: {self._what(transfer, written)}", error.code) from error
        except (FrameError, ReplyTimeoutError, asyncio.CancelledError) as error:
            self._aligned_ns = None
            if not isinstance(error, asyncio.CancelledError):
                await self._send(abort_frame(index, sub, TIMED_OUT))
            if isinstance(error, FrameError):
                raise FrameError(f"{self.target}: {error.message}", hint=error.hint) from error
            raise
        finally:
            self._is_asking = False

    async def _answer(self, transfer: Transfer) -> _Got:
        timeout_ms = self._pacing.reply_timeout_ms
        try:
            async with asyncio.timeout(timeout_ms / 1000):
                while True:
                    got = await self._replies.get()
                    if not isinstance(got, _Got):
                        raise got
                    if transfer.feed(got.data):
                        return got
                    self.figures.late += 1
        except TimeoutError:
            pass
        raise ReplyTimeoutError(
            f"{self.target}: no reply within {timeout_ms} ms to: {self._what(transfer, None)}",
            hint="check node number and bit rate; a node that has been stopped by NMT answers no SDO",
        )

    async def _align(self) -> None:
        """Prove that nothing is under way any more: only an echo of this very probe ends it."""
        for _ in range(PROBES_MAX):
            self._probe = (self._probe + 1) % PROBE_SUBS
            try:
                await self._transfer(PROBE_INDEX, self._probe, None)
            except PlcRefusedError:
                pass
            except ReplyTimeoutError:
                continue
            except FrameError as error:
                if _STOLEN in error.message:
                    raise
                continue
            self._aligned_ns = self._clock.now_ns()
            return
        self.figures.timeouts += 1
        raise ReplyTimeoutError(
            f"{self.target}: node {self._node} answers no SDO request, {PROBES_MAX} were sent",
            hint="check node number and bit rate; a node that has been stopped by NMT answers no SDO",
        )

    async def _send(self, data: bytes) -> None:
        try:
            await self.bus.send(CanFrame(SDO_REQUEST + self._node, data))
        except LinkError:
            self._aligned_ns = None
            raise

    def _what(self, transfer: Transfer, written: bytes | None) -> str:
        verb = "read" if written is None else f"write {len(written)} bytes to"
        return f"{verb} object {transfer.index:#06x}:{transfer.sub:02x} of node {self._node}"

    def _clear(self) -> None:
        while not self._replies.empty():
            if isinstance(self._replies.get_nowait(), _Got):
                self.figures.late += 1

    def _frame(self, frame: CanFrame) -> None:
        if frame.is_extended or frame.is_remote:
            return
        if frame.can_id == SDO_REPLY + self._node:
            if self._is_asking:
                self._tell(_Got(frame.data, frame.now_ns))
            else:
                self.figures.late += 1
        elif frame.can_id == SDO_REQUEST + self._node:
            # Its answer would look like ours: nothing is believed before a new probe.
            self._aligned_ns = None
            if self._is_asking:
                self._tell(FrameError(f"{_STOLEN}, node {self._node}", hint="one SDO client at a time"))

    def _trouble(self, trouble: Trouble) -> None:
        if trouble.name in ("lost", "bus-off"):
            self._aligned_ns = None
            self.figures.first_cause = self.figures.first_cause or trouble.text
            self._tell(LinkError(f"{self.target}: the interface was lost: {trouble.text}"))
        elif trouble.name == "open":
            self.figures.reconnects += 1 if self._opens_seen else 0
            self._opens_seen += 1

    def _tell(self, event: _Got | LinkError | FrameError) -> None:
        if self._replies.full():
            self._replies.get_nowait()
            self.figures.late += 1
        self._replies.put_nowait(event)
