"""The SDO link over python-can's virtual bus: what every link must do, and what only CAN can get wrong."""

from __future__ import annotations

import asyncio
import struct
from collections.abc import AsyncIterator
from dataclasses import replace
from typing import NamedTuple

import can
import numpy as np
import pytest
from transports.can.can_bench import fake_plc, served, station, target

from ahgateway.clock import WallClock
from ahgateway.codec.access import Read, Table, Write
from ahgateway.codec.can_frame import unpack
from ahgateway.codec.station import Pacing
from ahgateway.errors import CodecError, FrameError, LinkError, PlcRefusedError, ReplyTimeoutError
from ahgateway.fake.plc import FakePlc
from ahgateway.transports.base import Frame, Link
from ahgateway.transports.uri import open_link, parse_uri

SV = Read(1, Table.HOLDING, 100, 2)
BLOCK = Read(1, Table.HOLDING, 100, 46)
FLAGS = Read(1, Table.COIL, 1, 6)
PACING = Pacing(reply_timeout_ms=5000)
"""Long: nothing here waits for it to pass, and a busy machine answers late."""
IMPATIENT = Pacing(reply_timeout_ms=1500)
"""For tests that wait until it has passed, and whose other answers must come in time."""


class Bench(NamedTuple):
    link: Link
    plc: FakePlc
    frames: list[Frame]
    text: str


@pytest.fixture
async def bench() -> AsyncIterator[Bench]:
    text, plc, frames = target(), fake_plc(), list[Frame]()
    async with served(text, plc):
        link = open_link(parse_uri(text), WallClock(), PACING, frames.append, can=station(text).can)
        yield Bench(link, plc, frames, text)
        await link.close()


def channel(text: str) -> str:
    return parse_uri(text).path


async def test_words_bits_and_blocks_are_the_plc_s(bench: Bench) -> None:
    """80.0 is 0x42A00000, low word first; M1 PID_RUN, M5 PID_DE and M6 PID_DIR are on."""
    assert (0x0000, 0x42A0) == (await bench.link.exchange(SV)).values
    assert (1, 0, 0, 0, 1, 1) == (await bench.link.exchange(FLAGS)).values
    block = (await bench.link.exchange(BLOCK)).values
    assert 46 == len(block)
    assert struct.pack("<2H", *block[12:14]) == struct.pack("<f", 4.0), "Td_Kd stands at D112"
    assert (0x42A0,) == (await bench.link.exchange(Read(1, Table.HOLDING, 101, 1))).values


async def test_a_write_of_one_object_arrives_whole(bench: Bench) -> None:
    await bench.link.exchange(Write(1, Table.HOLDING, 100, (0x0000, 0x4120)))
    assert np.float32(10) == bench.plc.read("TIC-101", "SV")


async def test_a_write_that_is_not_one_object_is_refused_before_it_is_sent(bench: Bench) -> None:
    for write in (Write(1, Table.HOLDING, 100, (0, 0, 0, 0)), Write(1, Table.HOLDING, 100, (0,))):
        with pytest.raises(CodecError, match="is not exactly one object"):
            await bench.link.exchange(write)
    assert [] == bench.frames


async def test_a_device_in_no_object_is_named(bench: Bench) -> None:
    with pytest.raises(CodecError, match="holding register 0x01f4 stands in no CANopen object"):
        await bench.link.exchange(Read(1, Table.HOLDING, 500, 2))


async def test_a_refusal_names_object_node_and_code(bench: Bench) -> None:
    bench.plc.refuse(Table.HOLDING, 100, 101, 2, count=1)
    with pytest.raises(PlcRefusedError, match=r"read object 0x2000:01 of node 3: SDO abort 0x06020000") as caught:
        await bench.link.exchange(SV)
    assert 0x0602_0000 == caught.value.code
    assert caught.value.hint
    assert (0x0000, 0x42A0) == (await bench.link.exchange(SV)).values
    assert 1 == bench.link.figures.refused


async def test_times_are_ours_and_in_order(bench: Bench) -> None:
    first, second = await bench.link.exchange(BLOCK), await bench.link.exchange(SV)
    assert first.sent_ns <= first.first_ns <= first.last_ns <= second.sent_ns
    assert first.aligned_since_ns == second.aligned_since_ns <= first.sent_ns


async def test_every_frame_can_be_tapped(bench: Bench) -> None:
    await bench.link.exchange(SV)
    seen = [(frame.direction, unpack(frame.data)) for frame in bench.frames]
    # A probe of the identity object comes first: nothing is believed before its echo.
    assert [(">", 0x603), ("<", 0x583)] * 2 == [(way, frame.can_id) for way, frame in seen if frame.can_id != 0x703]
    assert "40 00 20 01 00 00 00 00" == seen[-2][1].data.hex(" ")
    assert "43 00 20 01 00 00 a0 42" == seen[-1][1].data.hex(" ")


async def test_each_of_many_callers_gets_its_own_answer(bench: Bench) -> None:
    asked = [Read(1, Table.HOLDING, address, 2) for address in range(104, 126, 2)]
    block = (await bench.link.exchange(BLOCK)).values
    replies = await asyncio.gather(*(bench.link.exchange(request) for request in asked))
    assert [block[at : at + 2] for at in range(4, 26, 2)] == [reply.values for reply in replies]


async def test_a_node_that_is_not_there_is_a_timeout_with_a_hint() -> None:
    text = target()
    link = open_link(parse_uri(text), WallClock(), Pacing(reply_timeout_ms=10), can=station(text).can)
    with pytest.raises(ReplyTimeoutError, match="node 3 answers no SDO request") as caught:
        await link.exchange(SV)
    assert "NMT" in str(caught.value.hint)
    await link.close()
    with pytest.raises(LinkError, match="closed"):
        await link.exchange(SV)


class LateNode:
    """A raw server on python-can that can hold an answer back until the next request comes."""

    def __init__(self, name: str) -> None:
        self.bus = can.Bus(interface="virtual", channel=name)
        self.held: can.Message | None = None
        self.is_holding = False
        self.value = 0x1111_1111
        self.notifier = can.Notifier(self.bus, [self.on], timeout=0.02)

    def on(self, message: can.Message) -> None:
        if message.arbitration_id != 0x603 or message.data[0] == 0x80:
            return
        held, self.held = self.held, None
        echo = bytes(message.data[1:4])
        known = echo == bytes.fromhex("00 20 01")
        data = b"\x43" + echo + self.value.to_bytes(4, "little") if known else b"\x80" + echo + b"\x11\0\x09\x06"
        answer = can.Message(arbitration_id=0x583, data=data, is_extended_id=False)
        if held is not None:
            self.bus.send(held)
        if self.is_holding and known:
            self.held, self.is_holding = answer, False
            return
        self.bus.send(answer)

    def close(self) -> None:
        self.notifier.stop()
        self.bus.shutdown()


@pytest.mark.slow
async def test_a_late_reply_about_the_same_object_is_never_believed() -> None:
    text = target()
    node = LateNode(channel(text))
    link = open_link(parse_uri(text), WallClock(), IMPATIENT, can=station(text).can)
    try:
        before = await link.exchange(SV)
        node.is_holding = True
        with pytest.raises(ReplyTimeoutError, match="no reply within 1500 ms to: read object 0x2000:01 of node 3"):
            await link.exchange(SV)
        node.value = 0x2222_2222
        after = await link.exchange(SV)
        assert (0x2222, 0x2222) == after.values, "the held answer carried 0x11111111"
        assert after.aligned_since_ns > before.aligned_since_ns
        assert 1 == link.figures.late
    finally:
        await link.close()
        node.close()


async def test_another_client_of_the_same_node_is_noticed(bench: Bench) -> None:
    stranger = can.Bus(interface="virtual", channel=channel(bench.text))
    try:
        await bench.link.exchange(SV)
        reading = asyncio.ensure_future(bench.link.exchange(BLOCK))
        for _ in range(100_000):
            if any(unpack(frame.data).data[:4] == b"\x40\x00\x20\x05" for frame in bench.frames):
                break
            await asyncio.sleep(0)
        ask = can.Message(arbitration_id=0x603, data=bytes.fromhex("40 00 20 01 00 00 00 00"), is_extended_id=False)
        stranger.send(ask)
        with pytest.raises(FrameError, match="another SDO client speaks to this node, node 3"):
            await reading
        assert (0x0000, 0x42A0) == (await bench.link.exchange(SV)).values
    finally:
        stranger.shutdown()


@pytest.mark.slow
async def test_a_stopped_node_answers_nothing_and_a_started_one_again(bench: Bench) -> None:
    master = can.Bus(interface="virtual", channel=channel(bench.text))
    link = open_link(parse_uri(bench.text), WallClock(), IMPATIENT, can=station(bench.text).can)
    try:
        await link.exchange(SV)
        master.send(can.Message(arbitration_id=0, data=[0x02, 3], is_extended_id=False))
        with pytest.raises(ReplyTimeoutError):
            await link.exchange(SV)
        master.send(can.Message(arbitration_id=0, data=[0x01, 3], is_extended_id=False))
        assert (0x0000, 0x42A0) == (await link.exchange(SV)).values
    finally:
        await link.close()
        master.shutdown()


async def test_commands_go_before_the_polls_that_wait_for_the_node(bench: Bench) -> None:
    """2000:01 is SV, 2000:02 stands behind it in the block; a frame's bytes 1 to 3 name the object."""
    back = Read(1, Table.HOLDING, 100, 2, is_command=True)
    write = Write(1, Table.HOLDING, 100, (0x0000, 0x4120))
    polls = [Read(1, Table.HOLDING, 104, 2) for _ in range(3)]
    await asyncio.gather(*(bench.link.exchange(request) for request in (*polls, write, back)))
    asked = [unpack(frame.data).data[:4] for frame in bench.frames if frame.direction == ">"]
    poll = asked[1]
    assert [poll, b"\x23\x00\x20\x01", b"\x40\x00\x20\x01", poll, poll] == asked[1:]


@pytest.mark.slow
async def test_a_request_that_waits_too_long_for_the_node_is_refused_unsent() -> None:
    text = target()
    node = LateNode(channel(text))
    pacing = replace(IMPATIENT, request_wait_max_ms=30)
    link = open_link(parse_uri(text), WallClock(), pacing, can=station(text).can)
    try:
        await link.exchange(SV)
        node.is_holding = True
        first = asyncio.ensure_future(link.exchange(SV))
        await asyncio.sleep(0)
        with pytest.raises(ReplyTimeoutError, match="waited 30 ms for its turn and was not sent: write 2 holding"):
            await link.exchange(Write(1, Table.HOLDING, 100, (0x0000, 0x4120)))
        with pytest.raises(ReplyTimeoutError, match="no reply within 1500 ms"):
            await first
        assert 2 == len((await link.exchange(SV)).values)
    finally:
        await link.close()
        node.close()
