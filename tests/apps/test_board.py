"""What stands behind a screen: trails that are rings, events that are bounded, words that never call the old live."""

from __future__ import annotations

import dataclasses
from concurrent.futures import Executor, Future
from itertools import pairwise

import numpy as np
import pytest
from tui.screen_world import ScreenWorld

from ahgateway.apps.board import EVENTS_MAX, Board
from ahgateway.apps.monitor import LinkChange, Report
from ahgateway.apps.trail import Trail
from ahgateway.clock import SECOND
from ahgateway.lockstep.judge import Execution

NAN = float("nan")
UTC_START_S = 1_767_225_600


def row(pv: float) -> tuple[float, ...]:
    return (50.0, pv, 10.0, NAN, 0.0, 100.0, 1.0, 1.0)


@pytest.fixture
async def world() -> ScreenWorld:
    world = ScreenWorld(warm_up_s=5)
    await world.run(1.0)
    return world


def test_a_trail_keeps_the_newest_in_order():
    trail = Trail(3)
    for moment in range(5):
        trail.add(float(moment), row(float(moment)))
    trace = trail.trace()
    assert [2.0, 3.0, 4.0] == trace.t_s.tolist()
    assert [2.0, 3.0, 4.0] == trace.pv.tolist()
    assert 3 == len(trail)
    assert [4.0] == trail.trace(since_s=3.5).pv.tolist()


def test_a_real_comes_back_exactly():
    trail = Trail(3)
    trail.add(0.0, row(float(np.float32(0.1))))
    assert [float(np.float32(0.1))] == trail.trace().pv.tolist()


def test_health_sees_neither_gaps_nor_time_that_stands():
    trail = Trail(9)
    trail.add(1.0, row(1.0))
    trail.gap(2.0)
    trail.add(3.0, row(3.0))
    trail.add(3.0, row(4.0))
    trail.add(5.0, row(5.0))
    window = trail.trace().window()
    assert [1.0, 3.0, 5.0] == window.t_s.tolist()
    assert [True, True, True] == window.auto.tolist()


async def test_a_loop_leaves_one_sample_for_each_execution(world):
    trail = world.board.trails.trails["TIC-101"]
    # CYCLE is 200 ms and a second was followed: five executions, and the first picture.
    assert 5 <= len(trail) <= 6
    trace = trail.trace()
    assert UTC_START_S + 5.0 <= trace.t_s[0] < UTC_START_S + 5.2
    assert 80.0 == trace.sv[-1]
    assert trace.mv[-1] == trace.ref_mv[-1]


async def test_a_link_that_goes_leaves_a_gap_in_every_trail(world):
    world.board.take(Report(world.clock.utc_ns(), "", 0, LinkChange(False, "unplugged")))
    for trail in world.board.trails.trails.values():
        assert np.isnan(trail.trace().pv[-1])


async def test_a_value_is_stale_from_two_seconds_and_a_nanosecond_on(world):
    watch = world.board.watches["TIC-101"]
    last_ns = watch.follower.picture.last_ns
    world.clock.advance_ns(last_ns + 2 * SECOND - world.clock.now_ns())
    assert not world.board.freshness(watch).is_stale
    world.clock.advance_ns(1)
    assert world.board.freshness(watch).is_stale
    assert "STALE" == world.board.word(watch)


def test_before_the_first_picture_nothing_is_live():
    world = ScreenWorld()
    watch = world.board.watches["TIC-101"]
    assert world.board.freshness(watch).is_stale
    assert "LINK DOWN" == world.board.word(watch)
    world.monitor.is_up = True
    assert "WAITING" == world.board.word(watch)
    watch.refused = "no such address"
    assert "REFUSED" == world.board.word(watch)


def test_events_are_bounded_and_counted():
    world = ScreenWorld()
    for number in range(EVENTS_MAX + 10):
        world.board.note(str(number))
    assert EVENTS_MAX == len(world.board.events)
    assert EVENTS_MAX + 10 == world.board.event_count
    assert "10" == world.board.events[0].text


async def test_a_loop_that_goes_on_to_diverge_does_not_flood_the_log(world):
    world.plc.fail("TIC-101", "gain-1-percent")
    world.plc.write("TIC-101", "SV", 84.0)
    await world.run(3.0)

    def told() -> list[Report]:
        return [each for each in world.board.events if isinstance(each, Report) and isinstance(each.event, Execution)]

    causes = [each.event.blame.suspects[0].cause for each in told()]
    assert all(one != another for one, another in pairwise(causes))
    last, count = told()[-1], len(told())
    for after_s in (1, 59, 60, 119, 120):
        world.board.take(dataclasses.replace(last, utc_ns=last.utc_ns + after_s * SECOND))
    assert [60, 120] == [(each.utc_ns - last.utc_ns) // SECOND for each in told()[count:]]


async def test_health_is_worked_out_one_loop_at_a_time_and_not_before_five_seconds(world):
    board = Board(world.monitor, world.clock)
    assert "TIC-101" == board.oldest_health()
    board.health("TIC-101")
    assert "LIC-201" == board.oldest_health()
    for report in (report for report in list(world.board.events)):
        board.take(report)
    world.clock.advance_ns(5 * SECOND)
    before = board.known_health("TIC-101")
    assert before is board.health("TIC-101")


class Inline(Executor):
    """Does it at once."""

    def submit(self, work, /, *given):
        done = Future()
        done.set_result(work(*given))
        return done


async def test_a_process_that_changes_while_the_controller_does_not_is_said_live():
    """Nobody hands a model in: it is learned from steps of SV, and then the process loses half of its gain."""
    world = ScreenWorld("single", warm_up_s=400)
    world.board._pool = Inline()

    async def step(sv):
        world.plc.write("TIC-101", "SV", sv)
        await world.run(45.0)
        world.board.health("TIC-101")
        return world.board.statement("TIC-101")

    said = [await step(80.0 + 5.0 * (count % 2 == 0)) for count in range(8)]
    known = world.board._learners["TIC-101"].known
    assert known is not None
    assert all(each is None or each.name != "valve-or-process" for each in said)
    rig = world.plc.processes["TIC-101"].rig
    rig._plant = dataclasses.replace(rig._plant, gain=0.5 * rig._plant.gain)
    said = [await step(80.0 + 5.0 * (count % 2 == 0)) for count in range(3)]
    assert ("valve-or-process", True) == (said[-1].name, "do not retune" in said[-1].text)
    assert 0 == world.monitor.watches[0].follower.summary().diverged
