"""What was recorded of a ring, or step by step, is judged again as it was then, losses included."""

from __future__ import annotations

from pathlib import Path

import pytest
from lockstep.soak import GAINS
from lockstep.ways_world import ground

from ahgateway.apps.monitor import Monitor
from ahgateway.apps.record import Tape
from ahgateway.apps.replay import Comparison, Replay
from ahgateway.clock import MILLISECOND, SECOND
from ahgateway.codec.ways import Each, Way
from ahgateway.core.verdict import Counts
from ahgateway.recording.reader import Recording


@pytest.mark.parametrize(
    ("way", "each", "latency_ms"),
    [
        (Way.RECORDED, Each.SCAN, 1),
        (Way.RECORDED, Each.CALL, 1),
        (Way.RECORDED, Each.SCAN, 30),
        (Way.STEPPED, Each.CALL, 1),
        (Way.STEPPED, Each.SCAN, 1),
    ],
)
async def test_the_verdicts_are_found_again(tmp_path: Path, way: Way, each: Each, latency_ms: int) -> None:
    world = ground(way, "DPIDE", GAINS["DPIDE"], each=each, latency_ns=latency_ms * MILLISECOND)
    steps = {}
    if world.gate_of_steps is not None:
        await world.gate_of_steps.arm("test")
        steps = {"L1": world.gate_of_steps.step}
    monitor = Monitor(world.station, world.link, world.clock, steps)
    tape = Tape(tmp_path / "run.ahrec", world.station, world.clock)
    with tape:
        async for report in monitor.reports(duration_ns=6 * SECOND):
            tape.take(report)

    with Recording(tmp_path / "run.ahrec") as recording:
        replay = Replay(recording)
        compared = Comparison(replay)
        for report in replay.reports():
            compared.take(report)
        agreement = compared.result()
        again = replay.followers["L1"].summary()
    assert agreement.is_whole, agreement.first
    assert agreement.same > 5
    then = monitor.summaries()["L1"]
    assert counted(then) == counted(again)


def counted(counts: Counts) -> tuple[int, int, int, int]:
    return counts.proven, counts.diverged, counts.unobservable, counts.link
