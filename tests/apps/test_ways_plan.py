"""`monitor --plan`: which way is possible on a line of known speed, and what it is worth."""

from __future__ import annotations

from dataclasses import replace

from lockstep.bench_world import World
from lockstep.soak import GAINS
from lockstep.ways_world import ground

from ahgateway.apps.monitor import Monitor
from ahgateway.apps.ways import LoopPlan, WayPlan, as_json, is_enough, lines, planned
from ahgateway.clock import MILLISECOND, SECOND
from ahgateway.codec.station import Pacing
from ahgateway.codec.ways import Way
from ahgateway.lockstep.events import Finding


async def plan_of(world: World) -> LoopPlan:
    world.clock.advance_ns(3_000_000_000)
    return (await planned(world.station, world.link, world.clock))[0]


def by_way(plan: LoopPlan) -> dict[Way, WayPlan]:
    return {each.way: each for each in plan.ways}


async def test_a_fast_line_polls_faster_than_cycle_and_could_carry_a_recorder() -> None:
    plan = await plan_of(World("DPIDE", GAINS["DPIDE"]))
    ways = by_way(plan)

    assert (Way.POLLED, 25 * MILLISECOND) == (plan.chosen, plan.look_ns)
    assert abs(plan.cycle_ns - 100 * MILLISECOND) <= 1  # 0.1 s is no REAL
    assert ways[Way.POLLED].is_possible
    assert 1.0 == ways[Way.POLLED].coverage.informative
    assert not ways[Way.COUNTED].is_possible
    assert not ways[Way.RECORDED].is_possible
    # 36 words at each scan of at most 10 ms.
    assert 3600.0 == ways[Way.RECORDED].words_per_s
    assert "plc-code recorder" in ways[Way.RECORDED].hint
    assert "plc-code trigger" in ways[Way.STEPPED].hint
    assert is_enough([plan])


async def test_a_slow_line_counts_and_proves_nothing_unless_pv_stands_still() -> None:
    ways = by_way(await plan_of(World("DPIDE", GAINS["DPIDE"], latency_ns=60 * MILLISECOND)))
    assert not ways[Way.POLLED].is_possible
    assert "falls into every picture" in ways[Way.POLLED].text
    assert 1.0 == ways[Way.POLLED].coverage.unobservable
    assert 1.0 == ways[Way.COUNTED].coverage.unobservable
    assert "pv_rate_max" in ways[Way.COUNTED].hint


async def test_a_loop_whose_pv_only_we_move_is_counted_out() -> None:
    world = ground(Way.COUNTED, "DPIDE", GAINS["DPIDE"])
    world.station = replace(world.station, pacing=Pacing(poll_ms=250))
    plan = await plan_of(world)
    assert Way.COUNTED is plan.chosen
    assert 1.0 == sum((by_way(plan)[Way.COUNTED].coverage.informative, by_way(plan)[Way.COUNTED].coverage.trivial))


async def test_a_ring_is_measured_as_it_fills() -> None:
    plan = await plan_of(ground(Way.RECORDED, "DPIDE", GAINS["DPIDE"]))
    found = by_way(plan)[Way.RECORDED]

    assert Way.RECORDED is plan.chosen
    assert found.is_possible
    # A scan of 5 ms, a record of 37 words.
    assert 7200 < found.words_per_s < 7600
    assert 0.0 == found.coverage.lost


async def test_a_ring_that_the_line_cannot_empty_loses_the_rest() -> None:
    plan = await plan_of(ground(Way.RECORDED, "DPIDE", GAINS["DPIDE"], latency_ns=20 * MILLISECOND))
    found = by_way(plan)[Way.RECORDED]

    assert not found.is_possible
    # Two records of 37 words in 20 ms are 3700 of 7400 words/s.
    assert 0.45 < found.coverage.lost < 0.55
    assert "faster line" in found.hint


async def test_a_bench_with_a_trigger_can_be_stepped_and_the_plan_reads_as_text_and_json() -> None:
    world = ground(Way.STEPPED, "DPIDE", GAINS["DPIDE"])
    plan = await plan_of(world)

    assert by_way(plan)[Way.STEPPED].is_possible
    assert ["stepped", "recorded", "polled", "counted"] == [each["way"] for each in as_json(plan)["ways"]]
    text = "\n".join(lines([plan]))
    assert "L1: CYCLE 100 ms, followed now as `stepped`" in text
    assert "--arm L1" in text


async def test_a_ring_that_runs_over_is_said_once_with_the_words_that_the_line_must_carry() -> None:
    world = ground(Way.RECORDED, "DPIDE", GAINS["DPIDE"], latency_ns=30 * MILLISECOND)
    monitor = Monitor(world.station, world.link, world.clock)
    said = [
        report.event
        async for report in monitor.reports(duration_ns=5 * SECOND)
        if isinstance(report.event, Finding) and report.event.name == "ring-overrun"
    ]

    assert [False] == [each.is_over for each in said]
    # 37 words at each scan of 5 ms.
    assert "the ring makes 7400 words/s" in said[0].text
    assert monitor.summaries()["L1"].link > 0
    assert monitor.summaries()["L1"].diverged == 0
