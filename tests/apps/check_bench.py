"""Short scenarios on the shipped bench, written where they are used."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from typing import Any

from ahgateway.apps.check.result import Floor, Result
from ahgateway.apps.check.run import Bench, floor_of
from ahgateway.apps.check.suite import results
from ahgateway.clock import VirtualClock
from ahgateway.codec.station import Loop, Station
from ahgateway.schema.profile import load
from ahgateway.schema.scenario import Scenario, library, parse

STATION = load(str(library() / "bench.toml")).station()
BENCH = Bench(STATION, STATION)

HEAD = """
title = "A loop"
instruction = "DPID"
duration = 8.0
plant = { kind = "fopdt", gain = 1.2, tau_s = 1.0, dead_time_s = 0.1, bias = 10.0, noise = 0.02, initial = 49.0 }

[initial]
SV = 50.0
CYCLE = 10
Kp = 1.1
Ki = 0.9
"""
STEP = "\n[[step]]\nat = 4.0\nset = { SV = 60.0 }\n"


def scenario(body: str, head: str = HEAD) -> Scenario:
    return parse(head + body, "loop.toml", "mine/loop")


def with_dialect(station: Station, **axes: Any) -> Station:
    def changed(loop: Loop) -> Loop:
        has = set(axes) <= set(loop.controller.axes)
        return replace(loop, dialect=loop.dialect._replace(**axes)) if has else loop

    return replace(station, loops=tuple(changed(loop) for loop in station.loops))


def ran(wanted: Scenario, bench: Bench = BENCH, **options: Any) -> Result:
    """Run one scenario and return its only result."""

    async def first() -> Result:
        return await anext(results([wanted], bench, VirtualClock(), **options))

    return asyncio.run(first())


def floored(wanted: Scenario, bench: Bench = BENCH) -> Floor:
    return asyncio.run(floor_of(wanted, bench, 1, VirtualClock()))
