"""How near a client comes to the legal limit of a serial line, and whether it keeps the silence.

Beside libmodbus and pymodbus, in the same run:

    python tests/bench/bench_serial.py [--seconds 6] [--json]

A relay of its own process stands for the wire and for a unit that answers at once: it takes a request as long as its
characters last, keeps 3.5 characters of silence, and releases the reply byte by byte at the baud rate. It sees when
each request begins. Efficiency is the legal limit of a cycle over its median, for 40 registers, and in brackets over
the quickest tenth, which a busy machine disturbs less; a client that does not keep the silence gets more than it may,
so the violated gaps (below 0.98 of the silence) belong to the figure. Needs Linux, two cores, gcc, libmodbus-dev. Exits
1 when a bar is missed. On a machine that does other work run it with `chrt -f 10`, or what is measured is the other
work.
"""

from __future__ import annotations

import argparse
import asyncio
import itertools
import json
import multiprocessing
import os
import statistics
import subprocess
import sys
import tempfile
import time
import tty
from collections.abc import Callable
from multiprocessing.connection import Connection
from pathlib import Path
from typing import NamedTuple

from pymodbus import FramerType
from pymodbus.client import AsyncModbusSerialClient, ModbusSerialClient

from ahgateway.clock import WallClock
from ahgateway.codec.access import Read, Table
from ahgateway.transports.ascii import AsciiReplies, AsciiRequests
from ahgateway.transports.floor import floor_ns
from ahgateway.transports.line import Line
from ahgateway.transports.responder import Responder
from ahgateway.transports.rtu import RtuReplies, RtuRequests
from ahgateway.transports.serial_link import SerialLink

FORTY = Read(1, Table.HOLDING, 0, 40)
SOURCE = Path(__file__).with_name("serial_peer.c")
SPIN_NS = 60_000
CORES = os.sched_getaffinity(0)
RELAY_CORE = max(CORES)
"""The wire spins on a core of its own; the clients have the others."""


class Kind(NamedTuple):
    """One kind of line and the least efficiency of our client on it."""

    name: str
    baud: int
    bits: int
    is_rtu: bool
    bar: float


KINDS = (
    Kind("9600 ASCII", 9600, 8, False, 0.99),  # ten bits a character as in 7E1: a pseudo-terminal has no 7 bits
    Kind("19200 8N1 RTU", 19200, 8, True, 0.98),
    Kind("115200 8N1 RTU", 115200, 8, True, 0.97),
)


class Registers:
    """Unit 1, register n holding n."""

    def answer(self, request: Read) -> tuple[int, ...]:
        return tuple(range(request.address, request.address + request.count))


def wait_until(due_ns: int) -> None:
    while (left := due_ns - time.monotonic_ns()) > 0:
        if left > SPIN_NS:
            time.sleep((left - SPIN_NS) / 1e9)


def relay(master: int, line: Line, is_rtu: bool, pipe: Connection) -> None:
    """Be wire and unit until told to stop; then hand back the start of each request and the end of each reply in ns."""
    os.sched_setaffinity(0, {RELAY_CORE})
    responder = Responder(Registers(), RtuRequests() if is_rtu else AsciiRequests())
    os.set_blocking(master, False)
    cycles: list[tuple[int, int]] = []
    began_ns = ended_ns = arrived = 0
    while not pipe.poll():
        try:
            piece = os.read(master, 512)
        except OSError:
            time.sleep(20e-6)
            continue
        began_ns = began_ns or time.monotonic_ns()
        arrived += len(piece)
        answer = responder.feed(piece)
        if not answer:
            continue
        due_ns = began_ns + arrived * line.byte_ns + (line.gap_ns if is_rtu else 0)
        for byte in answer:
            due_ns += line.byte_ns
            wait_until(due_ns)
            ended_ns = time.monotonic_ns()  # before the write: its reader may run before we do again
            os.write(master, bytes((byte,)))
        cycles.append((began_ns, ended_ns))
        began_ns = arrived = 0
    pipe.send(cycles)


def ours(port: str, line: Line, kind: Kind, count: int) -> None:
    async def ask() -> None:
        framing, scheme = (RtuReplies, "modbus+rtu") if kind.is_rtu else (AsciiReplies, "modbus+ascii")
        link = SerialLink(line, clock=WallClock(), framing=framing, scheme=scheme)
        for _ in range(count):
            assert (await link.exchange(FORTY)).values == tuple(range(40))
        await link.close()

    asyncio.run(ask())


def pymodbus_async(port: str, line: Line, kind: Kind, count: int) -> None:
    async def ask() -> None:
        framer = FramerType.RTU if kind.is_rtu else FramerType.ASCII
        client = AsyncModbusSerialClient(
            port, framer=framer, baudrate=kind.baud, bytesize=kind.bits, parity="N", timeout=3
        )
        assert await client.connect()
        for _ in range(count):
            assert len((await client.read_holding_registers(0, count=40, device_id=1)).registers) == 40
        client.close()

    asyncio.run(ask())


def pymodbus_sync(port: str, line: Line, kind: Kind, count: int) -> None:
    framer = FramerType.RTU if kind.is_rtu else FramerType.ASCII
    client = ModbusSerialClient(port, framer=framer, baudrate=kind.baud, bytesize=kind.bits, parity="N", timeout=3)
    assert client.connect()
    for _ in range(count):
        assert len(client.read_holding_registers(0, count=40, device_id=1).registers) == 40
    client.close()


def build(folder: str) -> str:
    program = str(Path(folder) / "serial_peer")
    found = subprocess.run(
        ["pkg-config", "--cflags", "--libs", "libmodbus"], capture_output=True, text=True, check=True
    )
    subprocess.run(["gcc", "-O2", "-o", program, str(SOURCE), *found.stdout.split()], check=True)
    return program


def measured(kind: Kind, client: Callable[[str, Line, Kind, int], None], count: int) -> dict[str, float]:
    """Run one client over one paced line and return its figures."""
    master, slave = os.openpty()
    tty.setraw(slave)
    port = os.ttyname(slave)
    line = Line(port, kind.baud, "N", kind.bits, 1)
    mine, theirs = multiprocessing.Pipe()
    process = multiprocessing.get_context("fork").Process(target=relay, args=(master, line, kind.is_rtu, theirs))
    process.start()
    try:
        client(port, line, kind, count)
    finally:
        mine.send("stop")
        cycles = mine.recv()
        process.join()
        os.close(slave)
        os.close(master)
    cycles = cycles[-count:]  # an alignment probe comes first
    starts = [start for start, _ in cycles]
    lasted = [after - before for before, after in itertools.pairwise(starts)]
    gaps = [after - end for (_, end), after in zip(cycles, starts[1:], strict=False)]
    least = 0.98 * line.gap_ns if kind.is_rtu else 0
    limit = floor_ns(FORTY, line, is_rtu=kind.is_rtu)
    return {
        "limit_ms": limit / 1e6,
        "median_ms": statistics.median(lasted) / 1e6,
        "efficiency": limit / statistics.median(lasted),
        "undisturbed": limit / statistics.quantiles(lasted, n=10)[0],
        "violated": sum(gap < least for gap in gaps),
        "cycles": len(gaps),
        "gap_min_ms": min(gaps) / 1e6,
    }


def main() -> int:
    os.sched_setaffinity(0, CORES - {RELAY_CORE} or CORES)
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=6.0)
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    found: dict[str, dict[str, dict[str, float]]] = {}
    with tempfile.TemporaryDirectory() as folder:
        program = build(folder)

        def libmodbus(port: str, line: Line, kind: Kind, count: int) -> None:
            subprocess.run([program, "client", port, str(kind.baud), str(count)], check=True)

        for kind in KINDS:
            limit_s = floor_ns(FORTY, Line("x", kind.baud, "N", kind.bits, 1), is_rtu=kind.is_rtu) / 1e9
            count = max(10, round(arguments.seconds / limit_s))
            clients = {"ours": ours, "pymodbus async": pymodbus_async, "pymodbus sync": pymodbus_sync}
            if kind.is_rtu:  # libmodbus has no ASCII
                clients["libmodbus C"] = libmodbus
            found[kind.name] = {name: measured(kind, client, count) for name, client in clients.items()}
    missed = [
        kind.name
        for kind in KINDS
        if found[kind.name]["ours"]["efficiency"] < kind.bar or found[kind.name]["ours"]["violated"]
    ]
    if arguments.json:
        sys.stdout.write(json.dumps({"lines": found, "missed": missed}) + "\n")
    else:
        for line_name, clients in found.items():
            for name, facts in clients.items():
                share = f"{facts['efficiency']:8.1%} ({facts['undisturbed']:.1%})"
                sys.stdout.write(
                    f"{line_name:16}{name:16}{share}  cycle {facts['median_ms']:8.2f} ms of "
                    f"{facts['limit_ms']:.2f}  violated gaps {facts['violated']:.0f}/{facts['cycles']:.0f}, "
                    f"least {facts['gap_min_ms']:.2f} ms\n"
                )
        sys.stdout.write(f"bars missed: {', '.join(missed) or 'none'}\n")
    return 1 if missed else 0


if __name__ == "__main__":
    raise SystemExit(main())
