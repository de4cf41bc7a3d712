"""Where the PLC may answer, in a sensible order: units, framings, line settings, other ports; each with a proof read.

What the profile says is tried first, with all the patience of its own time-out. Only when that is silent, other ways
are tried for a stated time, each with as short a wait as its speed allows. The order is Delta's factory setting, then
what people change first: the framing, the parity, the baud rate. The proof is two reads in two lengths that must
agree; a refusal of the PLC's own is a proof too, since its checksum came through.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace

from ahgateway.clock import MILLISECOND, SECOND, Clock
from ahgateway.codec import block
from ahgateway.codec.access import Read, Span, Table
from ahgateway.codec.station import Loop, Station
from ahgateway.core.operands import Access, Kind
from ahgateway.errors import AhGatewayError, LinkError, PlcRefusedError, ProfileError
from ahgateway.transports.base import Link
from ahgateway.transports.floor import round_trip_floor_ns
from ahgateway.transports.uri import line_of, parse_uri

SEARCH_NS = 60 * SECOND
ANSWER_NS = 250 * MILLISECOND
"""So long a PLC may think while ways are tried; a scan ends within it."""
UNITS = (1, 2, 3, 4, 5, 6, 7, 8, 9, 10)
TCP_UNITS = (*UNITS, 0, 255)
BAUDS = (9600, 19200, 38400, 115200, 57600)
ASCII_FRAMES = (("E", 7), ("O", 7), ("N", 7), ("N", 8), ("E", 8))
RTU_FRAMES = (("E", 8), ("N", 8), ("O", 8))
SERIAL = ("modbus+rtu", "modbus+ascii")
TCP = ("modbus+tcp", "modbus+rtu+tcp", "modbus+ascii+tcp")
CLOSED_TRIES = 3
"""A port that gives the same error so often is not there; one that refuses a setting says which."""
NOT_THERE = frozenset({10, 11})
"""Exceptions of a gateway that cannot reach the unit: no answer of a PLC."""

Opener = Callable[[Station], Awaitable[Link]]
"""Opens the link to a station; the caller closes it."""


@dataclass(slots=True)
class Search:
    """What was tried.

    Attributes:
        found: The way that answers, None when none did.
        tried: How many ways, and the first of them by name.
        noisy: Ways on which bytes came that are no answer: the line lives, its settings do not fit.
        closed: Why ports could not be opened, and how often they could not.
    """

    found: Station | None = None
    tried: int = 0
    first: list[str] = field(default_factory=list)
    noisy: list[str] = field(default_factory=list)
    closed: dict[str, list[str]] = field(default_factory=dict)

    @property
    def text(self) -> str:
        """What was tried, as part of a sentence."""
        parts = [f"{self.tried} way{'s' if self.tried != 1 else ''} tried: {', '.join(self.first)}"]
        if self.tried > len(self.first):
            parts[0] += ", …"
        if self.noisy:
            parts.append(f"bytes that are no answer came at {', '.join(self.noisy[:3])}: the line lives")
        parts += [texts[-1] for port, texts in self.closed.items() if self.is_closed(port)]
        return "; ".join(parts)

    def is_closed(self, port: str) -> bool:
        """Tell whether a port cannot be opened, whatever its settings."""
        texts = self.closed.get(port, [])
        return len(texts) >= CLOSED_TRIES and len(set(texts[-CLOSED_TRIES:])) == 1


async def search(
    station: Station, loop: Loop, opener: Opener, clock: Clock, *, ports: Iterable[str] = (), budget_ns: int = SEARCH_NS
) -> Search:
    """Try the profile's own way, then others until the time is over.

    Args:
        station: As the profile says.
        loop: Its registers are read as the proof.
        opener: Opens a link to a variant of the station.
        clock: Bounds the search.
        ports: Other serial ports of this machine, where the profile's own is one.
        budget_ns: How long other ways are tried.
    """
    done = Search()
    ends_ns = clock.now_ns() + budget_ns
    for variant in ways(station, ports):
        if done.tried and clock.now_ns() >= ends_ns:
            break
        if done.is_closed(_port(variant.target)):
            continue
        done.tried += 1
        if len(done.first) < 5:
            done.first.append(name(variant))
        if await _answers(variant if done.tried == 1 else _hasty(variant, loop), loop, opener, done):
            done.found = variant
            break
    return done


def name(station: Station) -> str:
    """Return a way by name."""
    return f"{station.target} unit {station.unit}"


def ways(station: Station, ports: Iterable[str] = ()) -> Iterator[Station]:
    """The profile's own way first; then its own unit and unit 1 on all settings; then other units; then other ports."""
    yield station
    told = {(station.target, station.unit)}
    for target, unit in _others(station, ports):
        if (target, unit) not in told:
            told.add((target, unit))
            yield replace(station, target=target, unit=unit)


def _others(station: Station, ports: Iterable[str]) -> Iterator[tuple[str, int]]:
    scheme, _, rest = station.target.partition("://")
    place = rest.partition("?")[0]
    near = tuple(dict.fromkeys((station.unit, 1)))
    if scheme in SERIAL:
        for port in (place, *(each for each in ports if each != place)):
            settings = list(_settings(scheme, port, _plain(station.target) if port == place else ""))
            yield from ((target, unit) for target in settings for unit in near)
            yield from ((target, unit) for target in settings for unit in UNITS if unit not in near)
    elif scheme in TCP:
        own = _plain(station.target)
        host, _, number = place.rpartition(":") if place.count(":") else (place, "", "")
        target_port = number or "502"
        yield from ((own, unit) for unit in TCP_UNITS)
        others = [f"{each}://{host or place}:{target_port}" for each in TCP if each != scheme]
        if target_port != "502":
            others.append(f"modbus+tcp://{host}:502")
        yield from ((target, unit) for target in others for unit in near)
        yield from ((target, unit) for target in others for unit in UNITS if unit not in near)


def _plain(target: str) -> str:
    """The target without a unit in it: the station says it."""
    base, _, query = target.partition("?")
    options = "&".join(option for option in query.split("&") if option and not option.startswith("unit="))
    return f"{base}?{options}" if options else base


def _settings(scheme: str, port: str, own: str) -> Iterator[str]:
    """Own settings in both framings, the factory's, then by baud rate."""
    if own:
        yield own
    factory = f"modbus+ascii://{port}?baud=9600&parity=E&bits=7"
    yield factory
    bauds = list(BAUDS)
    if own:
        line = line_of(parse_uri(own))
        bauds = list(dict.fromkeys((line.baud, *BAUDS)))
    for baud in bauds:
        for parity, _ in RTU_FRAMES:
            yield f"modbus+rtu://{port}?baud={baud}&parity={parity}"
        for parity, bits in ASCII_FRAMES:
            yield f"modbus+ascii://{port}?baud={baud}&parity={parity}&bits={bits}"


def _port(target: str) -> str:
    scheme, _, rest = target.partition("://")
    return rest.partition("?")[0] if scheme in SERIAL else ""


def _hasty(station: Station, loop: Loop) -> Station:
    """The same way with as little patience as its speed allows."""
    pacing, wait_ns = station.pacing, ANSWER_NS
    target = parse_uri(station.target)
    if target.scheme in SERIAL:
        wait_ns += round_trip_floor_ns(_proof(station, loop), line_of(target), is_rtu=target.scheme == SERIAL[0])
    wait_ms = min(pacing.reply_timeout_ms, wait_ns // MILLISECOND)
    return replace(station, pacing=replace(pacing, reply_timeout_ms=max(1, wait_ms)))


def _proof(station: Station, loop: Loop) -> Read:
    span = still_words(station, loop)
    return Read(station.unit, span.table, span.address, span.count)


async def _answers(station: Station, loop: Loop, opener: Opener, done: Search) -> bool:
    """Prove one way: the same registers in two lengths, which must agree; a refusal is an answer too."""
    link: Link | None = None
    whole = _proof(station, loop)
    part = replace(whole, count=1)
    try:
        link = await opener(station)
        for _ in range(3):
            words = (await link.exchange(whole)).values
            if words[:1] == (await link.exchange(part)).values:
                return True
        return False
    except PlcRefusedError as error:
        return error.code not in NOT_THERE
    except LinkError as error:
        if port := _port(station.target):
            # Neither the target in front, which names the framing, nor what was asked: a port that refuses a setting
            # says another thing each time, one that is not there always the same.
            cause = error.message.partition(": ")[2].partition(", before an answer to")[0]
            done.closed.setdefault(port, []).append(f"{port}: {cause}")
        return False
    except ProfileError:
        raise
    except AhGatewayError:
        return False
    finally:
        if link is not None:
            if link.figures.garbage_bytes:
                done.noisy.append(name(station))
            await link.close()


def still_words(station: Station, loop: Loop) -> Span:
    """Two words that hardly anybody writes: an operand that is only read, no process value and no setpoint."""
    spans = block.spans(loop, station.devices)
    roles = loop.controller.roles
    moving = {*roles.pvs, roles.sv, roles.mout}
    rows = [row for row in loop.controller.operands if row.name in spans and row.kind is not Kind.BOOL]
    rows.sort(key=lambda row: (row.name in moving or row.access is not Access.IN, row.words < 2))
    for row in rows:
        span = spans[row.name]
        for address in (span.address, span.address - 1):
            two = Span(span.table, address, 2)
            if address >= 0 and span.table is Table.HOLDING and station.devices.covers(two):
                return two
    return Span(Table.HOLDING, 0, 2)
