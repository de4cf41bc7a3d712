"""A link without a wire: the same bytes, encoded and decoded both ways, in the process of the device."""

from __future__ import annotations

from ahgateway.clock import MILLISECOND, Clock
from ahgateway.codec.access import Request
from ahgateway.codec.station import Pacing
from ahgateway.errors import LinkError, PlcRefusedError, ReplyTimeoutError
from ahgateway.transports.base import Device, Frame, LinkFigures, Reply, Tap
from ahgateway.transports.framing import Mbap
from ahgateway.transports.pdu import decode_reply, describe, encode_request, reply_shape
from ahgateway.transports.responder import answer_pdu


class MemoryLink:
    """A `base.Link` to a device in this process; it serves any clock, virtual ones above all.

    Args:
        device: The PLC's side.
        clock: Gives the times and waits the latency.
        unit: The only unit that answers, None for those that the device answers itself.
        latency_ns: Time from request to reply; the device sees the request after half of it.
        pacing: Only its reply time-out counts: how long silence takes.
        tap: Gets every frame, wrapped as Modbus TCP.
        target: How errors name the link.
    """

    def __init__(
        self,
        device: Device,
        clock: Clock,
        unit: int | None = None,
        latency_ns: int = 0,
        tap: Tap | None = None,
        *,
        pacing: Pacing | None = None,
        target: str = "memory://",
    ) -> None:
        self.target = target
        self.figures = LinkFigures()
        self._device = device
        self._clock = clock
        self._unit = unit
        self._latency_ns = latency_ns
        self._timeout_ns = (pacing or Pacing()).reply_timeout_ms * MILLISECOND
        self._tap = tap
        self._wrap = Mbap().wrap
        self._tag = 0
        self._opened_ns = clock.now_ns()
        self._is_closed = False

    async def exchange(self, request: Request) -> Reply:
        """Carry one request to the device and back; see `base.Link.exchange`."""
        if self._is_closed:
            raise LinkError(f"{self.target}: the link has been closed, cannot {describe(request)}")
        pdu = encode_request(request)
        clock, figures, latency_ns = self._clock, self.figures, self._latency_ns
        sent_ns = clock.now_ns()
        figures.requests += 1
        self._tag = (self._tag + 1) & 0xFFFF
        self._show(">", request.unit, pdu)
        if latency_ns:
            await clock.sleep_ns(latency_ns // 2)
        is_there = self._unit is None or request.unit == self._unit
        answer = answer_pdu(self._device, request.unit, pdu) if is_there else None
        if answer is None:
            await clock.sleep_ns(self._timeout_ns - latency_ns // 2)
            figures.timeouts += 1
            raise ReplyTimeoutError(
                f"{self.target}: no reply within {self._timeout_ns // MILLISECOND} ms to: {describe(request)}",
                hint="check the unit number",
            )
        if latency_ns:
            await clock.sleep_ns(latency_ns - latency_ns // 2)
        self._show("<", request.unit, answer)
        try:
            values = decode_reply(request, reply_shape(request, pdu), answer)
        except PlcRefusedError:
            figures.refused += 1
            raise
        now_ns = clock.now_ns()
        self.figures.answered(now_ns - sent_ns)
        return Reply(request, values, sent_ns, now_ns, now_ns, self._opened_ns)

    async def close(self) -> None:
        """Refuse every later request."""
        self._is_closed = True

    def _show(self, direction: str, unit: int, pdu: bytes) -> None:
        if self._tap is not None:
            frame = self._wrap(self._tag, unit, pdu)
            self._tap(Frame(direction, frame, self._clock.now_ns(), self._clock.utc_ns()))
