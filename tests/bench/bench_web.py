"""How smooth the page is with 100 live loops: time between drawn frames, beside an empty page in the same browser.

    PYTHONPATH=tests python tests/bench/bench_web.py

Empty page, loops and one loop's trend in turn, so that whatever else the machine does meets all three alike. Exit code
1 when half of the page's frames need more than `RATIO_MAX` times as long as those of the empty page in the same round,
in every round.
"""

from __future__ import annotations

import asyncio
import sys
import tempfile
from collections import defaultdict
from pathlib import Path

from conformance.browser import Browser
from tui.hundred_world import HundredWorld

from ahgateway.apps.history import History
from ahgateway.apps.trail import CAPACITY
from ahgateway.web.server import Source, served

ROUNDS = 5
FRAMES = 120
PATIENCE_S = 180.0
RATIO_MAX = 1.5
FILLED_S = 20.0
GAPS = """new Promise(done => { const gaps = []; let last = performance.now();
  const draw = now => { gaps.push(now - last); last = now;
    if (gaps.length < %d) requestAnimationFrame(draw); else { gaps.sort((a, b) => a - b); done(gaps); } };
  requestAnimationFrame(draw); })"""
PAGES = {
    "empty": ("about:blank", "document.readyState == 'complete'"),
    "100 loops": ("#loops", "document.querySelectorAll('#loops tbody tr').length == 100 && ahgateway.sparks.clock"),
    "one of 100": ("?trend#loop=LIC-007", "window.ahgateway && ahgateway.trend.asked > 1"),
}


def say(line: str) -> None:
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


async def live(world: HundredWorld) -> None:
    """One second of the loops a second of ours, as near as the machine allows."""
    while True:
        for _ in range(10):
            await world.run(0.1)
            await asyncio.sleep(0.1)


async def measured(browser: Browser, home: str, name: str) -> float:
    """Return the median time between frames of one page in ms."""
    place, is_there = PAGES[name]
    await browser.open(place if place.startswith("about:") else home + place)
    await browser.until(is_there)
    gaps = await browser.ask(GAPS % FRAMES)
    half, most = gaps[len(gaps) // 2], gaps[len(gaps) * 95 // 100]
    say(f"{name:>10}: {half:.1f} ms between frames, {most:.1f} ms at 95 %, worst {gaps[-1]:.1f} ms")
    return float(half)


async def main() -> int:
    world = HundredWorld(capacity=CAPACITY)
    ratios = defaultdict(list)
    async with world.app.run_test(size=(150, 60)):
        await world.run(FILLED_S)
        with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as home:
            browser = Browser(Path(home), patience_s=PATIENCE_S)
            await browser.start()
            running = asyncio.ensure_future(live(world))
            async with served(Source(world.board, History(world.board, lambda: None), "hundred"), 0) as port:
                for _ in range(ROUNDS):
                    found = {name: await measured(browser, f"http://127.0.0.1:{port}/", name) for name in PAGES}
                    for name, half in found.items():
                        ratios[name].append(half / found["empty"])
            running.cancel()
            await browser.close()
    say(", ".join(f"{name} {min(each):.2f} times" for name, each in ratios.items()) + f", at most {RATIO_MAX:g}")
    return 0 if max(min(each) for each in ratios.values()) <= RATIO_MAX else 1


if __name__ == "__main__":
    sys.exit(asyncio.run(main()))
