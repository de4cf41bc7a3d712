"""Loops on the fake PLC in random dialects, followed by a shadow of the same dialect: no execution may be convicted.

Run it as a program: `python tests/bench/bench_dialects.py [DIALECTS] [POLLS] [FIRST]`. It prints one line per loop
that was convicted wrongly, and the totals.
"""

from __future__ import annotations

import asyncio
import random
import sys
import time
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent.parent))

from dialects import random_dialect
from lockstep.bench_world import World

from ahgateway.core.dialect_axes import spelled
from ahgateway.core.verdict import Verdict
from ahgateway.lockstep.judge import Execution


def meddle(world: World, chance: random.Random) -> None:
    """What operators do: steps, manual and back, limits, band, gains, standstill."""
    if chance.random() > 0.04:
        return
    kind = chance.randrange(9)
    write = world.plc.write
    if kind < 3:
        write("L1", "SV", round(chance.uniform(30, 80), 1))
    elif kind == 3:
        write("L1", "MOUT", chance.uniform(-5, 110))
        write("L1", "PID_MAN", not world.plc.read("L1", "PID_MAN"))
    elif kind == 4:
        write("L1", "MV_MAX", chance.uniform(50, 100))
    elif kind == 5:
        write("L1", "ERR_DBW", chance.choice([0.0, 1.5, 4.0]))
    elif kind == 6:
        write("L1", "PID_RUN", not world.plc.read("L1", "PID_RUN"))
    elif kind == 7:
        write("L1", "MOUT_AUTO", not world.plc.read("L1", "MOUT_AUTO"))
    elif world.loop.controller.name == "DPIDE":
        name = chance.choice(["PID_EQ", "PID_DE"])
        write("L1", name, not world.plc.read("L1", name))


async def soak(name: str, seed: int, polls: int, dialect: Any) -> World:
    """Follow one loop in one dialect, with operators at work."""
    chance = random.Random(f"soak {seed}")
    gains = {"Kp": 1.3, "Ki": 0.37, "Kd": 0.11} if name == "DPID" else {"Kc_Kp": 1.3, "Ti_Ki": 0.7, "Td_Kd": 0.11}
    if name == "DPIDE":
        gains |= {"Tf": chance.choice([0.0, 0.21]), "BIAS": chance.choice([0.0, 3.3])}
    world = World(
        name, gains, seed=seed, cycle_ms=90, poll_ms=20, scan_ms=7, loop_changes={"dialect": dialect, "scan_ms_max": 10}
    )
    for _ in range(polls):
        meddle(world, chance)
        await world.poll()
    return world


def main() -> None:
    dialects, polls, first = (int(text) for text in (sys.argv[1:] + ["30", "600", "0"][len(sys.argv) - 1 :]))
    started, wrong, executions, proven = time.perf_counter(), 0, 0, 0
    for seed in range(first, first + dialects):
        dialect = random_dialect(seed, share=(seed % 4 + 1) / 4)
        for name in ("DPID", "DPIDE"):
            world = asyncio.run(soak(name, seed, polls, dialect))
            counts = world.follower.counts
            executions += world.plc.executed("L1")
            proven += counts.proven
            if counts.diverged:
                wrong += 1
                bad = next(e for _, e in world.events if isinstance(e, Execution) and e.verdict is Verdict.DIVERGED)
                sys.stdout.write(f"seed {seed} {name}: {counts.diverged} convicted, {bad.blame}\n")
                sys.stdout.write(f"   {spelled(dialect)}\n")
    took = time.perf_counter() - started
    sys.stdout.write(f"{wrong} loops convicted wrongly, {executions} executions, {proven} proven, {took:.0f} s\n")


if __name__ == "__main__":
    main()
