"""Soak of the judge: 100 000 executions in memory, in virtual time, with operators who meddle; no false verdict.

    python tests/bench/soak_lockstep.py [EXECUTIONS] [SEEDS]

Prints per law and seed what was proven; exits 1 if anything was convicted.
"""

from __future__ import annotations

import asyncio
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent))

from lockstep.bench_world import World
from lockstep.soak import GAINS, soak


def main() -> int:
    executions = int(sys.argv[1]) if len(sys.argv) > 1 else 50_000
    seeds = int(sys.argv[2]) if len(sys.argv) > 2 else 1
    convicted = 0
    for controller in GAINS:
        for seed in range(seeds):
            world = World(controller, GAINS[controller], seed=seed, poll_ms=45)
            started = time.perf_counter()
            counts = asyncio.run(soak(world, executions, seed=seed))
            convicted += counts.diverged
            print(  # noqa: T201
                f"{controller} seed {seed}: {counts.total} executions, proven {counts.coverage:.2%} "
                f"(informative {counts.informative}, trivial {counts.trivial}), diverged {counts.diverged}, "
                f"unobservable {counts.unobservable}, {time.perf_counter() - started:.0f} s"
            )
    return 1 if convicted else 0


if __name__ == "__main__":
    sys.exit(main())
