"""Politeness: commands before polls, a share of the line, closed when idle, no more connections than allowed."""

from __future__ import annotations

import asyncio
import os
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from conformance.patience import PatientClock, PatientLoop
from conformance.peers import CLIENT, SERVER, TinyPlc, serial_pair

from ahgateway.clock import MILLISECOND, VirtualClock, WallClock
from ahgateway.codec.access import Read, Request, Table, Write
from ahgateway.codec.station import Pacing
from ahgateway.errors import LinkError, ReplyTimeoutError
from ahgateway.transports.base import LinkFigures, Reply
from ahgateway.transports.engine import Engine, Limits
from ahgateway.transports.framing import Mbap
from ahgateway.transports.line import Line
from ahgateway.transports.machine_lock import Holder, MachineLock, take
from ahgateway.transports.responder import Responder
from ahgateway.transports.serial_link import SerialLink
from ahgateway.transports.serial_server import serve_serial
from ahgateway.transports.server import serve_tcp
from ahgateway.transports.slots import take_slot
from ahgateway.transports.tcp import TcpLink

LOOP = PatientLoop
POLL = Read(1, Table.INPUT, 1, 2)


class Slot:
    """Where an outcome goes."""

    def __init__(self) -> None:
        self.outcome: Reply | Exception | None = None

    def done(self) -> bool:
        return self.outcome is not None

    def set_result(self, reply: Reply, /) -> None:
        self.outcome = reply

    def set_exception(self, error: Exception, /) -> None:
        self.outcome = error


def engine(clock: VirtualClock, **limits: float) -> Engine:
    made = Engine(Mbap(), Limits(1000 * MILLISECOND, **limits), clock, LinkFigures(), "x")  # type: ignore[arg-type]
    made.connected(0)
    return made


def test_commands_go_before_the_polls_that_wait_in_their_own_order(clock: VirtualClock) -> None:
    plc, line = TinyPlc(), engine(clock)
    unit = Responder(plc, Mbap())
    asked = [POLL, Read(1, Table.INPUT, 3, 2), Write(1, Table.HOLDING, 5, (1,)), Write(1, Table.HOLDING, 6, (2,))]
    for request in asked:
        line.submit(request, Slot(), 0)
    while (frame := line.outgoing(0)) is not None:
        line.received(unit.feed(frame), 0)
    assert [asked[2], asked[3], asked[0], asked[1]] == plc.seen


def test_what_belongs_to_a_write_goes_before_polls_as_the_write_does(clock: VirtualClock) -> None:
    plc, line = TinyPlc(), engine(clock)
    unit = Responder(plc, Mbap())
    write, back = Write(1, Table.HOLDING, 5, (1,)), Read(1, Table.HOLDING, 5, 1, is_command=True)
    for request in (POLL, write, POLL, back):
        line.submit(request, Slot(), 0)
    while (frame := line.outgoing(0)) is not None:
        line.received(unit.feed(frame), 0)
    assert [write, back, POLL, POLL] == plc.seen


class Poller(Slot):
    """Asks again as soon as it has its answer, as the loops of a monitor do."""

    def __init__(self, line: Engine, clock: VirtualClock, unit: int, order: list[int]) -> None:
        super().__init__()
        self._line, self._clock, self._unit, self._order = line, clock, unit, order

    def ask(self) -> None:
        self._line.submit(Read(self._unit, Table.HOLDING, 0, 2), self, self._clock.now_ns())

    def done(self) -> bool:
        return False

    def set_result(self, reply: Reply, /) -> None:
        self._order.append(self._unit)
        self.ask()

    def set_exception(self, error: Exception, /) -> None:
        self._order.append(-self._unit)
        self.ask()


class AnyUnit(TinyPlc):
    """A TinyPlc behind every unit number."""

    def answer(self, request: Request) -> tuple[int, ...] | None:
        return super().answer(replace(request, unit=1))


@pytest.mark.parametrize("wire", ["rtu", "ascii"])
def test_units_on_one_line_take_turns_and_a_dead_one_costs_the_others_its_time_out_only(
    wire: str, clock: VirtualClock
) -> None:
    """Units 1 and 3 answer, 2 is dead; each asks again at once, unit 1 with two loops."""
    line = Engine(CLIENT[wire](), Limits(100 * MILLISECOND, quiet_ns=MILLISECOND), clock, LinkFigures(), "x")
    line.connected(0)
    units, order = Responder(AnyUnit(), SERVER[wire]()), list[int]()
    for unit in (1, 2, 1, 3):
        Poller(line, clock, unit, order).ask()
    while len(order) < 16:
        frame = line.outgoing(clock.now_ns())
        if frame is not None:
            asked = int(frame[1:3], 16) if wire == "ascii" else frame[0]
            clock.advance_ns(MILLISECOND)
            if asked != 2:
                line.received(units.feed(frame), clock.now_ns())
            continue
        wake_ns = line.wake_ns()
        assert wake_ns is not None
        clock.advance_ns(max(0, wake_ns - clock.now_ns()))
        line.tick(clock.now_ns())
    assert [1, -2, 1, 3] * 4 == order


def test_a_request_that_waited_too_long_is_refused_and_never_sent(clock: VirtualClock) -> None:
    plc, line = TinyPlc(), engine(clock, wait_max_ns=300 * MILLISECOND, pause_ns=MILLISECOND)
    unit = Responder(plc, Mbap())
    write = Write(1, Table.HOLDING, 5, (1,))
    first, second, third = Slot(), Slot(), Slot()
    line.submit(POLL, first, 0)
    frame = line.outgoing(0)
    line.submit(POLL, second, 100 * MILLISECOND)
    line.submit(write, third, 200 * MILLISECOND)
    assert 400 * MILLISECOND == line.wake_ns()
    line.tick(399 * MILLISECOND)
    assert not second.done()
    line.tick(400 * MILLISECOND)
    assert isinstance(second.outcome, ReplyTimeoutError)
    assert (
        "x: waited 300 ms for its turn and was not sent: read 2 input registers from 0x0001 of unit 1"
        == second.outcome.message
    )
    line.tick(500 * MILLISECOND)
    assert isinstance(third.outcome, ReplyTimeoutError)
    assert "was not sent: write 1 holding register to 0x0005 of unit 1" in third.outcome.message
    assert frame is not None
    line.received(unit.feed(frame), 600 * MILLISECOND)
    assert isinstance(first.outcome, Reply), "what was sent has its own time-out"
    assert line.outgoing(700 * MILLISECOND) is None
    assert [POLL] == plc.seen


@pytest.mark.parametrize("wire", ["tcp", "rtu"])
async def test_the_profile_s_deadline_holds_on_a_link(wire: str) -> None:
    """The first request makes the line pause for longer than the second may wait."""
    plc = TinyPlc()
    server = await serve_tcp(plc, framing=SERVER[wire])
    pacing = Pacing(pause_between_requests_ms=5000, request_wait_max_ms=30)
    link = TcpLink(
        "127.0.0.1", server.port, clock=PatientClock(), pacing=pacing, framing=CLIENT[wire], quiet_ns=MILLISECOND
    )
    if wire == "tcp":
        await link.exchange(POLL)
    before = len(plc.seen)
    with pytest.raises(
        ReplyTimeoutError, match=r"waited \d+ ms for its turn and was not sent: write 1 holding"
    ) as caught:
        await asyncio.gather(link.exchange(Write(1, Table.HOLDING, 5, (1,))))
    assert "request_wait_max_ms" in str(caught.value.hint)
    assert [] == [request for request in plc.seen[before:] if isinstance(request, Write)]
    await link.close()
    await server.close()


@pytest.mark.parametrize(("share", "rest_ms"), [(1.0, 0), (0.5, 20), (0.25, 60), (0.1, 180)])
def test_the_line_rests_after_each_reply_as_its_share_says(clock: VirtualClock, share: float, rest_ms: int) -> None:
    line, unit = engine(clock, share=share), Responder(TinyPlc(), Mbap())
    line.submit(POLL, Slot(), 0)
    line.submit(POLL, Slot(), 0)
    frame = line.outgoing(0)
    assert frame is not None
    line.received(unit.feed(frame), 20 * MILLISECOND)
    assert (20 + rest_ms) * MILLISECOND == max(20 * MILLISECOND, line.wake_ns() or 0)
    assert line.outgoing((20 + rest_ms) * MILLISECOND) is not None
    assert rest_ms == 0 or line.outgoing((19 + rest_ms) * MILLISECOND) is None


async def test_a_request_whose_caller_gave_up_is_not_sent() -> None:
    plc = TinyPlc()
    server = await serve_tcp(plc)
    link = TcpLink("127.0.0.1", server.port, clock=PatientClock(), pacing=Pacing(pause_between_requests_ms=40))
    await link.exchange(POLL)
    with pytest.raises(TimeoutError):
        async with asyncio.timeout(0.005):
            await link.exchange(Write(1, Table.HOLDING, 5, (1,)))
    await link.exchange(POLL)
    assert [POLL, POLL] == plc.seen
    await link.close()
    await server.close()


@pytest.mark.parametrize("wire", ["tcp", "rtu", "ascii"])
async def test_an_idle_connection_is_closed_and_made_again_when_it_is_needed(wire: str) -> None:
    server = await serve_tcp(TinyPlc(), framing=SERVER[wire])
    pacing = Pacing(close_when_idle_ms=40)
    link = TcpLink(
        "127.0.0.1", server.port, clock=PatientClock(), pacing=pacing, framing=CLIENT[wire], quiet_ns=MILLISECOND
    )
    for _ in range(2):
        assert (7, 14) == (await link.exchange(POLL)).values
        assert 1 == server.connections
        for _ in range(400):
            if not server.connections:
                break
            await asyncio.sleep(0.005)
        assert 0 == server.connections
    assert (0, "") == (link.figures.reconnects, link.figures.first_cause)
    await link.close()
    await server.close()


async def test_a_connection_in_use_is_not_closed() -> None:
    server = await serve_tcp(TinyPlc())
    link = TcpLink("127.0.0.1", server.port, clock=PatientClock(), pacing=Pacing(close_when_idle_ms=40))
    since = (await link.exchange(POLL)).aligned_since_ns
    for _ in range(20):
        await asyncio.sleep(0.005)
        assert since == (await link.exchange(POLL)).aligned_since_ns, "still the first connection"
    await link.close()
    await server.close()


async def test_an_idle_serial_port_is_released_for_others() -> None:
    async with serial_pair() as (plc_end, our_end):
        held = os.open(our_end, os.O_RDWR | os.O_NOCTTY)  # socat ends when nobody has its terminal open
        server = await serve_serial(TinyPlc(), Line(plc_end, 115200))
        first, second = (
            SerialLink(Line(our_end, 115200, "N"), clock=WallClock(), pacing=Pacing(close_when_idle_ms=idle_ms))
            for idle_ms in (1500, 0)
        )
        assert (7, 14) == (await first.exchange(POLL)).values
        with pytest.raises(LinkError, match="port is busy"):
            await second.exchange(POLL)
        async with asyncio.timeout(30):
            while True:
                try:
                    assert (7, 14) == (await second.exchange(POLL)).values
                    break
                except LinkError:
                    await asyncio.sleep(0.05)
        await second.close()
        assert (7, 14) == (await first.exchange(POLL)).values
        assert 0 == first.figures.reconnects
        await first.close()
        await server.close()
        os.close(held)


async def test_one_connection_more_than_allowed_is_refused_here() -> None:
    server = await serve_tcp(TinyPlc())
    links = [
        TcpLink("127.0.0.1", server.port, clock=PatientClock(), pacing=Pacing(connections_max=2)) for _ in range(3)
    ]
    for link in links[:2]:
        await link.exchange(POLL)
    with pytest.raises(LinkError, match="2 connections to it from this machine, as many as the pacing allows"):
        await links[2].exchange(POLL)
    await links[0].close()
    assert (7, 14) == (await links[2].exchange(POLL)).values
    for link in links:
        await link.close()
    await server.close()


HOLDER = """
import asyncio, sys
from ahgateway.clock import WallClock
from ahgateway.codec.access import Read, Table
from ahgateway.transports.tcp import TcpLink

async def hold():
    link = TcpLink("127.0.0.1", int(sys.argv[1]), clock=WallClock())
    await link.exchange(Read(1, Table.INPUT, 1, 2))
    print("holds", flush=True)
    await asyncio.sleep(60)

asyncio.run(hold())
"""


@pytest.mark.slow
async def test_connections_of_another_process_count_until_it_is_killed() -> None:
    server = await serve_tcp(TinyPlc())
    link = TcpLink("127.0.0.1", server.port, clock=PatientClock(), pacing=Pacing(connections_max=1))
    holder = await asyncio.create_subprocess_exec(
        sys.executable, "-c", HOLDER, str(server.port), stdout=asyncio.subprocess.PIPE
    )
    assert holder.stdout is not None
    assert b"holds\n" == await holder.stdout.readline()
    said = rf"1 connection to it from this machine, as many as the pacing allows \(process {holder.pid}\)"
    with pytest.raises(LinkError, match=said) as caught:
        await link.exchange(POLL)
    assert "connections_max" in str(caught.value.hint)
    holder.kill()
    await holder.wait()
    assert (7, 14) == (await link.exchange(POLL)).values
    await link.close()
    await server.close()


def test_a_lock_whose_file_was_removed_meanwhile_is_taken_on_a_new_one(tmp_path: Path) -> None:
    """Two of one name exclude each other also when the first goes away between the other's opening and locking."""
    first = take(tmp_path / "slot.lock", who="first")
    assert isinstance(first, MachineLock)
    assert Holder(os.getpid(), "first") == take(tmp_path / "slot.lock")
    first.release(removes=True)
    assert not (tmp_path / "slot.lock").exists()
    second = take(tmp_path / "slot.lock", who="second")
    assert isinstance(second, MachineLock)
    assert Holder(os.getpid(), "second") == take(tmp_path / "slot.lock")
    first.release(removes=True)
    assert (tmp_path / "slot.lock").exists(), "what is not ours any more is not removed"
    second.release()


def test_without_a_place_for_locks_the_error_says_where_it_looked(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("no directory")
    monkeypatch.setenv("XDG_STATE_HOME", str(blocked))
    monkeypatch.setattr("tempfile.tempdir", str(blocked))
    with pytest.raises(LinkError, match=r"connections cannot be counted: .*file/ahgateway: Not a directory; "):
        take_slot("192.0.2.1", 502, 8, "modbus+tcp://192.0.2.1:502")
