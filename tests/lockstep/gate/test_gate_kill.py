"""Killed at any moment: what stands in the PLC is as found, or the next start puts it back.

`Cut` goes through everything like a killed process: no `except` and no `finally` of the gate may reach the PLC after
it, which the dead link makes sure of.
"""

from __future__ import annotations

import asyncio
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from lockstep.gate.gate_world import Cut, FailingLink, GateWorld, is_write

from ahgateway.clock import WallClock
from ahgateway.lockstep.gate.gate import Gate
from ahgateway.lockstep.gate.journal import verify
from ahgateway.lockstep.gate.states import State
from ahgateway.transports.server import serve_tcp
from ahgateway.transports.tcp import TcpLink

KILL = getattr(signal, "SIGKILL", signal.SIGTERM)
"""Windows ends a process at once with either."""

OPERANDS = ("SV", "MV_MAX", "MV_MIN", "PID_MAN", "MOUT")
AS_FOUND = [0x42480000, 0x42C80000, 0, False, 0]
"""50.0, 100.0, 0.0, automatic, 0.0."""


async def sequence(gate: Gate) -> None:
    """Registers together, into manual, a step, back, put back: every kind of write and every order."""
    async with gate.armed("sequence"):
        await gate.write({"SV": 52.5})
        await gate.write({"MV_MAX": 90.0, "MV_MIN": 5.0})
        await gate.write({"PID_MAN": True})
        mout = float(gate.link.inner.plc.read("L1", "MOUT"))
        await gate.write({"MOUT": mout + 2.0})
        await gate.write({"PID_MAN": False})


def killed_at(number: int, when: str, only_writes: bool):
    count = 0
    is_dead = False

    def at(moment: str, request) -> None:
        nonlocal count, is_dead
        if is_dead:
            raise Cut
        if moment != when or (only_writes and not is_write(request)):
            return
        count += 1
        if count == number:
            is_dead = True
            raise Cut

    return at


async def run_until(folder: Path, number: int, when: str, only_writes: bool = True) -> GateWorld | None:
    """Run the sequence with a kill; None when it had no such moment any more."""
    world = GateWorld(folder)
    gate = world.gate(FailingLink(world.link, killed_at(number, when, only_writes)))
    try:
        await sequence(gate)
    except Cut:
        gate._papers.close()  # the operating system gives a dead process's lock back
        return world
    return None


@pytest.mark.parametrize("when", ["before", "behind"])
async def test_killed_around_any_write_the_next_start_puts_everything_back(tmp_path, when: str) -> None:
    number = 0
    while (world := await run_until(tmp_path / str(number), number + 1, when)) is not None:
        number += 1
        async with world.gate().armed("next start") as gate:
            assert AS_FOUND == world.holds(*OPERANDS), number
            assert gate.state is State.ARMED
        assert AS_FOUND == world.holds(*OPERANDS)
        assert "" == verify(gate.path).fault
    assert number == 9  # 6 of the sequence; SV, both limits and MOUT of the way back


async def test_killed_in_the_middle_of_putting_back_and_again(tmp_path) -> None:
    world = await run_until(tmp_path, 5, "behind")
    assert world is not None
    second = world.gate(FailingLink(world.link, killed_at(1, "behind", True)))
    with pytest.raises(Cut):
        await second.arm("second start")
    second._papers.close()
    async with world.gate().armed("third start"):
        assert AS_FOUND == world.holds(*OPERANDS)


@pytest.mark.parametrize("times", [1, 2])
async def test_a_first_end_while_putting_back_waits_until_that_is_done_and_a_second_does_not(tmp_path, times: int):
    world, reads = GateWorld(tmp_path), []

    class Link(FailingLink):
        async def exchange(self, request):
            if gate.state is State.RESTORING and len(reads) < times:
                reads.append(request)
                task.cancel()
            await asyncio.sleep(0)
            return await self.inner.exchange(request)

    async def work() -> None:
        async with gate.armed("there and back"):
            await gate.write({"SV": 52.5})

    gate = world.gate(Link(world.link, lambda moment, request: None))
    task = asyncio.ensure_future(work())
    with pytest.raises(asyncio.CancelledError):
        await task
    assert (times == 1) == (AS_FOUND == world.holds(*OPERANDS))
    async with world.gate().armed("next start"):
        assert AS_FOUND == world.holds(*OPERANDS)


async def test_killed_and_then_an_operator_takes_over(tmp_path) -> None:
    """He finds the loop in manual, moves MOUT, and finds it as he left it after the next start."""
    world = await run_until(tmp_path, 4, "behind")
    assert world is not None
    assert [True] == world.holds("PID_MAN")
    world.plc.write("L1", "MOUT", 33.0, who="operator")
    before = len(world.sent())
    restored = await world.gate().recover()
    assert restored is not None
    assert restored.is_taken_over
    assert before == len(world.sent())
    assert [0x42040000, True] == world.holds("MOUT", "PID_MAN")


async def test_the_log_of_the_plc_shows_no_write_outside_the_list(tmp_path) -> None:
    allowed = {("HOLDING", 100), ("HOLDING", 118), ("COIL", 2), ("HOLDING", 122)}
    number = 0
    while (world := await run_until(tmp_path / str(number), 13 * number + 1, "before", only_writes=False)) is not None:
        number += 1
        async with world.gate().armed("next start"):
            pass
        assert {(table, address) for table, address, _ in world.sent()} <= allowed
    assert number > 3


TESTS = Path(__file__).parents[2]
CHILD = """
import sys
from pathlib import Path
sys.path.insert(0, sys.argv[4])
from lockstep.gate.test_gate_kill import killed_in_child
killed_in_child(Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]))
"""


def killed_in_child(folder: Path, port: int, number: int) -> None:
    """Run in a process of its own: the gate over TCP, killed for real before its n-th write is acknowledged."""

    async def main() -> None:
        world = GateWorld(folder / "own")
        clock = WallClock()
        link = TcpLink("127.0.0.1", port, clock=clock)
        count = 0

        class Killing:
            target, figures = link.target, link.figures

            async def exchange(self, request):
                nonlocal count
                reply = await link.exchange(request)
                count += is_write(request)
                if count == number:
                    os.kill(os.getpid(), KILL)
                return reply

        gate = Gate(world.station, world.loop, Killing(), clock, folder / "journal", who="child")
        async with gate.armed("killed"):
            await gate.write({"SV": 52.5})
            await gate.write({"PID_MAN": True})

    asyncio.run(main())


@pytest.mark.slow
@pytest.mark.parametrize("number", [1, 3])
async def test_kill_minus_9_of_a_real_process(tmp_path, number: int) -> None:
    world = GateWorld(tmp_path / "world")
    server = await serve_tcp(world.plc, "127.0.0.1", 0, clock=WallClock())
    child = await asyncio.create_subprocess_exec(
        sys.executable, "-c", CHILD, str(tmp_path), str(server.port), str(number), str(TESTS), stderr=subprocess.PIPE
    )
    _, said = await child.communicate()
    await server.close()
    assert child.returncode != 0
    assert b"Error" not in said, said.decode()
    assert AS_FOUND != world.holds(*OPERANDS)
    gate = Gate(world.station, world.loop, world.link, world.clock, tmp_path / "journal")
    async with gate.armed("next start"):
        assert AS_FOUND == world.holds(*OPERANDS)
