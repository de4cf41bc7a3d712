"""The operand block of one loop: from its devices to spans, from a memory picture to raw words, to typed values.

Three faces of a value: words as read, `Raw` words per operand, typed inputs. Nothing here knows a controller by name.
"""

from __future__ import annotations

from collections.abc import Mapping
from difflib import get_close_matches
from typing import Any

from ahgateway.codec.access import Read, Span, Table
from ahgateway.codec.devices import Address, DeviceMap
from ahgateway.codec.station import Const, Loop
from ahgateway.codec.words import decode, encode
from ahgateway.core.controllers import Controller
from ahgateway.core.operands import Kind, Operand
from ahgateway.errors import CodecError

Raw = Mapping[str, tuple[int, ...]]
"""Operand name to its words, low word first; a BOOL is one number, 0 or 1; `EN` too when the loop binds it."""

EN = "EN"
COUNTER = "COUNTER"
"""Names of what a loop may bind beside the operands: its contact, and a count of its executions."""


class Image:
    """A picture of the PLC's memory, put together from replies; what is put later counts."""

    def __init__(self) -> None:
        self._cells: dict[Table, dict[int, int]] = {table: {} for table in Table}

    def put(self, read: Read, values: tuple[int, ...]) -> None:
        """Take in the reply to `read`: `read.count` bits or words.

        Raises:
            CodecError: The number of values is not what was asked for.
        """
        if len(values) != read.count:
            raise CodecError(
                f"{read.table.value} {read.address:#06x}: {len(values)} values came, {read.count} were asked for"
            )
        self._cells[read.table].update(zip(range(read.address, read.address + read.count), values, strict=True))

    def words(self, span: Span) -> tuple[int, ...]:
        """Return the `span.count` bits or words of a span; CodecError where nothing was read."""
        cells, first = self._cells[span.table], span.address
        try:
            if span.count == 2:
                return cells[first], cells[first + 1]
            return tuple([cells[address] for address in range(first, span.end)])
        except KeyError as error:
            raise _not_read(span.table, error.args[0]) from None

    def bit(self, address: Address) -> bool:
        """Return the bit at an address, of a bit table or inside a word; CodecError where nothing was read."""
        value = self._cells[address.table].get(address.address)
        if value is None:
            raise _not_read(address.table, address.address)
        return bool(value >> address.bit & 1) if address.bit is not None else value != 0


def _not_read(table: Table, address: int) -> CodecError:
    return CodecError(f"{table.value} {address:#06x} was not read")


def address(loop: Loop, devices: DeviceMap, operand: str) -> Address:
    """Return where the first word, or the bit, of an operand (or of `EN` or `COUNTER`) stands.

    Raises:
        CodecError: No such operand, it is a constant of the program, or its device is not in the map.
    """
    if operand == EN and EN not in loop.bindings:
        if loop.en is None:
            raise CodecError(f"loop {loop.name}: EN is bound to no device")
        return devices.address(loop.en, bits=True)
    if operand == COUNTER:
        if loop.counter is None:
            raise CodecError(f"loop {loop.name}: nothing counts its executions")
        return devices.address(loop.counter)
    row = _row(loop, operand)
    binding = loop.bindings[operand]
    if isinstance(binding, Const):
        raise CodecError(f"loop {loop.name}: {operand} is the constant {binding.value} in the program")
    return devices.address(binding, bits=row.kind is Kind.BOOL)


def spans(loop: Loop, devices: DeviceMap) -> dict[str, Span]:
    """Return what must be read: operand name to its span, `EN` and `COUNTER` last where bound; constants have none."""
    found = {
        row.name: _span(address(loop, devices, row.name), row)
        for row in loop.controller.operands
        if not isinstance(loop.bindings[row.name], Const)
    }
    if loop.en is not None:
        place = address(loop, devices, EN)
        found[EN] = Span(place.table, place.address, 1)
    if loop.counter is not None:
        place = address(loop, devices, COUNTER)
        found[COUNTER] = Span(place.table, place.address, 1)
    return found


class Layout:
    """Where every operand of one loop stands, found once for all its pictures.

    Args:
        loop: The loop.
        devices: Map of its PLC.

    Raises:
        CodecError: A device is not in the map.
    """

    def __init__(self, loop: Loop, devices: DeviceMap) -> None:
        # Every name in the instruction's order; what is read takes its place.
        self._blank: dict[str, tuple[int, ...]] = {}
        self._words: list[tuple[str, Span]] = []
        self._bits: list[tuple[str, Address]] = []
        for row in loop.controller.operands:
            binding = loop.bindings[row.name]
            if isinstance(binding, Const):
                self._blank[row.name] = encode(row.kind, binding.value)
                continue
            self._blank[row.name] = ()
            if row.kind is Kind.BOOL:
                self._bits.append((row.name, devices.address(binding, bits=True)))
            else:
                self._words.append((row.name, _span(devices.address(binding), row)))
        if loop.en is not None:
            self._bits.append((EN, devices.address(loop.en, bits=True)))
        if loop.counter is not None:
            place = devices.address(loop.counter)
            self._words.append((COUNTER, Span(place.table, place.address, 1)))

    def raw(self, image: Image) -> dict[str, tuple[int, ...]]:
        """Return the raw words of every operand, constants encoded, and of `EN` and `COUNTER` where bound.

        Raises:
            CodecError: The image lacks a word.
        """
        found = dict(self._blank)
        for name, span in self._words:
            found[name] = image.words(span)
        for name, place in self._bits:
            found[name] = (int(image.bit(place)),)
        return found


def inputs(loop: Loop, raw: Raw) -> Any:
    """Return what a step of the loop's controller reads, typed, REALs with their bits kept."""
    controller = loop.controller
    rows = {row.attr: row for row in controller.operands}
    read = controller.inputs(*[decode(rows[attr].kind, raw[rows[attr].name]) for attr in controller.input_names])
    return read if loop.interval_ms is None else timed(loop, read)


def timed(loop: Loop, read: Any) -> Any:
    """Return inputs with the interval of the loop's task in place of CYCLE, which has no effect there."""
    assert loop.interval_ms is not None
    unit_s = float(loop.controller.nominal_ts(read._replace(cycle=1)))
    return read._replace(cycle=round(loop.interval_ms / 1000 / unit_s))


def seen(loop: Loop, raw: Raw) -> dict[str, Any]:
    """Return what the instruction left in memory, keyed by `Seen.name`; an operand bound to a constant is not there."""
    found: dict[str, Any] = {}
    for each in loop.controller.seen:
        if not isinstance(loop.bindings[each.operand], Const):
            words = raw[each.operand]
            found[each.name] = decode(each.kind, words[2 * each.dword :])
    return found


def field_words(loop: Loop, name: str) -> int:
    """Return how many words a recorded field takes: an operand, a seen value, or `EN`; 0 for a bit.

    Raises:
        CodecError: The loop has nothing of that name that a record could hold.
    """
    if name == EN:
        return 0
    for each in loop.controller.seen:
        if each.name == name:
            return {Kind.BOOL: 0, Kind.INT: 1}.get(each.kind, 2)
    row = _row(loop, name)
    if row.kind is Kind.BLOCK:
        parts = ", ".join(each.name for each in loop.controller.seen if each.operand == name)
        raise CodecError(f"loop {loop.name}: {name} is the instruction's memory; a record holds {parts} of it")
    return row.words


def from_fields(
    loop: Loop, fields: Mapping[str, tuple[int, ...]], beside: Mapping[str, tuple[int, ...]]
) -> dict[str, tuple[int, ...]]:
    """Return the raw words of every operand from a record; words of the instruction's memory that it lacks are 0.

    Args:
        loop: The loop.
        fields: What the record holds, by name.
        beside: What was read beside it, by name.
    """
    found: dict[str, tuple[int, ...]] = {}
    parts: dict[str, list[tuple[int, tuple[int, ...]]]] = {}
    for each in loop.controller.seen:
        if each.name in fields:
            parts.setdefault(each.operand, []).append((2 * each.dword, fields[each.name]))
    for row in loop.controller.operands:
        binding = loop.bindings[row.name]
        if isinstance(binding, Const):
            found[row.name] = encode(row.kind, binding.value)
        elif row.kind is Kind.BLOCK:
            words = [0] * row.words
            for at, part in parts.get(row.name, ()):
                words[at : at + len(part)] = part
            found[row.name] = tuple(words)
        else:
            found[row.name] = fields[row.name] if row.name in fields else beside[row.name]
    for name, bound in ((EN, loop.en), (COUNTER, loop.counter)):
        if bound is not None:
            found[name] = fields.get(name) or beside.get(name) or (int(name == EN),)
    return found


def defaults(controller: Controller) -> dict[str, tuple[int, ...]]:
    """Return the raw words of a block nobody has written yet: each operand's default, the instruction's memory 0."""
    return {
        row.name: encode(row.kind, row.default) if row.default is not None else (0,) * max(1, row.words)
        for row in controller.operands
    }


def _span(place: Address, row: Operand) -> Span:
    return Span(place.table, place.address, max(1, row.words))


def _row(loop: Loop, operand: str) -> Operand:
    try:
        return loop.controller.operand(operand)
    except KeyError:
        names = [row.name for row in loop.controller.operands]
        near = get_close_matches(operand, names, 1, 0.5)
        raise CodecError(
            f"loop {loop.name}: {loop.controller.name} has no operand `{operand}`, it has {', '.join(names)}",
            hint=f"did you mean `{near[0]}`?" if near else None,
        ) from None
