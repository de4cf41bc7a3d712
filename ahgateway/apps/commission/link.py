"""Step 1, find the link: does the target answer, as which unit, in which framing, how fast, in how long requests?

`link_search` finds the way. What is measured on it is what the profile's pacing needs: the longest request, requests
in flight, the time of a picture, an adapter that keeps bytes back, a connection that is closed while it idles.
"""

from __future__ import annotations

import asyncio
from collections.abc import Iterable
from dataclasses import dataclass, replace
from statistics import median
from typing import Any

from ahgateway.apps.commission.checks import Check, failed, judged, passed, skipped, unclear
from ahgateway.apps.commission.link_search import SERIAL, Opener, Search, name, search
from ahgateway.clock import MILLISECOND, SECOND, Clock
from ahgateway.codec import block
from ahgateway.codec.access import Read, Span, Table
from ahgateway.codec.station import Loop, Station
from ahgateway.errors import PlcRefusedError, TransportError
from ahgateway.lockstep.follow import cycle_ns
from ahgateway.lockstep.patient import BUSY, Patient
from ahgateway.lockstep.picture import Picture, Sampler, Sees
from ahgateway.transports.adapter import LATENCY_MS_GOOD, adapter_of, adapters
from ahgateway.transports.base import Link
from ahgateway.transports.uri import parse_uri

ROUNDS = 20
LENGTHS = (125, 100, 64, 32, 20)
IN_FLIGHT = (8, 4, 2)
IDLE_FIRST_NS = SECOND
NAMES = (
    "wrong-unit", "wrong-framing", "wrong-line", "wrong-port", "slow-adapter", "short-requests", "requests-in-flight",
    "slow-link", "busy", "idle-disconnect",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Found:
    """The way that answers, and what is to be changed in the profile to use it: key of [station] to value."""

    station: Station
    changes: dict[str, str | int]


@dataclass(frozen=True, slots=True)
class Patience:
    """How long step 1 may take beyond its few seconds.

    Attributes:
        search_ns: For trying other ways when the profile's own is silent.
        idle_ns: For finding out whether a connection is closed while it idles; 0 leaves it out.
    """

    search_ns: int = 60 * SECOND
    idle_ns: int = 40 * SECOND


PATIENCE = Patience()
"""What is waited when nobody says otherwise."""


async def find(
    station: Station,
    loop: Loop,
    opener: Opener,
    clock: Clock,
    sees: Sees | None = None,
    *,
    patience: Patience = PATIENCE,
    ports: Iterable[str] | None = None,
) -> tuple[Found | None, list[Check]]:
    """Return the way to the PLC and the checks of step 1; None when nothing answered.

    Args:
        station: As the profile says.
        loop: Its registers are read as the proof.
        opener: Opens a link to a variant of the station.
        clock: Bounds the search and measures round trips.
        sees: Shown every picture.
        patience: How long it may take.
        ports: Serial ports to try besides the profile's own; None for all of this machine.
    """
    others = tuple(each.port for each in adapters()) if ports is None else tuple(ports)
    done = await search(station, loop, opener, clock, ports=others, budget_ns=patience.search_ns)
    if done.found is None:
        checks = [failed("no-answer", f"nothing answers; {done.text}")]
        return None, [*checks, *(skipped(each, "nothing answers") for each in NAMES)]
    found = Found(done.found, _changes(station, done.found))
    return found, [*_identity(station, done), *await _measured(found, loop, opener, clock, sees, patience)]


def _changes(station: Station, found: Station) -> dict[str, str | int]:
    changes: dict[str, str | int] = {}
    if found.target != station.target or (found.unit != station.unit and "unit=" in station.target):
        changes["target"] = found.target
    if found.unit != station.unit:
        changes["unit"] = found.unit
    return changes


def _identity(station: Station, done: Search) -> list[Check]:
    found = done.found
    assert found is not None
    here, there = parse_uri(station.target), parse_uri(found.target)
    is_serial = here.scheme in SERIAL
    is_line = {**here.options, "unit": ""} == {**there.options, "unit": ""} or found.target == station.target
    silent = f"{name(station)} is silent"
    aspects = (
        ("wrong-unit", found.unit == station.unit, f"unit {found.unit} answers"),
        ("wrong-framing", here.scheme == there.scheme, f"{there.scheme} answers"),
    )
    checks = [
        passed("no-answer", f"{name(found)} answers; {done.text}" if done.tried > 1 else f"{name(found)} answers")
    ]
    checks += [judged(each, good, text if good else f"{text}, {silent}") for each, good, text in aspects]
    if not is_serial:
        why = "there is no serial line"
        return [*checks, skipped("wrong-line", why), skipped("wrong-port", why)]
    text = f"{found.target} answers"
    return [
        *checks,
        judged("wrong-line", is_line, text if is_line else f"{text}, {silent}"),
        judged("wrong-port", here.path == there.path, text if here.path == there.path else f"{text}, {silent}"),
    ]


async def _measured(
    found: Found, loop: Loop, opener: Opener, clock: Clock, sees: Sees | None, patience: Patience
) -> list[Check]:
    """Round trips, longest request, time of a picture; what is too long is noted as a change of the profile."""
    station = found.station
    checks = [_adapter(station)]
    link = await opener(station)
    try:
        if station.is_snapshot:
            longest = await _longest(station, loop, Patient(link, clock))
            checks.append(_short(station, found, longest))
            if longest and longest < station.pacing.words_per_request_max:
                station = replace(station, pacing=replace(station.pacing, words_per_request_max=longest))
        else:
            checks.append(skipped("short-requests", "SDO reads each object by itself"))
        checks.append(await _in_flight(station, found, loop, opener))
        checks += await _paced(station, loop, link, clock, sees)
        checks.append(await _idle(station, found, loop, link, clock, patience.idle_ns))
        return checks
    except TransportError as error:
        made = {check.name for check in checks}
        return [*checks, *(unclear(each, error.message) for each in NAMES[5:] if each not in made)]
    finally:
        await link.close()


def _adapter(station: Station) -> Check:
    """The latency timer of the USB adapter, where the system shows it."""
    target = parse_uri(station.target)
    if target.scheme not in SERIAL or "://" in target.path:
        return skipped("slow-adapter", "there is no adapter of this machine between us and the line")
    adapter = adapter_of(target.path)
    if adapter.latency_ms is None:
        return skipped("slow-adapter", f"{adapter.port}: {adapter.product} shows no latency timer")
    text = f"{adapter.port}: {adapter.product} keeps bytes back for up to {adapter.latency_ms} ms"
    return judged("slow-adapter", adapter.latency_ms <= LATENCY_MS_GOOD, text, latency_ms=adapter.latency_ms)


async def _longest(station: Station, loop: Loop, link: Link) -> int:
    """Longest read that is answered; 0 when even the shortest is refused."""
    address = _first_address(station, loop)
    for length in LENGTHS:
        if not station.devices.covers(Span(Table.HOLDING, address, length)):
            continue
        try:
            await link.exchange(Read(station.unit, Table.HOLDING, address, length))
        except PlcRefusedError:
            continue
        return length
    return 0


def _short(station: Station, found: Found, longest: int) -> Check:
    asked = station.pacing.words_per_request_max
    if not longest:
        return unclear("short-requests", "the PLC refuses the loop's registers in any length")
    text = f"{longest} words in one request are answered, the profile asks for up to {asked}"
    if longest < asked:
        found.changes["pacing.words_per_request_max"] = longest
    return judged("short-requests", longest >= asked, text, longest=longest)


async def _in_flight(station: Station, found: Found, loop: Loop, opener: Opener) -> Check:
    """How many requests may be under way at once; the profile's own number must work, more is only told."""
    asked = station.pacing.requests_in_flight_max
    if not station.target.startswith("modbus+tcp:"):
        return skipped("requests-in-flight", "this wire carries one request at a time")
    works = 1
    for count in (*(each for each in IN_FLIGHT if each > asked), *((asked,) if asked > 1 else ())):
        if await _answers_at_once(station, loop, opener, count):
            works = count
            break
    if works < asked:
        found.changes["pacing.requests_in_flight_max"] = works
    text = f"{works} at once {'are' if works > 1 else 'is'} answered, the profile asks for {asked}"
    return judged("requests-in-flight", works >= asked, text, in_flight=works)


async def _answers_at_once(station: Station, loop: Loop, opener: Opener, count: int) -> bool:
    """Send so many reads at once, each in a length of its own, and see all of them answered."""
    first = _first_address(station, loop)
    reads = [Read(station.unit, Table.HOLDING, first, 1 + number) for number in range(count)]
    link = await opener(replace(station, pacing=replace(station.pacing, requests_in_flight_max=count)))
    try:
        replies = await asyncio.gather(*(link.exchange(read) for read in reads), return_exceptions=True)
        return all(
            not isinstance(reply, BaseException) and len(reply.values) == read.count
            for read, reply in zip(reads, replies, strict=True)
        )
    finally:
        await link.close()


async def _paced(station: Station, loop: Loop, link: Link, clock: Clock, sees: Sees | None) -> list[Check]:
    sampler = Sampler(loop, station, link, clock, sees)
    times_ns: list[int] = []
    busy, torn, cycle_s = 0, 0, 0.0
    for _ in range(ROUNDS):
        begun_ns = clock.now_ns()
        try:
            picture = await sampler.picture()
        except PlcRefusedError as error:
            busy += error.code == BUSY
            if error.code != BUSY:
                return [unclear("slow-link", error.message), unclear("busy", error.message)]
            await clock.sleep_ns(20 * MILLISECOND)
            continue
        times_ns.append(clock.now_ns() - begun_ns)
        if picture is None:
            torn += 1
        elif _is_legal(loop, picture):
            cycle_s = cycle_ns(loop, picture) / SECOND
    asked = f"{busy} of {ROUNDS} pictures met a busy PLC"
    checks = [judged("busy", not busy, asked, busy=busy)]
    if torn and torn == len(times_ns):
        return [failed("slow-link", "an execution falls into every picture: the link is slower than CYCLE"), *checks]
    if not times_ns or not cycle_s:
        return [unclear("slow-link", "no picture of the loop with a legal CYCLE was taken"), *checks]
    middle, worst = median(times_ns) / MILLISECOND, max(times_ns) / MILLISECOND
    text = f"a picture takes {middle:.1f} ms, at worst {worst:.1f} ms; CYCLE is {cycle_s * 1000:g} ms"
    good = middle <= cycle_s * 250
    return [judged("slow-link", good, text, median_ms=round(middle, 3), worst_ms=round(worst, 3)), *checks]


async def _idle(station: Station, found: Found, loop: Loop, link: Link, clock: Clock, budget_ns: int) -> Check:
    """Leave the connection alone for longer and longer, and see whether it still is the same one."""
    if "tcp" not in station.target.partition("://")[0]:
        return skipped("idle-disconnect", "there is no connection that could be closed")
    if not budget_ns:
        return skipped("idle-disconnect", "not asked for: --idle SECONDS")
    read = Read(station.unit, Table.HOLDING, _first_address(station, loop), 1)
    wait_ns, good_ns, spent_ns = IDLE_FIRST_NS, 0, 0
    while spent_ns + wait_ns <= budget_ns:
        before = link.figures.reconnects
        await clock.sleep_ns(wait_ns)
        try:
            await link.exchange(read)
            is_same = link.figures.reconnects == before
        except TransportError:
            is_same = False
        if not is_same:
            return _closes(station, found, good_ns, wait_ns)
        spent_ns, good_ns, wait_ns = spent_ns + wait_ns, wait_ns, 2 * wait_ns
    return passed("idle-disconnect", f"a connection that idled for {good_ns / SECOND:g} s was still open")


def _closes(station: Station, found: Found, good_ns: int, bad_ns: int) -> Check:
    """The PLC closes an idle connection somewhere between two waits; ours is closed before that."""
    text = f"the connection was closed while it idled for {bad_ns / SECOND:g} s, after {good_ns / SECOND:g} s it stood"
    ours_ms = station.pacing.close_when_idle_ms
    if good_ns:
        found.changes["pacing.close_when_idle_ms"] = good_ns // MILLISECOND
    return judged("idle-disconnect", 0 < ours_ms * MILLISECOND < bad_ns, text, closed_within_s=bad_ns / SECOND)


def _is_legal(loop: Loop, picture: Picture) -> bool:
    """Tell whether CYCLE, where the controller has one, is within the manual's range."""
    row = next((row for row in loop.controller.operands if row.name == "CYCLE"), None)
    return row is None or (row.minimum or 0) <= picture.inputs.cycle <= (row.maximum or picture.inputs.cycle)


def _first_address(station: Station, loop: Loop) -> int:
    spans = block.spans(loop, station.devices).values()
    return min((span.address for span in spans if span.table is Table.HOLDING), default=0)


def amended(text: str, changes: dict[str, str | int]) -> str:
    """Return a profile's text with the changes made in [station]; comments and order are kept."""
    import tomlkit

    document = tomlkit.parse(text)
    for key, value in changes.items():
        table: Any = document["station"]
        *parents, last = key.split(".")
        for parent in parents:
            if parent not in table:
                table[parent] = tomlkit.table()
            table = table[parent]
        table[last] = value
    return tomlkit.dumps(document)
