"""The lease in the PLC: it guards while the gate beats, puts the loop back when the beat stops, and knows one owner.

The fake PLC runs the very text that `plc-code heartbeat` writes. From D700 on: D703 OWNER, D706 EXPIRED, D707 RESULT.
"""

from __future__ import annotations

import asyncio
import os
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from lockstep.gate.gate_world import Cut, FailingLink, GateWorld, is_write

from ahgateway.clock import MILLISECOND, SECOND, WallClock
from ahgateway.codec.access import Table
from ahgateway.codec.devices import parse_device
from ahgateway.codec.station import LeaseSpec
from ahgateway.errors import LinkError, StateError
from ahgateway.lockstep.gate.gate import Gate
from ahgateway.lockstep.gate.journal import verify
from ahgateway.lockstep.gate.states import State
from ahgateway.transports.server import serve_tcp
from ahgateway.transports.tcp import TcpLink

LEASE = LeaseSpec(parse_device("D700"), timeout_ms=2000, task_ms=100)
NAMES = ("SV", "MV_MAX", "MV_MIN", "PID_MAN", "MOUT", "CYCLE")
AS_FOUND = [0x42480000, 0x42C80000, 0, False, 0, 100]
"""50.0, 100.0, 0.0, automatic, 0.0, 100 ms."""
OWNER, CALLS, EXPIRED, RESULT, ALIVE = 703, 705, 706, 707, 708


class LeasedWorld(GateWorld):
    def __init__(self, folder: Path, initial=None, **changes) -> None:
        super().__init__(folder, initial, loop_changes={"lease": LEASE, **changes.pop("loop_changes", {})}, **changes)

    def word(self, number: int) -> int:
        return self.plc.memory.read(Table.HOLDING, number, 1)[0]

    def later(self, seconds: float) -> None:
        """Let the PLC go on alone."""
        self.clock.advance_ns(round(seconds * SECOND))
        self.plc.advance(self.clock.now_ns() - self.plc.now_ns)

    def operands_sent(self) -> set[tuple[str, int]]:
        return {(table, address) for table, address, _ in self.sent() if not (table == "HOLDING" and address >= 700)}


@pytest.fixture
def world(tmp_path) -> LeasedWorld:
    return LeasedWorld(tmp_path)


async def written(gate: Gate) -> None:
    """Every kind of operand: a REAL, a DINT, two limits at once, a flag with its manual value."""
    await gate.write({"SV": 52.5, "CYCLE": 200})
    await gate.write({"MV_MAX": 90.0, "MV_MIN": 5.0})
    await gate.write({"PID_MAN": True})


async def vanishing(world: LeasedWorld, work) -> Gate:
    """Arm, work, and be gone without putting anything back; the system frees a dead process's lock."""
    gate = world.gate()
    await gate.arm("test")
    await work(gate)
    gate._papers.close()
    return gate


async def setpoint(gate: Gate) -> None:
    await gate.write({"SV": 52.5, "CYCLE": 200})


async def test_while_it_beats_the_lease_lasts_and_at_the_end_it_is_given_back(world: LeasedWorld) -> None:
    async with world.gate().armed("test") as gate:
        assert 1 <= world.word(OWNER) <= 30_000
        await gate.write({"SV": 52.5})
        for _ in range(30):
            await gate.pause(SECOND)
            assert world.word(CALLS) <= 8
        assert [0x42520000] == world.holds("SV")
    assert [0, 0] == [world.word(OWNER), world.word(EXPIRED)]
    assert AS_FOUND == world.holds(*NAMES)
    world.later(10)
    assert 0 == world.word(EXPIRED)


async def test_when_the_gateway_vanishes_the_plc_puts_everything_back_in_time(world: LeasedWorld) -> None:
    gate = await vanishing(world, written)
    held = world.holds(*NAMES)
    assert [0x42520000, 0x42B40000, 0x40A00000, True, 200] == [*held[:4], held[5]]
    world.later(1.9 - (world.clock.now_ns() - gate._guard._beaten_ns) / SECOND)
    assert held == world.holds(*NAMES)
    world.later(0.3)
    assert AS_FOUND == world.holds(*NAMES)
    assert [0, 1] == [world.word(OWNER), world.word(RESULT)]


async def test_what_somebody_else_changed_the_plc_leaves_alone(world: LeasedWorld) -> None:
    await vanishing(world, setpoint)
    world.plc.write("L1", "SV", 60.0, who="operator")
    world.later(3)
    assert [0x42700000, 100] == world.holds("SV", "CYCLE")


@pytest.mark.parametrize(
    ("operand", "value"), [("MOUT", 33.0), ("PID_MAN", False), ("PID_RUN", False), ("PID_MODE", 1)]
)
async def test_an_operator_who_took_over_is_not_overwritten_by_the_plc(world: LeasedWorld, operand, value) -> None:
    await vanishing(world, written)
    world.plc.write("L1", operand, value, who="operator")
    held = world.holds("SV", "MV_MAX", "PID_MAN", "MOUT", "CYCLE")
    world.later(3)
    assert 2 == world.word(RESULT)
    assert held == world.holds("SV", "MV_MAX", "PID_MAN", "MOUT", "CYCLE")


async def test_a_second_gateway_is_refused_by_the_owner_word_that_beats(world: LeasedWorld, tmp_path) -> None:
    """Another laptop: it has a directory of its own, so that no lock of this machine tells them apart."""
    async with world.gate().armed("first") as gate:
        owner = world.word(OWNER)
        other = Gate(world.station, world.loop, world.link, world.clock, tmp_path / "other", who="second")
        beats = asyncio.ensure_future(_beating(gate, world))
        with pytest.raises(StateError, match=f"owner word {owner} stands in the lease at D703 of the PLC, and beats"):
            await other.arm("second")
        await beats
        assert State.ARMED is gate.state
        await gate.write({"SV": 52.5})
    async with other.armed("second"):
        assert owner != world.word(OWNER)


async def _beating(gate: Gate, world: LeasedWorld) -> None:
    for _ in range(40):
        await gate.check()
        await asyncio.sleep(0)


async def test_of_two_claims_in_one_call_the_plc_grants_one(world: LeasedWorld) -> None:
    """Words by hand: both write CLAIM before the snippet is called; the later one has it, and the other sees so."""
    world.plc.memory.write(Table.HOLDING, 700, (111, 111, 1))
    world.plc.memory.write(Table.HOLDING, 700, (222, 222, 1))
    world.later(0.2)
    assert [222, 0] == [world.word(OWNER), world.word(700)]
    world.plc.memory.write(Table.HOLDING, 700, (111,))
    world.later(0.2)
    assert [222, 0] == [world.word(OWNER), world.word(700)]


async def test_the_lease_of_a_gateway_that_died_is_waited_for(world: LeasedWorld, tmp_path) -> None:
    await vanishing(world, setpoint)
    begun_ns = world.clock.now_ns()
    other = Gate(world.station, world.loop, world.link, world.clock, tmp_path / "other", who="second")
    async with other.armed("second"):
        assert world.clock.now_ns() - begun_ns < 3 * SECOND


async def test_a_plc_without_the_snippet_is_not_armed(world: LeasedWorld) -> None:
    world.plc.snippets.clear()
    with pytest.raises(StateError, match="the lease at D700 stands still: the PLC does not run its snippet") as caught:
        await world.gate().arm("test")
    assert "plc-code heartbeat" in str(caught.value.hint)
    assert [] == world.sent()


async def test_a_snippet_made_from_another_profile_is_not_armed(world: LeasedWorld) -> None:
    world.loop = replace(world.loop, lease=replace(LEASE, timeout_ms=3000))
    with pytest.raises(
        StateError, match=r"has layout \d+, the profile gives \d+: the snippet in the PLC was made from"
    ):
        await world.gate().arm("test")
    assert [] == world.sent()


async def test_a_beat_that_comes_too_late_ends_the_arming_cleanly(world: LeasedWorld) -> None:
    gate = world.gate()
    with pytest.raises(
        StateError, match=r"no beat for \d\S* s, the lease ends after 2 s: the PLC has put the loop back"
    ):
        async with gate.armed("test"):
            await written(gate)
            world.later(5)
            await gate.write({"SV": 54.0})
    assert State.DISARMED is gate.state
    assert AS_FOUND == world.holds(*NAMES)
    assert "put-back" in [record["kind"] for record in verify(gate.path).records]


async def test_a_link_that_is_lost_for_longer_than_the_lease_is_no_takeover(world: LeasedWorld) -> None:
    gate = world.gate()
    async with gate.armed("test"):
        await written(gate)
        gone_ns = world.clock.now_ns() + 10 * SECOND

        def gone(when: str, request) -> None:
            if world.clock.now_ns() < gone_ns:
                raise LinkError("unplugged")

        gate._wire.link._link = FailingLink(world.link, gone)
    assert State.DISARMED is gate.state
    assert AS_FOUND == world.holds(*NAMES)
    assert 1 == world.word(RESULT)


async def test_what_is_kept_stays_when_the_lease_is_over(world: LeasedWorld) -> None:
    async with world.gate().armed("test", keep=True) as gate:
        await gate.write({"SV": 52.5})
    world.later(10)
    assert [0x42520000] == world.holds("SV")
    assert [0, 0] == [world.word(OWNER), world.word(EXPIRED)]


async def test_what_cannot_be_given_back_is_not_called_kept(world: LeasedWorld) -> None:
    """The PLC would undo it, so that the gate does, and says so."""
    gate = world.gate()
    lost = []

    def lose(when: str, request) -> None:
        if when == "before" and is_write(request) and request.address == 701 and request.values[1] == 0 and not lost:
            lost.append(request)
            raise LinkError("unplugged")

    gate._wire.link._link = FailingLink(world.link, lose)
    with pytest.raises(LinkError):
        async with gate.armed("test", keep=True):
            await gate.write({"SV": 52.5})
    assert AS_FOUND == world.holds(*NAMES)
    assert ["restored"] == [record["how"] for record in verify(gate.path).records if record["kind"] == "ended"]


def cut_at(number: int, when: str = "behind"):
    count = 0

    def at(moment: str, request) -> None:
        nonlocal count
        count += moment == when and is_write(request)
        if count >= number:
            raise Cut

    return at


@pytest.mark.parametrize("initial", [{}, {"MOUT_AUTO": True}], ids=["MOUT stands", "MOUT follows"])
async def test_killed_around_any_request_the_plc_alone_puts_everything_back(tmp_path, initial) -> None:
    """No next start: the PLC does it. Slots, claims and beats count as requests here; before one is behind another."""
    number = 0
    while True:
        number += 1
        world = LeasedWorld(tmp_path / str(number), initial, scan_ms=20)
        found = world.holds(*NAMES)
        gate = world.gate(FailingLink(world.link, cut_at(number)))
        try:
            async with gate.armed("killed"):
                await written(gate)
                held = float(world.plc.read("L1", "MOUT"))
                await gate.write({"MOUT": held + 2.0})
        except Cut:
            gate._papers.close()
        else:
            break
        world.later(2.5)
        left = world.holds(*NAMES)
        if initial:  # MOUT follows MV in automatic
            left[4] = found[4] = 0
        assert found == left, number
        assert 0 == world.word(OWNER)
        async with world.gate().armed("next start") as after:
            assert after.state is State.ARMED
        assert "" == verify(after.path).fault
    assert number > 15


async def test_the_next_start_takes_its_own_lease_up_again(tmp_path) -> None:
    """Killed and started at once: nobody waits for the lease of the dead one to end."""
    world = LeasedWorld(tmp_path)
    gate = world.gate(FailingLink(world.link, cut_at(8)))
    with pytest.raises(Cut):
        async with gate.armed("killed"):
            await written(gate)
    gate._papers.close()
    owner, begun_ns = world.word(OWNER), world.clock.now_ns()
    assert owner
    restored = await world.gate().recover()
    assert restored.is_clean
    assert AS_FOUND == world.holds(*NAMES)
    assert world.clock.now_ns() - begun_ns < 1500 * MILLISECOND
    assert [0, 0] == [world.word(OWNER), world.word(EXPIRED)]


async def test_putting_back_needs_no_snippet(tmp_path) -> None:
    world = LeasedWorld(tmp_path)
    async with world.gate().armed("test", keep=True) as gate:
        await gate.write({"SV": 52.5})
    world.plc.snippets.clear()
    restored = await world.gate().recover()
    assert restored.is_clean
    assert AS_FOUND == world.holds(*NAMES)


async def test_outside_the_block_only_what_is_listed_is_written(world: LeasedWorld) -> None:
    async with world.gate().armed("test") as gate:
        await written(gate)
    assert {
        ("HOLDING", 100),
        ("HOLDING", 106),
        ("HOLDING", 118),
        ("COIL", 2),
        ("HOLDING", 122),
    } == world.operands_sent()
    block = {address for table, address, _ in world.sent() if table == "HOLDING" and address >= 700}
    assert max(block) < 700 + 10 + 4 * 3 + 7 * 8 + 7


async def test_a_plc_that_restarts_keeps_or_loses_the_lease_with_its_registers(world: LeasedWorld) -> None:
    await vanishing(world, written)
    world.plc.restart(is_retained=True)
    world.later(3)
    assert AS_FOUND[:3] == world.holds("SV", "MV_MAX", "MV_MIN")


TESTS = Path(__file__).parents[2]
CHILD = """
import sys
from pathlib import Path
sys.path.insert(0, sys.argv[3])
from lockstep.gate.test_gate_plc_lease import vanish_in_child
vanish_in_child(Path(sys.argv[1]), int(sys.argv[2]))
"""
KILL = getattr(signal, "SIGKILL", signal.SIGTERM)


def vanish_in_child(folder: Path, port: int) -> None:
    """Run in a process of its own: write over TCP, then kill it for real while it is armed."""

    async def main() -> None:
        world = LeasedWorld(folder / "own")
        clock = WallClock()
        link = TcpLink("127.0.0.1", port, clock=clock)
        gate = Gate(world.station, world.loop, link, clock, folder / "journal", who="child")
        async with gate.armed("killed"):
            await written(gate)
            os.kill(os.getpid(), KILL)

    asyncio.run(main())


@pytest.mark.slow
async def test_kill_minus_9_over_a_socket_and_the_plc_puts_the_loop_back(tmp_path) -> None:
    """The child lives in real time and the PLC with it; behind the kill only the PLC's own time goes on."""
    world = LeasedWorld(tmp_path / "world")
    wall = WallClock()
    origin_ns = wall.now_ns() - world.clock.now_ns()

    class InTime:
        """The PLC, kept in step with the wall clock while the child speaks to it."""

        def answer(self, request):
            behind_ns = wall.now_ns() - origin_ns - world.clock.now_ns()
            world.clock.advance_ns(max(0, behind_ns))
            return world.plc.answer(request)

    server = await serve_tcp(InTime(), "127.0.0.1", 0, clock=wall)
    child = await asyncio.create_subprocess_exec(
        sys.executable, "-c", CHILD, str(tmp_path), str(server.port), str(TESTS), stderr=subprocess.PIPE
    )
    _, said = await child.communicate()
    await server.close()
    assert child.returncode != 0
    assert b"Error" not in said, said.decode()
    assert AS_FOUND != world.holds(*NAMES)
    world.later(2.5)
    assert AS_FOUND == world.holds(*NAMES)
    assert [0, 1] == [world.word(OWNER), world.word(RESULT)]
