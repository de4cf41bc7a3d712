"""The other end of a link in tests: a tiny PLC, and a peer that answers what a script says."""

from __future__ import annotations

import asyncio
import contextlib
import json
import signal
import subprocess
import sys
import tempfile
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from pathlib import Path
from typing import Any

from ahgateway.codec.access import Read, Request, Table
from ahgateway.errors import PlcRefusedError
from ahgateway.transports.ascii import AsciiReplies, AsciiRequests
from ahgateway.transports.framing import Framing, Mbap
from ahgateway.transports.pdu import decode_request, encode_reply
from ahgateway.transports.rtu import RtuReplies, RtuRequests

CLIENT: dict[str, type[Framing]] = {"tcp": Mbap, "rtu": RtuReplies, "ascii": AsciiReplies}
SERVER: dict[str, type[Framing]] = {"tcp": Mbap, "rtu": RtuRequests, "ascii": AsciiRequests}

AHGATEWAY = [sys.executable, "-m", "ahgateway.cli.main"]


@contextlib.contextmanager
def plc_process(profile: str) -> Iterator[str]:
    """A profile's fake PLC in a process of its own, which must end well; gives its target."""
    process = subprocess.Popen(
        [*AHGATEWAY, "fake", profile, "--tcp", "0"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    try:
        assert process.stdout is not None
        yield f"modbus+tcp://127.0.0.1:{int(process.stdout.readline())}?unit=1"
    finally:
        process.send_signal(signal.SIGTERM)
        _, said = process.communicate(timeout=60)
        assert process.returncode == 0, said


def followed(*arguments: str | Path, enough: Callable[[list[dict[str, Any]]], bool]) -> list[dict[str, Any]]:
    """Let `monitor` follow until it has said enough, end it with Ctrl-C; return its JSON lines, its exit code behind.

    No time is waited for: how much is seen in a second is a matter of how busy the machine is.
    """
    command = [*AHGATEWAY, "monitor", *map(str, arguments), "--duration", "200", "--output", "json"]
    lines: list[dict[str, Any]] = []
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        for line in process.stdout:
            lines.append(json.loads(line))
            if enough(lines):
                process.send_signal(signal.SIGINT)
                break
        rest, said = process.communicate(timeout=100)
    assert enough(lines), said
    assert "internal error" not in said, said
    return [*lines, *map(json.loads, rest.splitlines()), {"kind": "end", "code": process.returncode, "said": said}]


def verdicts(lines: list[dict[str, Any]], loop: str = "") -> list[str]:
    """The verdicts of executions among what `monitor` said, of one loop or of all."""
    return [line["verdict"] for line in lines if "verdict" in line and loop in ("", line["loop"])]


class TinyPlc:
    """Unit 1 with 1000 addresses in each table; 900 and above are refused with exception 02, a write to 899 is busy."""

    def __init__(self) -> None:
        self.memory: dict[Table, list[int]] = {table: [0] * 1000 for table in Table}
        self.memory[Table.DISCRETE] = [address % 3 == 0 for address in range(1000)]
        self.memory[Table.INPUT] = [address * 7 for address in range(1000)]
        self.seen: list[Request] = []

    def answer(self, request: Request) -> tuple[int, ...] | None:
        if request.unit != 1:
            return None
        self.seen.append(request)
        cells = self.memory[request.table]
        count = request.count if isinstance(request, Read) else len(request.values)
        if request.address + count > 900:
            raise PlcRefusedError("outside", code=2)
        if isinstance(request, Read):
            return tuple(int(cell) for cell in cells[request.address : request.address + count])
        if request.address == 899:
            raise PlcRefusedError("busy", code=6)
        cells[request.address : request.address + count] = list(request.values)
        return ()


@contextlib.asynccontextmanager
async def serial_pair() -> AsyncIterator[tuple[str, str]]:
    """Two pseudo-terminals joined by socat: they carry bytes and ignore baud rate, parity and data bits."""
    with tempfile.TemporaryDirectory() as folder:
        ends = Path(folder, "plc"), Path(folder, "laptop")
        process = await asyncio.create_subprocess_exec("socat", *(f"PTY,raw,echo=0,link={end}" for end in ends))
        while not all(end.exists() for end in ends):
            assert process.returncode is None, "socat made no pseudo-terminals"
            await asyncio.sleep(0.002)
        try:
            yield str(ends[0]), str(ends[1])
        finally:
            if process.returncode is None:
                process.terminate()
            await process.wait()


Answer = Callable[["Peer", int, Request, bytes], Awaitable[bytes | None]]


class Peer:
    """A TCP server whose every answer is written by a test.

    Attributes:
        asked: Requests seen, alignment probes among them.
        connections: How many were accepted.
    """

    def __init__(self, wire: str, answer: Answer) -> None:
        self.asked: list[Request] = []
        self.connections = 0
        self.port = 0
        self._wire = wire
        self._answer = answer
        self._writers: list[asyncio.StreamWriter] = []
        self._server: asyncio.Server | None = None

    async def __aenter__(self) -> Peer:
        self._server = await asyncio.start_server(self._serve, "127.0.0.1", 0)
        self.port = self._server.sockets[0].getsockname()[1]
        return self

    async def __aexit__(self, *_: object) -> None:
        assert self._server is not None
        self._server.close()
        self.cut()
        await self._server.wait_closed()

    def cut(self) -> None:
        """Reset every connection."""
        for writer in self._writers:
            writer.transport.abort()
        self._writers.clear()

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self.connections += 1
        self._writers.append(writer)
        framing = SERVER[self._wire]()
        try:
            while piece := await reader.read(4096):
                for adu in framing.feed(piece):
                    request = decode_request(adu.unit, adu.pdu)
                    self.asked.append(request)
                    sound = framing.wrap(adu.tag, adu.unit, sound_pdu(request, adu.pdu))
                    answer = await self._answer(self, len(self.asked), request, sound)
                    if answer:
                        writer.write(answer)
        except ConnectionError:
            pass
        finally:
            writer.transport.abort()


def sound_pdu(request: Request, pdu: bytes) -> bytes:
    """Answer a read with each cell's own address, so that a foreign answer shows."""
    count = request.count if isinstance(request, Read) else 0
    values = [(request.address + index) % (2 if request.table.is_bits else 0x10000) for index in range(count)]
    return encode_reply(request, pdu, values)


def addresses(request: Read) -> tuple[int, ...]:
    """What `sound_pdu` answers to a read of words."""
    return tuple(range(request.address, request.address + request.count))
