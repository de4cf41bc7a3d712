"""The fake PLC of the shipped CAN example on python-can's virtual bus, and raw peers beside it."""

from __future__ import annotations

import itertools
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import replace

from ahgateway.clock import WallClock
from ahgateway.codec.station import Station
from ahgateway.fake.can import CanPlc
from ahgateway.fake.plc import FakePlc
from ahgateway.schema.profile import load
from ahgateway.transports.can.bus import bus_for
from ahgateway.transports.can.node import CanNode
from ahgateway.transports.can.server import NodeServer, serve_node
from ahgateway.transports.uri import parse_uri

NODE = 3
_numbers = itertools.count(1)


def target(options: str = "") -> str:
    """A bus that no other test is on."""
    return f"canopen://virtual/test-{next(_numbers)}?node={NODE}{options}"


def station(text: str) -> Station:
    return replace(load("can").station(), target=text)


def fake_plc() -> FakePlc:
    loaded = load("can")
    return FakePlc(loaded.station(), loaded.fake_setup(), clock=WallClock())


@asynccontextmanager
async def served(text: str, plc: FakePlc) -> AsyncIterator[NodeServer]:
    """The PLC as node 3 of the bus that a target names."""
    can = plc.station.can
    assert can is not None
    clock = WallClock()
    server = await serve_node(CanNode(NODE, CanPlc(plc, can)), bus_for(parse_uri(text), clock), clock)
    try:
        yield server
    finally:
        await server.close()
