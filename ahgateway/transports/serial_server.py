"""Serve a device on a serial port: a thread reads, the event loop answers, so that the device stays in one thread."""

from __future__ import annotations

import asyncio
import logging
import threading
from collections.abc import Callable

import serial

from ahgateway.clock import Clock
from ahgateway.transports.base import Device, Tap
from ahgateway.transports.framing import Framing
from ahgateway.transports.line import Line, open_port
from ahgateway.transports.responder import Responder
from ahgateway.transports.rtu import RtuRequests

_log = logging.getLogger(__name__)


class SerialServer:
    """A running server; made by `serve_serial`."""

    def __init__(self, responder: Responder, port: serial.Serial) -> None:
        self._responder = responder
        self._port = port
        self._loop = asyncio.get_running_loop()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._read, name=f"server {port.name}", daemon=True)
        self._thread.start()

    async def close(self) -> None:
        """Stop answering and release the port."""
        self._stop.set()
        await asyncio.to_thread(self._thread.join)
        self._port.close()

    def _read(self) -> None:
        try:
            while not self._stop.is_set():
                piece = self._port.read(max(1, self._port.in_waiting))
                if piece and not self._loop.is_closed():
                    self._loop.call_soon_threadsafe(self._answer, bytes(piece))
        except (OSError, serial.SerialException) as error:
            _log.info("serial server ended: %s", error)

    def _answer(self, piece: bytes) -> None:
        answers = self._responder.feed(piece)
        if answers and not self._stop.is_set():
            self._port.write(answers)


async def serve_serial(
    device: Device,
    line: Line,
    *,
    framing: Callable[[], Framing] = RtuRequests,
    clock: Clock | None = None,
    tap: Tap | None = None,
) -> SerialServer:
    """Serve `device` on a serial port until `close`; the framing is the server's side.

    Raises:
        LinkError: The port cannot be had.
    """
    return SerialServer(Responder(device, framing(), clock, tap), open_port(line))
