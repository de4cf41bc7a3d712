"""Ctrl-C, SIGTERM and the closing console as one asyncio event; the only module that touches signals.

Windows ends a process as soon as its handler of a closing console has returned, and Python's own handler only makes a
note for the main thread. So ours stops the work and keeps Windows waiting, for as long as Windows allows.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from types import FrameType

GONE = ("SIGHUP", "SIGBREAK")
"""What comes when the terminal itself goes away: a screen that still wants to write to it would never end."""

GRACE_S = 5.0
"""So long a command may take to put things back and close its files once the terminal is gone."""

INCONCLUSIVE = 3
CLOSING = frozenset({2, 5, 6})
"""MANUAL CTRL_CLOSE_EVENT, CTRL_LOGOFF_EVENT, CTRL_SHUTDOWN_EVENT (Windows, HandlerRoutine callback)."""


def closing_handler(stop: Callable[[], None], wait: Callable[[float], object]) -> Callable[[int], bool]:
    """Return what Windows calls, in a thread of its own, when something happens to the console.

    Args:
        stop: Ends the work in good order.
        wait: Waits so many seconds; the process ends by itself before, when the work is done.
    """

    def handle(kind: int) -> bool:
        if kind not in CLOSING:
            return False  # Ctrl-C and Ctrl-Break are Python's
        stop()
        wait(GRACE_S)
        return True

    return handle


if sys.platform == "win32":

    @contextlib.contextmanager
    def _console(stop: Callable[[], None]) -> Iterator[None]:
        import ctypes
        import time

        routine = ctypes.WINFUNCTYPE(ctypes.c_int, ctypes.c_uint)(closing_handler(stop, time.sleep))
        kernel = ctypes.windll.kernel32
        kernel.SetConsoleCtrlHandler(routine, 1)
        try:
            yield
        finally:
            kernel.SetConsoleCtrlHandler(routine, 0)

else:

    @contextlib.contextmanager
    def _console(stop: Callable[[], None]) -> Iterator[None]:
        yield


@contextlib.contextmanager
def stop_event() -> Iterator[asyncio.Event]:
    """Yield an event that the first interrupt sets; a second Ctrl-C interrupts at once. Use inside a running loop."""
    loop = asyncio.get_running_loop()
    event = asyncio.Event()
    previous: dict[int, object] = {}
    last_resort = threading.Timer(GRACE_S, os._exit, (INCONCLUSIVE,))
    last_resort.daemon = True
    gone = {getattr(signal, name) for name in GONE if hasattr(signal, name)}

    def on_signal(number: int, frame: FrameType | None) -> None:
        _set(loop, event)
        if number in gone and not last_resort.is_alive():
            last_resort.start()
        signal.signal(number, signal.default_int_handler if number == signal.SIGINT else signal.SIG_DFL)

    # SIGBREAK is what a closing Windows console sends; SIGHUP what a closing terminal does elsewhere.
    numbers = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", *GONE) if hasattr(signal, name)]
    for number in numbers:
        with contextlib.suppress(ValueError, OSError):
            previous[number] = signal.signal(number, on_signal)
    try:
        with _console(lambda: _set(loop, event)):
            yield event
    finally:
        last_resort.cancel()
        for number, handler in previous.items():
            signal.signal(number, handler)  # type: ignore[arg-type]


@contextlib.contextmanager
def while_asking() -> Iterator[None]:
    """Let Ctrl-C end a question at once, as a KeyboardInterrupt; inside `stop_event` it would only be noted."""
    previous = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, previous)


def _set(loop: asyncio.AbstractEventLoop, event: asyncio.Event) -> None:
    with contextlib.suppress(RuntimeError):  # the loop has ended, and the work with it
        loop.call_soon_threadsafe(event.set)
