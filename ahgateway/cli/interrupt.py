"""Ctrl-C, SIGTERM and the closing console as one asyncio event; the only module that touches signals."""

from __future__ import annotations

import asyncio
import contextlib
import os
import signal
import threading
from collections.abc import Iterator
from types import FrameType

GONE = ("SIGHUP", "SIGBREAK")
"""What comes when the terminal itself goes away: a screen that still wants to write to it would never end."""

GRACE_S = 5.0
"""So long a command may take to put things back and close its files once the terminal is gone."""

INCONCLUSIVE = 3


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
        loop.call_soon_threadsafe(event.set)
        if number in gone and not last_resort.is_alive():
            last_resort.start()
        signal.signal(number, signal.default_int_handler if number == signal.SIGINT else signal.SIG_DFL)

    # SIGBREAK is what a closing Windows console sends; SIGHUP what a closing terminal does elsewhere.
    numbers = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", *GONE) if hasattr(signal, name)]
    for number in numbers:
        with contextlib.suppress(ValueError, OSError):
            previous[number] = signal.signal(number, on_signal)
    try:
        yield event
    finally:
        last_resort.cancel()
        for number, handler in previous.items():
            signal.signal(number, handler)  # type: ignore[arg-type]
