"""One CAN interface for asyncio: a reader thread behind it, bounded queues, own time stamps, loss seen and mended."""

from __future__ import annotations

import asyncio
import threading
from collections import deque
from collections.abc import Callable
from typing import Any

import can

from ahgateway.clock import Clock
from ahgateway.codec.can_frame import CanFrame, pack
from ahgateway.errors import LinkError, StateError
from ahgateway.transports.base import Frame, Tap
from ahgateway.transports.can.reader import BusFigures, BusReader, Health, RawBus, Trouble
from ahgateway.transports.uri import Target

QUEUE_MAX = 4096
TROUBLES_MAX = 256
SEND_TIMEOUT_S = 0.2
OPEN_TIMEOUT_S = 5.0
SETTLE_MS = 2000
"""After a serial adapter's port is opened it may restart; python-can waits as long."""

BACKLOG_NS_MAX = 300_000_000
BACKLOG_PAUSE_S = 0.003
"""A backlog comes without pauses; on a bus that has none itself the first 0.3 s go with it."""

QUICK = frozenset({"virtual", "socketcan", "udp_multicast"})
"""Interfaces whose `send` does not wait for a wire; others send from a thread of their own."""

FrameSink = Callable[[CanFrame], None]
TroubleSink = Callable[[Trouble], None]


class CanBus:
    """Frames in and out of one interface.

    The reader thread is started by `open` and opens the interface again, with backoff, whenever it is lost. Sinks are
    called in the event loop, in the order of arrival.

    Args:
        opener: Opens the python-can bus; called in the thread.
        clock: Stamps every frame when it is taken from the adapter.
        target: How errors name the bus.
        is_listen_only: Nothing is ever sent.
        is_quick: `send` of the interface never waits.
        queue_max: Frames that may wait for the event loop; further ones are dropped and counted.
        silence_ns: A bus without frames for so long is reported as silent.
        tap: Gets every frame, in both directions, as `codec.can_frame.pack` makes it.
    """

    def __init__(
        self,
        opener: Callable[[], RawBus],
        clock: Clock,
        target: str,
        *,
        is_listen_only: bool = False,
        is_quick: bool = True,
        queue_max: int = QUEUE_MAX,
        silence_ns: int = 1_000_000_000,
        tap: Tap | None = None,
    ) -> None:
        self.target = target
        self.is_listen_only = is_listen_only
        self._clock = clock
        self._is_quick = is_quick
        self._queue_max = queue_max
        self._tap = tap
        self._reader = BusReader(opener, clock, self._put, self._put, silence_ns=silence_ns)
        self._waiting: deque[CanFrame | Trouble] = deque()
        self._troubles_waiting = 0
        self._guard = threading.Lock()
        self._is_woken = False
        self._frame_sinks: list[FrameSink] = []
        self._trouble_sinks: list[TroubleSink] = []
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._sending = asyncio.Lock()
        self._is_open = asyncio.Event()
        self._changed = asyncio.Event()
        self._cause = ""

    @property
    def figures(self) -> BusFigures:
        """Running totals since the bus was made."""
        return self._reader.figures

    @property
    def health(self) -> Health:
        """State of the adapter's controller."""
        return self._reader.health

    @property
    def is_open(self) -> bool:
        """True while the interface is open, as far as the event loop knows."""
        return self._is_open.is_set()

    @property
    def cause(self) -> str:
        """Why the interface was lost last, empty when it never was."""
        return self._cause

    def subscribe(self, on_frame: FrameSink, on_trouble: TroubleSink | None = None) -> Callable[[], None]:
        """Hand every frame, and what happens to the bus, to these; the returned call ends it."""
        self._frame_sinks.append(on_frame)
        if on_trouble is not None:
            self._trouble_sinks.append(on_trouble)

        def end() -> None:
            if on_frame in self._frame_sinks:
                self._frame_sinks.remove(on_frame)
            if on_trouble is not None and on_trouble in self._trouble_sinks:
                self._trouble_sinks.remove(on_trouble)

        return end

    async def open(self, timeout_s: float = OPEN_TIMEOUT_S) -> None:
        """Start the reader and wait until the interface is open.

        Raises:
            LinkError: It could not be opened, or not in time; the reader goes on trying.
        """
        if self._stop.is_set():
            raise LinkError(f"{self.target}: the bus has been closed")
        if self._thread is None:
            self._loop = asyncio.get_running_loop()
            self._thread = threading.Thread(target=self._run, name=f"can {self.target}", daemon=True)
            self._thread.start()
        if self._is_open.is_set():
            return
        try:
            async with asyncio.timeout(timeout_s):
                while not self._is_open.is_set() and not self._cause:
                    self._changed.clear()
                    await self._changed.wait()
        except TimeoutError:
            pass
        if not self._is_open.is_set():
            raise LinkError(
                f"{self.target}: {self._cause or f'did not open within {timeout_s:g} s'}",
                hint="is the adapter plugged in, its driver there, and no other program at it?",
            )

    async def send(self, frame: CanFrame) -> None:
        """Put one frame on the bus.

        Raises:
            StateError: The bus is listen-only.
            LinkError: The interface is not open, or it does not take the frame.
        """
        if self.is_listen_only:
            raise StateError(f"{self.target}: listen-only, frame {frame} was not sent")
        raw = self._reader.raw
        if raw is None or not self._is_open.is_set():
            raise LinkError(f"{self.target}: not open{': ' if self._cause else ''}{self._cause}")
        message = can.Message(
            arbitration_id=frame.can_id,
            data=frame.data,
            is_extended_id=frame.is_extended,
            is_remote_frame=frame.is_remote,
        )
        self._show(">", frame)
        try:
            if self._is_quick:
                raw.send(message, timeout=0)
            else:
                async with self._sending:
                    await asyncio.to_thread(raw.send, message, timeout=SEND_TIMEOUT_S)
        except (can.CanError, OSError) as error:
            raise LinkError(
                f"{self.target}: frame {frame} could not be sent: {error or type(error).__name__}",
                hint="without another node that acknowledges, a frame never leaves",
            ) from error
        self.figures.sent += 1

    async def close(self) -> None:
        """End the thread and release the interface; may be called twice."""
        self._stop.set()
        thread, self._thread = self._thread, None
        self._is_open.clear()
        if thread is not None:
            await asyncio.to_thread(thread.join)

    def _run(self) -> None:
        try:
            while not self._stop.is_set():
                self._reader.turn(self._stop.wait)
        finally:
            self._reader.shut()

    def _put(self, event: CanFrame | Trouble) -> None:
        """Called in the thread: hand over to the event loop, which is woken once for many frames."""
        with self._guard:
            is_trouble = isinstance(event, Trouble)
            if len(self._waiting) >= self._queue_max + (TROUBLES_MAX if is_trouble else 0):
                self.figures.overflows += 1
                return
            self._waiting.append(event)
            if self._is_woken:
                return
            self._is_woken = True
        assert self._loop is not None
        try:
            self._loop.call_soon_threadsafe(self._drain)
        except RuntimeError:
            self._stop.set()  # the event loop has ended without closing us

    def _drain(self) -> None:
        with self._guard:
            events = list(self._waiting)
            self._waiting.clear()
            self._is_woken = False
        for event in events:
            if isinstance(event, Trouble):
                self._trouble(event)
            else:
                self._show("<", event)
                for sink in tuple(self._frame_sinks):
                    sink(event)

    def _trouble(self, event: Trouble) -> None:
        if event.name == "open":
            self._is_open.set()
        elif event.name in ("lost", "bus-off"):
            self._is_open.clear()
            self._cause = event.text
        self._changed.set()
        for sink in tuple(self._trouble_sinks):
            sink(event)

    def _show(self, direction: str, frame: CanFrame) -> None:
        if self._tap is not None:
            now_ns = frame.now_ns or self._clock.now_ns()
            utc_ns = self._clock.utc_ns() - (self._clock.now_ns() - now_ns)
            self._tap(Frame(direction, pack(frame), now_ns, utc_ns))


def _forget_backlog(raw: RawBus, clock: Clock) -> None:
    """Drop what a driver kept from before we opened it: with our time stamps it would look fresh."""
    ends_ns = clock.now_ns() + BACKLOG_NS_MAX
    while clock.now_ns() < ends_ns and raw.recv(timeout=BACKLOG_PAUSE_S) is not None:
        pass


def channel(target: Target) -> str:
    """Return python-can's channel: a serial port's path gets back the slash that a URI takes."""
    path = target.path
    return f"/{path}" if "/" in path and "://" not in path else path


def bus_for(target: Target, clock: Clock, tap: Tap | None = None, *, is_listen_only: bool = False) -> CanBus:
    """Return the bus that a canopen target names; it opens when `open` is called."""
    interface = target.host
    options: dict[str, Any] = {}
    if "bitrate" in target.options:
        options["bitrate"] = int(target.options["bitrate"])
    if interface == "slcan":
        # python-can's own serial time-out of 1 ms would wake the thread a thousand times a second.
        options |= {"sleep_after_open": target.whole("settle_ms", SETTLE_MS) / 1000, "timeout": 0.02}
        options |= {"listen_only": is_listen_only}

    def opener() -> RawBus:
        raw = can.Bus(interface=interface, channel=channel(target), ignore_config=True, **options)
        _forget_backlog(raw, clock)
        if is_listen_only and interface not in ("slcan", "virtual"):
            try:
                raw.state = can.BusState.PASSIVE
            except RuntimeError:  # the adapter has no such mode: it acknowledges, and we still never send
                return raw
        return raw

    return CanBus(opener, clock, target.text, is_listen_only=is_listen_only, is_quick=interface in QUICK, tap=tap)
