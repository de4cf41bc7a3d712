"""Runs a set of scenarios one behind the other, each with its verdict; then what is known of them."""

from __future__ import annotations

import zlib
from collections.abc import AsyncIterator, Sequence
from dataclasses import replace
from datetime import date
from fnmatch import fnmatchcase
from typing import Protocol

from ahgateway.apps.check.expect import judged
from ahgateway.apps.check.result import Floor, Outcome, Result, State, Verdict, concluded, excused
from ahgateway.apps.check.watch import Seen
from ahgateway.clock import SECOND, Clock
from ahgateway.errors import AhGatewayError
from ahgateway.schema.scenario import KnownForm, Scenario

TRACE_MAX = 1500
"""Most points kept of a trace."""


class Ground(Protocol):
    """What scenarios run on: a fake in virtual time, or a real PLC."""

    @property
    def target(self) -> str:
        """What people call it."""

    @property
    def is_repeatable(self) -> bool:
        """Tell whether equal seeds leave equal words."""

    def floors(self, scenarios: Sequence[Scenario], seed: int, wall: Clock) -> AsyncIterator[tuple[str, Floor]]:
        """Try the ground itself, for each instruction among the scenarios."""

    async def run(self, scenario: Scenario, seed: int, wall: Clock) -> Seen:
        """Run one scenario."""


async def results(
    scenarios: Sequence[Scenario],
    bench: Ground,
    wall: Clock,
    *,
    seed: int = 1,
    repeat: int = 1,
    known: Sequence[KnownForm] = (),
    today: date | None = None,
) -> AsyncIterator[Result]:
    """Yield the result of each scenario as it comes.

    Args:
        scenarios: What to run, in order.
        bench: What to run it on.
        wall: Real time.
        seed: Of the noise; the second repetition takes the next one.
        repeat: How often to run each.
        known: Differences that are known.
        today: Day that decides which of them have expired; None: none has.
    """
    for scenario in scenarios:
        for number in range(repeat):
            name = scenario.name if repeat == 1 else f"{scenario.name}#{number + 1}"
            result = await _one(scenario, name, bench, seed + number, wall)
            yield with_known(result, scenario.name, known, today)


async def _one(scenario: Scenario, name: str, bench: Ground, seed: int, wall: Clock) -> Result:
    begun_ns = wall.now_ns()
    head = Result(name, scenario.title, scenario.controller.name, Verdict.ERROR, "", seed=seed)
    try:
        # A scenario keeps its noise whatever runs beside it.
        seen = await bench.run(scenario, zlib.crc32(f"{scenario.name} {seed}".encode()), wall)
    except AhGatewayError as error:
        text = f"{error}; hint: {error.hint}" if error.hint else str(error)
        return replace(head, reason=text, wall_s=(wall.now_ns() - begun_ns) / SECOND)
    outcomes = excused(judged(scenario, seen), seen.troubles)
    verdict, reason = concluded(outcomes, seen.troubles)
    return replace(
        head,
        verdict=verdict,
        reason=reason,
        outcomes=outcomes,
        troubles=tuple(seen.troubles),
        counts=seen.counts,
        digests=tuple(seen.digests) if bench.is_repeatable else told(outcomes),
        pace=seen.pace,
        trace=trace_of(seen),
        simulated_s=seen.simulated_s,
        wall_s=(wall.now_ns() - begun_ns) / SECOND,
    )


def told(outcomes: Sequence[Outcome]) -> tuple[int, ...]:
    """Return CRC32s of what became of each expectation: all that two runs in real time can have in common."""
    return tuple(zlib.crc32(f"{each.name} {each.state.value}".encode()) for each in outcomes)


def trace_of(seen: Seen) -> dict[str, list[float]]:
    """Return time, SV, PV and MV of a scenario, thinned to `TRACE_MAX` points."""
    every = max(1, -(-len(seen.moments) // TRACE_MAX))
    kept = seen.moments[::every]
    return {
        "t": [each.t_s for each in kept],
        "SV": [each.sv for each in kept],
        "PV": [each.pv for each in kept],
        "MV": [each.mv for each in kept],
    }


def with_known(result: Result, name: str, known: Sequence[KnownForm], today: date | None) -> Result:
    """Return the result as KNOWN when every violation of it is covered; an entry that has expired says so."""
    if result.verdict is not Verdict.FAIL:
        return result
    violated = [each for each in result.outcomes if each.state is State.VIOLATED]
    covering = [next((entry for entry in known if _covers(entry, name, each)), None) for each in violated]
    entries = [entry for entry in covering if entry is not None]
    expired = [entry for entry in entries if today is not None and entry.expires < today]
    if expired:
        text = f"{result.reason}; known to {expired[0].owner} until {expired[0].expires}, which is over"
        return replace(result, reason=text)
    if len(entries) < len(violated):
        return result
    entry = entries[0]
    text = f"{result.reason}; known to {entry.owner} until {entry.expires}: {entry.reason}"
    return replace(result, verdict=Verdict.KNOWN, reason=text)


def _covers(entry: KnownForm, name: str, outcome: Outcome) -> bool:
    return fnmatchcase(name, entry.scenario) and fnmatchcase(outcome.name, entry.expectation)


def unused(known: Sequence[KnownForm], found: Sequence[Result]) -> list[KnownForm]:
    """Return the entries that cover no failure of this run, although they name a scenario of it."""
    idle = []
    for entry in known:
        named = [each for each in found if fnmatchcase(each.name.partition("#")[0], entry.scenario)]
        hit = [
            each
            for each in named
            for out in each.outcomes
            if out.state is State.VIOLATED and fnmatchcase(out.name, entry.expectation)
        ]
        if named and not hit:
            idle.append(entry)
    return idle


def sharded(scenarios: Sequence[Scenario], index: int, count: int) -> list[Scenario]:
    """Return the scenarios of one shard of several, index from 1; together the shards are the whole."""
    return [each for number, each in enumerate(scenarios) if number % count == index - 1]
