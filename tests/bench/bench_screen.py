"""How much a screen costs: 100 loops for an hour of virtual time with flat memory, and CPU time for each redraw.

    PYTHONPATH=tests python tests/bench/bench_screen.py [minutes]

Every loop is read from a fake PLC and followed for real, twice a CYCLE of one second; drawn once a second of virtual
time, so that an hour takes about twenty minutes.
"""

from __future__ import annotations

import asyncio
import resource
import sys
import time

from tui.hundred_world import HundredWorld

from ahgateway.apps.trail import CAPACITY
from ahgateway.clock import SECOND

REDRAWS = 40
REPORT_MINUTES = 5


def say(line: str) -> None:
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


async def main() -> None:
    minutes = int(sys.argv[1]) if len(sys.argv) > 1 else 60
    world = HundredWorld(capacity=CAPACITY)
    async with world.app.run_test(size=(150, 60)) as pilot:
        for minute in range(minutes):
            await world.run(60.0)
            await pilot.pause()
            if minute % REPORT_MINUTES == REPORT_MINUTES - 1 or minute == 0:
                held = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1000
                say(f"minute {minute + 1}: {held:.1f} MB held at most, {world.app.redraws} redraws")
        counts = [watch.follower.summary() for watch in world.monitor.watches]
        say(f"proven {sum(each.proven for each in counts)} of {sum(each.total for each in counts)} executions")
        for page in ("loops", "loop", "link", "log"):
            world.app.action_page(page)
            await pilot.pause()
            begun = time.process_time()
            for _ in range(REDRAWS):
                world.clock.advance_ns(SECOND // 8)
                world.app.redraw()
                await pilot.pause()
            say(f"{page}: {(time.process_time() - begun) / REDRAWS * 1000:.1f} ms CPU for each redraw")


if __name__ == "__main__":
    asyncio.run(main())
