"""Serve a device on a TCP port: all requests of a connection in order, pipelined or not."""

from __future__ import annotations

import asyncio
import logging
import socket
from collections.abc import Callable
from typing import cast

from ahgateway.clock import Clock
from ahgateway.errors import FrameError, LinkError
from ahgateway.transports.base import Device, Tap
from ahgateway.transports.framing import Framing, Mbap
from ahgateway.transports.responder import Responder

BUFFER_SIZE = 8192
CONNECTIONS_MAX = 32

_log = logging.getLogger(__name__)


class TcpServer:
    """A running server; made by `serve_tcp`.

    Attributes:
        port: The port it listens on, also when 0 was asked for.
        connections_refused: Connections closed at once because the limit was reached.
    """

    def __init__(
        self,
        device: Device,
        framing: Callable[[], Framing],
        connections_max: int,
        clock: Clock | None = None,
        tap: Tap | None = None,
    ) -> None:
        self.port = 0
        self.connections_refused = 0
        self._device = device
        self._framing = framing
        self._connections_max = connections_max
        self._clock = clock
        self._tap = tap
        self._sessions: set[_Session] = set()
        self._server: asyncio.Server | None = None

    @property
    def connections(self) -> int:
        """Connections open now."""
        return len(self._sessions)

    async def listen(self, host: str, port: int) -> None:
        """Bind and start to answer.

        Raises:
            LinkError: The port cannot be had.
        """
        loop = asyncio.get_running_loop()
        try:
            self._server = await loop.create_server(lambda: _Session(self), host, port)
        except OSError as error:
            raise LinkError(
                f"cannot listen on {host}:{port}: {error.strerror or error}",
                hint="another program has this port, or it is below 1024 and needs rights; choose another",
            ) from error
        self.port = self._server.sockets[0].getsockname()[1]

    async def close(self) -> None:
        """Stop listening and cut every connection."""
        if self._server is not None:
            self._server.close()
        self.drop_connections()
        if self._server is not None:
            await self._server.wait_closed()
            self._server = None

    def drop_connections(self) -> None:
        """Cut every connection, as a PLC that restarts does; new ones are accepted."""
        for session in list(self._sessions):
            session.abort()

    def responder(self) -> Responder:
        """Return the server's side of a new connection."""
        return Responder(self._device, self._framing(), self._clock, self._tap)

    def admit(self, session: _Session) -> bool:
        """Count a new connection in, or refuse it because the limit is reached."""
        if len(self._sessions) >= self._connections_max:
            self.connections_refused += 1
            return False
        self._sessions.add(session)
        return True

    def dismiss(self, session: _Session) -> None:
        """Count a connection out."""
        self._sessions.discard(session)


class _Session(asyncio.BufferedProtocol):
    def __init__(self, server: TcpServer) -> None:
        self._server = server
        self._responder = server.responder()
        self._view = memoryview(bytearray(BUFFER_SIZE))
        self._transport: asyncio.Transport | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = cast(asyncio.Transport, transport)
        if not self._server.admit(self):
            self._transport.abort()
            return
        transport.get_extra_info("socket").setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def get_buffer(self, sizehint: int) -> memoryview:
        return self._view

    def buffer_updated(self, nbytes: int) -> None:
        assert self._transport is not None
        try:
            answers = self._responder.feed(self._view[:nbytes])
        except FrameError as error:
            _log.info("connection closed: %s", error)
            self.abort()
            return
        if answers:
            self._transport.write(answers)

    def pause_writing(self) -> None:
        # A peer that asks and does not read must not fill our memory.
        assert self._transport is not None
        self._transport.pause_reading()

    def resume_writing(self) -> None:
        assert self._transport is not None
        self._transport.resume_reading()

    def connection_lost(self, exc: Exception | None) -> None:
        self._server.dismiss(self)

    def abort(self) -> None:
        if self._transport is not None:
            self._transport.abort()


async def serve_tcp(
    device: Device,
    host: str = "127.0.0.1",
    port: int = 0,
    *,
    clock: Clock | None = None,
    framing: Callable[[], Framing] = Mbap,
    connections_max: int = CONNECTIONS_MAX,
    tap: Tap | None = None,
) -> TcpServer:
    """Serve `device` on `host:port` until `close`; port 0 takes a free one.

    Args:
        device: Answers the requests, one at a time, in the order of their arrival.
        host: Address to listen on.
        port: Port to listen on.
        clock: Stamps what the tap gets; needed only with a tap.
        framing: Makes the framing of each connection.
        connections_max: Beyond it a new connection is closed at once.
        tap: Gets what arrives (`>`) and what goes back (`<`).

    Source: MANUAL EIP 3.2.1: 16…128 connections by CPU for CIP; the Modbus server's own limit is ASSUMED alike.

    Raises:
        LinkError: The port cannot be had.
    """
    server = TcpServer(device, framing, connections_max, clock, tap)
    await server.listen(host, port)
    return server
