"""The fake PLC in the time of a clock, and on a port where strangers speak to it."""

from __future__ import annotations

import asyncio
import struct

import numpy as np
import pytest
from pymodbus.client import AsyncModbusTcpClient

from ahgateway.clock import MILLISECOND, VirtualClock
from ahgateway.codec.access import Read, Table
from ahgateway.codec.station import FakeLoop
from ahgateway.fake.serve import scan_in_time, until
from ahgateway.transports.memory import MemoryLink
from ahgateway.transports.server import serve_tcp

LOOP = "LIC-201"
SETUP = {LOOP: FakeLoop({"SV": 12.34, "PV": 2.34, "CYCLE": 1, "Kp": 2.0})}


class Sleepy(VirtualClock):
    """A clock whose sleeps come back late: by so many milliseconds each, then it cancels the sleeper."""

    def __init__(self, late_ms: list[int]) -> None:
        super().__init__()
        self._late_ms = late_ms

    async def sleep_ns(self, duration_ns: int) -> None:
        if not self._late_ms:
            raise asyncio.CancelledError
        self.advance_ns(duration_ns + self._late_ms.pop(0) * MILLISECOND)


async def scanned(plc, late_ms):
    """Times in ms of the scans, each of which takes PV in."""
    times, process = [], plc.processes[LOOP]
    sense = process.sense

    def watched():
        sense()
        times.append(plc.now_ns // MILLISECOND)

    process.sense = watched
    with pytest.raises(asyncio.CancelledError):
        await scan_in_time(plc, Sleepy(late_ms))
    return times


async def test_scans_follow_the_clock(make_plc):
    assert await scanned(make_plc(), [0, 0, 0]) == [5, 10, 15]


async def test_a_little_lateness_is_made_good_one_by_one(make_plc):
    assert await scanned(make_plc(), [0, 12, 0]) == [5, 10, 15, 20, 25]


async def test_much_lateness_is_one_long_scan_and_no_time_is_lost(make_plc):
    # 5 ms, then 200 ms late: at 210; 41 scans are due, 4 are made good after one of 37 × 5 = 185 ms.
    assert await scanned(make_plc(), [0, 200, 0]) == [5, 190, 195, 200, 205, 210, 215]


async def test_until_ends_when_told(make_plc):
    plc, stop = make_plc(), asyncio.Event()
    plc.at(50 * MILLISECOND, lambda plc: stop.set())
    await until(stop, plc, VirtualClock())
    assert plc.now_ns >= 50 * MILLISECOND


async def test_an_error_in_a_scan_is_raised_and_not_swallowed(make_plc):
    plc = make_plc()

    def fail(plc):
        raise ZeroDivisionError

    plc.at(10 * MILLISECOND, fail)
    with pytest.raises(ZeroDivisionError):
        await until(asyncio.Event(), plc, VirtualClock())


async def test_a_memory_link_sees_the_plc_at_the_time_of_its_clock(make_plc):
    clock = VirtualClock()
    plc = make_plc(setups=SETUP, clock=clock)
    link = MemoryLink(plc, clock, latency_ns=2 * MILLISECOND)
    clock.advance_ns(20 * MILLISECOND)
    reply = await link.exchange(Read(1, Table.HOLDING, 200, 2))
    assert struct.unpack("<f", struct.pack("<2H", *reply.values)) == (20.0,)
    assert plc.now_ns == 20 * MILLISECOND
    await link.close()


async def test_a_stranger_reads_and_writes_the_same_values(make_plc):
    """pymodbus' own client and its own conversions; 12.34 is 0x414570A4, low word first."""
    plc = make_plc(setups=SETUP)
    server = await serve_tcp(plc, "127.0.0.1", 0)
    client = AsyncModbusTcpClient("127.0.0.1", port=server.port)
    try:
        assert await client.connect()
        plc.scan()
        block = await client.read_holding_registers(100, count=4, device_id=1)
        assert block.registers[:2] == [0x70A4, 0x4145]
        mv = await client.read_holding_registers(200, count=2, device_id=1)
        assert client.convert_from_registers(mv.registers, client.DATATYPE.FLOAT32, word_order="little") == 20.0
        assert (await client.read_coils(1, count=4, device_id=1)).bits[:4] == [True, False, False, True]
        await client.write_registers(100, [0x0000, 0x4120], device_id=1)
        await client.write_coil(2, True, device_id=1)
        assert (plc.read(LOOP, "SV"), plc.read(LOOP, "PID_MAN")) == (np.float32(10), True)
        refused = await client.read_holding_registers(5000, count=1, device_id=1)
        assert (refused.isError(), refused.exception_code) == (True, 2)
    finally:
        client.close()
        await server.close()
