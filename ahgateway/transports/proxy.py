"""A proxy that spoils a real line on purpose: a client on TCP or a serial port, a PLC on TCP or a serial port.

Between two frames it changes nothing; what is no frame passes as it came. One client at a time, as on a line. Which
exchange suffers what is the script's (`fault`); this file moves bytes and keeps their order.
"""

from __future__ import annotations

import asyncio
import contextlib
import threading
from collections.abc import Awaitable, Callable
from typing import Protocol

import serial

from ahgateway.clock import SECOND, Clock
from ahgateway.errors import FrameError, LinkError, PlcRefusedError
from ahgateway.transports.ascii import AsciiReplies, AsciiRequests
from ahgateway.transports.fault import Fault, FaultyWire, Piece, Script
from ahgateway.transports.framing import Framing, Mbap
from ahgateway.transports.line import Line, open_port
from ahgateway.transports.pdu import decode_request, describe, reply_shape
from ahgateway.transports.rtu import RtuReplies, RtuRequests
from ahgateway.transports.uri import Target, line_of

WIRES = {
    "modbus+tcp": "tcp",
    "modbus+rtu": "rtu",
    "modbus+ascii": "ascii",
    "modbus+rtu+tcp": "rtu",
    "modbus+ascii+tcp": "ascii",
}
_FRAMINGS: dict[str, tuple[type[Framing], type[Framing]]] = {
    "tcp": (Mbap, Mbap),
    "rtu": (RtuRequests, RtuReplies),
    "ascii": (AsciiRequests, AsciiReplies),
}
PIECE_SIZE = 4096
AGAIN_NS = SECOND // 2
"""A client on a serial line stays when the PLC's side is lost; that side is opened again after so long."""

Said = Callable[[int, Fault, str], None]
"""Told of every fault: the exchange's number, the fault, the request that suffers it."""


class _End(Protocol):
    """The PLC's side of the proxy."""

    def write(self, data: bytes) -> None: ...

    async def close(self) -> None: ...


class _SocketEnd:
    def __init__(
        self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter, came: Callable[[bytes], None]
    ) -> None:
        self._writer = writer
        self._task = asyncio.ensure_future(self._read(reader, came))

    async def _read(self, reader: asyncio.StreamReader, came: Callable[[bytes], None]) -> None:
        with contextlib.suppress(ConnectionError):
            while piece := await reader.read(PIECE_SIZE):
                came(piece)
        came(b"")

    def write(self, data: bytes) -> None:
        self._writer.write(data)

    async def close(self) -> None:
        self._task.cancel()
        self._writer.transport.abort()
        await asyncio.gather(self._task, return_exceptions=True)


class _PortEnd:
    def __init__(self, port: serial.Serial, came: Callable[[bytes], None]) -> None:
        self._port = port
        self._came = came
        self._loop = asyncio.get_running_loop()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._read, name=f"proxy {port.name}", daemon=True)
        self._thread.start()

    def _read(self) -> None:
        try:
            while not self._stop.is_set():
                piece = self._port.read(max(1, self._port.in_waiting))
                if piece:
                    self._loop.call_soon_threadsafe(self._came, bytes(piece))
        except (OSError, serial.SerialException):
            self._loop.call_soon_threadsafe(self._came, b"")

    def write(self, data: bytes) -> None:
        self._port.write(data)

    async def close(self) -> None:
        self._stop.set()
        await asyncio.to_thread(self._thread.join)
        self._port.close()


class FaultProxy:
    """Listens for one client at a time and passes its requests on; made for one target.

    Args:
        target: Where the PLC is; the client speaks the same framing.
        script: What happens when; one without rules changes nothing.
        clock: Waits delays.
        said: Told of every fault.
        trouble: Told why a client was dropped.

    Attributes:
        port: Where it listens.
        exchanges: Requests seen.
        faults: Faults done.
    """

    def __init__(
        self, target: Target, script: Script, clock: Clock, said: Said, trouble: Callable[[str], None] | None = None
    ) -> None:
        self.port = 0
        self.exchanges = 0
        self.faults = 0
        self._target = target
        self._wire = WIRES[target.scheme]
        self._faulty = FaultyWire(self._wire, script)
        self._clock = clock
        self._said = said
        self._trouble = trouble
        self._server: asyncio.Server | None = None
        self._sessions: set[asyncio.Task[None]] = set()

    async def listen(self, host: str, port: int) -> None:
        """Start to listen; port 0 takes a free one.

        Raises:
            LinkError: The port cannot be had.
        """
        try:
            self._server = await asyncio.start_server(self._accepted, host, port)
        except OSError as error:
            raise LinkError(
                f"cannot listen on {host}:{port}: {error.strerror or error}", hint="choose another port"
            ) from error
        self.port = self._server.sockets[0].getsockname()[1]

    async def listen_on(self, line: Line) -> None:
        """Be the PLC on a serial line, where a client is the master.

        Raises:
            LinkError: The port cannot be had.
        """
        task = asyncio.ensure_future(self._serve_line(open_port(line)))
        self._sessions.add(task)
        task.add_done_callback(self._sessions.discard)

    async def _serve_line(self, port: serial.Serial) -> None:
        pieces: asyncio.Queue[bytes] = asyncio.Queue()
        client = _PortEnd(port, pieces.put_nowait)
        try:
            while True:
                try:
                    await _Session(self, pieces.get, client.write).run()
                except (OSError, FrameError) as error:
                    self._dropped(error)
                await self.wait(AGAIN_NS)
        finally:
            await client.close()

    async def close(self) -> None:
        """Stop listening and cut the client off."""
        if self._server is not None:
            self._server.close()
        for session in self._sessions:
            session.cancel()
        await asyncio.gather(*self._sessions, return_exceptions=True)
        if self._server is not None:
            await self._server.wait_closed()

    async def _accepted(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        if self._sessions:
            writer.transport.abort()
            return
        task = asyncio.current_task()
        assert task is not None
        self._sessions.add(task)
        try:
            await _Session(self, lambda: reader.read(PIECE_SIZE), writer.write).run()
        except asyncio.CancelledError:
            pass  # the proxy is being closed
        except (OSError, FrameError) as error:
            self._dropped(error)
        finally:
            self._sessions.discard(task)
            writer.transport.abort()

    def _dropped(self, error: OSError | FrameError) -> None:
        if self._trouble is not None:
            self._trouble(error.message if isinstance(error, LinkError | FrameError) else str(error))

    async def open_end(self, came: Callable[[bytes], None]) -> _End:
        """Open the PLC's side; `came` gets its bytes, and none when it is gone."""
        target = self._target
        if target.scheme in ("modbus+rtu", "modbus+ascii"):
            line: Line = line_of(target)
            return _PortEnd(open_port(line), came)
        try:
            reader, writer = await asyncio.open_connection(target.host, target.port)
        except OSError as error:
            raise LinkError(f"{target.text}: no connection ({error})") from error
        return _SocketEnd(reader, writer, came)

    def begin(self, frame: bytes, what: str) -> tuple[bytes, list[Piece]]:
        """Let the script decide about one request; see `FaultyWire.request`."""
        self.exchanges += 1
        passed, back = self._faulty.request(frame)
        if self._faulty.fault is not None:
            self.faults += 1
            self._said(self.exchanges, self._faulty.fault, what)
        return passed, back

    def spoiled(self, frame: bytes) -> list[Piece]:
        """Return what comes of a reply."""
        return self._faulty.reply(frame)

    def framings(self) -> tuple[Framing, Framing]:
        """Return fresh framings for requests and for replies."""
        asked, answered = _FRAMINGS[self._wire]
        return asked(), answered()

    async def wait(self, duration_ns: int) -> None:
        """Wait on the proxy's clock."""
        if duration_ns:
            await self._clock.sleep_ns(duration_ns)


class _Session:
    """One client from its connection to its end.

    Args:
        proxy: Decides what happens to each exchange.
        read: Waits for the client's next bytes; none when it is gone.
        write: Sends to the client.
    """

    def __init__(
        self, proxy: FaultProxy, read: Callable[[], Awaitable[bytes]], write: Callable[[bytes], object]
    ) -> None:
        self._proxy = proxy
        self._read = read
        self._write = write
        self._asked, self._answered = proxy.framings()
        self._raw = bytearray()
        self._out: asyncio.Queue[Piece] = asyncio.Queue()
        self._gone = asyncio.Event()

    async def run(self) -> None:
        end = await self._proxy.open_end(self._came)
        tasks = [asyncio.ensure_future(each) for each in (self._requests(end), self._send(), self._gone.wait())]
        try:
            done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            for task in done:
                task.result()
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
            await end.close()

    async def _requests(self, end: _End) -> None:
        while piece := await self._read():
            for adu in self._asked.feed(piece):
                self._pass_on_rest()
                what = self._expect(adu.unit, adu.pdu)
                passed, back = self._proxy.begin(self._asked.wrap(adu.tag, adu.unit, adu.pdu), what)
                for each in back:
                    self._out.put_nowait(each)
                if passed:
                    end.write(passed)

    def _expect(self, unit: int, pdu: bytes) -> str:
        try:
            request = decode_request(unit, pdu)
        except PlcRefusedError:
            return f"a request of function {pdu[0]}"
        shape = reply_shape(request, pdu)
        self._answered.expect(unit, shape.head, shape.size)
        return describe(request)

    def _pass_on_rest(self) -> None:
        """What came and was no frame by the time of the next request passes as it is."""
        if self._raw:
            self._out.put_nowait(Piece(0, bytes(self._raw)))
            self._raw.clear()
        self._answered.drain()

    def _came(self, piece: bytes) -> None:
        if not piece:
            self._gone.set()
            return
        self._raw += piece
        try:
            found = self._answered.feed(piece)
        except FrameError:
            self._pass_on_rest()
            return
        if len(self._raw) > PIECE_SIZE and not found:
            self._pass_on_rest()
        for adu in found:
            frame = self._answered.wrap(adu.tag, adu.unit, adu.pdu)
            before, _, rest = bytes(self._raw).partition(frame)
            self._raw[:] = rest
            if before:
                self._out.put_nowait(Piece(0, before))
            for each in self._proxy.spoiled(frame):
                self._out.put_nowait(each)

    async def _send(self) -> None:
        while True:
            delay_ns, data = await self._out.get()
            await self._proxy.wait(delay_ns)
            self._write(data)
