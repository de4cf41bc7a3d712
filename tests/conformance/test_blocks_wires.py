"""PID_Temp, PID_REG_CE and MELSEC PID in lockstep over a real socket and a real serial port, right and then wrong."""

from __future__ import annotations

import contextlib
from collections.abc import AsyncIterator
from typing import Any

import pytest
from conformance.peers import serial_pair
from lockstep.other_world import OtherWorld
from lockstep.test_other_lockstep import STEPS, begun_in, diverged

from ahgateway.clock import WallClock
from ahgateway.core.controllers import CONTROLLERS
from ahgateway.fake.plc import FakePlc
from ahgateway.transports.base import Link
from ahgateway.transports.serial_server import SerialServer
from ahgateway.transports.server import TcpServer, serve_tcp
from ahgateway.transports.serving import FRAMINGS, serve_at
from ahgateway.transports.uri import open_link, parse_uri

PICTURES = {"modbus+tcp": 1000, "modbus+rtu": 200}
PROVEN = {"modbus+tcp": 200, "modbus+rtu": 40}


@contextlib.asynccontextmanager
async def joined(plc: FakePlc, wire: str) -> AsyncIterator[Link]:
    """Serve a PLC on one end of a wire and open the other."""
    clock = WallClock()
    server: TcpServer | SerialServer
    async with contextlib.AsyncExitStack() as stack:
        if wire == "modbus+rtu":
            plc_end, our_end = await stack.enter_async_context(serial_pair())
            server = await serve_at(plc, parse_uri(f"{wire}://{plc_end}?unit=1&baud=115200"), clock, connections_max=1)
            link = open_link(parse_uri(f"{wire}://{our_end}?unit=1&baud=115200"), clock)
        else:
            server = await serve_tcp(plc, "127.0.0.1", 0, clock=clock, framing=FRAMINGS[wire])
            link = open_link(parse_uri(f"{wire}://127.0.0.1:{server.port}?unit=1"), clock)
        stack.push_async_callback(server.close)
        stack.push_async_callback(link.close)
        yield link


@pytest.mark.parametrize("wire", list(PICTURES))
@pytest.mark.parametrize("name", ["PID_Temp", "PID_REG_CE", "MELSEC_PID"])
async def test_a_block_is_proven_over_a_wire_and_convicted_when_its_gain_moves(name: str, wire: str) -> None:
    ground = OtherWorld(name, counter=True)
    async with joined(ground.plc, wire) as link:
        ground.sampler._link = link
        await begun_in(ground, name)
        await ground.follow(PICTURES[wire])
        right = diverged(ground)
        proven = ground.follower.summary().proven
        ground.plc.fail("L1", "kp-1-percent")
        await _excited(ground, CONTROLLERS[name].roles.sv, STEPS[name])

    assert right == []
    assert proven > PROVEN[wire]
    assert diverged(ground)


async def _excited(ground: OtherWorld, sv: str, steps: tuple[Any, Any]) -> None:
    """Move SV to and fro until the block is convicted, twenty times at most."""
    for turn in range(20):
        ground.plc.write("L1", sv, steps[turn % 2])
        await ground.follow(20)
        if diverged(ground):
            return
