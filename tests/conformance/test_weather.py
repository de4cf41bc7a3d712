"""Everything that goes wrong on a wire: late, foreign, cut, torn and no replies, lost connections, garbage."""

from __future__ import annotations

import asyncio
import errno
import socket
import struct

import pytest
from conformance.patience import PatientClock, PatientLoop
from conformance.peers import CLIENT, Peer, addresses

from ahgateway.apps.scan import scan
from ahgateway.clock import MILLISECOND, WallClock
from ahgateway.codec.access import Read, Request, Table, Write
from ahgateway.codec.station import Pacing
from ahgateway.errors import AhGatewayError, FrameError, LinkError, ReplyTimeoutError, TransportError
from ahgateway.transports.base import Reply
from ahgateway.transports.tcp import TcpLink, _connect_failure

TEN = Read(1, Table.HOLDING, 10, 2)
FIVE_HUNDRED = Read(1, Table.HOLDING, 500, 2)
SEVEN_HUNDRED = Read(1, Table.HOLDING, 700, 2)
SIX = Read(1, Table.HOLDING, 500, 6)
WRITE = Write(1, Table.HOLDING, 40, (1, 2))
TIMEOUT_MS = 50
LOOP = PatientLoop

all_wires = pytest.mark.parametrize("wire", ["tcp", "rtu", "ascii"])
unnumbered_wires = pytest.mark.parametrize("wire", ["rtu", "ascii"])


def open_link(peer: Peer, wire: str, **pacing: int) -> TcpLink:
    return TcpLink(
        "127.0.0.1",
        peer.port,
        clock=PatientClock(),
        pacing=Pacing(**{"reply_timeout_ms": TIMEOUT_MS, **pacing}),
        framing=CLIENT[wire],
        quiet_ns=2 * MILLISECOND,
    )


def now_s() -> float:
    return asyncio.get_running_loop().time()


async def honest(peer: Peer, number: int, request: Request, sound: bytes) -> bytes:
    return sound


def is_probe(request: Request) -> bool:
    return request not in (TEN, FIVE_HUNDRED, SEVEN_HUNDRED, SIX, WRITE)


async def first_reply(link: TcpLink) -> Reply:
    """Ask until the link is back; it paces itself."""
    for _ in range(20):
        try:
            return await link.exchange(TEN)
        except AhGatewayError:
            continue
    raise AssertionError("the link did not come back")


@all_wires
@pytest.mark.parametrize("later", [FIVE_HUNDRED, SIX, WRITE])
@pytest.mark.parametrize("first", [TEN, WRITE])
async def test_a_late_reply_is_never_the_answer_to_a_later_request(wire: str, first: Request, later: Request) -> None:
    """The table of spec field §0: the usual library returns the values of 10 and 11 for 500 and 501."""
    held: list[bytes] = []

    async def late(peer: Peer, number: int, request: Request, sound: bytes) -> bytes | None:
        if request == first and not held:
            held.append(sound)
            return None
        if held and held[0]:
            sound, held[0] = held[0] + sound, b""
        return sound

    async with Peer(wire, late) as peer:
        link = open_link(peer, wire)
        with pytest.raises(ReplyTimeoutError):
            await link.exchange(first)
        for request in (later, SEVEN_HUNDRED):
            reply = await link.exchange(request)
            assert reply.values == (addresses(request) if isinstance(request, Read) else ())
        assert link.figures.timeouts == 1
        await link.close()


@unnumbered_wires
async def test_a_stream_that_stays_one_reply_behind_is_never_believed(wire: str) -> None:
    """A unit that answers each request only when the next one comes: no value may pass, ever."""
    held: list[bytes] = []

    async def one_behind(peer: Peer, number: int, request: Request, sound: bytes) -> bytes | None:
        held.append(sound)
        return held[-2] if len(held) > 1 else None

    async with Peer(wire, one_behind) as peer:
        link = open_link(peer, wire, reply_timeout_ms=15)
        for _ in range(12):
            for request in (TEN, FIVE_HUNDRED):
                with pytest.raises(TransportError):
                    await link.exchange(request)
        assert link.figures.replies == 0
        await link.close()


@unnumbered_wires
async def test_after_a_timeout_nothing_is_sent_before_the_probe_is_answered(wire: str) -> None:
    async def second_is_lost(peer: Peer, number: int, request: Request, sound: bytes) -> bytes | None:
        return None if number == 3 else sound

    async with Peer(wire, second_is_lost) as peer:
        link = open_link(peer, wire)
        before = await link.exchange(TEN)
        with pytest.raises(ReplyTimeoutError):
            await link.exchange(WRITE)
        after = await link.exchange(WRITE)
        assert after.aligned_since_ns > before.aligned_since_ns
        assert [True, False, False, True, False] == [is_probe(request) for request in peer.asked]
        assert peer.asked.count(WRITE) == 2, "once for each call: no write is repeated by the link"
        await link.close()


@all_wires
async def test_a_reply_in_single_bytes_is_one_reply(wire: str) -> None:
    async def dribble(peer: Peer, number: int, request: Request, sound: bytes) -> None:
        for byte in sound:
            peer._writers[0].write(bytes((byte,)))
            await asyncio.sleep(0)

    async with Peer(wire, dribble) as peer:
        link = open_link(peer, wire)
        assert addresses(SIX) == (await link.exchange(SIX)).values
        await link.close()


@all_wires
async def test_a_connection_closed_in_the_middle_fails_all_at_once_and_is_made_again(wire: str) -> None:
    async def cut_once(peer: Peer, number: int, request: Request, sound: bytes) -> bytes | None:
        if peer.connections == 1 and not is_probe(request):
            peer._writers[0].write(sound[:5])
            await asyncio.sleep(0)
            peer.cut()
            return None
        return sound

    async with Peer(wire, cut_once) as peer:
        link = open_link(peer, wire, reply_timeout_ms=2000)
        started = now_s()
        outcomes = await asyncio.gather(
            *(link.exchange(TEN) for _ in range(3)), link.exchange(WRITE), return_exceptions=True
        )
        assert now_s() - started < 1
        assert all(isinstance(outcome, LinkError) for outcome in outcomes)
        # Behind an alignment probe the command overtakes the polls; over TCP the first poll has left already.
        fate = "it was not sent" if wire == "tcp" else "whether the PLC carried it out is not known"
        assert fate in str(outcomes[3])
        assert addresses(TEN) == (await link.exchange(TEN)).values
        assert link.figures.reconnects == 1
        assert link.figures.first_cause
        await link.close()


@all_wires
async def test_the_deadline_is_kept_when_nothing_comes(wire: str) -> None:
    async def silent(peer: Peer, number: int, request: Request, sound: bytes) -> bytes | None:
        return sound if is_probe(request) else None

    async with Peer(wire, silent) as peer:
        link = open_link(peer, wire)
        started = now_s()
        with pytest.raises(ReplyTimeoutError, match=f"no reply within {TIMEOUT_MS} ms to: read 2 holding registers"):
            await link.exchange(TEN)
        took = now_s() - started
        assert TIMEOUT_MS / 1000 <= took < TIMEOUT_MS / 1000 + 0.2
        await link.close()


@all_wires
async def test_a_peer_that_never_answers_is_connected_anew(wire: str) -> None:
    async def deaf_at_first(peer: Peer, number: int, request: Request, sound: bytes) -> bytes | None:
        return sound if peer.connections > 1 else None

    async with Peer(wire, deaf_at_first) as peer:
        link = open_link(peer, wire, reply_timeout_ms=15)
        for _ in range(3):
            with pytest.raises(ReplyTimeoutError):
                await link.exchange(TEN)
        assert addresses(TEN) == (await link.exchange(TEN)).values
        assert peer.connections == 2
        assert "3 requests in a row without a byte in answer, connection renewed" == link.figures.first_cause
        await link.close()


@all_wires
async def test_a_scan_goes_on_behind_many_silent_units(wire: str) -> None:
    """Each three of them cost the connection, and the last unit was once never asked."""

    async def twelfth(peer: Peer, number: int, request: Request, sound: bytes) -> bytes | None:
        return sound if request.unit == 12 else None

    async with Peer(wire, twelfth) as peer:
        link = open_link(peer, wire, reply_timeout_ms=15)
        found = [answer async for answer in scan(link, WallClock(), range(1, 13), 2**63)]
        assert [12] == [answer.unit for answer in found if answer.is_proven]
        assert ["silent"] * 11 == [answer.text for answer in found[:11]]
        assert 4 == peer.connections
        await link.close()


async def test_a_scan_goes_on_behind_a_converter_that_hangs_up() -> None:
    async def hangs_up(peer: Peer, number: int, request: Request, sound: bytes) -> bytes | None:
        if request.unit == 2 or (request.unit == 3 and isinstance(request, Read) and request.count == 2):
            peer.cut()
            return None
        return sound

    async with Peer("tcp", hangs_up) as peer:
        link = open_link(peer, "tcp", reply_timeout_ms=2000)
        found = [answer async for answer in scan(link, WallClock(), range(1, 5), 2**63)]
        assert [(True, True), (False, False), (True, False), (True, True)] == [
            (answer.is_there, answer.is_proven) for answer in found
        ]
        assert "asked, and no answer: " in found[1].text
        assert "answered once, then: " in found[2].text
        await link.close()
    with pytest.raises(LinkError, match="connection refused"):
        await anext(scan(open_link(peer, "tcp"), WallClock(), (1,), 2**63))


@all_wires
@pytest.mark.parametrize("place", ["function", "count", "unit", "cut"])
async def test_a_reply_that_does_not_fit_is_an_error_and_the_link_recovers(wire: str, place: str) -> None:
    framing = CLIENT[wire]()

    async def wrong_once(peer: Peer, number: int, request: Request, sound: bytes) -> bytes | None:
        if is_probe(request) or peer.asked.count(TEN) > 1:
            return sound
        if place == "cut":
            return sound[:-3]
        unit, pdu = 1, bytes.fromhex("03 04 000A 000B")
        if place == "function":
            pdu = bytes.fromhex("04 04 000A 000B")
        elif place == "count":
            pdu = bytes.fromhex("03 06 000A 000B 000C")
        else:
            unit = 2
        tag = int.from_bytes(sound[:2], "big")
        return framing.wrap(tag, unit, pdu)

    async with Peer(wire, wrong_once) as peer:
        link = open_link(peer, wire)
        with pytest.raises((FrameError, ReplyTimeoutError)):
            await link.exchange(TEN)
        if place == "cut" and wire == "tcp":
            await link.close()  # a numbered stream that was cut never comes back to its beat by itself
            return
        assert addresses(TEN) == (await link.exchange(TEN)).values
        await link.close()


@unnumbered_wires
@pytest.mark.parametrize("noise", [b"\x00", b"\xff\x01\x03", b"\x01\x03\x04", b":01", b"\x01\x83\x02", bytes(200)])
async def test_a_good_reply_behind_noise_is_delivered(wire: str, noise: bytes) -> None:
    async def noisy(peer: Peer, number: int, request: Request, sound: bytes) -> bytes:
        return noise + sound

    async with Peer(wire, noisy) as peer:
        link = open_link(peer, wire)
        for _ in range(5):
            assert addresses(TEN) == (await link.exchange(TEN)).values
        assert link.figures.timeouts == 0
        await link.close()


@unnumbered_wires
async def test_bytes_that_are_no_frame_point_at_the_settings_from_the_first_request_on(wire: str) -> None:
    """A wrong baud rate or parity: the first request of a connection is the alignment probe, and it must say so too."""

    async def another_baud(peer: Peer, number: int, request: Request, sound: bytes) -> bytes:
        return bytes(byte ^ 0x81 for byte in sound)

    async with Peer(wire, another_baud) as peer:
        link = open_link(peer, wire)
        with pytest.raises(
            FrameError, match=r"\d+ bytes within 50 ms, but no answer to: the alignment probe"
        ) as caught:
            await link.exchange(TEN)
        assert "check baud rate, parity, RTU against ASCII" in (caught.value.hint or "")
        found = await anext(scan(link, WallClock(), (1,), 2**63))
        assert (False, True) == (found.is_there, found.text.startswith("something came that is no answer: "))
        await link.close()


@unnumbered_wires
async def test_silence_from_the_first_request_on_points_at_the_settings_too(wire: str) -> None:
    async def silent(peer: Peer, number: int, request: Request, sound: bytes) -> None:
        return None

    async with Peer(wire, silent) as peer:
        link = open_link(peer, wire)
        with pytest.raises(ReplyTimeoutError, match="nothing on this line is believed before it answers") as caught:
            await link.exchange(TEN)
        assert "check the unit number, baud rate, parity and wiring" in (caught.value.hint or "")
        await link.close()


@unnumbered_wires
async def test_a_second_reply_behind_the_first_is_not_kept_for_the_next_request(wire: str) -> None:
    async def twice(peer: Peer, number: int, request: Request, sound: bytes) -> bytes:
        return sound + sound

    async with Peer(wire, twice) as peer:
        link = open_link(peer, wire)
        for request in (TEN, FIVE_HUNDRED, SEVEN_HUNDRED):
            assert addresses(request) == (await link.exchange(request)).values
        assert [is_probe(request) for request in peer.asked] == [True, False] * 3, (
            "a whole stray frame puts it in doubt"
        )
        await link.close()


@unnumbered_wires
async def test_a_line_that_never_falls_silent_holds_nobody_beyond_its_deadlines(wire: str) -> None:
    async def chatter(peer: Peer, number: int, request: Request, sound: bytes) -> bytes:
        async def speak() -> None:
            for _ in range(400):
                peer._writers[0].write(b"\x01\x03\x04\x00\x0a\x00\x0b")
                await asyncio.sleep(0.001)

        if number == 2:
            chatters.append(asyncio.create_task(speak()))
        return sound

    chatters: list[asyncio.Task[None]] = []
    async with Peer(wire, chatter) as peer:
        link = open_link(peer, wire, reply_timeout_ms=20)
        await link.exchange(TEN)
        for request in (FIVE_HUNDRED, SEVEN_HUNDRED):
            started = now_s()
            outcome = (await asyncio.gather(link.exchange(request), return_exceptions=True))[0]
            assert now_s() - started < 0.2
            assert isinstance(outcome, TransportError) or outcome.values == addresses(request)
        await link.close()
        chatters[0].cancel()


@all_wires
async def test_a_flood_of_garbage_ends_in_an_error_with_a_small_buffer(wire: str) -> None:
    async def flood(peer: Peer, number: int, request: Request, sound: bytes) -> bytes:
        return b"\x55\xaa\x03:" * 60_000

    async with Peer(wire, flood) as peer:
        link = open_link(peer, wire, reply_timeout_ms=150)
        with pytest.raises((FrameError, ReplyTimeoutError)):
            await link.exchange(TEN)
        assert link._engine.framing.kept < 2048
        assert link.figures.garbage_bytes >= 8192
        await link.close()


async def test_text_on_a_modbus_port_closes_the_connection_and_says_what_came() -> None:
    async def web_server(peer: Peer, number: int, request: Request, sound: bytes) -> bytes:
        return b"HTTP/1.1 400 Bad Request\r\n\r\n"

    async with Peer("tcp", web_server) as peer:
        link = open_link(peer, "tcp")
        with pytest.raises(FrameError, match="48 54 54 50") as caught:
            await link.exchange(TEN)
        assert "converter" in (caught.value.hint or "")
        await link.close()


async def test_the_window_is_filled_and_answers_may_come_in_any_order() -> None:
    waiting: list[bytes] = []

    async def backwards(peer: Peer, number: int, request: Request, sound: bytes) -> bytes | None:
        waiting.append(sound)
        if len(waiting) < 4:
            return None
        answer = b"".join(reversed(waiting))
        waiting.clear()
        return answer

    async with Peer("tcp", backwards) as peer:
        link = open_link(peer, "tcp", requests_in_flight_max=4)
        asked = [Read(1, Table.HOLDING, address, 2) for address in range(8)]
        replies = await asyncio.gather(*(link.exchange(request) for request in asked))
        assert [(address, address + 1) for address in range(8)] == [reply.values for reply in replies]
        await link.close()


async def test_one_request_is_in_flight_unless_more_are_allowed() -> None:
    most = 0

    async def count(peer: Peer, number: int, request: Request, sound: bytes) -> bytes:
        nonlocal most
        most = max(most, number - answered[0])
        await asyncio.sleep(0.001)
        answered[0] += 1
        return sound

    answered = [0]
    async with Peer("tcp", count) as peer:
        link = open_link(peer, "tcp")
        await asyncio.gather(*(link.exchange(TEN) for _ in range(8)))
        assert most == 1
        await link.close()


@all_wires
async def test_a_caller_that_goes_away_leaves_no_answer_behind(wire: str) -> None:
    async def slow(peer: Peer, number: int, request: Request, sound: bytes) -> bytes:
        await asyncio.sleep(0.01)
        return sound

    async with Peer(wire, slow) as peer:
        link = open_link(peer, wire)
        await link.exchange(SEVEN_HUNDRED)
        task = asyncio.create_task(link.exchange(TEN))
        await asyncio.sleep(0.002)
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task
        assert addresses(FIVE_HUNDRED) == (await link.exchange(FIVE_HUNDRED)).values
        await link.close()


async def test_pauses_are_kept() -> None:
    async with Peer("tcp", honest) as peer:
        link = open_link(peer, "tcp", pause_after_connect_ms=20, pause_between_requests_ms=10)
        started = now_s()
        first = await link.exchange(TEN)
        second = await link.exchange(TEN)
        assert first.sent_ns / 1e9 - started >= 0.02
        assert second.sent_ns - first.last_ns >= 10 * MILLISECOND
        await link.close()


async def test_nothing_listening_is_named_with_a_hint_and_the_first_cause_is_kept() -> None:
    async with Peer("tcp", honest) as peer:
        port = peer.port
    link = TcpLink("127.0.0.1", port, clock=PatientClock(), pacing=Pacing(reply_timeout_ms=20))
    for _ in range(3):
        with pytest.raises(LinkError, match=f"127.0.0.1:{port}") as caught:
            await link.exchange(TEN)
    assert isinstance(caught.value, ConnectionError)
    assert link.figures.first_cause == "connection refused"
    await link.close()


def test_what_the_system_says_of_a_connection_is_not_hidden_by_asyncio() -> None:
    unreachable = OSError(errno.EHOSTUNREACH, "Connect call failed ('192.0.2.10', 502)")
    assert "no connection (No route to host)" == _connect_failure(unreachable)[0]


async def test_the_link_is_back_when_its_peer_is() -> None:
    async with Peer("tcp", honest) as peer:
        port = peer.port
        link = open_link(peer, "tcp", reply_timeout_ms=200)
        await link.exchange(TEN)
    with pytest.raises(LinkError):
        await link.exchange(TEN)
    server = await asyncio.start_server(lambda r, w: Peer("tcp", honest)._serve(r, w), "127.0.0.1", port)
    reply = await first_reply(link)
    assert addresses(TEN) == reply.values
    await link.close()
    server.close()
    await server.wait_closed()


async def test_a_reset_connection_fails_the_request_at_once_and_is_made_again() -> None:
    """SO_LINGER 0 makes the peer send RST instead of FIN, as a PLC does that restarts."""

    async def reset_once(peer: Peer, number: int, request: Request, sound: bytes) -> bytes | None:
        if peer.connections == 1 and number == 2:
            sock = peer._writers[0].get_extra_info("socket")
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            peer.cut()
            return None
        return sound

    async with Peer("tcp", reset_once) as peer:
        link = open_link(peer, "tcp", reply_timeout_ms=5000)
        await link.exchange(TEN)
        with pytest.raises(LinkError, match=r"the connection went away \(.*reset"):
            await link.exchange(TEN)
        assert addresses(TEN) == (await link.exchange(TEN)).values
        assert 1 == link.figures.reconnects
        await link.close()


async def test_a_connection_that_is_idle_is_kept_alive_so_that_a_dead_peer_is_noticed() -> None:
    async with Peer("tcp", honest) as peer:
        link = open_link(peer, "tcp")
        await link.exchange(TEN)
        assert link._transport is not None
        sock = link._transport.get_extra_info("socket")
        assert 1 == sock.getsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE)
        # After 30 s of silence three questions, ten seconds apart.
        options = (socket.TCP_KEEPIDLE, socket.TCP_KEEPINTVL, socket.TCP_KEEPCNT)
        assert [30, 10, 3] == [sock.getsockopt(socket.IPPROTO_TCP, option) for option in options]
        await link.close()


async def test_closing_wakes_everybody_who_waits() -> None:
    async def silent(peer: Peer, number: int, request: Request, sound: bytes) -> None:
        return None

    async with Peer("tcp", silent) as peer:
        link = open_link(peer, "tcp", reply_timeout_ms=5000)
        tasks = [asyncio.create_task(link.exchange(TEN)) for _ in range(3)]
        await asyncio.sleep(0.01)
        await link.close()
        outcomes = await asyncio.gather(*tasks, return_exceptions=True)
        assert all(isinstance(outcome, LinkError) and "closed by us" in str(outcome) for outcome in outcomes)
