"""A link over a serial port: pyserial in a thread of its own behind the same async `Link`.

The thread owns port and engine; callers only put requests into its inbox and wait. A thread keeps the silence of 3.5
characters far better than the event loop's timers do (MEASURED spec speed §2.3: 98 % of the legal limit at 115200
baud against 95 %), and works on Windows, where serial ports cannot be polled by the loop.
"""

from __future__ import annotations

import asyncio
import contextlib
import queue
import threading
import time
from collections.abc import Callable

import serial

from ahgateway.clock import MILLISECOND, SECOND, Clock
from ahgateway.codec.access import Request
from ahgateway.codec.station import Pacing
from ahgateway.errors import AhGatewayError, LinkError
from ahgateway.transports.base import LinkFigures, Reply, Tap
from ahgateway.transports.engine import Engine, Limits
from ahgateway.transports.framing import Framing
from ahgateway.transports.line import Line, open_port
from ahgateway.transports.pdu import describe
from ahgateway.transports.port_errors import why_gone
from ahgateway.transports.rtu import RtuReplies
from ahgateway.transports.tcp import BACKOFF_MAX_NS, BACKOFF_MIN_NS

QUIET_MIN_NS = 20 * MILLISECOND
GAP_MARGIN_NS = 10_000
"""Added to the gap for the clock. The gap counts from when we saw the last byte, which was on the wire before."""
AWAKE_NS = 200_000
"""A sleeper is woken 60 µs late and more (MEASURED Linux, idle): half a percent of a cycle at 115200 baud."""


class _Handover:
    """Carries an outcome from the port's thread to the caller's loop."""

    def __init__(self, loop: asyncio.AbstractEventLoop, future: asyncio.Future[Reply]) -> None:
        self._loop = loop
        self._future = future

    def done(self) -> bool:
        return self._future.done()

    def set_result(self, reply: Reply, /) -> None:
        self._pass(lambda: self._future.set_result(reply))

    def set_exception(self, error: Exception, /) -> None:
        self._pass(lambda: self._future.set_exception(error))

    def _pass(self, settle: Callable[[], None]) -> None:
        if not self._loop.is_closed():
            self._loop.call_soon_threadsafe(lambda: None if self._future.done() else settle())


_Asked = tuple[Request, _Handover, int]
"""A request, where its outcome goes, and when it was asked."""


class SerialLink:
    """A `base.Link` to the units on one serial line.

    Args:
        line: Port and settings.
        clock: Must run in real time, as `WallClock` does; the port's thread reads it.
        pacing: Limits of the station; one request is in flight whatever it says.
        tap: Gets every frame, in the port's thread.
        framing: RTU or ASCII, the client's side.
        scheme: How `target` begins.
    """

    def __init__(
        self,
        line: Line,
        *,
        clock: Clock,
        pacing: Pacing | None = None,
        tap: Tap | None = None,
        framing: Callable[[], Framing] = RtuReplies,
        scheme: str = "modbus+rtu",
    ) -> None:
        pacing = pacing or Pacing()
        self.target = f"{scheme}://{line.port}"
        self.figures = LinkFigures()
        self._line, self._clock = line, clock
        self._timeout_ns = pacing.reply_timeout_ms * MILLISECOND
        # ASCII needs no gap; one character's time shows whether a second frame follows the first.
        gap_ns = line.gap_ns + GAP_MARGIN_NS if scheme == "modbus+rtu" else line.byte_ns
        limits = Limits(
            timeout_ns=self._timeout_ns,
            pause_ns=max(gap_ns, pacing.pause_between_requests_ms * MILLISECOND),
            pause_after_connect_ns=max(gap_ns, pacing.pause_after_connect_ms * MILLISECOND),
            quiet_ns=max(QUIET_MIN_NS, 2 * line.gap_ns),
            byte_ns=line.byte_ns,
            share=pacing.line_share_max,
            wait_max_ns=pacing.request_wait_max_ms * MILLISECOND,
        )
        self._idle_s = pacing.close_when_idle_ms / 1000 or None
        self._engine = Engine(framing(), limits, clock, self.figures, self.target, tap)
        self._inbox: queue.SimpleQueue[_Asked | None] = queue.SimpleQueue()
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None
        self._port: serial.Serial | None = None
        self._opened = 0
        self._backoff_ns = 0
        self._retry_ns = 0
        self._is_out = False

    async def exchange(self, request: Request) -> Reply:
        """Send one request and return its reply; see `base.Link.exchange`."""
        if self._stop.is_set():
            raise LinkError(f"{self.target}: the link has been closed, cannot {describe(request)}")
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, name=self.target, daemon=True)
            self._thread.start()
        loop = asyncio.get_running_loop()
        future: asyncio.Future[Reply] = loop.create_future()
        self._inbox.put((request, _Handover(loop, future), self._clock.now_ns()))
        return await future

    async def close(self) -> None:
        """Close the port; every request still waiting fails with LinkError."""
        self._stop.set()
        self._inbox.put(None)
        if self._thread is not None:
            await asyncio.to_thread(self._thread.join)

    def _run(self) -> None:
        try:
            while not self._stop.is_set():
                try:
                    job = self._inbox.get(timeout=self._idle_s)
                except queue.Empty:
                    self._opened = 0  # what we close ourselves is no reconnection
                    self._close_port()
                    job = self._inbox.get()
                if job is not None and self._submit(job):
                    self._serve()
        finally:
            # Also when this thread dies of a bug of ours: nobody may wait for ever.
            why = "closed by us" if self._stop.is_set() else "the port's thread has ended by an error of this program"
            self._stop.set()
            while not self._inbox.empty():
                job = self._inbox.get()
                if job is not None:
                    self._submit(job)
            self._engine.lost(self._clock.now_ns(), why)
            self._close_port()

    def _serve(self) -> None:
        try:
            self._work(self._open())
        except LinkError as error:
            self._engine.lost(self._clock.now_ns(), error.message.removeprefix(f"{self._line.port}: "), error.hint)
        except (OSError, serial.SerialException) as error:
            self._went_away(error)

    def _submit(self, job: _Asked) -> bool:
        request, handover, asked_ns = job
        try:
            self._engine.submit(request, handover, asked_ns)
        except AhGatewayError as error:
            handover.set_exception(error)
            return False
        return True

    def _work(self, port: serial.Serial) -> None:
        """Speak until nobody waits any more."""
        engine, clock = self._engine, self._clock
        while engine.is_busy and not self._stop.is_set():
            while not self._inbox.empty():
                job = self._inbox.get()
                if job is not None:
                    self._submit(job)
            if port.in_waiting:
                self._take(port)
            now_ns = clock.now_ns()
            engine.tick(now_ns)
            frame = engine.outgoing(now_ns)
            if frame is not None:
                port.write(frame)
            elif engine.is_flying:
                self._take(port)
            else:
                self._wait(engine.wake_ns() or now_ns)

    def _wait(self, until_ns: int) -> None:
        """Sleep towards a time, at most 10 ms; the last part of it awake, so that the line rests no longer than due."""
        left_ns = until_ns - self._clock.now_ns()
        if left_ns > AWAKE_NS:
            time.sleep(min(left_ns - AWAKE_NS, 10 * MILLISECOND) / SECOND)
            return
        while self._clock.now_ns() < until_ns:
            pass  # MEASURED Linux 6.18: sleep(0) takes 100 µs; the event loop waits no longer than AWAKE_NS

    def _await_rest(self, port: serial.Serial, missing: int) -> None:
        """Sleep while the rest of a reply crosses the wire and be awake when it ends: the gap counts from then.

        An adapter that hands bytes over later than the wire carries them is left to the blocking read behind this.
        """
        byte_ns = self._line.byte_ns
        end_ns = self._clock.now_ns() + (missing - port.in_waiting) * byte_ns
        while (left_ns := end_ns - self._clock.now_ns()) > AWAKE_NS and not self._stop.is_set():
            time.sleep(min(left_ns - AWAKE_NS, 10 * MILLISECOND) / SECOND)
        while port.in_waiting < missing and self._clock.now_ns() < end_ns + byte_ns + AWAKE_NS:
            pass

    def _take(self, port: serial.Serial) -> None:
        # Waking for each byte of a reply would make its end come late; what is missing of it is waited for at once.
        missing = self._engine.framing.missing
        if missing > 1:
            self._await_rest(port, missing)
        piece = port.read(max(missing, port.in_waiting))
        if piece:
            self._engine.received(piece, self._clock.now_ns())
            if self._is_out and self._engine.replies_on_connection:
                self._is_out, self._backoff_ns = False, 0

    def _open(self) -> serial.Serial:
        if self._port is not None:
            return self._port
        wait_ns = self._retry_ns - self._clock.now_ns()
        if wait_ns > 0:
            self._stop.wait(min(wait_ns, self._timeout_ns) / SECOND)
        if wait_ns > self._timeout_ns:
            left_s = (wait_ns - self._timeout_ns) / SECOND
            raise LinkError(f"still not there, next attempt in {left_s:.1f} s; first cause: {self.figures.first_cause}")
        try:
            port = open_port(self._line)
        except LinkError as error:
            self._note_outage(error.message)
            raise
        self._port = port
        self.figures.reconnects += self._opened > 0
        self._opened += 1
        self._engine.connected(self._clock.now_ns())
        return port

    def _went_away(self, error: Exception) -> None:
        what = why_gone(error)
        self._note_outage(what)
        self._close_port()
        self._engine.lost(self._clock.now_ns(), what, "is the adapter still plugged in? the link opens it again")

    def _note_outage(self, what: str) -> None:
        if not self._is_out:
            self.figures.first_cause = what
            self._is_out = True
        self._backoff_ns = min(BACKOFF_MAX_NS, max(BACKOFF_MIN_NS, 2 * self._backoff_ns))
        self._retry_ns = self._clock.now_ns() + self._backoff_ns

    def _close_port(self) -> None:
        port, self._port = self._port, None
        if port is not None:
            with contextlib.suppress(OSError):  # it may be gone already
                port.close()
