"""Soak of the judge: ten million executions in virtual time, with operators who meddle; no false verdict.

    python tests/bench/soak_lockstep.py [POLLED] [RECORDED] [WALKED]

Of each law so many executions are polled from a fake PLC, judged one by one as records of a ring in random dialects,
and walked in bulk as blocks of a recording. Prints what was proven; exits 1 if anything was convicted.
"""

from __future__ import annotations

import asyncio
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent))

from dialects import random_dialect
from lockstep.bench_world import World
from lockstep.million import recorded, walked
from lockstep.soak import GAINS, soak

from ahgateway.core.verdict import Counts

POLLED, RECORDED, WALKED = 25_000, 500_000, 4_800_000
PART = 10_000
WALK = 100_000


def polled(law: str, executions: int) -> Counts:
    world = World(law, GAINS[law], seed=0, poll_ms=45)
    return asyncio.run(soak(world, executions, seed=0))


def in_dialects(law: str, executions: int) -> Counts:
    total = Counts()
    for seed in range(max(1, executions // PART)):
        dialect = random_dialect(seed, share=seed % 5 / 4, without=("ts_source",))
        counts = recorded(law, dialect, min(PART, executions), seed)
        if counts.diverged:
            print(f"{law} dialect {seed}: {counts.diverged} convicted")  # noqa: T201
        total += counts
    return total


def in_bulk(law: str, executions: int) -> tuple[int, int]:
    total = differing = 0
    for seed in range(max(1, executions // WALK)):
        # With PID_RUN off no word shows that PID_MAN was taken note of, and the walk sees words alone.
        without = ("ts_source", "manual_history", "run_off_manual")
        dialect = random_dialect(seed, share=seed % 5 / 4, without=without)
        found = walked(law, dialect, min(WALK, executions), seed)
        total, differing = total + found[0], differing + found[1]
    return total, differing


def main() -> int:
    given = [int(text) for text in sys.argv[1:]]
    counts = [*given, *(POLLED, RECORDED, WALKED)[len(given) :]]
    convicted = 0
    for law in GAINS:
        for name, road, executions in (("polled", polled, counts[0]), ("recorded", in_dialects, counts[1])):
            started = time.perf_counter()
            found = road(law, executions)
            convicted += found.diverged
            print(  # noqa: T201
                f"{law} {name}: {found.total} executions, proven {found.coverage:.2%} "
                f"(informative {found.informative}, trivial {found.trivial}), diverged {found.diverged}, "
                f"unobservable {found.unobservable}, {time.perf_counter() - started:.0f} s",
                flush=True,
            )
        started = time.perf_counter()
        total, differing = in_bulk(law, counts[2])
        convicted += differing
        took = time.perf_counter() - started
        print(f"{law} walked: {total} executions, {differing} not reproduced, {took:.0f} s", flush=True)  # noqa: T201
    return 1 if convicted else 0


if __name__ == "__main__":
    sys.exit(main())
