"""Serial lines: unplugging, busy and missing ports, settings that really arrive, the gap between frames."""

from __future__ import annotations

import asyncio
import os
import socket
import threading
import time
from collections.abc import Iterator

import pytest
import serial
import serial.rfc2217
from conformance.peers import SERVER, TinyPlc, serial_pair

from ahgateway.clock import WallClock
from ahgateway.codec.access import Read, Table
from ahgateway.codec.station import Pacing
from ahgateway.errors import CodecError, LinkError
from ahgateway.transports.line import Line
from ahgateway.transports.responder import Responder
from ahgateway.transports.serial_link import SerialLink
from ahgateway.transports.serial_server import serve_serial
from ahgateway.transports.uri import open_link, parse_uri

INPUT = Read(1, Table.INPUT, 1, 2)


def test_the_gap_is_the_standards() -> None:
    assert Line("x", 9600, "E", 8, 1).byte_ns == 1_145_833  # 11 bits
    assert Line("x", 9600, "E", 8, 1).gap_ns == 4_010_415
    assert Line("x", 19200, "N", 8, 1).gap_ns == 1_822_915  # 10 bits
    assert Line("x", 38400).gap_ns == 1_750_000


async def test_a_port_that_is_not_there_is_named_with_those_that_are() -> None:
    link = open_link(parse_uri("modbus+rtu:///dev/ttyNOWHERE?baud=19200"), WallClock(), Pacing(reply_timeout_ms=20))
    with pytest.raises(LinkError, match="/dev/ttyNOWHERE: no such port") as caught:
        await link.exchange(INPUT)
    assert "ports here" in (caught.value.hint or "")
    assert "no such port" in link.figures.first_cause
    with pytest.raises(LinkError, match="still not there, next attempt in"):
        await link.exchange(INPUT)
    await link.close()


async def test_a_port_that_another_program_holds_is_busy() -> None:
    async with serial_pair() as (_, our_end):
        holder = serial.Serial(our_end, exclusive=True)
        link = SerialLink(Line(our_end), clock=WallClock())
        with pytest.raises(LinkError, match="port is busy"):
            await link.exchange(INPUT)
        await link.close()
        holder.close()


async def test_settings_that_the_adapter_refuses_are_named() -> None:
    """A pseudo-terminal takes no parity; asked a second time it says so, with an error that is no OSError."""
    async with serial_pair() as (_, our_end):
        held = os.open(our_end, os.O_RDWR | os.O_NOCTTY)
        serial.Serial(our_end, 115200, parity="E").close()
        link = SerialLink(Line(our_end, 115200, "E"), clock=WallClock())
        with pytest.raises(LinkError, match="the adapter refuses 115200 8E1"):
            await link.exchange(INPUT)
        await link.close()
        os.close(held)


async def test_broadcasts_are_refused_on_a_line() -> None:
    link = SerialLink(Line("/dev/ttyNOWHERE"), clock=WallClock())
    with pytest.raises(CodecError, match="unit 0 is everybody"):
        await link.exchange(Read(0, Table.INPUT, 1, 2))
    await link.close()


async def test_an_unplugged_adapter_is_found_again_when_it_is_back() -> None:
    async with serial_pair() as (plc_end, our_end):
        server = await serve_serial(TinyPlc(), Line(plc_end, 115200))
        link = SerialLink(Line(our_end, 115200), clock=WallClock(), pacing=Pacing(reply_timeout_ms=2000))
        assert (7, 14) == (await link.exchange(INPUT)).values
        await server.close()
    with pytest.raises(LinkError):
        await link.exchange(INPUT)
    async with serial_pair() as (plc_end, our_end_again):
        server = await serve_serial(TinyPlc(), Line(plc_end, 115200))
        os.mkdir(os.path.dirname(our_end))
        os.symlink(os.readlink(our_end_again), our_end)
        for _ in range(20):
            outcome = (await asyncio.gather(link.exchange(INPUT), return_exceptions=True))[0]
            if not isinstance(outcome, BaseException):
                break
        assert (7, 14) == outcome.values
        assert link.figures.reconnects == 1
        assert "went away" in link.figures.first_cause
        await link.close()
        await server.close()
    os.unlink(our_end)
    os.rmdir(os.path.dirname(our_end))


class SlowUnit(threading.Thread):
    """Answers on a pseudo-terminal and measures the silence between its answer and the next request."""

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self.master, slave = os.openpty()
        self.name_of_port = os.ttyname(slave)
        self.slave = slave
        self.gaps_ns: list[int] = []

    def run(self) -> None:
        framing, plc, answered_ns = SERVER["rtu"](), TinyPlc(), 0
        responder = Responder(plc, framing)
        while True:
            try:
                piece = os.read(self.master, 256)
            except OSError:
                return
            now_ns = time.monotonic_ns()
            if answered_ns:
                self.gaps_ns.append(now_ns - answered_ns)
                answered_ns = 0
            answer = responder.feed(piece)
            if answer:
                answered_ns = time.monotonic_ns()
                os.write(self.master, answer)


@pytest.fixture
def slow_unit() -> Iterator[SlowUnit]:
    unit = SlowUnit()
    unit.start()
    yield unit
    os.close(unit.slave)
    unit.join(1)
    os.close(unit.master)


class Terminal(serial.Serial):
    """A pseudo-terminal has no modem lines, and refuses every setting but 8N1: here settings are kept, not applied."""

    cts = dsr = ri = cd = False

    def _reconfigure_port(self, force_update: bool = False) -> None:
        if force_update:
            super()._reconfigure_port(force_update)

    def _update_dtr_state(self) -> None:
        pass

    def _update_rts_state(self) -> None:
        pass


class SettingsServer(threading.Thread):
    """pyserial's RFC 2217 server before a pseudo-terminal: a network port that sees the settings asked for."""

    def __init__(self, port: str) -> None:
        super().__init__(daemon=True)
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.serial = Terminal(port, timeout=0.01)
        self.seen: set[tuple[int, int, str, int]] = set()

    def run(self) -> None:
        connection, _ = self.listener.accept()
        with connection:
            self._relay(connection)

    def passes(self, settings: tuple[int, int, str, int]) -> bool:
        """Tell whether bytes reach the line while it is set so."""
        return True

    def _relay(self, connection: socket.socket) -> None:
        connection.settimeout(0.01)
        manager = serial.rfc2217.PortManager(self.serial, Writer(connection))
        while True:
            try:
                data = connection.recv(1024)
            except TimeoutError:
                data = None
            except OSError:
                return
            if data == b"":
                return
            sent = b"".join(manager.filter(data)) if data else b""
            port = self.serial
            settings = (port.baudrate, port.bytesize, port.parity, int(port.stopbits))
            self.seen.add(settings)
            if sent and self.passes(settings):
                self.serial.write(sent)
            if port.in_waiting:
                connection.sendall(b"".join(manager.escape(port.read(port.in_waiting))))


class Writer:
    def __init__(self, connection: socket.socket) -> None:
        self.connection = connection

    def write(self, data: bytes) -> None:
        self.connection.sendall(data)


@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # pyserial 3.5's own
async def test_the_settings_of_the_target_reach_the_port() -> None:
    async with serial_pair() as (plc_end, gateway_end):
        plc = await serve_serial(TinyPlc(), Line(plc_end, 9600), framing=SERVER["ascii"])
        gateway = SettingsServer(gateway_end)
        gateway.start()
        port = gateway.listener.getsockname()[1]
        target = parse_uri(f"modbus+ascii://rfc2217://127.0.0.1:{port}?baud=19200&parity=O&bits=7&stop=2")
        link = open_link(target, WallClock(), Pacing(reply_timeout_ms=10_000))
        assert (7, 14) == (await link.exchange(INPUT)).values
        await link.close()
        assert (19200, 7, "O", 2) in gateway.seen
        await plc.close()
        gateway.join(2)
        gateway.listener.close()
        gateway.serial.close()


@pytest.mark.parametrize("baud", [19200, 115200])
async def test_the_silence_between_frames_is_never_shorter_than_the_standards(slow_unit: SlowUnit, baud: int) -> None:
    line = Line(slow_unit.name_of_port, baud)
    link = SerialLink(line, clock=WallClock(), pacing=Pacing(reply_timeout_ms=5000))
    for _ in range(15):
        await link.exchange(INPUT)
    await link.close()
    assert len(slow_unit.gaps_ns) == 15, "the alignment probe and fifteen requests"
    assert min(slow_unit.gaps_ns) >= line.gap_ns


async def test_many_callers_share_one_line() -> None:
    async with serial_pair() as (plc_end, our_end):
        server = await serve_serial(TinyPlc(), Line(plc_end, 115200))
        link = SerialLink(Line(our_end, 115200), clock=WallClock(), pacing=Pacing(reply_timeout_ms=5000))
        asked = [Read(1, Table.INPUT, address, 2) for address in range(12)]
        replies = await asyncio.gather(*(link.exchange(request) for request in asked))
        assert [(7 * address, 7 * address + 7) for address in range(12)] == [reply.values for reply in replies]
        await link.close()
        await server.close()
