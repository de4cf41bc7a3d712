"""Step 1, find the link: does the target answer, as which unit, in which framing, how fast, in how long requests?

What the profile says is tried first. Only when that is silent, other settings are tried in a sensible order within a
stated time, each with a proof read: the loop's first registers twice, in two lengths that must agree.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Iterator
from dataclasses import dataclass, replace
from statistics import median
from typing import Any

from ahgateway.apps.commission.checks import Check, failed, judged, passed, skipped, unclear
from ahgateway.clock import MILLISECOND, SECOND, Clock
from ahgateway.codec import block
from ahgateway.codec.access import Read, Span, Table
from ahgateway.codec.station import Loop, Station
from ahgateway.errors import AhGatewayError, PlcRefusedError, TransportError
from ahgateway.lockstep.picture import Sampler, Sees
from ahgateway.transports.base import Link

ROUNDS = 20
BUDGET_NS = 60 * SECOND
LENGTHS = (125, 100, 64, 32, 20)
UNITS = (1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 0, 255)
SERIAL = (
    "baud=9600&parity=E&bits=7", "baud=9600&parity=E", "baud=19200&parity=E", "baud=38400&parity=E",
    "baud=57600&parity=E", "baud=115200&parity=E", "baud=9600&parity=N", "baud=19200&parity=N", "baud=115200&parity=N",
)  # fmt: skip
"""Delta's factory setting first; seven bits only where the line speaks ASCII."""
BUSY = 6

Opener = Callable[[Station], Awaitable[Link]]
"""Opens the link to a station; the caller closes it."""


@dataclass(frozen=True, slots=True)
class Found:
    """The way that answers, and what is to be changed in the profile to use it: key of [station] to value."""

    station: Station
    changes: dict[str, str | int]


async def find(
    station: Station, loop: Loop, opener: Opener, clock: Clock, sees: Sees | None = None
) -> tuple[Found | None, list[Check]]:
    """Return the way to the PLC and the checks of step 1; None when nothing answered.

    Args:
        station: As the profile says.
        loop: Its registers are read as the proof.
        opener: Opens a link to a variant of the station.
        clock: Bounds the search and measures round trips.
        sees: Shown every picture.
    """
    tried: list[str] = []
    ends_ns = clock.now_ns() + BUDGET_NS
    for variant in _variants(station):
        if tried and clock.now_ns() >= ends_ns:
            break
        if await _answers(variant, loop, opener):
            found = Found(variant, _changes(station, variant))
            return found, [*_identity(station, variant), *await _measured(found, loop, opener, clock, sees)]
        tried.append(_name(variant))
    names = ("wrong-unit", "wrong-framing", "short-requests", "slow-link", "busy")
    text = f"nothing answers; {len(tried)} settings tried: {', '.join(tried[:6])}{', …' if len(tried) > 6 else ''}"
    return None, [failed("no-answer", text), *(skipped(name, "nothing answers") for name in names)]


def _name(station: Station) -> str:
    return f"{station.target} unit {station.unit}"


def _variants(station: Station) -> Iterator[Station]:
    """The profile's own settings first, then other units, then other framings of the same place."""
    yield station
    for unit in UNITS:
        if unit != station.unit:
            yield _with(station, unit=unit)
    for target in _framings(station.target):
        for unit in dict.fromkeys((station.unit, 1)):
            yield _with(station, target=target, unit=unit)


def _with(station: Station, *, target: str | None = None, unit: int | None = None) -> Station:
    text = target or station.target
    base, _, query = text.partition("?")
    options = "&".join(option for option in query.split("&") if option and not option.startswith("unit="))
    return replace(
        station, target=f"{base}?{options}" if options else base, unit=station.unit if unit is None else unit
    )


def _framings(target: str) -> list[str]:
    scheme, _, rest = target.partition("://")
    place = rest.partition("?")[0]
    if scheme in ("modbus+rtu", "modbus+ascii"):
        found = [f"modbus+ascii://{place}?{options}" for options in SERIAL]
        found += [f"modbus+rtu://{place}?{options}" for options in SERIAL if "bits=7" not in options]
        return [each for each in found if each != target]
    if scheme in ("modbus+tcp", "modbus+rtu+tcp", "modbus+ascii+tcp"):
        place = place if ":" in place else f"{place}:502"
        return [
            f"{other}://{place}" for other in ("modbus+tcp", "modbus+rtu+tcp", "modbus+ascii+tcp") if other != scheme
        ]
    return []


async def _answers(station: Station, loop: Loop, opener: Opener) -> bool:
    """Prove one way: the same registers in two lengths, which must agree; a refusal is an answer too."""
    link: Link | None = None
    try:
        link = await opener(station)
        span = _first_span(station, loop)
        for _ in range(3):
            try:
                whole = await link.exchange(Read(station.unit, span.table, span.address, span.count))
                part = await link.exchange(Read(station.unit, span.table, span.address, span.count - 1))
            except PlcRefusedError as error:
                if error.code != BUSY:
                    return True
                continue
            if whole.values[: span.count - 1] == part.values:
                return True
        return False
    except AhGatewayError:
        return False
    finally:
        if link is not None:
            await link.close()


def _first_span(station: Station, loop: Loop) -> Span:
    """Words that stand still: CYCLE and its neighbour are written by nobody."""
    spans = [span for span in block.spans(loop, station.devices).values() if span.table is Table.HOLDING]
    by_name = block.spans(loop, station.devices)
    return by_name["CYCLE"] if by_name.get("CYCLE") in spans else spans[0]


def _changes(station: Station, found: Station) -> dict[str, str | int]:
    changes: dict[str, str | int] = {}
    if (
        found.target.partition("?")[0] != station.target.partition("?")[0]
        or found.target.partition("://")[0] != (station.target.partition("://")[0])
    ):
        changes["target"] = found.target
    if found.unit != station.unit:
        changes["unit"] = found.unit
        if "unit=" in station.target:
            changes["target"] = found.target
    return changes


def _identity(station: Station, found: Station) -> list[Check]:
    is_framing = found.target.partition("://")[0] == station.target.partition("://")[0]
    is_same = found.target.partition("?")[0] == station.target.partition("?")[0]
    return [
        passed("no-answer", f"{_name(found)} answers"),
        judged(
            "wrong-unit", found.unit == station.unit,
            f"unit {found.unit} answers" + ("" if found.unit == station.unit else f", unit {station.unit} is silent"),
        ),
        judged(
            "wrong-framing", is_framing and is_same,
            f"{found.target} answers" + ("" if is_framing and is_same else f", {station.target} is silent"),
        ),
    ]  # fmt: skip


async def _measured(found: Found, loop: Loop, opener: Opener, clock: Clock, sees: Sees | None) -> list[Check]:
    """Round trips, longest request, time of a picture; what is too long is noted as a change of the profile."""
    station = found.station
    link = await opener(station)
    try:
        longest = await _longest(station, loop, link)
        checks = [_short(station, found, longest)]
        if longest and longest < station.pacing.words_per_request_max:
            station = replace(station, pacing=replace(station.pacing, words_per_request_max=longest))
        return [*checks, *await _paced(station, loop, link, clock, sees)]
    except TransportError as error:
        return [unclear(name, error.message) for name in ("short-requests", "slow-link", "busy")]
    finally:
        await link.close()


async def _longest(station: Station, loop: Loop, link: Link) -> int:
    """Longest read that is answered; 0 when even the shortest is refused."""
    address = min(span.address for span in block.spans(loop, station.devices).values() if span.table is Table.HOLDING)
    for length in LENGTHS:
        span = Span(Table.HOLDING, address, length)
        if not station.devices.covers(span):
            continue
        for _ in range(3):
            try:
                await link.exchange(Read(station.unit, span.table, span.address, span.count))
            except PlcRefusedError as error:
                if error.code != BUSY:
                    break
            else:
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
        elif _is_legal(loop, picture.inputs.cycle):
            cycle_s = float(loop.controller.nominal_ts(picture.inputs))
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


def _is_legal(loop: Loop, cycle: int) -> bool:
    row = loop.controller.operand("CYCLE")
    return (row.minimum or 0) <= cycle <= (row.maximum or cycle)


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
