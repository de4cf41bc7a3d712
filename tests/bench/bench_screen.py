"""How much a screen costs: 100 loops for an hour of virtual time with flat memory, and CPU time for each redraw.

    PYTHONPATH=tests python tests/bench/bench_screen.py [minutes]

Every loop is read from a fake PLC and followed for real, twice a CYCLE of two seconds; drawn once a second of virtual
time, each page in turn, so that an hour takes about ten minutes. Exit code 1 when memory grows in the last third of
the run by more than `GROWTH_MAX_MB` over the third before, 3 when the run is too short to tell.
"""

from __future__ import annotations

import asyncio
import gc
import resource
import sys
import time
from pathlib import Path

from tui.hundred_world import HundredWorld

from ahgateway.apps.trail import CAPACITY
from ahgateway.clock import SECOND

REDRAWS = 40
CYCLE_S = 2
MINUTES_MIN = 30
GROWTH_MAX_MB = 2.0
"""In a third of an hour a hundred loops make 60 000 executions: 34 bytes kept of each would be more."""
PAGES = ("loops", "loop", "link", "log")


def say(line: str) -> None:
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


def held_mb() -> float:
    """Memory of this process that is in RAM now."""
    gc.collect()
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize() / 1e6


def is_flat(held: list[float]) -> bool:
    """Say whether the last third of the samples stays within the bound above the third before."""
    third = len(held) // 3
    before, after = max(held[-2 * third : -third]), max(held[-third:])
    say(f"second third {before:.1f} MB, last third {after:.1f} MB; at most {GROWTH_MAX_MB:g} MB more are allowed")
    return after - before <= GROWTH_MAX_MB


async def main() -> int:
    minutes = int(sys.argv[1]) if len(sys.argv) > 1 else 60
    world = HundredWorld(capacity=CAPACITY, cycle_s=CYCLE_S)
    held: list[float] = []
    async with world.app.run_test(size=(150, 60)) as pilot:
        for minute in range(minutes):
            world.app.action_page(PAGES[minute % len(PAGES)])
            await world.run(60.0)
            await pilot.pause()
            held.append(held_mb())
            say(f"minute {minute + 1}: {held[-1]:.1f} MB, {world.app.redraws} redraws")
        counts = [watch.follower.summary() for watch in world.monitor.watches]
        say(f"proven {sum(each.proven for each in counts)} of {sum(each.total for each in counts)} executions")
        for page in PAGES:
            world.app.action_page(page)
            await pilot.pause()
            begun = time.process_time()
            for _ in range(REDRAWS):
                world.clock.advance_ns(SECOND // 8)
                world.app.redraw()
                await pilot.pause()
            say(f"{page}: {(time.process_time() - begun) / REDRAWS * 1000:.1f} ms CPU for each redraw")
    if minutes < MINUTES_MIN:
        say(f"too short to tell whether memory is flat: {MINUTES_MIN} minutes are asked for")
        return 3
    return 0 if is_flat(held) else 1


if __name__ == "__main__":
    sys.exit(asyncio.run(main()))
