"""A link over a TCP connection: Modbus TCP, or RTU and ASCII through a converter, as the framing says.

It owns the socket and the timer, nothing else: what to send and what a reply means is the engine's. Reading goes
through `asyncio.BufferedProtocol` into one buffer that is used again and again (MEASURED `spec/speed.md` §1.1:
the ordinary protocol asks the C library for 256 KiB at every read, which halves the throughput). One timer serves all
deadlines: it is moved when it fires, not at every request.
"""

from __future__ import annotations

import asyncio
import os
import socket
from collections.abc import Callable
from contextvars import Context
from typing import Any, cast

from ahgateway.clock import MILLISECOND, SECOND, Clock
from ahgateway.codec.access import Request
from ahgateway.codec.station import Pacing
from ahgateway.errors import FrameError, LinkError
from ahgateway.transports.base import LinkFigures, Reply, Tap
from ahgateway.transports.engine import UNANSWERED_MAX, Engine, Limits
from ahgateway.transports.framing import Framing, Mbap
from ahgateway.transports.machine_lock import MachineLock
from ahgateway.transports.pdu import describe
from ahgateway.transports.slots import take_slot

CONNECT_TIMEOUT_NS = 3 * SECOND
BACKOFF_MIN_NS = 100 * MILLISECOND
BACKOFF_MAX_NS = 5 * SECOND
KEEPALIVE_IDLE_S = 30
"""MANUAL AH10SCM, Modbus settings: keep-alive of 30 s is the default there; the CPU port's value is not known."""
CONVERTER_PAUSE_NS = 2 * MILLISECOND
"""Behind a reply on a connection without transaction numbers: a second copy shows itself before the next request."""
BUFFER_SIZE = 8192
IDLE_LOOKS = 4
"""So often the idle time is looked at before it is over: a hot path that notes no times may end a quarter late."""


class _Wire(asyncio.BufferedProtocol):
    """The socket's two ends of a callback: bytes in, connection gone."""

    def __init__(self, received: Callable[[memoryview], None], gone: Callable[[_Wire, Exception | None], None]) -> None:
        self._view = memoryview(bytearray(BUFFER_SIZE))
        self._received = received
        self._gone = gone
        self.closed = asyncio.Event()
        self.is_adopted = False

    def get_buffer(self, sizehint: int) -> memoryview:
        return self._view

    def buffer_updated(self, nbytes: int) -> None:
        self._received(self._view[:nbytes])

    def connection_lost(self, exc: Exception | None) -> None:
        self.closed.set()
        self._gone(self, exc)


class _Answer(asyncio.Future[Reply]):
    """A future whose waiting task goes on inside `set_result`, not at the next turn of the loop.

    One turn of the loop costs as much as the rest of an exchange (MEASURED: a quarter of the throughput with one
    request in flight). `set_result` is only called where bytes arrive, which is never inside a task.
    """

    _waker: Callable[[Any], object] | None = None
    _waker_context: Context | None = None

    def add_done_callback(self, fn: Callable[[Any], object], /, *, context: Context | None = None) -> None:
        if self._waker is None and context is not None and not self.done():
            self._waker, self._waker_context = fn, context
        else:
            super().add_done_callback(fn, context=context)

    def remove_done_callback(self, fn: Callable[[Any], object], /) -> int:
        self._hand_back()
        return super().remove_done_callback(fn)

    def set_result(self, reply: Reply, /) -> None:
        waker, context = self._waker, self._waker_context
        self._waker = None
        asyncio.Future.set_result(self, reply)
        if waker is not None and context is not None:
            context.run(waker, self)

    def set_exception(self, error: type | BaseException, /) -> None:
        self._hand_back()
        super().set_exception(error)

    def cancel(self, msg: object | None = None) -> bool:
        self._hand_back()
        return super().cancel(msg)

    def _hand_back(self) -> None:
        waker, self._waker = self._waker, None
        if waker is not None:
            super().add_done_callback(waker, context=self._waker_context)


class TcpLink:
    """A `base.Link` to `host:port`.

    Args:
        host: Name or address.
        port: TCP port.
        clock: Must run with the event loop's own time, as `WallClock` does.
        pacing: Limits of the station; requests in flight count only where the framing numbers them.
        tap: Gets every frame.
        framing: Makes the framing of the connection.
        scheme: How `target` begins.
        quiet_ns: Silence after anything odd on a line without transaction numbers.
    """

    def __init__(
        self,
        host: str,
        port: int,
        *,
        clock: Clock,
        pacing: Pacing | None = None,
        tap: Tap | None = None,
        framing: Callable[[], Framing] = Mbap,
        scheme: str = "modbus+tcp",
        quiet_ns: int = 50 * MILLISECOND,
    ) -> None:
        pacing = pacing or Pacing()
        self.target = f"{scheme}://{host}:{port}"
        self.figures = LinkFigures()
        self._host, self._port, self._clock = host, port, clock
        self._timeout_ns = pacing.reply_timeout_ms * MILLISECOND
        wire = framing()
        limits = Limits(
            timeout_ns=self._timeout_ns,
            window=pacing.requests_in_flight_max,
            pause_ns=max(pacing.pause_between_requests_ms * MILLISECOND, 0 if wire.identifies else CONVERTER_PAUSE_NS),
            pause_after_connect_ns=pacing.pause_after_connect_ms * MILLISECOND,
            quiet_ns=quiet_ns,
            share=pacing.line_share_max,
            wait_max_ns=pacing.request_wait_max_ms * MILLISECOND,
        )
        self._connections_max = pacing.connections_max
        self._idle_ns = pacing.close_when_idle_ms * MILLISECOND
        self._idle_timer: asyncio.TimerHandle | None = None
        self._slot: MachineLock | None = None
        self._engine = Engine(wire, limits, clock, self.figures, self.target, tap)
        self._loop: asyncio.AbstractEventLoop | None = None
        self._wire: _Wire | None = None
        self._transport: asyncio.Transport | None = None
        self._opening: asyncio.Task[None] | None = None
        self._timer: asyncio.TimerHandle | None = None
        self._timer_ns = 0
        self._backoff_ns = 0
        self._retry_ns = 0
        self._connections = 0
        self._is_out = False
        self._is_receiving = False
        self._is_closed = False

    async def exchange(self, request: Request) -> Reply:
        """Send one request and return its reply; see `base.Link.exchange`."""
        if self._transport is None:
            await self._connect(request)
        answer = _Answer(loop=self._loop)
        if self._is_receiving:
            self._engine.submit(request, answer, self._clock.now_ns())
            return await answer
        frame = self._engine.offer(request, answer, self._clock.now_ns())
        if frame is not None and self._transport is not None:
            self._transport.write(frame)
        if self._timer is None or frame is None:
            self._watch()
        return await answer

    async def close(self) -> None:
        """Close the connection; every request still waiting fails with LinkError."""
        self._is_closed = True
        wire = self._wire
        if self._opening is not None:
            self._opening.cancel()
        self._drop("closed by us", None)
        if wire is not None:
            await wire.closed.wait()

    async def _connect(self, request: Request) -> None:
        if self._is_closed:
            raise LinkError(f"{self.target}: the link has been closed, cannot {describe(request)}")
        if self._opening is None:
            self._loop = asyncio.get_running_loop()
            self._opening = self._loop.create_task(self._open())
            self._opening.add_done_callback(self._opened)
        # Several callers wait for one attempt; a caller that goes away does not end it for the others.
        try:
            await asyncio.shield(self._opening)
        except asyncio.CancelledError:
            if self._is_closed:
                raise LinkError(f"{self.target}: closed by us before: {describe(request)}") from None
            raise
        if self._transport is None:
            raise LinkError(f"{self.target}: the connection was closed as soon as it was made", hint=_FULL_HINT)

    def _opened(self, task: asyncio.Task[None]) -> None:
        self._opening = None
        if not task.cancelled():
            task.exception()  # the callers have it; nobody may be left when all were cancelled

    async def _open(self) -> None:
        loop = asyncio.get_running_loop()
        wait_ns = self._retry_ns - self._clock.now_ns()
        if wait_ns > self._timeout_ns:
            await self._clock.sleep_ns(self._timeout_ns)
            raise LinkError(
                f"{self.target}: still not reachable, next attempt in {(wait_ns - self._timeout_ns) / SECOND:.1f} s; "
                f"first cause: {self.figures.first_cause}"
            )
        if wait_ns > 0:
            await self._clock.sleep_ns(wait_ns)
        self._slot = take_slot(self._host, self._port, self._connections_max, self.target)
        try:
            async with asyncio.timeout(CONNECT_TIMEOUT_NS / SECOND):
                transport, wire = await loop.create_connection(
                    lambda: _Wire(self._received, self._lost), self._host, self._port
                )
        except BaseException as error:
            self._free_slot()
            if not isinstance(error, OSError | TimeoutError):
                raise
            what, hint = _connect_failure(error)
            self._note_outage(what)
            raise LinkError(f"{self.target}: {what}", hint=hint) from error
        _set_up(transport.get_extra_info("socket"))
        if wire.closed.is_set():
            self._free_slot()
            return
        wire.is_adopted = True
        self._wire, self._transport = wire, transport
        self.figures.reconnects += self._connections > 0
        self._connections += 1
        self._engine.connected(self._clock.now_ns())
        if self._idle_ns:
            self._look_idle(self.figures.requests, 0)

    def _look_idle(self, requests: int, looks: int) -> None:
        """Close the connection when nothing was asked for long enough; the next request opens it again."""
        if looks and (self._engine.is_busy or self.figures.requests != requests):
            requests, looks = self.figures.requests, 0
        if looks > IDLE_LOOKS and self._transport is not None:
            transport, self._wire, self._transport = self._transport, None, None
            self._connections = 0  # what we closed ourselves is no reconnection
            self._engine.lost(self._clock.now_ns(), "closed because it was idle")
            self._stop_timers()
            transport.close()
            return
        loop = cast(asyncio.AbstractEventLoop, self._loop)
        wait_s = self._idle_ns / IDLE_LOOKS / SECOND
        self._idle_timer = loop.call_later(wait_s, self._look_idle, requests, looks + 1)

    def _free_slot(self) -> None:
        slot, self._slot = self._slot, None
        if slot is not None:
            slot.release(removes=True)

    def _stop_timers(self) -> None:
        for timer in (self._timer, self._idle_timer):
            if timer is not None:
                timer.cancel()
        self._timer = self._idle_timer = None
        self._free_slot()

    def _pump(self) -> None:
        engine, transport = self._engine, self._transport
        if transport is None:
            return
        now_ns = self._clock.now_ns()
        frames = []
        while (frame := engine.outgoing(now_ns)) is not None:
            frames.append(frame)
        if frames:
            transport.write(b"".join(frames))
        self._watch()

    def _watch(self) -> None:
        """See to it that a timer runs. One that runs is early enough for all deadlines: all time-outs are equal."""
        wake_ns = self._engine.wake_ns()
        if wake_ns is not None and (self._timer is None or wake_ns < self._timer_ns):
            self._arm(wake_ns, self._clock.now_ns())

    def _arm(self, wake_ns: int, now_ns: int) -> None:
        if self._timer is not None:
            self._timer.cancel()
        self._timer_ns = wake_ns
        loop = cast(asyncio.AbstractEventLoop, self._loop)
        self._timer = loop.call_later(max(0, wake_ns - now_ns) / SECOND, self._on_timer)

    def _on_timer(self) -> None:
        self._timer = None
        self._engine.tick(self._clock.now_ns())
        if self._engine.is_worn:
            self._drop(f"{UNANSWERED_MAX} requests in a row without a byte in answer, connection renewed", None)
            self._backoff_ns = self._retry_ns = 0  # the time-outs were pause enough; a scan meets many silent units
        self._pump()

    def _received(self, piece: memoryview) -> None:
        engine = self._engine
        self._is_receiving = True  # callers that go on at once only queue; all they ask leaves in one piece
        try:
            engine.received(piece, self._clock.now_ns())
        except FrameError as error:
            self._drop(error.message, error.hint, FrameError)
            return
        finally:
            self._is_receiving = False
        if self._is_out and engine.replies_on_connection:
            self._is_out, self._backoff_ns = False, 0
        if engine.has_queue:
            self._pump()

    def _lost(self, wire: _Wire, error: Exception | None) -> None:
        if not wire.is_adopted:
            self._note_outage("the connection was closed as soon as it was made")
        if wire is not self._wire:
            return
        what = f"the connection went away ({error})" if error else "the other side closed the connection"
        self._drop(what, None if self._engine.replies_on_connection else _FULL_HINT)

    def _drop(self, what: str, hint: str | None, kind: type[LinkError] | type[FrameError] = LinkError) -> None:
        transport, engine = self._transport, self._engine
        self._wire = self._transport = None
        self._stop_timers()
        if transport is None:
            return
        if not self._is_closed:
            self._note_outage(what)
        transport.abort()
        engine.lost(self._clock.now_ns(), what, hint, kind)

    def _note_outage(self, what: str) -> None:
        if not self._is_out:
            self.figures.first_cause = what
            self._is_out = True
        # A connection that has worked is tried again at once, any other ever more slowly.
        worked = self._engine.replies_on_connection > 0
        self._engine.replies_on_connection = 0
        self._backoff_ns = 0 if worked else min(BACKOFF_MAX_NS, max(BACKOFF_MIN_NS, 2 * self._backoff_ns))
        self._retry_ns = self._clock.now_ns() + self._backoff_ns


_FULL_HINT = "the limit of connections may be reached (AH: SM1089), or another tool holds the only one"


def _set_up(sock: socket.socket) -> None:
    """Send small frames at once and notice a dead peer even when nothing is asked."""
    sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    for name, value in (("TCP_KEEPIDLE", KEEPALIVE_IDLE_S), ("TCP_KEEPINTVL", 10), ("TCP_KEEPCNT", 3)):
        option = getattr(socket, name, None)  # older Windows has none of them
        if option is not None:
            sock.setsockopt(socket.IPPROTO_TCP, option, value)


def _connect_failure(error: Exception) -> tuple[str, str]:
    """Say for people why there is no connection, and what to look at."""
    if isinstance(error, ConnectionRefusedError):
        return "connection refused", "nothing listens there; is the port right (Modbus TCP is 502)?"
    if isinstance(error, TimeoutError):
        seconds = CONNECT_TIMEOUT_NS // SECOND
        return f"no connection within {seconds} s", "is the address right, the PLC powered, a firewall between?"
    if isinstance(error, socket.gaierror):
        return f"the name cannot be resolved ({error.strerror})", "use the PLC's IP address"
    text = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
    if text.startswith("Connect call failed") and isinstance(error, OSError) and error.errno:
        text = os.strerror(error.errno)  # asyncio's own words hide the system's
    return f"no connection ({text})", "is the cable in, and the laptop in the PLC's network?"
