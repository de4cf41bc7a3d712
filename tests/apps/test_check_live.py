"""Scenarios on a PLC that only the link reaches: PV comes from us, everything goes back, the bench takes the blame."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from ahgateway.apps.check.live import LiveBench, bench_lease, only_virtual
from ahgateway.apps.check.pace import Pace
from ahgateway.apps.check.result import Result, Verdict
from ahgateway.apps.check.suite import results
from ahgateway.clock import MILLISECOND, SECOND, VirtualClock
from ahgateway.codec.access import Request
from ahgateway.codec.devices import parse_device
from ahgateway.codec.station import Loop
from ahgateway.errors import LinkError, StateError
from ahgateway.fake.plc import FakePlc
from ahgateway.schema.profile import load
from ahgateway.schema.scenario import Scenario, library, parse
from ahgateway.transports.base import Reply
from ahgateway.transports.memory import MemoryLink

PROFILE = load("live_bench")
STATION = PROFILE.station()
LATENCY_NS = 2 * MILLISECOND

STEP = """
title = "A step on a real PLC"
instruction = "DPIDE"
duration = 8.0
plant = { kind = "fopdt", gain = 1.2, tau_s = 1.0, dead_time_s = 0.1, bias = 10.0, noise = 0.02, initial = 50.0 }
initial = { SV = 50.0, CYCLE = 100, Kc_Kp = 1.2, Ti_Ki = 0.9 }

[[step]]
at = 4.0
set = { SV = 60.0 }

[expect]
coverage = 0.8
clamps = true

[[expect.response]]
after = 4.0
overshoot = 30.0
steady_error = 1.0
direction = "up"
"""


class Bench:
    """A PLC with no process of its own, reached over a link in virtual time."""

    def __init__(self, folder: Path, fault: str | None = None) -> None:
        self.clock = VirtualClock(utc_start_ns=1_795_262_400 * SECOND)
        self.plc = FakePlc(STATION, PROFILE.fake_setup(), clock=self.clock, seed=3)
        self.folder = folder
        if fault is not None:
            self.plc.fail("DPIDE", fault)

    def found(self) -> list[object]:
        return [self.plc.read("DPIDE", name) for name in ("SV", "PV", "CYCLE", "Kc_Kp", "Ti_Ki", "PID_MAN")]

    def link(self) -> MemoryLink:
        return MemoryLink(self.plc, self.clock, latency_ns=LATENCY_NS)

    def run(self, wanted: Scenario, link: object = None, loop: Callable[[Loop], Loop] = lambda loop: loop) -> Result:
        station = replace(STATION, loops=tuple(loop(each) for each in STATION.loops))
        bench = LiveBench(station, link or self.link(), self.clock, self.folder)  # type: ignore[arg-type]

        async def first() -> Result:
            return await anext(results([wanted], bench, self.clock))

        return asyncio.run(first())


def scenario(text: str = STEP) -> Scenario:
    return parse(text, "step.toml", "mine/step")


AS_FOUND = [33.0, 30.0, 500, 1.25, 0.5, False]


def test_a_loop_is_closed_over_the_link_and_everything_is_put_back(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    result = bench.run(scenario())

    assert (Verdict.PASS, "6 expectations met") == (result.verdict, result.reason)
    assert (0, 160) == (result.pace["late"], round(result.pace["steps"], -1))
    assert AS_FOUND == bench.found()
    assert {"link"} == {each.who for each in bench.plc.writes}


def test_a_wrong_controller_is_convicted_over_the_link(tmp_path: Path) -> None:
    result = Bench(tmp_path, "ki-1-percent").run(scenario())

    assert (Verdict.FAIL, True) == (result.verdict, result.reason.startswith("shadow: "))


def test_the_time_line_ramps_loads_freezes_and_cuts_the_link(tmp_path: Path) -> None:
    deeds = (
        STEP.replace(
            "[expect]",
            """[[step]]
at = 1.0
until = 2.0
ramp = { SV = 55.0 }

[[step]]
at = 2.5
until = 3.0
do = "link-down"

[[step]]
at = 3.2
until = 3.6
set = { PV = 70.0 }

[[step]]
at = 5.0
until = 6.0
load = -10.0

[expect]
recovery = 1.0""",
        )
        .replace("coverage = 0.8\n", "")
        .replace('direction = "up"\n', "")
    )
    bench = Bench(tmp_path)
    result = bench.run(scenario(deeds))

    assert Verdict.PASS is result.verdict, result.reason
    sv = dict(zip(result.trace["t"], result.trace["SV"], strict=True))
    assert any(51.0 < value < 54.0 for t, value in sv.items() if 1.2 < t < 1.8)
    assert 55.0 == next(value for t, value in sv.items() if t > 2.2)
    assert not [t for t in sv if 2.55 < t < 2.95]
    assert 70.0 in [value for t, value in zip(result.trace["t"], result.trace["PV"], strict=True) if 3.2 < t < 3.7]


# A broken bench is never the product's fault.


def test_a_program_that_writes_pv_itself_is_found_before_anything_else(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    for number in range(4000):
        bench.plc.at(number * 50 * MILLISECOND, lambda plc: plc.write("DPIDE", "PV", 12.5))
    result = bench.run(scenario())

    assert Verdict.ERROR is result.verdict
    assert "the PLC program or another master writes it too" in result.reason
    assert [33.0, 12.5, 500] == bench.found()[:3]


def test_pv_that_somebody_overwrites_later_ends_the_scenario(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    bench.plc.at(9 * SECOND, lambda plc: plc.write("DPIDE", "PV", 12.5))
    result = bench.run(scenario(STEP.replace("overshoot = 30.0", "settling = 0.2")))

    assert Verdict.INCONCLUSIVE is result.verdict
    assert "PV at D102 holds [0, 16712]" in result.reason
    assert AS_FOUND == bench.found()


def test_a_stop_is_the_benchs_trouble(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    bench.plc.at(9 * SECOND, FakePlc.stop)
    result = bench.run(scenario(STEP.replace("overshoot = 30.0", "settling = 0.2")))

    assert Verdict.FAIL is not result.verdict
    assert "the PLC is in STOP" in result.reason


class Failing:
    """A link that is down between two times, or takes longer from one time on."""

    def __init__(self, bench: Bench, down: tuple[int, int] = (0, 0), slow_ns: int = 0) -> None:
        self._inner, self._clock, self._down, self._slow_ns = bench.link(), bench.clock, down, slow_ns
        self.target, self.figures = self._inner.target, self._inner.figures

    async def exchange(self, request: Request) -> Reply:
        if self._down[0] <= self._clock.now_ns() < self._down[1]:
            await self._clock.sleep_ns(200 * MILLISECOND)
            raise LinkError("bench: nobody there")
        await self._clock.sleep_ns(self._slow_ns)
        return await self._inner.exchange(request)

    async def close(self) -> None:
        await self._inner.close()


def test_a_link_that_goes_down_is_the_benchs_trouble_and_everything_is_put_back_when_it_returns(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    strict = scenario(STEP.replace("overshoot = 30.0", "settling = 0.2"))
    result = bench.run(strict, Failing(bench, (9 * SECOND, 18 * SECOND)))

    assert (Verdict.INCONCLUSIVE, True) == (result.verdict, "link down" in result.reason)
    assert AS_FOUND == bench.found()


def test_a_slow_line_is_the_benchs_trouble(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    result = bench.run(scenario(STEP.replace("overshoot = 30.0", "settling = 0.2")), Failing(bench, slow_ns=60_000_000))

    assert Verdict.FAIL is not result.verdict
    assert "more than a step of 0.05 s: the line or this computer is too slow for this CYCLE" in result.reason
    assert AS_FOUND == bench.found()


def test_a_computer_that_is_too_slow_from_some_moment_on_is_the_benchs_trouble(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    slow = Failing(bench)
    bench.plc.at(9 * SECOND, lambda plc: setattr(slow, "_slow_ns", 15_000_000))
    result = bench.run(scenario(STEP.replace("overshoot = 30.0", "settling = 0.2")), slow)

    assert Verdict.FAIL is not result.verdict
    assert "came too late: the line or this computer is too slow for this CYCLE" in result.reason


def test_a_wrong_profile_is_the_benchs_trouble(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    elsewhere = {"MV": parse_device("D600")}
    result = bench.run(scenario(), loop=lambda loop: replace(loop, bindings={**loop.bindings, **elsewhere}))

    assert Verdict.ERROR is result.verdict
    assert "MV at D600 holds 0 in manual, MOUT is 1: wrong profile" in result.reason
    assert AS_FOUND == bench.found()


# What is refused, and what is left when we are killed.


def test_a_scenario_that_writes_what_the_profile_does_not_list_is_refused_whole(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    without = lambda loop: replace(loop, writes={k: v for k, v in loop.writes.items() if k not in ("PV", "SV")})  # noqa: E731
    result = bench.run(scenario(), loop=without)

    assert Verdict.ERROR is result.verdict
    assert "writes PV, SV, which [loops.DPIDE.write] does not list" in result.reason
    assert not bench.plc.writes


def test_a_station_that_is_no_bench_is_refused(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    live = LiveBench(replace(STATION, bench=False), bench.link(), bench.clock, tmp_path)

    with pytest.raises(StateError, match="is no bench"):
        asyncio.run(live.run(scenario(), 1, bench.clock))
    assert not bench.plc.writes


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("stop-restart", "it asks for restart and stop"),
        ("fresh-pv", "fresh_pv needs a picture of every scan"),
        ("not-a-number", "no finite number"),
        ("setpoint-step", ""),
    ],
)
def test_what_only_a_fake_can_do_says_why(name: str, reason: str) -> None:
    from ahgateway.schema.scenario import load as loaded

    said = only_virtual(loaded(library() / "dpide" / f"{name}.toml"))
    assert reason in said
    assert bool(reason) == bool(said)


class Killed(BaseException):
    """The process ends here: nothing that it would still do happens."""


def test_what_a_killed_run_left_is_put_back_by_the_next(tmp_path: Path) -> None:
    bench = Bench(tmp_path)

    class Dies(Failing):
        async def exchange(self, request: Request) -> Reply:
            if self._clock.now_ns() > 9 * SECOND:
                raise Killed
            return await super().exchange(request)

    with pytest.raises(Killed):
        bench.run(scenario(), Dies(bench))
    assert AS_FOUND != bench.found()
    journal = next(tmp_path.glob("*.jsonl"))
    streamed = [each for line in journal.read_text().splitlines() if (each := json.loads(line))["kind"] == "stream"]
    assert ["PV"] == [item["operand"] for each in streamed for item in each["items"]]
    result = bench.run(scenario())

    assert (Verdict.PASS, AS_FOUND) == (result.verdict, bench.found())


def test_one_bench_has_one_owner_until_it_lets_go(tmp_path: Path) -> None:
    mine = bench_lease(tmp_path, "modbus+tcp://192.0.2.7:502?unit=1", "night")

    with pytest.raises(StateError, match=r"bench modbus\+tcp://192.0.2.7:502 is taken by another run .*night"):
        bench_lease(tmp_path, "modbus+tcp://192.0.2.7:502", "day")
    bench_lease(tmp_path, "modbus+tcp://192.0.2.8:502", "day").release()
    mine.release()
    bench_lease(tmp_path, "modbus+tcp://192.0.2.7:502", "day").release()


# Pace.


def test_pace_counts_what_came_late_and_what_was_missed() -> None:
    pace = Pace(1000, 100)
    begun = []
    for late in (0, 30, 250, 0, 99):
        begun.append(pace.due_ns)
        pace.begin(pace.due_ns + late)
        pace.end(0, 40)

    assert [1000, 1100, 1200, 1500, 1600] == begun
    assert (5, 2, False) == (pace.steps, pace.late, pace.is_kept)
    figures = pace.figures()
    assert (30e-6, 250e-6, 40e-6) == (
        figures["jitter_median_ms"], figures["jitter_max_ms"], figures["step_median_ms"]
    )  # fmt: skip
