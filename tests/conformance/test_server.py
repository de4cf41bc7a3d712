"""The PLC's side: every request of a connection answered in order, limits kept, garbage shown the door."""

from __future__ import annotations

import asyncio

import pytest
from conformance.patience import PatientClock, PatientLoop
from conformance.peers import CLIENT, SERVER, TinyPlc

from ahgateway.clock import VirtualClock
from ahgateway.codec.access import Read, Table
from ahgateway.codec.station import Pacing
from ahgateway.errors import LinkError
from ahgateway.transports.base import Frame
from ahgateway.transports.server import serve_tcp
from ahgateway.transports.tcp import TcpLink

LOOP = PatientLoop
READ = "{tag:04X} 0000 0006 {unit:02X} 04 {address:04X} 0001"


async def test_four_requests_in_one_segment_get_four_answers_in_order() -> None:
    """The usual library's server answers the first and throws the others away."""
    server = await serve_tcp(TinyPlc())
    reader, writer = await asyncio.open_connection("127.0.0.1", server.port)
    writer.write(bytes.fromhex("".join(READ.format(tag=tag, unit=1, address=tag) for tag in range(1, 5))))
    answers = await reader.readexactly(44)
    values = {1: "0007", 2: "000E", 3: "0015", 4: "001C"}
    assert bytes.fromhex("".join(f"{tag:04X} 0000 0005 01 04 02 {word}" for tag, word in values.items())) == answers
    writer.close()
    await writer.wait_closed()
    await server.close()


async def test_a_request_may_come_in_single_bytes_and_another_unit_is_met_with_silence() -> None:
    server = await serve_tcp(TinyPlc())
    reader, writer = await asyncio.open_connection("127.0.0.1", server.port)
    for byte in bytes.fromhex(READ.format(tag=1, unit=5, address=1) + READ.format(tag=2, unit=1, address=1)):
        writer.write(bytes((byte,)))
        await asyncio.sleep(0)
    assert bytes.fromhex("0002 0000 0005 01 04 02 0007") == await reader.readexactly(11)
    writer.close()
    await writer.wait_closed()
    await server.close()


@pytest.mark.parametrize(
    ("asked", "answered"),
    [
        ("0001 0000 0002 01 2B", "0001 0000 0003 01 AB 01"),
        ("0001 0000 0006 01 03 0000 007E", "0001 0000 0003 01 83 03"),
        ("0001 0000 0006 01 03 0384 0001", "0001 0000 0003 01 83 02"),
        ("0001 0000 0006 01 06 0383 0001", "0001 0000 0003 01 86 06"),
    ],
)
async def test_refusals_go_out_as_exceptions(asked: str, answered: str) -> None:
    server = await serve_tcp(TinyPlc())
    reader, writer = await asyncio.open_connection("127.0.0.1", server.port)
    writer.write(bytes.fromhex(asked))
    assert bytes.fromhex(answered) == await reader.readexactly(9)
    writer.close()
    await writer.wait_closed()
    await server.close()


async def test_garbage_closes_the_connection_and_only_that() -> None:
    server = await serve_tcp(TinyPlc())
    reader, writer = await asyncio.open_connection("127.0.0.1", server.port)
    writer.write(b"GET / HTTP/1.1\r\n\r\n")
    with pytest.raises((asyncio.IncompleteReadError, ConnectionError)):
        await reader.readexactly(1)
    writer.close()
    link = TcpLink("127.0.0.1", server.port, clock=PatientClock())
    assert (7,) == (await link.exchange(Read(1, Table.INPUT, 1, 1))).values
    await link.close()
    await server.close()


async def test_a_connection_beyond_the_limit_is_closed_and_the_client_says_what_it_may_be() -> None:
    server = await serve_tcp(TinyPlc(), connections_max=1)
    first = TcpLink("127.0.0.1", server.port, clock=PatientClock())
    second = TcpLink("127.0.0.1", server.port, clock=PatientClock(), pacing=Pacing(reply_timeout_ms=100))
    await first.exchange(Read(1, Table.INPUT, 1, 1))
    with pytest.raises(LinkError) as caught:
        await second.exchange(Read(1, Table.INPUT, 1, 1))
    assert "SM1089" in (caught.value.hint or "")
    assert (server.connections, server.connections_refused) == (1, 1)
    await first.close()
    await second.close()
    await server.close()


async def test_a_port_that_is_taken_is_named() -> None:
    server = await serve_tcp(TinyPlc())
    with pytest.raises(LinkError, match=f"cannot listen on 127.0.0.1:{server.port}"):
        await serve_tcp(TinyPlc(), port=server.port)
    await server.close()


@pytest.mark.parametrize("wire", ["tcp", "rtu", "ascii"])
async def test_the_server_can_be_tapped_and_answers_no_broadcast(wire: str) -> None:
    frames: list[Frame] = []
    server = await serve_tcp(TinyPlc(), framing=SERVER[wire], clock=VirtualClock(), tap=frames.append)
    link = TcpLink("127.0.0.1", server.port, clock=PatientClock(), framing=CLIENT[wire])
    await link.exchange(Read(1, Table.INPUT, 1, 1))
    assert [">", "<"] == [frame.direction for frame in frames][-2:]
    await link.close()
    await server.close()


async def test_a_peer_that_asks_and_never_reads_does_not_fill_our_memory() -> None:
    plc = TinyPlc()
    server = await serve_tcp(plc)
    reader, writer = await asyncio.open_connection("127.0.0.1", server.port)
    writer.transport.pause_reading()  # type: ignore[attr-defined]
    request = bytes.fromhex("0001 0000 0006 01 03 0000 007D")
    writer.write(request * 60_000)
    answered = -1
    while answered < len(plc.seen):
        answered = len(plc.seen)
        await asyncio.sleep(0.05)
    assert answered < 60_000
    writer.transport.abort()
    await server.close()
    assert reader is not None
