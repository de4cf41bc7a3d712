"""Ground for tests of recordings: one loop followed on a fake PLC in virtual time, recorded as a live run is."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pytest
from lockstep.bench_world import World

from ahgateway.apps.monitor import Report, Sample
from ahgateway.apps.record import Tape
from ahgateway.lockstep.follow import Event

collect_ignore = [] if sys.platform == "linux" else ["test_full_disk.py"]
"""A limit on the size of files is a matter of Linux; elsewhere the limit on pages in `test_runfile` stands for it."""


class Run:
    """A world, its tape, and what was reported."""

    def __init__(self, path: Path, world: World) -> None:
        self.path = path
        self.world = world
        self.tape = Tape(path, world.station, world.clock, profile_text="# by hand\n", command="test")
        self.reports: list[Report] = []

    async def polls(self, count: int) -> None:
        """Take so many pictures and hand every report to the tape, as the monitor does."""
        for _ in range(count):
            events: list[Any] = list(await self.world.poll())
            picture = self.world.follower.picture
            assert picture is not None
            for event in [*events, Sample(picture)]:
                self.report(event)

    def report(self, event: Event | Sample) -> None:
        picture = self.world.follower.picture
        assert picture is not None
        report = Report(picture.utc_ns, "L1", picture.tick, event)
        self.reports.append(report)
        self.tape.take(report)

    def close(self) -> None:
        self.tape.recorder.close()


@pytest.fixture
def run(tmp_path: Path) -> Run:
    return Run(tmp_path / "run.ahrec", World(is_restless=True))
