"""The fake PLC in the time of a clock: scans when they are due, catches up a little, never pretends."""

from __future__ import annotations

import asyncio

from ahgateway.clock import Clock
from ahgateway.fake.plc import FakePlc


async def scan_in_time(plc: FakePlc, clock: Clock, *, catch_up_scans_max: int = 4) -> None:
    """Scan as the clock goes, until cancelled.

    A scan that comes late has its measured time, rounded down to whole scans. Up to `catch_up_scans_max` scans are
    made good one by one; what is beyond becomes one long scan first, so that no time is lost and no storm follows.
    """
    scanned_ns = clock.now_ns()
    while True:
        await clock.sleep_ns(scanned_ns + plc.scan_ns - clock.now_ns())
        due = (clock.now_ns() - scanned_ns) // plc.scan_ns
        scanned_ns += due * plc.scan_ns
        if due > catch_up_scans_max:
            plc.scan((due - catch_up_scans_max) * plc.scan_ns)
            due = catch_up_scans_max
        for _ in range(due):
            plc.advance(plc.scan_ns)


async def until(stop: asyncio.Event, plc: FakePlc, clock: Clock) -> None:
    """Scan in time until `stop` is set; an error in a scan is raised here."""
    scanning = asyncio.ensure_future(scan_in_time(plc, clock))
    stopping = asyncio.ensure_future(stop.wait())
    try:
        done, _ = await asyncio.wait({scanning, stopping}, return_when=asyncio.FIRST_COMPLETED)
        if scanning in done:
            scanning.result()
    finally:
        scanning.cancel()
        stopping.cancel()
        await asyncio.gather(scanning, stopping, return_exceptions=True)
