"""The shipped scenarios proven: the whole library, every wrong controller and every dialect, simulated ÷ wall time.

python tests/bench/bench_check.py [library|wires|mutants|dialects|speed]

Exits 1 when a scenario does not pass or the library takes a minute, a wire changes words, a wrong controller is missed,
half of the dialects leave the usual words, or a loop of one second runs less than 500 times as fast as real time. Time
is CPU time, so that a busy machine does not count.
"""

from __future__ import annotations

import asyncio
import sys
import time
from dataclasses import replace

from ahgateway.apps.check.expect import judged
from ahgateway.apps.check.result import State, Verdict
from ahgateway.apps.check.run import Bench, run
from ahgateway.apps.check.suite import results
from ahgateway.apps.check.wires import WIRES
from ahgateway.clock import MILLISECOND, WallClock
from ahgateway.codec.station import Station
from ahgateway.core.controllers.block_axes import axes_of
from ahgateway.core.dialect import AXES
from ahgateway.fake.call_faults import CALL_FAULTS
from ahgateway.fake.faults import FAULTS
from ahgateway.schema.profile import load
from ahgateway.schema.scenario import collected, library, parse

WALL = WallClock()
INSTRUCTIONS = ("dpid", "dpide", "melsec_pid", "pid_reg_ce", "pid_temp")


def say(line: str) -> None:
    sys.stdout.write(line + "\n")
    sys.stdout.flush()


LIBRARY_MAX_S = 60.0
SPEED_MIN = 500.0
failed: list[str] = []


def bar(is_met: bool, what: str) -> None:
    if not is_met:
        failed.append(what)
        say(f"BELOW THE BAR: {what}")


def bench() -> Bench:
    station = load(str(library() / "bench.toml")).station()
    return Bench(station, station)


async def whole() -> None:
    """The library on a healthy fake: verdicts and time."""
    begun_s, simulated_s, count = time.process_time(), 0.0, 0
    async for result in results(collected([*INSTRUCTIONS, "plants"]), bench(), WALL):
        count, simulated_s = count + 1, simulated_s + result.simulated_s
        say(f"{result.name:26} {result.verdict.value:12} {result.wall_s:5.2f} s  {result.reason[:90]}")
        bar(result.verdict is Verdict.PASS, f"{result.name} is {result.verdict.value}")
    took_s = time.process_time() - begun_s
    say(f"{count} scenarios, {simulated_s:.0f} s simulated in {took_s:.1f} s of CPU time")
    bar(0 < took_s < LIBRARY_MAX_S and count > 0, f"the library takes {took_s:.0f} s, allowed {LIBRARY_MAX_S:.0f} s")


async def wires() -> None:
    """The conformance library over each wire: the same words as in memory."""
    scenarios = collected(["conformance"])
    here = {each.name: (await run(each, bench(), 1, WALL)).digests for each in scenarios}
    for name, wire in WIRES.items():
        begun_s, differing = time.process_time(), []
        for scenario in scenarios:
            seen = await run(scenario, replace(bench(), wire=wire), 1, WALL)
            if seen.digests != here[scenario.name] or seen.troubles:
                differing.append(scenario.name)
        took_s = time.process_time() - begun_s
        say(f"{name:6} {len(scenarios)} scenarios in {took_s:.1f} s, {len(differing)} differ {', '.join(differing)}")
        bar(not differing, f"{name} changes words")


async def mutants() -> None:
    """Each fault of the fake: which scenarios diverge, and which see it without the shadow."""
    for instruction in INSTRUCTIONS:
        scenarios = collected([instruction])
        law = scenarios[0].controller.name
        for name, fault in {**FAULTS, **CALL_FAULTS}.items():
            if law not in fault.controllers:
                continue
            caught, blind = [], []
            for scenario in scenarios:
                seen = await run(scenario, replace(bench(), fault=name), 1, WALL)
                violated = [each.name for each in judged(scenario, seen) if each.state is State.VIOLATED]
                if "shadow" in violated:
                    caught.append(scenario.name.partition("/")[2])
                if set(violated) - {"shadow"}:
                    blind.append(scenario.name.partition("/")[2])
            mark = "caught" if caught or blind else "MISSED"
            say(f"{instruction:6} {name:26} {mark} by {len(caught):2}/{len(scenarios)}, "
                  f"without the shadow by {len(blind)}: {', '.join(blind[:5])}")  # fmt: skip
            if caught and len(caught) <= 4:
                say(f"{'':34}only {', '.join(caught)}")
            bar(bool(caught or blind), f"{instruction} {name} is missed")


async def dialects() -> None:
    """Each other value of each axis, told apart by the fingerprints of the library."""
    ground = bench()
    for instruction in ("dpid", "dpide"):
        scenarios = collected([instruction])
        usual = {each.name: (await run(each, ground, 1, WALL)).digests for each in scenarios}
        told = count = 0
        axes = {axis.name for axis in axes_of(scenarios[0].controller.name)}
        for axis, values in AXES.items():
            if axis not in axes:
                continue  # of the other instruction
            for value in list(values)[1:]:
                fake = with_axis(ground.station, axis, value)
                hit = None
                for scenario in scenarios:
                    seen = await run(scenario, replace(ground, station=fake, fake=fake), 1, WALL)
                    if seen.digests != usual[scenario.name]:
                        hit = scenario.name
                        break
                say(f"{instruction:6} {axis}={value.name.lower():24} {hit or 'the same words'}")
                told, count = told + (hit is not None), count + 1
        say(f"{instruction:6} {told} of {count} values leave words of their own")
        bar(told > count // 2, f"{instruction}: {told} of {count} dialects are told apart")


def with_axis(station: Station, axis: str, value: object) -> Station:
    loops = [loop for loop in station.loops if axis in loop.controller.axes]
    return replace(
        station, loops=tuple(replace(each, dialect=each.dialect._replace(**{axis: value})) for each in loops)
    )


SLOW = """
title = "A loop of one second"
instruction = "DPIDE"
duration = 600.0
plant = { kind = "fopdt", gain = 1.2, tau_s = 60.0, dead_time_s = 4.0, bias = 10.0, noise = 0.02, initial = 20.0 }
[initial]
SV = 50.0
CYCLE = 1000
Kc_Kp = 2.0
Ti_Ki = 0.02
[[step]]
at = 300.0
set = { SV = 60.0 }
"""


async def speed() -> None:
    """Simulated ÷ CPU time of one loop at CYCLE 1 s, by the length of a scan."""
    scenario = parse(SLOW, "slow.toml", "bench/slow")
    for scan_ms in (10, 50, 100):
        ratios = []
        for _ in range(3):
            begun_s = time.process_time()
            seen = await run(scenario, replace(bench(), scan_ns=scan_ms * MILLISECOND), 1, WALL)
            ratios.append(seen.simulated_s / (time.process_time() - begun_s))
        best = max(ratios)
        say(f"scan {scan_ms:3} ms: {best:6.0f} times real time, {seen.counts.informative} proven")
        bar(best >= SPEED_MIN, f"{best:.0f} times real time at scans of {scan_ms} ms, asked for {SPEED_MIN:.0f}")


WHAT = {"library": whole, "wires": wires, "mutants": mutants, "dialects": dialects, "speed": speed}


def main() -> int:
    for name in sys.argv[1:] or ["library", "speed"]:
        asyncio.run(WHAT[name]())
    return 1 if failed else 0


if __name__ == "__main__":
    raise SystemExit(main())
