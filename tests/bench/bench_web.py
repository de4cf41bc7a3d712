"""How smooth the page is with 100 live loops: time between drawn frames, beside an empty page in the same browser.

PYTHONPATH=tests python tests/bench/bench_web.py
"""

from __future__ import annotations

import asyncio
import sys
import tempfile
from pathlib import Path

from conformance.browser import Browser
from tui.hundred_world import HundredWorld

from ahgateway.apps.history import History
from ahgateway.apps.trail import CAPACITY
from ahgateway.web.server import Source, served

ROUNDS = 3
FRAMES = 240
GAPS = """new Promise(done => { const gaps = []; let last = performance.now();
  const draw = now => { gaps.push(now - last); last = now;
    if (gaps.length < %d) requestAnimationFrame(draw); else { gaps.sort((a, b) => a - b); done(gaps); } };
  requestAnimationFrame(draw); })"""


def say(line: str) -> None:
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


async def live(world: HundredWorld) -> None:
    """One second of the loops a second of ours, as near as the machine allows."""
    while True:
        for _ in range(10):
            await world.run(0.1)
            await asyncio.sleep(0.1)


async def main() -> None:
    world = HundredWorld(capacity=CAPACITY)
    async with world.app.run_test(size=(150, 60)):
        await world.run(10.0)
        running = asyncio.ensure_future(live(world))
        with tempfile.TemporaryDirectory() as home:
            browser = Browser(Path(home))
            await browser.start()
            async with served(Source(world.board, History(world.board, lambda: None), "hundred"), 0) as port:
                for _ in range(ROUNDS):
                    for name, url in (("empty", "about:blank"), ("100 loops", f"http://127.0.0.1:{port}/")):
                        await browser.open(url)
                        if name != "empty":
                            await browser.until("document.querySelectorAll('#loops tbody tr').length == 100")
                        gaps = await browser.ask(GAPS % FRAMES)
                        half, most = gaps[len(gaps) // 2], gaps[len(gaps) * 95 // 100]
                        say(f"{name}: {half:.1f} ms between frames, {most:.1f} ms at 95 %, worst {gaps[-1]:.1f} ms")
            await browser.close()
        running.cancel()


if __name__ == "__main__":
    asyncio.run(main())
