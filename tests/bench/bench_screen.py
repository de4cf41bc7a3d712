"""How much a screen costs: 100 loops for an hour of virtual time with flat memory, and CPU time for each redraw.

    python tests/bench/bench_screen.py [minutes]

The pictures are made up and judged by a real follower each; only the wire is left out, so that an hour takes minutes.
"""

from __future__ import annotations

import asyncio
import sys
import time
import tracemalloc
from dataclasses import replace

from ahgateway.apps.board import Board
from ahgateway.apps.monitor import Monitor, Report, Sample
from ahgateway.clock import SECOND, VirtualClock
from ahgateway.fake.plc import FakePlc
from ahgateway.lockstep.picture import Sampler
from ahgateway.schema.profile import load
from ahgateway.transports.memory import MemoryLink
from ahgateway.tui.app import MonitorApp

LOOPS = 100
REDRAWS = 40
PERIOD_NS = SECOND


def say(line: str) -> None:
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


async def main() -> None:
    minutes = int(sys.argv[1]) if len(sys.argv) > 1 else 60
    loaded = load("demo")
    station, clock = loaded.station(), VirtualClock()
    plc = FakePlc(station, loaded.fake_setup(), clock=clock)
    link = MemoryLink(plc, clock, target="memory:")
    first = station.loops[0]
    loops = tuple(replace(first, name=f"TIC-{number:03d}") for number in range(LOOPS))
    monitor = Monitor(replace(station, loops=loops), link, clock)
    monitor.is_up = True
    board = Board(monitor, clock)
    sampler = Sampler(first, station, link, clock)
    app = MonitorApp(board, "bench", is_ticking=False)
    async with app.run_test(size=(150, 60)) as pilot:
        for minute in range(minutes):
            for _ in range(60 * SECOND // PERIOD_NS):
                clock.advance_ns(PERIOD_NS)
                picture = await sampler.picture()
                if picture is None:
                    continue
                for watch in monitor.watches:
                    watch.follower.picture = picture
                    board.take(Report(picture.utc_ns, watch.loop.name, picture.tick, Sample(picture)))
                app.redraw()
            await pilot.pause()
            if minute == 0:
                tracemalloc.start()
            if minute % 10 == 9:
                say(f"minute {minute + 1}: {tracemalloc.get_traced_memory()[0] / 1e6:.2f} MB since the first minute")
        tracemalloc.stop()
        for page in ("loops", "loop", "link", "log"):
            app.action_page(page)
            await pilot.pause()
            begun = time.process_time()
            for _ in range(REDRAWS):
                clock.advance_ns(SECOND // 8)
                app.redraw()
                await pilot.pause()
            say(f"{page}: {(time.process_time() - begun) / REDRAWS * 1000:.1f} ms CPU for each redraw")


if __name__ == "__main__":
    asyncio.run(main())
