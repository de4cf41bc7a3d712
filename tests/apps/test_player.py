"""A recording that is played: paused, sought in, faster, and what a run may claim after that; virtual time."""

from __future__ import annotations

import asyncio

import pytest
from apps.test_history import Recorded

from ahgateway.apps.board import Board
from ahgateway.apps.monitor import Sample
from ahgateway.apps.player import LEAD_NS, Player
from ahgateway.apps.replay import Replay, ReplayMonitor
from ahgateway.clock import SECOND, VirtualClock
from ahgateway.core.verdict import Exit
from ahgateway.recording.parts import opened
from ahgateway.transports.replay import RecordedClock, ReplayLink

pytestmark = pytest.mark.slow


class Turns(VirtualClock):
    """Time that goes on by one sleep for each turn that a test gives, and stands while it looks."""

    def __init__(self) -> None:
        super().__init__()
        self._turn = asyncio.Semaphore(0)

    def give(self) -> None:
        if self._turn.locked():
            self._turn.release()

    async def sleep_ns(self, duration_ns: int) -> None:
        await self._turn.acquire()
        await super().sleep_ns(duration_ns)


class Played:
    """Twelve seconds of the demo being played; TIC-101 is wrong from the eighth on."""

    def __init__(self, path, speed: float = 1.0) -> None:
        self.recording = opened(path)
        self.wall = Turns()
        _, first, last = self.recording.totals()
        row = next(self.recording.rows())
        self.clock = RecordedClock(self.wall, row.sent_ns, row.utc_ns - (row.last_ns - row.sent_ns), speed)
        self.player = Player(self.clock, row.sent_ns, row.sent_ns + last - first, speed)
        replay = Replay(self.recording)
        self.monitor = ReplayMonitor(replay, ReplayLink(self.recording, self.clock), self.clock, self.player)
        self.board = Board(self.monitor, self.clock)
        self.monitor.on_jump = self.board.cut
        self.stop = asyncio.Event()
        self.seen: list[int] = []
        self.task = asyncio.ensure_future(self._run())

    async def _run(self) -> None:
        async for report in self.monitor.reports(stop=self.stop):
            self.board.take(report)
            if isinstance(report.event, Sample) and report.loop == "TIC-101":
                self.seen.append(report.event.picture.last_ns)

    async def until(self, holds) -> None:
        for _ in range(20000):
            if holds():
                return
            self.wall.give()
            await asyncio.sleep(0)
        raise AssertionError("never came to that")

    async def end(self) -> Exit:
        self.stop.set()
        await self.until(self.task.done)
        self.recording.close()
        return self.monitor.outcome(0.0)

    @property
    def at_s(self) -> float:
        return (self.clock.now_ns() - self.player.first_ns) / SECOND


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    found = tmp_path_factory.mktemp("played") / "run.ahrec"

    async def make() -> None:
        world = Recorded(found)
        await world.run(8.0)
        world.plc.fail("TIC-101", "gain-1-percent")
        world.plc.write("TIC-101", "SV", 84.0)
        world.monitor._started_ns = world.clock.now_ns()
        await world.run(4.0)
        world.tape.recorder.close()

    asyncio.run(make())
    return found


async def test_it_goes_at_the_speed_of_the_time_and_stands_at_its_end(path):
    played = Played(path)
    await played.until(lambda: played.at_s >= 5.0)
    assert 5.0 == pytest.approx(played.wall.now_ns() / SECOND, abs=0.1)
    assert "playing 5.0 of 11.9 s at 1x" == played.player.text().replace("5.1 of", "5.0 of")
    await played.until(lambda: played.player.is_over)
    assert played.player.text().startswith("END 11.9 of 11.9 s")
    assert 0.0 == played.player.moves
    before = played.clock.now_ns()
    wall_ns = played.wall.now_ns()
    await played.until(lambda: played.wall.now_ns() > wall_ns + 10 * SECOND)
    assert before == played.clock.now_ns()
    assert Exit.DIFFERENT == await played.end()


async def test_a_pause_holds_the_time_and_every_picture(path):
    played = Played(path)
    await played.until(lambda: played.at_s >= 2.0)
    played.player.pause()
    # What was due at this very moment is still seen.
    await played.until(lambda: played.wall.now_ns() > 4 * SECOND)
    count, at_ns = len(played.seen), played.clock.now_ns()
    wall_ns = played.wall.now_ns()
    await played.until(lambda: played.wall.now_ns() > wall_ns + 60 * SECOND)
    assert (count, at_ns) == (len(played.seen), played.clock.now_ns())
    assert played.player.text().startswith("PAUSED 2.")
    assert not played.board.freshness(played.board.watches["TIC-101"]).is_stale
    played.player.pause()
    await played.until(lambda: len(played.seen) > count)
    await played.end()


@pytest.mark.parametrize(("steps", "speed"), [(2, 4.0), (-1, 0.5), (99, 64.0), (-99, 0.25)])
async def test_faster_and_slower_change_how_long_a_second_takes(path, steps, speed):
    played = Played(path)
    await played.until(lambda: played.at_s >= 1.0)
    played.player.faster(steps)
    at_s, wall_ns = played.at_s, played.wall.now_ns()
    await played.until(lambda: played.at_s >= at_s + 3.0)
    assert speed == pytest.approx((played.at_s - at_s) / ((played.wall.now_ns() - wall_ns) / SECOND), rel=0.2)
    await played.end()


async def test_a_place_ahead_is_reached_at_once_with_a_settled_shadow(path):
    played = Played(path)
    await played.until(lambda: played.at_s >= 1.0)
    wall_ns = played.wall.now_ns()
    played.player.pause()
    played.player.skip(5 * SECOND)
    assert played.player.text().startswith("SEEKING 6.")
    await played.until(lambda: played.player.text().startswith("PAUSED"))
    assert 6.0 == pytest.approx(played.at_s, abs=0.3)
    assert played.wall.now_ns() - wall_ns < SECOND
    assert "MATCH" == played.board.word(played.board.watches["TIC-101"])
    assert played.board.watches["TIC-101"].follower.summary().proven > 20
    await played.end()


async def test_going_back_shows_again_and_forgets_what_is_ahead(path):
    played = Played(path)
    await played.until(lambda: played.player.is_over)
    assert "DIVERGED" == played.board.word(played.board.watches["TIC-101"])
    played.player.pause()
    played.player.seek(played.player.first_ns + 4 * SECOND)
    await played.until(lambda: played.player.text().startswith("PAUSED 4.0"))
    watch = played.board.watches["TIC-101"]
    assert "MATCH" == played.board.word(watch)
    assert 0 == watch.follower.summary().diverged
    assert [] == [event for event in played.board.events if event.utc_ns > played.clock.utc_ns()]
    last_s = played.board.trails.trails["TIC-101"].ends()[1]
    assert last_s <= played.clock.utc_ns() / SECOND
    # What was found before is not forgotten by the run, though the screen shows another time.
    assert Exit.DIFFERENT == await played.end()


async def test_a_place_outside_is_the_nearer_end(path):
    played = Played(path)
    await played.until(lambda: played.at_s >= 1.0)
    played.player.skip(-1000 * SECOND)
    await played.until(lambda: played.player.text().startswith("playing"))
    assert played.at_s < 0.5
    played.player.skip(1000 * SECOND)
    await played.until(lambda: played.player.is_over)
    await played.end()


async def test_keys_pressed_in_a_row_add_up(path):
    played = Played(path)
    await played.until(lambda: played.at_s >= 1.0)
    played.player.pause()
    at_s = played.at_s
    for _ in range(3):
        played.player.skip(2 * SECOND)
    await played.until(lambda: played.player.text().startswith("PAUSED"))
    assert at_s + 6.0 == pytest.approx(played.at_s, abs=0.3)
    await played.end()


def test_the_lead_is_longer_than_any_shadow_needs():
    assert 10 * SECOND <= LEAD_NS
