"""Looking back: what comes out of a recording is what was seen, and memory and file say the same."""

from __future__ import annotations

import numpy as np
import pytest
from tui.screen_world import ScreenWorld

from ahgateway.apps.history import History, recorded
from ahgateway.apps.marks import Mark
from ahgateway.apps.monitor import LinkChange, Report, Sample
from ahgateway.apps.record import Tape
from ahgateway.apps.stretch import runs
from ahgateway.clock import SECOND
from ahgateway.recording.parts import opened
from ahgateway.transports.base import Frame

pytestmark = pytest.mark.slow
START_S = 1_767_225_600.0


class Recorded(ScreenWorld):
    """The demo's loops, followed, shown and recorded, with every frame of the link."""

    def __init__(self, path) -> None:
        super().__init__(warm_up_s=20, tap=self._frame)
        self.path = path
        self.tape = Tape(path, self.monitor.station, self.clock)
        self.pictures = []

    def _frame(self, frame: Frame) -> None:
        self.tape.recorder.frame(frame.direction, frame.data, frame.now_ns, frame.utc_ns)

    async def run(self, seconds: float) -> None:
        async for report in self.monitor.reports(duration_ns=round(seconds * SECOND)):
            self.board.take(report)
            self.tape.take(report)
            if isinstance(report.event, Sample) and report.loop == "TIC-101":
                self.pictures.append(report.event.picture)


@pytest.fixture
async def run(tmp_path):
    world = Recorded(tmp_path / "run.ahrec")
    await world.run(6.0)
    world.tape.recorder.close()
    return world


async def test_every_picture_comes_back_with_its_bits(run):
    with opened(run.path) as recording:
        found = recorded(recording, "TIC-101", START_S, START_S + 60.0, 1000)
    assert found.is_whole
    assert len(run.pictures) == found.t_s.size
    assert [picture.utc_ns / SECOND for picture in run.pictures] == pytest.approx(found.t_s.tolist(), abs=1e-6)
    for name, values in (
        ("sv", [picture.inputs.sv for picture in run.pictures]),
        ("pv", [picture.inputs.pv for picture in run.pictures]),
        ("mv", [picture.seen["MV"] for picture in run.pictures]),
    ):
        assert np.array(values, np.float32).tobytes() == found.curve(name).astype(np.float32).tobytes()


async def test_a_proven_execution_shows_the_reference_and_others_do_not(run):
    with opened(run.path) as recording:
        found = recorded(recording, "TIC-101", START_S, START_S + 60.0, 1000)
    proven = (found.mark == Mark.PROVEN) | (found.mark == Mark.TRIVIAL)
    assert proven.sum() > 20
    assert np.array_equal(found.curve("mv")[proven], found.curve("ref_mv")[proven])
    assert np.all(np.isnan(found.curve("ref_mv")[~proven]))


async def test_only_what_was_asked_for_comes(run):
    since_s, until_s = START_S + 22.0, START_S + 23.0
    with opened(run.path) as recording:
        found = recorded(recording, "TIC-101", since_s, until_s, 1000)
    wanted = [picture.utc_ns / SECOND for picture in run.pictures if since_s <= picture.utc_ns / SECOND <= until_s]
    assert wanted == pytest.approx(found.t_s.tolist(), abs=1e-6)


async def test_memory_answers_what_it_holds_and_the_file_what_is_older(run):
    history = History(run.board, lambda: run.path)
    trail = run.board.trails.trails["TIC-101"]
    first_s = trail.ends()[0]
    kept = await history.stretch("TIC-101", first_s, START_S + 30.0, 1000)
    assert len(trail) == kept.t_s.size
    older = await history.stretch("TIC-101", first_s - 0.001, START_S + 30.0, 1000)
    assert len(run.pictures) == older.t_s.size
    played = History(run.board, lambda: run.path, is_replay=True)
    ahead = await played.stretch("TIC-101", first_s, START_S + 300.0, 4000)
    assert len(run.pictures) == ahead.t_s.size


async def test_without_a_recording_there_is_what_is_in_memory(run):
    history = History(run.board, lambda: None)
    found = await history.stretch("TIC-101", START_S, START_S + 30.0, 1000)
    assert len(run.board.trails.trails["TIC-101"]) == found.t_s.size
    assert (found.t_s[0], run.board.trails.trails["LIC-201"].ends()[1]) == pytest.approx(history.reach(), abs=0.3)
    with pytest.raises(ValueError, match="slices"):
        await history.stretch("TIC-101", START_S, START_S + 30.0, 0)


async def test_how_far_a_recording_reaches_is_looked_up_once(run, monkeypatch):
    asked = []
    monkeypatch.setattr("ahgateway.apps.history.opened", lambda path: asked.append(path) or opened(path))
    files = [run.path]
    history = History(run.board, lambda: files[0])
    first, last = history.reach()
    assert (first, last) == history.reach()
    assert [run.path] == asked
    assert first < START_S + 21.0
    assert last == pytest.approx(run.clock.utc_ns() / SECOND, abs=0.3)
    files[0] = run.path.with_name("next.ahrec")
    files[0].write_bytes(run.path.read_bytes())
    history.reach()
    assert files[0] == asked[-1]


async def test_a_link_that_went_breaks_the_curve(tmp_path):
    world = Recorded(tmp_path / "run.ahrec")
    await world.run(1.0)
    world.tape.take(Report(world.clock.utc_ns(), "", 0, LinkChange(False, "unplugged")))
    down_s = world.clock.utc_ns() / SECOND
    world.monitor._started_ns = world.clock.now_ns()
    await world.run(1.0)
    world.tape.recorder.close()
    with opened(world.path) as recording:
        found = recorded(recording, "TIC-101", START_S, START_S + 60.0, 1000)
    at = found.t_s.tolist().index(down_s)
    assert np.isnan(found.curve("pv")[at])
    assert Mark.LINK == found.mark[at]
    assert Mark.LINK in [mark for _, _, mark in runs(found)]


async def test_a_diverged_execution_shows_where_the_reference_was(tmp_path):
    world = Recorded(tmp_path / "run.ahrec")
    await world.run(1.0)
    world.plc.fail("TIC-101", "gain-1-percent")
    world.plc.write("TIC-101", "SV", 84.0)
    world.monitor._started_ns = world.clock.now_ns()
    await world.run(2.0)
    world.tape.recorder.close()
    with opened(world.path) as recording:
        found = recorded(recording, "TIC-101", START_S, START_S + 60.0, 1000)
        told = {tick: each for name, tick, each in recording.verdicts() if name == "TIC-101"}
    diverged = found.mark == Mark.DIVERGED
    assert diverged.sum() == sum(each["verdict"] == "DIVERGED" for each in told.values()) > 3
    shown = [each["ref"] for each in told.values() if each["verdict"] == "DIVERGED" and each["term"] == "MV"]
    known = found.curve("ref_mv")[diverged]
    assert shown == known[np.isfinite(known)].tolist()
