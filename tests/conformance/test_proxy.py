"""The proxy between two real ends: nothing changed without faults, every fault said, and our link not fooled."""

from __future__ import annotations

import contextlib
import signal
import subprocess
import sys
from collections.abc import AsyncIterator
from pathlib import Path
from typing import NamedTuple

import pytest
from conformance.patience import PatientClock, PatientLoop
from conformance.peers import CLIENT, SERVER, TinyPlc, serial_pair
from typer.testing import CliRunner

from ahgateway.cli.main import app
from ahgateway.clock import MILLISECOND, WallClock
from ahgateway.codec.access import Read, Table, Write
from ahgateway.codec.station import Pacing
from ahgateway.errors import AhGatewayError, LinkError, PlcRefusedError, ReplyTimeoutError
from ahgateway.transports.fault import DETECTABLE, Fault, Rule, Script
from ahgateway.transports.line import Line
from ahgateway.transports.proxy import FaultProxy
from ahgateway.transports.serial_link import SerialLink
from ahgateway.transports.serial_server import serve_serial
from ahgateway.transports.server import serve_tcp
from ahgateway.transports.tcp import TcpLink
from ahgateway.transports.uri import parse_uri

LOOP = PatientLoop
FAST = Pacing(reply_timeout_ms=150)
OVER_A_PORT = Pacing(reply_timeout_ms=1000)
"""A serial port lives in a thread of its own, on the time of this machine, which may be busy."""
SCHEMES = {"tcp": "modbus+tcp", "rtu": "modbus+rtu+tcp", "ascii": "modbus+ascii+tcp"}


class Bench(NamedTuple):
    link: TcpLink
    proxy: FaultProxy
    said: list[tuple[int, Fault, str]]


@contextlib.asynccontextmanager
async def between(wire: str, *rules: Rule, seed: int = 0) -> AsyncIterator[Bench]:
    server = await serve_tcp(TinyPlc(), framing=SERVER[wire])
    said: list[tuple[int, Fault, str]] = []
    target = parse_uri(f"{SCHEMES[wire]}://127.0.0.1:{server.port}")
    proxy = FaultProxy(target, Script(rules, seed), PatientClock(), lambda *what: said.append(what))
    await proxy.listen("127.0.0.1", 0)
    link = link_to(proxy.port, wire)
    yield Bench(link, proxy, said)
    await link.close()
    await proxy.close()
    await server.close()


def link_to(port: int, wire: str, pacing: Pacing = FAST) -> TcpLink:
    clock = PatientClock()
    return TcpLink("127.0.0.1", port, clock=clock, pacing=pacing, framing=CLIENT[wire], quiet_ns=5 * MILLISECOND)


@pytest.mark.parametrize("wire", SCHEMES)
async def test_without_faults_nothing_is_changed(wire: str) -> None:
    async with between(wire) as (link, proxy, said):
        await link.exchange(Write(1, Table.HOLDING, 5, (1, 2, 3)))
        assert (0, 1, 2, 3) == (await link.exchange(Read(1, Table.HOLDING, 4, 4))).values
        with pytest.raises(PlcRefusedError, match="exception 02"):
            await link.exchange(Read(1, Table.HOLDING, 950, 2))
        assert (0, []) == (proxy.faults, said)


@pytest.mark.parametrize("wire", SCHEMES)
async def test_on_a_spoiled_line_no_foreign_value_comes_through(wire: str) -> None:
    async with between(wire, Rule(DETECTABLE[wire], rate=0.3, late_ms=70), seed=3) as (link, proxy, said):
        right = 0
        for address in range(60):
            try:
                reply = await link.exchange(Read(1, Table.INPUT, address, 2))
            except AhGatewayError:
                continue
            assert (7 * address, 7 * address + 7) == reply.values
            right += 1
        assert right > 15
        assert proxy.faults == len(said) > 5


@pytest.mark.parametrize("wire", SCHEMES)
async def test_each_kind_of_fault_is_done_once_and_none_of_them_hands_out_a_foreign_value(wire: str) -> None:
    faults = DETECTABLE[wire]
    rules = [Rule((fault,), first=number, last=number, late_ms=70) for number, fault in enumerate(faults, start=2)]
    async with between(wire, *rules) as (link, proxy, said):
        for address in range(4 * len(faults)):
            try:
                reply = await link.exchange(Read(1, Table.INPUT, address, 2))
            except AhGatewayError:
                continue
            assert (7 * address, 7 * address + 7) == reply.values
            if proxy.exchanges > len(faults) + 4:
                break
        assert list(faults) == [fault for _, fault, _ in said]
        assert (0, 7) == (await link.exchange(Read(1, Table.INPUT, 0, 2))).values


async def test_every_fault_is_said_with_its_request() -> None:
    async with between("tcp", Rule((Fault.BUSY,), first=2, last=2), Rule((Fault.LOST,), first=3)) as bench:
        await bench.link.exchange(Read(1, Table.INPUT, 1, 2))
        with pytest.raises(PlcRefusedError, match="exception 06"):
            await bench.link.exchange(Read(1, Table.INPUT, 1, 2))
        with pytest.raises(ReplyTimeoutError):
            await bench.link.exchange(Write(1, Table.HOLDING, 9, (4,)))
        assert [
            (2, Fault.BUSY, "read 2 input registers from 0x0001 of unit 1"),
            (3, Fault.LOST, "write 1 holding register to 0x0009 of unit 1"),
        ] == bench.said


async def test_a_second_client_is_turned_away() -> None:
    async with between("tcp") as (link, proxy, _):
        await link.exchange(Read(1, Table.INPUT, 1, 2))
        second = link_to(proxy.port, "tcp")
        with pytest.raises(LinkError):
            await second.exchange(Read(1, Table.INPUT, 1, 2))
        await second.close()


async def test_it_stands_before_a_serial_port() -> None:
    async with serial_pair() as (plc_end, our_end):
        server = await serve_serial(TinyPlc(), Line(plc_end, 115200))
        target = parse_uri(f"modbus+rtu://{our_end}?baud=115200")
        said: list[Fault] = []
        script = Script((Rule((Fault.CORRUPTED,), first=3, last=3),))
        proxy = FaultProxy(target, script, WallClock(), lambda number, fault, what: said.append(fault))
        await proxy.listen("127.0.0.1", 0)
        link = link_to(proxy.port, "rtu", OVER_A_PORT)
        assert (7, 14) == (await link.exchange(Read(1, Table.INPUT, 1, 2))).values
        with pytest.raises(AhGatewayError):
            await link.exchange(Read(1, Table.INPUT, 2, 2))
        assert (21, 28) == (await link.exchange(Read(1, Table.INPUT, 3, 2))).values
        assert [Fault.CORRUPTED] == said
        await link.close()
        await proxy.close()
        await server.close()


@pytest.mark.parametrize("wire", ["rtu", "ascii"])
async def test_it_stands_between_two_serial_ports(wire: str) -> None:
    """Master, line, proxy, line, PLC: as with two adapters on a real RS-485 bus cut in two."""
    async with serial_pair() as (plc_end, proxy_out), serial_pair() as (proxy_in, our_end):
        server = await serve_serial(TinyPlc(), Line(plc_end, 115200, "N"), framing=SERVER[wire])
        said: list[Fault] = []
        script = Script((Rule((Fault.NOISE_INSIDE,), first=3, last=3),))
        target = parse_uri(f"modbus+{wire}://{proxy_out}?baud=115200&parity=N&bits=8")
        proxy = FaultProxy(target, script, WallClock(), lambda number, fault, what: said.append(fault))
        await proxy.listen_on(Line(proxy_in, 115200, "N"))
        line, scheme = Line(our_end, 115200, "N"), f"modbus+{wire}"
        link = SerialLink(line, clock=WallClock(), pacing=OVER_A_PORT, framing=CLIENT[wire], scheme=scheme)
        assert (7, 14) == (await link.exchange(Read(1, Table.INPUT, 1, 2))).values
        with pytest.raises(AhGatewayError):
            await link.exchange(Read(1, Table.INPUT, 2, 2))
        assert (21, 28) == (await link.exchange(Read(1, Table.INPUT, 3, 2))).values
        assert [Fault.NOISE_INSIDE] == said
        await link.close()
        await proxy.close()
        await server.close()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ((), "give either --listen PORT or --on TARGET"),
        (("--listen", "0", "--on", "modbus+rtu:///dev/x"), "give either --listen PORT or --on TARGET"),
        (("--on", "modbus+ascii:///dev/x"), "is no serial port that speaks as `modbus+rtu:///dev/y` does"),
        (("--on", "modbus+rtu+tcp://127.0.0.1:1"), "is no serial port that speaks as"),
    ],
)
def test_where_the_client_is_must_be_said_once(arguments: tuple[str, ...], said: str) -> None:
    done = CliRunner().invoke(app, ["proxy", "--to", "modbus+rtu:///dev/y", *arguments])
    assert said in str(done.exception)


@pytest.mark.slow
def test_the_command_is_off_by_default_and_unmistakable_when_on(tmp_path: Path) -> None:
    script = tmp_path / "bad.txt"
    script.write_text("1 lost\n", encoding="utf-8")
    for extra, said in (([], "no faults asked for"), (["--faults", str(script)], "FAULTS ARE ON")):
        command = [
            sys.executable,
            "-m",
            "ahgateway.cli.main",
            "proxy",
            "--listen",
            "0",
            "--to",
            "modbus+tcp://127.0.0.1:9",
        ]
        process = subprocess.Popen([*command, *extra], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        assert process.stdout is not None
        assert int(process.stdout.readline()) > 0
        process.send_signal(signal.SIGTERM)
        _, talk = process.communicate(timeout=60)
        assert (0, True) == (process.returncode, said in talk)
