"""Requests a second for 40 holding registers on loopback, beside libmodbus (C) and pymodbus, in the same run.

    python tests/bench/bench_link.py [--rounds 9] [--seconds 0.4] [--json]

Rounds are interleaved, so that a busy machine slows all alike; only the ratios mean anything. Two placements are
measured: the server on a core of its own, as a PLC is a computer of its own (the wake-up across cores stands for the
wire), and client and server on one core, where nothing but instructions counts. Needs Linux, two cores, gcc and
libmodbus-dev. Exits 1 when a bar is missed.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import os
import socket
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Awaitable, Callable
from pathlib import Path

from pymodbus.client import AsyncModbusTcpClient

from ahgateway.clock import WallClock
from ahgateway.codec.access import Read, Table
from ahgateway.codec.station import Pacing
from ahgateway.transports.server import serve_tcp
from ahgateway.transports.tcp import TcpLink

FORTY = Read(1, Table.HOLDING, 0, 40)
SOURCE = Path(__file__).with_name("link_peer.c")
OWN_CORE, ONE_CORE = "server on its own core", "client and server on one core"
BARS = [
    (OWN_CORE, "ours", "libmodbus C", 0.55),
    (OWN_CORE, "ours, 4 in flight", "libmodbus C", 1.0),
    (ONE_CORE, "ours", "libmodbus C", 0.40),
    (ONE_CORE, "ours", "pymodbus async", 2.0),
]


class Zeros:
    """A device that answers any read with zeros."""

    def answer(self, request: Read) -> tuple[int, ...]:
        return (0,) * request.count


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def build(folder: str) -> str:
    program = str(Path(folder) / "link_peer")
    flags = subprocess.run(
        ["pkg-config", "--cflags", "--libs", "libmodbus"], capture_output=True, text=True, check=True
    )
    subprocess.run(["gcc", "-O2", "-o", program, str(SOURCE), *flags.stdout.split()], check=True)
    return program


async def until(seconds: float, one: Callable[[], Awaitable[object]], tasks: int = 1) -> float:
    """Repeat `one` in `tasks` tasks for about `seconds` and return repetitions a second."""
    done, started = 0, time.perf_counter()

    async def repeat() -> None:
        nonlocal done
        while time.perf_counter() - started < seconds:
            for _ in range(20):
                await one()
            done += 20

    await asyncio.gather(*(repeat() for _ in range(tasks)))
    return done / (time.perf_counter() - started)


async def ours(port: int, seconds: float, window: int) -> float:
    link = TcpLink("127.0.0.1", port, clock=WallClock(), pacing=Pacing(requests_in_flight_max=window))
    await link.exchange(FORTY)
    rate = await until(seconds, lambda: link.exchange(FORTY), window)
    await link.close()
    return rate


async def theirs(port: int, seconds: float) -> float:
    client = AsyncModbusTcpClient("127.0.0.1", port=port)
    await client.connect()
    rate = await until(seconds, lambda: client.read_holding_registers(0, count=40, device_id=1))
    client.close()
    return rate


async def native(program: str, port: int, count: int) -> float:
    process = await asyncio.create_subprocess_exec(
        program, "client", str(port), str(count), stdout=asyncio.subprocess.PIPE
    )
    output, _ = await process.communicate()
    return float(output)


async def measure(program: str, port: int, rounds: int, seconds: float) -> dict[str, list[float]]:
    rates: dict[str, list[float]] = {}
    count = int(4000 * seconds)
    for _ in range(rounds):
        rate = rates.setdefault("libmodbus C", [])
        rate.append(await native(program, port, count))
        count = int(rate[-1] * seconds)
        rates.setdefault("ours", []).append(await ours(port, seconds, 1))
        rates.setdefault("pymodbus async", []).append(await theirs(port, seconds))
        rates.setdefault("ours, 4 in flight", []).append(await ours(port, seconds, 4))
    return rates


async def measure_own_server(program: str, rounds: int, seconds: float) -> list[float]:
    own = await serve_tcp(Zeros())
    rates = [await native(program, own.port, int(10_000 * seconds)) for _ in range(rounds)]
    await own.close()
    return rates


def place(program: str, cores: tuple[int, int], rounds: int, seconds: float) -> dict[str, list[float]]:
    """Measure with the server on `cores[0]` and every client on `cores[1]`."""
    port = free_port()
    os.sched_setaffinity(0, {cores[0]})  # inherited by the server
    server = subprocess.Popen([program, "server", str(port)], stdout=subprocess.PIPE)
    os.sched_setaffinity(0, {cores[1]})
    assert server.stdout is not None
    server.stdout.readline()
    try:
        rates = asyncio.run(measure(program, port, rounds, seconds))
    finally:
        server.terminate()
        server.wait()
    if cores[0] == cores[1]:
        rates["libmodbus C, our server"] = asyncio.run(measure_own_server(program, rounds, seconds))
    return rates


def ratio(rates: dict[str, list[float]], name: str, base: str) -> tuple[float, float, float]:
    """Return median, least and greatest ratio of two clients, round by round."""
    ratios = sorted(a / b for a, b in zip(rates[name], rates[base], strict=True))
    return statistics.median(ratios), ratios[0], ratios[-1]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--seconds", type=float, default=0.3)
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    cores = sorted(os.sched_getaffinity(0))
    placements = {OWN_CORE: (cores[0], cores[-1]), ONE_CORE: (cores[-1], cores[-1])}
    with tempfile.TemporaryDirectory() as folder:
        program = build(folder)
        found = {name: place(program, where, arguments.rounds, arguments.seconds) for name, where in placements.items()}
    bars = []
    for placement, name, base, bar in BARS:
        median = ratio(found[placement], name, base)[0]
        bars.append({"placement": placement, "name": name, "base": base, "ratio": median, "bar": bar})
    out = sys.stdout.write
    if arguments.json:
        rates = {where: {name: statistics.median(values) for name, values in by.items()} for where, by in found.items()}
        out(json.dumps({"requests_per_second": rates, "bars": bars}) + "\n")
    else:
        for placement, by_name in found.items():
            out(f"{placement:36}{'req/s':>10}   ratio to libmodbus C [min..max]\n")
            for name, values in by_name.items():
                median, least, greatest = ratio(by_name, name, "libmodbus C")
                out(f"  {name:34}{statistics.median(values):10.0f}{median:8.2f} [{least:.2f}..{greatest:.2f}]\n")
        for bar in bars:
            verdict = f"bar {bar['bar']:.2f}: {'met' if bar['ratio'] >= bar['bar'] else 'MISSED'}"
            out(f"{bar['placement']}: {bar['name']} / {bar['base']} {bar['ratio']:.2f}, {verdict}\n")
    return 0 if all(bar["ratio"] >= bar["bar"] for bar in bars) else 1


if __name__ == "__main__":
    raise SystemExit(main())
