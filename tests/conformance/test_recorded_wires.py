"""A recorder's ring emptied over a TCP socket and over an ASCII line of 9600 baud, every execution bit for bit."""

from __future__ import annotations

import pytest
from conformance.test_line_lockstep import VirtualLine
from lockstep.soak import GAINS, Timed
from lockstep.ways_world import ground

from ahgateway.codec.ways import Each, Way
from ahgateway.core.verdict import Verdict
from ahgateway.lockstep.judge import Execution
from ahgateway.lockstep.source import source
from ahgateway.transports.line import Line
from ahgateway.transports.server import serve_tcp
from ahgateway.transports.tcp import TcpLink

FIRST = 6
"""Executions without verdict at the beginning, until the derivative's filter is known."""


@pytest.mark.slow
@pytest.mark.parametrize("law", ["DPID", "DPIDE"])
async def test_every_scan_of_5_ms_is_read_over_tcp(law: str) -> None:
    world = ground(Way.RECORDED, law, GAINS[law])
    server = await serve_tcp(world.plc)
    link = TcpLink("127.0.0.1", server.port, clock=world.clock)
    try:
        world.sampler = source(world.loop, world.station, Timed(link, world.clock), world.clock)
        await world.follow(60)
    finally:
        await link.close()
        await server.close()

    counts = world.follower.summary()
    assert counts.proven >= world.plc.executed("L1") - FIRST - 2
    assert (0, 0) == (counts.diverged, counts.link)


@pytest.mark.slow
@pytest.mark.parametrize("law", ["DPID", "DPIDE"])
async def test_every_call_of_500_ms_is_read_over_ascii_at_9600(law: str) -> None:
    world = ground(Way.RECORDED, law, GAINS[law], each=Each.CALL, cycle_ms=500)
    link = VirtualLine(world.plc, world.clock, "ascii", Line("x", 9600, "E", 7, 1))
    world.sampler = source(world.loop, world.station, link, world.clock)
    world.poll_ns = 1_000_000_000
    await world.follow(60)
    world.plc.fail("L1", "gain-1-percent")
    started = world.plc.executed("L1")
    await world.follow(4)

    counts = world.follower.summary()
    assert started >= 100
    assert counts.proven >= started - FIRST - 2
    assert 0 == counts.link
    diverged = [
        event for _, event in world.events if isinstance(event, Execution) and event.verdict is Verdict.DIVERGED
    ]
    assert len(diverged) >= 3


@pytest.mark.slow
async def test_a_line_that_cannot_empty_the_ring_loses_records_and_convicts_nobody() -> None:
    world = ground(Way.RECORDED, "DPIDE", GAINS["DPIDE"])
    link = VirtualLine(world.plc, world.clock, "ascii", Line("x", 9600, "E", 7, 1))
    world.sampler = source(world.loop, world.station, link, world.clock)
    await world.follow(20)

    counts = world.follower.summary()
    assert 0 == counts.diverged
    assert counts.link >= 0.8 * world.plc.executed("L1")
