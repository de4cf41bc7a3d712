"""A recording followed again: the same bits, the same verdicts; other dialects and tolerances, other verdicts."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lockstep.bench_world import World
from recording.conftest import Run

from ahgateway.apps.moments import moment_ns
from ahgateway.apps.monitor import LinkChange, Monitor, Report, Sample
from ahgateway.apps.record import Tape
from ahgateway.apps.replay import Changes, Comparison, Replay, ReplayMonitor, judged_again, term_lines
from ahgateway.apps.replay_bulk import bulk
from ahgateway.clock import SECOND, VirtualClock
from ahgateway.codec.station import Tolerance
from ahgateway.core.verdict import Verdict
from ahgateway.errors import CodecError, ProfileError, StateError
from ahgateway.lockstep.judge import Execution
from ahgateway.recording.reader import Recording
from ahgateway.transports.replay import ReplayLink

NO_CHANGES = Changes({})
DPID = {"SV": 50.0, "CYCLE": 10, "Kp": 1.0, "Ki": 0.2, "Kd": 0.05}


@pytest.fixture
async def faulty(tmp_path: Path) -> Run:
    """A DPID loop whose gain is wrong from the 120th picture on."""
    run = Run(tmp_path / "run.ahrec", World("DPID", DPID))
    await run.polls(60)
    run.tape.recorder.flush()
    await run.polls(60)
    run.world.plc.fail("L1", "gain-1-percent")
    await run.polls(60)
    run.close()
    return run


def said(reports: list[Report]) -> list[str]:
    """Everything in the reports, NaN-proof."""
    return [repr(report) for report in reports]


def test_replay_says_word_for_word_what_was_said(faulty: Run) -> None:
    with Recording(faulty.path) as recording:
        again = Replay(recording)
        then = Comparison(again)
        reports = list(again.reports())
        for report in reports:
            then.take(report)
    assert said(faulty.reports) == said(reports)
    assert then.result().is_whole
    assert then.result().same == sum(isinstance(each.event, Execution) for each in faulty.reports)
    assert 0 < again.followers["L1"].counts.diverged == faulty.world.follower.counts.diverged


def test_a_tolerance_turns_the_divergence_into_agreement_by_tolerance(faulty: Run) -> None:
    with Recording(faulty.path) as recording:
        again = Replay(recording, judged_again(recording.station, Changes({}, Tolerance(mv_max=100.0))))
        list(again.reports())
    counts = again.followers["L1"].counts
    assert 0 == counts.diverged < counts.tolerance


def test_another_core_or_dialect_shows_as_other_verdicts_than_then(faulty: Run) -> None:
    with Recording(faulty.path) as recording:
        station = judged_again(recording.station, Changes({"direction": "inverted"}))
        again = Replay(recording, station)
        then = Comparison(again)
        for report in again.reports():
            then.take(report)
    found = then.result()
    assert not found.is_whole
    assert found.first is not None
    assert ("L1", "MATCH", "DIVERGED") == (found.first[0], found.first[2]["verdict"], found.first[3]["verdict"])


def test_terms_stand_beside_each_other_where_the_plc_shows_them(faulty: Run) -> None:
    execution = next(each for each in faulty.reports if getattr(each.event, "verdict", None) is Verdict.DIVERGED)
    picture = next(
        each.event.picture for each in faulty.reports if isinstance(each.event, Sample) and each.tick == execution.tick
    )
    assert isinstance(execution.event, Execution)
    lines = {line.term: line for line in term_lines(faulty.world.loop, picture, execution.event)}
    assert ["PV", "E", "P", "I", "D", "RAW", "MV", "MOUT"] == list(lines)
    assert [None, None] == [lines["E"].plc, lines["P"].plc]
    assert lines["PV"].plc == lines["PV"].ref
    assert lines["I"].plc == lines["I"].ref
    assert lines["MV"].plc != lines["MV"].ref


def test_the_wrong_name_of_a_loop_or_axis_is_said_with_the_near_one(faulty: Run) -> None:
    with Recording(faulty.path) as recording:
        with pytest.raises(StateError, match="has no loop `L2`, it has L1") as wrong:
            Replay(recording, loops=("L2",))
        assert "did you mean `L1`?" == wrong.value.hint
        with pytest.raises(CodecError, match="unknown dialect axis `freez`") as unknown:
            judged_again(recording.station, Changes({"freez": "never"}))
        assert "did you mean `freeze`?" == unknown.value.hint
        with pytest.raises(CodecError, match="freeze = `x` is not known, allowed are always"):
            judged_again(recording.station, Changes({"freeze": "x"}))


async def test_what_was_lost_with_the_link_is_lost_in_the_replay_too(tmp_path: Path) -> None:
    world = World("DPID", DPID)
    watched = Monitor(world.station, world.link, world.clock)
    tape = Tape(tmp_path / "a.ahrec", world.station, world.clock)
    reports = []

    def weather(report: Report) -> None:
        reports.append(report)
        tape.take(report)
        if isinstance(report.event, Sample):
            world.link.is_down = 40 <= report.tick < 41 or report.tick == 80
        else:
            world.link.is_down = world.link.is_down and not isinstance(report.event, LinkChange)

    async for report in watched.reports(duration_ns=5 * SECOND):
        weather(report)
    tape.recorder.close()
    with Recording(tmp_path / "a.ahrec") as recording:
        again = Replay(recording)
        replayed = list(again.reports())
    assert watched.summaries() == {"L1": again.followers["L1"].summary()}
    assert 0 < again.followers["L1"].counts.link
    links = [each.event.is_up for each in replayed if isinstance(each.event, LinkChange)]
    assert [each.event.is_up for each in reports if isinstance(each.event, LinkChange)] == links


async def test_a_monitor_out_of_a_recording_reports_at_the_recorded_times(faulty: Run) -> None:
    with Recording(faulty.path) as recording:
        clock = VirtualClock()
        monitor = ReplayMonitor(Replay(recording), ReplayLink(recording, clock), clock)
        reports = []
        async for report in monitor.reports():
            reports.append(report)
            assert clock.now_ns() <= next(
                each.event.picture.last_ns
                for each in faulty.reports
                if isinstance(each.event, Sample) and each.tick >= report.tick
            )
    assert said(faulty.reports) == said(reports)
    assert {"L1": faulty.world.follower.summary()} == monitor.summaries()


async def test_a_duration_ends_the_replay_at_its_recorded_time(faulty: Run) -> None:
    with Recording(faulty.path) as recording:
        clock = VirtualClock()
        monitor = ReplayMonitor(Replay(recording), ReplayLink(recording, clock), clock)
        ticks = [each.tick async for each in monitor.reports(duration_ns=SECOND) if isinstance(each.event, Sample)]
    inside = [
        each.tick for each in faulty.reports if isinstance(each.event, Sample) and each.event.picture.last_ns < SECOND
    ]
    assert inside == ticks


@pytest.mark.slow
def test_a_walk_reproduces_what_agrees_and_counts_what_does_not(faulty: Run) -> None:
    executions = [each for each in faulty.reports if isinstance(each.event, Execution)]
    diverged = [each for each in executions if each.event.verdict is Verdict.DIVERGED]  # type: ignore[union-attr]
    with Recording(faulty.path) as recording:
        (found,) = bulk(recording, NO_CHANGES, compiled=False)
    assert (len(executions) - 1, len(diverged)) == (found.executions, found.differing)
    assert diverged[0].tick == found.first_tick
    assert "`ahgateway replay` without --bulk says why" in found.line()


def test_moments_are_seconds_from_the_start_or_utc() -> None:
    assert 1_500_000_000 == moment_ns("1.5", "--from", 0)
    assert 1_767_225_600 * SECOND == moment_ns("2026-01-01T00:00:00", "--from", 7)
    assert 1_767_225_600 * SECOND == moment_ns("2026-01-01 01:00:00+01:00", "--from", 7)
    with pytest.raises(ProfileError, match="`soon` is no moment"):
        moment_ns("soon", "--from", 0)


def test_the_station_of_another_instruction_is_refused(faulty: Run) -> None:
    other = World("DPIDE").station
    with Recording(faulty.path) as recording, pytest.raises(StateError, match="is DPID in the recording, DPIDE in"):
        Replay(recording, replace(other, name="x"))


def test_columns_of_a_walk_have_the_bits_of_the_words(faulty: Run) -> None:
    from ahgateway.core.operands import Kind
    from ahgateway.recording.values import column

    words: Any = np.array([[0x0001, 0x7FA0, 0xFFFF, 0xFFFF, 2, 0x8000]], np.uint16)
    assert 0x7FA00001 == int(column(words, Kind.REAL, 0).view(np.uint32)[0])
    assert -1 == int(column(words, Kind.DINT, 2)[0])
    assert bool(column(words, Kind.BOOL, 4, 1)[0])
    assert -32768 == int(column(words, Kind.INT, 5, 1)[0])
