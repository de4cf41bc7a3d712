"""Ctrl-C, SIGTERM and the closing console as one asyncio event; the only module that touches signals."""

from __future__ import annotations

import asyncio
import contextlib
import signal
from collections.abc import Iterator
from types import FrameType


@contextlib.contextmanager
def stop_event() -> Iterator[asyncio.Event]:
    """Yield an event that the first interrupt sets; a second Ctrl-C interrupts at once. Use inside a running loop."""
    loop = asyncio.get_running_loop()
    event = asyncio.Event()
    previous: dict[int, object] = {}

    def on_signal(number: int, frame: FrameType | None) -> None:
        loop.call_soon_threadsafe(event.set)
        signal.signal(number, signal.default_int_handler if number == signal.SIGINT else signal.SIG_DFL)

    # SIGBREAK is what a closing Windows console sends; SIGHUP what a closing terminal does elsewhere.
    names = ("SIGINT", "SIGTERM", "SIGBREAK", "SIGHUP")
    numbers = [getattr(signal, name) for name in names if hasattr(signal, name)]
    for number in numbers:
        with contextlib.suppress(ValueError, OSError):
            previous[number] = signal.signal(number, on_signal)
    try:
        yield event
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler)  # type: ignore[arg-type]
