"""How scenarios reach their fake PLC: in memory, or over a real socket of this machine with the bytes of each wire.

Time stays the fake's: a socket's replies are stamped with virtual time, so that a scenario gives the same words over
every wire, and a wire that does not is what the bench is condemned for. Requests have their real deadlines.
"""

from __future__ import annotations

import contextlib
from collections.abc import AsyncIterator, Callable
from contextlib import AbstractAsyncContextManager

from ahgateway.clock import Clock, WallClock
from ahgateway.codec.access import Request
from ahgateway.fake.plc import FakePlc
from ahgateway.transports.ascii import AsciiReplies, AsciiRequests
from ahgateway.transports.base import Link, LinkFigures, Reply
from ahgateway.transports.framing import Framing, Mbap
from ahgateway.transports.memory import MemoryLink
from ahgateway.transports.rtu import RtuReplies, RtuRequests
from ahgateway.transports.server import serve_tcp
from ahgateway.transports.tcp import TcpLink

Wire = Callable[[FakePlc, Clock], AbstractAsyncContextManager[Link]]
"""Opens a way to a fake whose time is this clock's."""


class Restamped:
    """A link in real time whose replies carry the time of another clock."""

    def __init__(self, link: Link, clock: Clock) -> None:
        self.target = link.target
        self.figures: LinkFigures = link.figures
        self._link = link
        self._clock = clock
        self._since_ns = clock.now_ns()

    async def exchange(self, request: Request) -> Reply:
        sent_ns = self._clock.now_ns()
        reply = await self._link.exchange(request)
        now_ns = self._clock.now_ns()
        return reply._replace(sent_ns=sent_ns, first_ns=now_ns, last_ns=now_ns, aligned_since_ns=self._since_ns)

    async def close(self) -> None:
        await self._link.close()


@contextlib.asynccontextmanager
async def memory(plc: FakePlc, clock: Clock) -> AsyncIterator[Link]:
    """Yield a link without a wire; silence costs virtual time only."""
    link = MemoryLink(plc, clock)
    try:
        yield link
    finally:
        await link.close()


def _socket(requests: Callable[[], Framing], replies: Callable[[], Framing], scheme: str) -> Wire:
    @contextlib.asynccontextmanager
    async def opened(plc: FakePlc, clock: Clock) -> AsyncIterator[Link]:
        server = await serve_tcp(plc, framing=requests)
        link = TcpLink("127.0.0.1", server.port, clock=WallClock(), framing=replies, scheme=scheme)
        try:
            yield Restamped(link, clock)
        finally:
            await link.close()
            await server.close()

    return opened


WIRES: dict[str, Wire] = {
    "memory": memory,
    "tcp": _socket(Mbap, Mbap, "modbus+tcp"),
    "rtu": _socket(RtuRequests, RtuReplies, "modbus+rtu+tcp"),
    "ascii": _socket(AsciiRequests, AsciiReplies, "modbus+ascii+tcp"),
}
"""Every wire by name; RTU and ASCII travel inside TCP, as behind a converter."""
