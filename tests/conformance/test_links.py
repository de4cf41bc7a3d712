"""What every link must do, whatever its wire: one suite over memory, TCP, and RTU and ASCII carried by TCP."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator
from typing import NamedTuple

import pytest
from conformance.patience import PatientClock, PatientLoop
from conformance.peers import CLIENT, SERVER, TinyPlc, serial_pair

from ahgateway.clock import MILLISECOND, VirtualClock, WallClock
from ahgateway.codec.access import Read, Table, Write
from ahgateway.codec.station import Pacing
from ahgateway.errors import CodecError, LinkError, PlcRefusedError, ReplyTimeoutError
from ahgateway.transports.base import Frame, Link
from ahgateway.transports.line import Line
from ahgateway.transports.memory import MemoryLink
from ahgateway.transports.serial_link import SerialLink
from ahgateway.transports.serial_server import serve_serial
from ahgateway.transports.server import serve_tcp
from ahgateway.transports.tcp import TcpLink

LOOP = PatientLoop


class Bench(NamedTuple):
    link: Link
    plc: TinyPlc
    frames: list[Frame]


@pytest.fixture(params=["memory", "tcp", "tcp-pipelined", "rtu", "ascii", "rtu-serial", "ascii-serial"])
async def bench(request: pytest.FixtureRequest) -> AsyncIterator[Bench]:
    plc, frames = TinyPlc(), list[Frame]()
    # Only the unit that is not there waits so long; a serial port's thread may be let wait by a busy machine.
    timeout_ms = 1500 if request.param.endswith("-serial") else 100
    pacing = Pacing(reply_timeout_ms=timeout_ms, requests_in_flight_max=4 if request.param == "tcp-pipelined" else 1)
    if request.param == "memory":
        yield Bench(
            MemoryLink(plc, VirtualClock(), latency_ns=MILLISECOND, tap=frames.append, pacing=pacing), plc, frames
        )
        return
    wire = request.param.partition("-")[0]
    if request.param.endswith("-serial"):
        async with serial_bench(wire, pacing) as found:
            yield found
        return
    server = await serve_tcp(plc, framing=SERVER[wire])
    link = TcpLink(
        "127.0.0.1",
        server.port,
        clock=PatientClock(),
        pacing=pacing,
        tap=frames.append,
        framing=CLIENT[wire],
        quiet_ns=5 * MILLISECOND,
    )
    yield Bench(link, plc, frames)
    await link.close()
    await server.close()


@contextlib.asynccontextmanager
async def serial_bench(wire: str, pacing: Pacing) -> AsyncIterator[Bench]:
    plc, frames = TinyPlc(), list[Frame]()
    async with serial_pair() as (plc_end, our_end):
        server = await serve_serial(plc, Line(plc_end, 115200), framing=SERVER[wire])
        link = SerialLink(
            Line(our_end, 115200),
            clock=WallClock(),
            pacing=pacing,
            tap=frames.append,
            framing=CLIENT[wire],
            scheme=f"modbus+{wire}",
        )
        yield Bench(link, plc, frames)
        await link.close()
        await server.close()


async def test_words_are_written_and_read_back(bench: Bench) -> None:
    await bench.link.exchange(Write(1, Table.HOLDING, 100, (0x5678, 0x1234, 0xFFFF)))
    await bench.link.exchange(Write(1, Table.HOLDING, 103, (7,)))
    reply = await bench.link.exchange(Read(1, Table.HOLDING, 99, 6))
    assert (0, 0x5678, 0x1234, 0xFFFF, 7, 0) == reply.values
    assert [0x5678, 0x1234, 0xFFFF, 7] == bench.plc.memory[Table.HOLDING][100:104]


async def test_bits_are_written_and_read_back(bench: Bench) -> None:
    await bench.link.exchange(Write(1, Table.COIL, 10, (1, 0, 1, 1, 0, 0, 0, 0, 1)))
    await bench.link.exchange(Write(1, Table.COIL, 20, (1,)))
    reply = await bench.link.exchange(Read(1, Table.COIL, 9, 12))
    assert (0, 1, 0, 1, 1, 0, 0, 0, 0, 1, 0, 1) == reply.values


async def test_the_read_only_tables_are_read(bench: Bench) -> None:
    assert (1, 0, 0, 1) == (await bench.link.exchange(Read(1, Table.DISCRETE, 300, 4))).values
    assert (70, 77) == (await bench.link.exchange(Read(1, Table.INPUT, 10, 2))).values


async def test_the_largest_requests_pass(bench: Bench) -> None:
    assert tuple(range(0, 875, 7)) == (await bench.link.exchange(Read(1, Table.INPUT, 0, 125))).values
    words = tuple(range(60000, 60123))
    await bench.link.exchange(Write(1, Table.HOLDING, 0, words))
    assert words == (await bench.link.exchange(Read(1, Table.HOLDING, 0, 123))).values
    assert len((await bench.link.exchange(Read(1, Table.COIL, 0, 900))).values) == 900


async def test_the_times_of_a_reply_are_in_order(bench: Bench) -> None:
    reply = await bench.link.exchange(Read(1, Table.HOLDING, 0, 40))
    later = await bench.link.exchange(Read(1, Table.HOLDING, 0, 40))
    assert reply.sent_ns <= reply.first_ns <= reply.last_ns <= later.sent_ns
    assert reply.aligned_since_ns <= reply.sent_ns
    assert later.aligned_since_ns == reply.aligned_since_ns
    assert bench.link.figures.replies == 2


async def test_an_exception_names_code_request_and_hint(bench: Bench) -> None:
    with pytest.raises(PlcRefusedError, match="read 2 holding registers from 0x0384 of unit 1: exception 02") as caught:
        await bench.link.exchange(Read(1, Table.HOLDING, 900, 2))
    assert caught.value.code == 2
    assert caught.value.hint
    with pytest.raises(PlcRefusedError, match="exception 06, device busy"):
        await bench.link.exchange(Write(1, Table.HOLDING, 899, (1,)))
    assert (0, 7) == (await bench.link.exchange(Read(1, Table.INPUT, 0, 2))).values
    assert bench.link.figures.refused == 2


async def test_a_unit_that_is_not_there_is_a_timeout_and_the_next_request_passes(bench: Bench) -> None:
    with pytest.raises(ReplyTimeoutError, match="unit 9") as caught:
        await bench.link.exchange(Read(9, Table.HOLDING, 0, 2))
    assert isinstance(caught.value, TimeoutError)
    assert bench.link.target in caught.value.message
    assert (0, 7) == (await bench.link.exchange(Read(1, Table.INPUT, 0, 2))).values
    assert bench.link.figures.timeouts == 1


async def test_each_of_many_callers_gets_its_own_answer(bench: Bench) -> None:
    asked = [Read(1, Table.INPUT, address, 2) for address in range(30)]
    replies = await asyncio.gather(*(bench.link.exchange(request) for request in asked))
    assert [(7 * address, 7 * address + 7) for address in range(30)] == [reply.values for reply in replies]


async def test_a_request_that_no_pdu_can_hold_never_leaves(bench: Bench) -> None:
    with pytest.raises(CodecError):
        await bench.link.exchange(Read(1, Table.HOLDING, 0, 126))
    with pytest.raises(CodecError):
        await bench.link.exchange(Write(1, Table.INPUT, 0, (1,)))
    assert bench.plc.seen == []
    assert (0, 7) == (await bench.link.exchange(Read(1, Table.INPUT, 0, 2))).values


async def test_a_closed_link_says_so(bench: Bench) -> None:
    await bench.link.exchange(Read(1, Table.HOLDING, 0, 2))
    await bench.link.close()
    await bench.link.close()
    with pytest.raises(LinkError, match="closed"):
        await bench.link.exchange(Read(1, Table.HOLDING, 0, 2))


async def test_every_frame_can_be_tapped_with_its_times(bench: Bench) -> None:
    await bench.link.exchange(Read(1, Table.HOLDING, 0, 2))
    directions = [frame.direction for frame in bench.frames]
    assert directions in ([">", "<"], [">", "<", ">", "<"]), "with an alignment probe where nothing is numbered"
    assert sorted(frame.now_ns for frame in bench.frames) == [frame.now_ns for frame in bench.frames]
    assert all(frame.utc_ns > 1_700_000_000 * 10**9 for frame in bench.frames)
