"""Step 5 does no harm: killed at any of its writes, or met by an operator at any moment."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from apps.commission_bench import ALLOWED, Bench

from ahgateway.apps.commission import wiring
from ahgateway.clock import SECOND
from ahgateway.codec.access import Request, Write
from ahgateway.codec.devices import parse_device
from ahgateway.lockstep.gate.gate import Gate
from ahgateway.lockstep.gate.scratch import MARKER, SCRATCH

NAMES = ("SV", "PID_MAN", "MOUT", "MV_MAX", "MV_MIN")
BOUNDS = wiring.Envelope(5.0, 30.0, 90.0, answer_ns=2 * SECOND, total_ns=120 * SECOND)


class Killed(BaseException):
    """The process ends here; nothing that it would still do reaches the PLC."""


async def gate_of(bench: Bench) -> Gate:
    return Gate(bench.station, bench.loop(), await bench.open(bench.station), bench.clock, bench.folder / "gates")


async def prove(bench: Bench, gate: Gate) -> wiring.Proof:
    return await wiring.prove(gate, bench.station, bench.loop(), gate.link, bench.clock, BOUNDS)


def values(bench: Bench) -> list[Any]:
    return [float(bench.plc.read("L", name)) for name in NAMES]


def kill_at(bench: Bench, number: int) -> None:
    """Kill before the n-th write leaves; before it is behind the one before."""
    count = 0
    is_dead = False

    def kill(request: Request) -> None:
        nonlocal count, is_dead
        count += isinstance(request, Write)
        is_dead = is_dead or count >= number
        if is_dead:
            raise Killed

    bench.effects.append(kill)


@pytest.mark.slow
async def test_killed_at_any_write_of_step_5_the_next_start_finds_or_makes_everything_as_found(tmp_path: Path) -> None:
    number = 0
    while True:
        number += 1
        bench = Bench(tmp_path / str(number))
        found = values(bench)
        kill_at(bench, number)
        gate = await gate_of(bench)
        try:
            await prove(bench, gate)
        except Killed:
            gate._papers.close()  # the operating system gives a dead process's lock back
        else:
            break
        bench.effects.clear()
        async with (await gate_of(bench)).armed("next start"):
            assert found == values(bench), number
        assert bench.touched() <= ALLOWED
    assert number >= 13, "into manual, two steps and back, two limits and back, out of manual, MOUT"


async def test_killed_at_the_marker_the_next_start_takes_it_away(tmp_path: Path) -> None:
    for number in (1, 2):
        bench = Bench(tmp_path / str(number), changes={"scratch": parse_device("D900")})
        kill_at(bench, number)
        gate = await gate_of(bench)
        with pytest.raises(Killed):
            async with gate.armed("marker"):
                await gate.write({SCRATCH: MARKER})
        gate._papers.close()
        bench.effects.clear()
        place = bench.station.devices.address(parse_device("D900"))
        async with (await gate_of(bench)).armed("next start"):
            assert (0, 0) == bench.plc.memory.read(place.table, place.address, 2)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("operand", "value"), [("MOUT", 33.0), ("PID_MAN", False), ("MV_MAX", 77.0), ("PID_RUN", False)]
)
async def test_whatever_an_operator_sets_at_any_moment_stays(tmp_path: Path, operand: str, value: float | bool) -> None:
    """He acts while the loop is in manual by our hand, at seven moments from its beginning to its end."""
    for tenths in (1, 9, 23, 41, 58, 83, 97):
        bench = Bench(tmp_path / str(tenths))
        acted = []

        def act(plc, bench=bench, acted=acted, tenths=tenths) -> None:
            if plc.read("L", "PID_MAN") and not acted:
                acted.append("seen")
                plc.at(plc.now_ns + tenths * SECOND // 10, take)
            elif not acted:
                plc.at(plc.now_ns + 1, act)

        def take(plc, acted=acted) -> None:
            if plc.read("L", "PID_MAN"):
                plc.write("L", operand, value, who="operator")
                acted.append("taken")

        bench.plc.at(0, act)
        gate = await gate_of(bench)
        proof = await prove(bench, gate)
        if "taken" in acted:
            assert value == bench.plc.read("L", operand), tenths
            checks = {check.name: check.outcome.value for check in proof.checks}
            assert "fail" in (checks["taken-over"], checks["not-written"], checks["clamp-ignored"]), (tenths, checks)
        assert bench.touched() <= ALLOWED
