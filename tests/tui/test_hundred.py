"""A hundred loops: memory that stays flat once the rings are full, and no picture drawn that nobody asked for."""

from __future__ import annotations

import gc
import tracemalloc

import pytest
from tui.hundred_world import LOOPS, HundredWorld
from tui.screen_world import text_of

from ahgateway.tui.app import REDRAWS_PER_SECOND

pytestmark = pytest.mark.slow
GROWTH_MAX = 150_000
"""Bytes in three seconds; pictures of every loop that were kept for ever would be more than a million."""


def ours() -> int:
    """Bytes that live objects of the monitor hold since tracing began.

    The fake PLC keeps a log of its own, and rich remembers the widths of the last few thousand texts.
    """
    gc.collect()
    kept = [tracemalloc.Filter(True, f"*/ahgateway/{floor}/*") for floor in ("apps", "codec", "lockstep")]
    found = tracemalloc.take_snapshot().filter_traces(kept)
    found = found.filter_traces([tracemalloc.Filter(False, "*/ahgateway/apps/lines.py")])
    return sum(each.size for each in found.statistics("filename"))


async def test_a_hundred_loops_live_in_flat_memory():
    world = HundredWorld(capacity=4)
    async with world.app.run_test(size=(150, 60)) as pilot:
        await world.run(6.0)
        tracemalloc.start()
        try:
            await world.run(1.5)
            before = ours()
            await world.run(3.0)
            after = ours()
        finally:
            tracemalloc.stop()
        await pilot.pause()
        lines = text_of(pilot.app)
    assert before > 10_000
    assert after - before < GROWTH_MAX, f"{(after - before) / 1000:.0f} kB in three seconds"
    proven = [watch.follower.summary().proven for watch in world.monitor.watches]
    assert LOOPS == len(proven)
    assert min(proven) >= 8
    assert "100 loops" in lines[0]
    assert "none diverged" in lines[0]


def test_the_screen_is_drawn_no_more_than_ten_times_a_second():
    assert 1 <= REDRAWS_PER_SECOND <= 10
