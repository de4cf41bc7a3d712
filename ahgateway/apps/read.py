"""Single devices and whole operand blocks as they stand in the PLC: names in, typed values with their words out.

What is asked for is read in as few requests as the pacing allows; no value is ever put together from two requests.
A loop is one picture: everything in it stood there at one moment.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from typing import Any

from ahgateway.clock import Clock
from ahgateway.codec import block
from ahgateway.codec.access import Span
from ahgateway.codec.devices import WORD_BITS, Address, Device, parse_device
from ahgateway.codec.plan import plan
from ahgateway.codec.station import Const, Loop, Station
from ahgateway.codec.words import decode
from ahgateway.core.operands import Kind, Operand
from ahgateway.errors import CodecError
from ahgateway.lockstep.picture import Sampler
from ahgateway.transports.base import Link

COUNT_MAX = 1000


class Form(Enum):
    """How words are read."""

    REAL = "real"
    DINT = "dint"
    INT = "int"
    WORD = "word"
    BITS = "bits"


_KINDS = {Form.REAL: Kind.REAL, Form.DINT: Kind.DINT, Form.INT: Kind.INT}
_FORMS = {Kind.REAL: Form.REAL, Kind.DINT: Form.DINT, Kind.INT: Form.INT, Kind.BOOL: Form.BITS, Kind.BLOCK: Form.WORD}


@dataclass(frozen=True, slots=True)
class Wanted:
    """One value to be read.

    Attributes:
        device: Its first device as the map spells it.
        place: Where that stands.
        form: How to read it.
        span: All of it, never split.
        names: What the profile calls it, `TIC-101 SV`; several loops may share it.
        unit: Engineering unit, empty where nobody named one.
    """

    device: str
    place: Address
    form: Form
    span: Span
    names: tuple[str, ...] = ()
    unit: str = ""


@dataclass(frozen=True, slots=True)
class Reading:
    """One value and when it stood there.

    Attributes:
        name: Operand or what the profile calls the device; empty where it has no name.
        device: Its first device, None for a constant of the program.
        form: How it was read: a `Form` or an operand's kind, in lower case.
        value: Number, truth value, tuple of bits with bit 0 first, or None where only the words mean something.
        words: As they came, low word first.
        unit: Engineering unit.
        utc_ns: When the last of it had arrived.
        aligned_utc_ns: Since when the line had been proven aligned then; None where nobody knows.
    """

    name: str
    device: str | None
    form: str
    value: Any
    words: tuple[int, ...]
    unit: str
    utc_ns: int
    aligned_utc_ns: int | None = None


def wanted(station: Station, names: Sequence[str], form: Form | None, count: int) -> list[Wanted]:
    """Return what `count` values from each named device on are; without a form, what the profile says stands there.

    Raises:
        CodecError: No device of that name, outside the map, or it cannot be read in that form.
    """
    known = _operands(station)
    found = []
    for name in names:
        device = parse_device(name)
        place = station.devices.address(device, bits=form is Form.BITS)
        if form is None and not place.is_bit and not known.get(place):
            is_wide = station.devices.range_of(device).stride == 2
            chosen = Form.DINT if is_wide else Form.WORD
        else:
            chosen = form or (Form.BITS if place.is_bit else _FORMS[known[place][0][1].kind])
        if place.is_bit and chosen is not Form.BITS:
            raise CodecError(f"`{name}` is a single bit, it cannot be read as {chosen.value}", hint="leave out --as")
        found += [_one(station, device, place, chosen, index, known) for index in range(count)]
    return found


Known = Mapping[Address, list[tuple[Loop, Operand]]]


def _one(station: Station, first: Device, start: Address, form: Form, index: int, known: Known) -> Wanted:
    if start.bit is not None:  # D100.3 and on: through the bits of the words
        words, bit = divmod(start.bit + index, WORD_BITS)
        place = Address(start.table, start.address + words, bit)
        span = Span(place.table, place.address, 1)
    else:
        width = 2 if form in (Form.REAL, Form.DINT) else 1
        place = Address(start.table, start.address + index * width)
        span = Span(place.table, place.address, width)
    device = station.devices.device(place.table, place.address)
    if device is None or not station.devices.covers(span):
        raise CodecError(
            f"value {index + 1} from `{first}` on, as {form.value}, reaches beyond a range of the device map "
            f"`{station.devices.name}`",
            hint=f"`{first}` is in {station.devices.range_of(first, bits=start.is_bit)}",
        )
    if place.bit is not None:
        device = Device(device.kind, device.index, place.bit)
    owners = known.get(place, [])
    names = tuple(f"{loop.name} {row.name}" for loop, row in owners)
    unit = _unit(*owners[0]) if owners else ""
    return Wanted(str(device), place, form, span, names, unit)


def _operands(station: Station) -> Known:
    found: dict[Address, list[tuple[Loop, Operand]]] = {}
    for loop in station.loops:
        for row in loop.controller.operands:
            if not isinstance(loop.bindings[row.name], Const):
                found.setdefault(block.address(loop, station.devices, row.name), []).append((loop, row))
    return found


def _unit(loop: Loop, row: Operand) -> str:
    return {"PV": loop.pv_unit, "MV": loop.mv_unit}.get(row.unit, row.unit)


async def read_devices(station: Station, link: Link, clock: Clock, values: Sequence[Wanted]) -> list[Reading]:
    """Read what is wanted and return it in that order.

    Raises:
        TransportError: The link failed.
        PlcRefusedError: The PLC refused a request.
    """
    limits = station.pacing
    reads = plan(
        {each.span for each in values},
        unit=station.unit,
        words_max=limits.words_per_request_max,
        gap_max=limits.gap_words_max,
        exists=station.devices.covers,
    )
    image, arrived = block.Image(), []
    for read in reads:
        reply = await link.exchange(read)
        image.put(read, reply.values)
        ahead_ns = clock.utc_ns() - clock.now_ns()
        arrived.append((read, reply.last_ns + ahead_ns, reply.aligned_since_ns + ahead_ns))
    found = []
    for each in values:
        times = next(
            times
            for read, *times in arrived
            if read.table is each.span.table
            and read.address <= each.span.address
            and each.span.end <= read.address + read.count
        )
        words = image.words(each.span)
        value = _value(each, words)
        found.append(Reading(", ".join(each.names), each.device, each.form.value, value, words, each.unit, *times))
    return found


def _value(each: Wanted, words: tuple[int, ...]) -> Any:
    if each.form in _KINDS:
        return decode(_KINDS[each.form], words)
    if each.form is Form.WORD:
        return words[0]
    if each.place.bit is not None:
        return bool(words[0] >> each.place.bit & 1)
    return words[0] != 0 if each.place.table.is_bits else tuple(words[0] >> bit & 1 for bit in range(WORD_BITS))


async def read_loop(station: Station, loop: Loop, link: Link, clock: Clock) -> list[Reading] | None:
    """Return every operand of a loop as it stood at one moment, and what the instruction keeps in its own words.

    None when an execution fell into every attempt to read it.

    Raises:
        TransportError: The link failed.
        PlcRefusedError: The PLC refused a request.
    """
    picture = await Sampler(loop, station, link, clock).picture()
    if picture is None:
        return None
    readings = _readings(loop, picture.words, picture.seen, picture.utc_ns)
    return [replace(each, aligned_utc_ns=picture.aligned_utc_ns) for each in readings]


def _readings(
    loop: Loop, words: Mapping[str, tuple[int, ...]], seen: Mapping[str, Any], utc_ns: int
) -> Iterator[Reading]:
    for row in loop.controller.operands:
        binding = loop.bindings[row.name]
        device = None if isinstance(binding, Const) else str(binding)
        own = words[row.name]
        value = None if row.kind is Kind.BLOCK else decode(row.kind, own)
        yield Reading(row.name, device, row.kind.value.lower(), value, own, _unit(loop, row), utc_ns)
        if row.kind is Kind.BLOCK and device is not None:
            for each in sorted(loop.controller.seen, key=lambda seen: seen.dword):
                if each.operand == row.name:
                    part = own[2 * each.dword : 2 * each.dword + (2 if each.kind in (Kind.REAL, Kind.DINT) else 1)]
                    name = f"{row.name}[{2 * each.dword}] {each.name}"
                    yield Reading(name, None, each.kind.value.lower(), seen[each.name], part, "", utc_ns)
    for name, place in ((block.EN, loop.en), (block.COUNTER, loop.counter)):
        if place is not None and name in words and name not in loop.bindings:
            is_bit = name == block.EN
            value = words[name][0] != 0 if is_bit else words[name][0]
            yield Reading(name, str(place), "bool" if is_bit else "word", value, words[name], "", utc_ns)
