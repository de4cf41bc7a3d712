"""SDO reads a second against raw python-can in the same run, and 10 000 SYNC cycles of lockstep with bad frames.

    python tests/bench/bench_can.py

Both clients ask the same server: a raw thread on python-can's virtual bus, which answers at once.
"""

from __future__ import annotations

import asyncio
import contextlib
import sys
import threading
import time
from pathlib import Path

import can

sys.path.insert(0, str(Path(__file__).parent.parent))

from transports.can.cyclic_world import CyclicWorld

from ahgateway.clock import WallClock
from ahgateway.codec.access import Read, Table
from ahgateway.core.verdict import Verdict
from ahgateway.errors import ReplyTimeoutError
from ahgateway.lockstep.judge import Execution
from ahgateway.schema.profile import load
from ahgateway.transports.uri import open_link, parse_uri

READS = 3000
ROUNDS = 5
SYNCS = 10_000
ASK = bytes.fromhex("40 00 20 01 00 00 00 00")
ANSWER = bytes.fromhex("43 00 20 01 00 00 A0 42")


def answer(bus: can.BusABC, stop: threading.Event) -> None:
    """Be node 3: object 2000:01 holds 80.0, everything else does not exist."""
    while not stop.is_set():
        message = bus.recv(timeout=0.1)
        if message is None or message.arbitration_id != 0x603:
            continue
        echo = bytes(message.data[1:4])
        data = ANSWER if echo == ASK[1:4] else b"\x80" + echo + b"\x11\0\x09\x06"
        bus.send(can.Message(arbitration_id=0x583, data=data, is_extended_id=False))


def raw_reads(name: str) -> float:
    """Reads a second of a bare loop: send, receive, no check of anything."""
    with can.Bus(interface="virtual", channel=name) as bus:
        start = time.perf_counter()
        for _ in range(READS):
            bus.send(can.Message(arbitration_id=0x603, data=ASK, is_extended_id=False))
            assert bus.recv(timeout=1) is not None
        return READS / (time.perf_counter() - start)


async def our_reads(name: str) -> float:
    """Reads a second of the link, every reply proven."""
    target = parse_uri(f"canopen://virtual/{name}?node=3")
    link = open_link(target, WallClock(), can=load("can").station().can)
    request = Read(1, Table.HOLDING, 100, 2)
    assert (0, 0x42A0) == (await link.exchange(request)).values
    start = time.perf_counter()
    for _ in range(READS):
        await link.exchange(request)
    rate = READS / (time.perf_counter() - start)
    await link.close()
    return rate


async def lockstep(lost: float, repeated: float) -> None:
    """Follow 10 000 SYNC cycles in virtual time."""
    world = CyclicWorld(lost=lost, repeated=repeated)
    start = time.perf_counter()
    for _ in range(SYNCS):
        with contextlib.suppress(ReplyTimeoutError):
            await world.sync()
    took_s = time.perf_counter() - start
    executions = [event for event in world.events if isinstance(event, Execution)]
    diverged = sum(each.verdict is Verdict.DIVERGED for each in executions)
    counts, executed = world.follower.summary(), world.plc.executed("TIC-101")
    out = sys.stdout.write
    out(f"lost {lost:.0%} repeated {repeated:.0%}: {SYNCS} cycles in {took_s:.1f} s, {diverged} diverged, {counts}\n")
    out(f"  executed {executed}, accounted for {counts.total}; {world.link.figures.cycles}\n")


def main() -> None:
    stop = threading.Event()
    with can.Bus(interface="virtual", channel="bench") as bus:
        peer = threading.Thread(target=answer, args=(bus, stop))
        peer.start()
        rates = [(raw_reads("bench"), asyncio.run(our_reads("bench"))) for _ in range(ROUNDS)]
        stop.set()
        peer.join()
    for raw, ours in rates:
        sys.stdout.write(f"raw python-can {raw:7.0f} reads/s   link {ours:7.0f} reads/s   ratio {ours / raw:.2f}\n")
    for lost, repeated in ((0.0, 0.0), (0.01, 0.02), (0.05, 0.1)):
        asyncio.run(lockstep(lost, repeated))


if __name__ == "__main__":
    main()
