"""Device names of a Delta PLC and the Modbus addresses behind them.

This file alone turns `D100`, `X0.3` or `SM400` into a table and a 0-based address, and back. It knows no address
itself: every number comes from a device map, which is data (`profiles/*.toml`), because AH/AS and DVP differ and the
AH table is only probable until commissioning has proven it (spec ah500 §3.1).
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from difflib import get_close_matches

from ahgateway.codec.access import Span, Table
from ahgateway.errors import CodecError

KINDS = ("D", "M", "SM", "S", "X", "Y", "SR", "T", "C", "HC", "E")
"""Kinds of device that some map knows how to reach; L and PR are not reachable (spec ah500 §3.1)."""

WORD_BITS = 16
_SPELLING = re.compile(r"([A-Za-z]+)([0-9]{1,9})(?:\.([0-9]{1,3}))?")


@dataclass(frozen=True, slots=True)
class Device:
    """A device as the PLC's programmer writes it.

    Attributes:
        kind: Letters in capitals, `D`.
        index: The number as written in decimal digits; a map may read those digits as octal.
        bit: Bit 0…15 of a word device, None for a whole device.
    """

    kind: str
    index: int
    bit: int | None = None

    def __str__(self) -> str:
        whole = f"{self.kind}{self.index}"
        return whole if self.bit is None else f"{whole}.{self.bit}"


def parse_device(text: str) -> Device:
    """Read Delta's spelling, in capitals or not: `D100`, `M1`, `X0.3`, `SM400`, `D100.3`.

    Raises:
        CodecError: It is no device name, the kind is unknown, or the bit is not 0…15.
    """
    match = _SPELLING.fullmatch(text.strip())
    if match is None:
        raise CodecError(
            f"`{text}` is no device name", hint="letters, a number and perhaps a bit: `D100`, `M1`, `X0.3`, `D100.3`"
        )
    kind, number, bit = match[1].upper(), int(match[2]), match[3]
    if kind not in KINDS:
        near = get_close_matches(kind, KINDS, 1, 0.5)
        raise CodecError(
            f"`{text}`: unknown kind of device `{kind}`, known are {', '.join(KINDS)}",
            hint=f"did you mean `{near[0]}{number}`?" if near else None,
        )
    if bit is not None and int(bit) >= WORD_BITS:
        raise CodecError(f"`{text}`: bit {int(bit)} of a word, allowed 0…15", hint=f"`{kind}{number}.15` is the last")
    return Device(kind, number, None if bit is None else int(bit))


@dataclass(frozen=True, slots=True)
class Address:
    """Where a device stands: 0-based PDU address of a table; `bit` 0…15 when it is a bit inside that word."""

    table: Table
    address: int
    bit: int | None = None

    @property
    def is_bit(self) -> bool:
        """True when a single bit stands there, in a table of bits or inside a word."""
        return self.table.is_bits or self.bit is not None


@dataclass(frozen=True, slots=True)
class DeviceRange:
    """Consecutive devices of one kind that stand at consecutive addresses of one table.

    Attributes:
        kind: Kind of device, `D`.
        first: First number (already decimal, also where people write octal).
        last: Last number, included.
        table: Modbus table.
        base: 0-based address of the device `first`.
        stride: Addresses per number: 1, 16 for the bits X0.0… and Y0.0…, 2 for 32-bit counters.
        functions: Modbus function codes that the PLC is known to accept here.
        confidence: V read in the source, S decoded from a damaged scan, I inferred, R remembered.
        writable: The PLC takes writes here at all; it is no permission.
        octal: People write the numbers in octal, as DVP does for X and Y.
        operands: PID operands may stand here.
    """

    kind: str
    first: int
    last: int
    table: Table
    base: int
    stride: int = 1
    functions: tuple[int, ...] = ()
    confidence: str = "R"
    writable: bool = True
    octal: bool = False
    operands: bool = True

    @property
    def end(self) -> int:
        """First address behind the range."""
        return self.base + (self.last - self.first + 1) * self.stride

    def name(self, number: int, bit: int | None = None) -> Device:
        """The device with this number, spelled as people spell it here."""
        return Device(self.kind, int(f"{number:o}") if self.octal else number, bit)

    def number(self, device: Device) -> int | None:
        """Number of the device in this range, None when it lies outside or its digits are not octal."""
        try:
            number = int(str(device.index), 8) if self.octal else device.index
        except ValueError:
            return None
        return number if self.first <= number <= self.last else None

    def __str__(self) -> str:
        if self.table.is_bits and self.stride == WORD_BITS:
            return f"{self.name(self.first, 0)}…{self.name(self.last, WORD_BITS - 1)}"
        return f"{self.name(self.first)}…{self.name(self.last)}"


@dataclass(frozen=True, slots=True)
class DeviceMap:
    """Which devices of a PLC family can be reached, and where.

    Attributes:
        name: Name in profiles, `ah500`.
        title: For people.
        ranges: In the order of the map file.
    """

    name: str
    title: str
    ranges: tuple[DeviceRange, ...]
    _known: dict[tuple[Device, bool], Address] = field(
        default_factory=dict, init=False, repr=False, compare=False, hash=False
    )

    def address(self, device: Device, *, bits: bool = False) -> Address:
        """Return where the device stands.

        Args:
            device: `X0.3`, `M1` give a bit of a bit table, `D100`, `X0`, `T0` a word, `D100.3` a bit of a word.
            bits: Prefer the bit where a whole device has both: the contact of `T0` instead of its value.

        Raises:
            CodecError: The map does not have the device; the message names what it has.
        """
        known = self._known.get((device, bits))
        if known is None:
            known = self._known[device, bits] = self._find(device, bits)
        return known

    def range_of(self, device: Device, *, bits: bool = False) -> DeviceRange:
        """Return the range in which `address` finds the device; CodecError as there."""
        suitable = self._suitable(device, bits)
        for row in suitable:
            if row.number(device) is not None:
                return row
        allowed = ", ".join(str(row) for row in suitable)
        octal = any(row.octal for row in suitable)
        ends = (row.name(number) for row in suitable for number in (row.first, row.last))
        near = min(ends, key=lambda end: abs(end.index - device.index))
        raise CodecError(
            f"`{device}` is outside the device map `{self.name}`, which has {allowed}{' in octal' if octal else ''}",
            hint=f"the nearest end is `{near}`",
        )

    def _find(self, device: Device, bits: bool) -> Address:
        row = self.range_of(device, bits=bits)
        number = row.number(device)
        assert number is not None
        address = row.base + (number - row.first) * row.stride
        if device.bit is None:
            return Address(row.table, address)
        if row.table.is_bits:
            return Address(row.table, address + device.bit)
        return Address(row.table, address, device.bit)

    def _suitable(self, device: Device, bits: bool) -> list[DeviceRange]:
        """Ranges of the kind in the table that this spelling means."""
        rows = [row for row in self.ranges if row.kind == device.kind]
        if not rows:
            kinds = sorted({row.kind for row in self.ranges})
            raise CodecError(f"`{device}`: the device map `{self.name}` has no {device.kind}, only {', '.join(kinds)}")
        words = [row for row in rows if not row.table.is_bits]
        single = [row for row in rows if row.table.is_bits and row.stride == 1]
        grouped = [row for row in rows if row.table.is_bits and row.stride == WORD_BITS]
        if device.bit is not None:
            found = grouped or [row for row in words if row.stride == 1]
            if not found:
                raise CodecError(
                    f"`{device}`: `{device.kind}{device.index}` is no 16-bit word in the device map `{self.name}`",
                    hint=f"write `{device.kind}{device.index}`",
                )
            return found
        found = (single or words) if bits else (words or single)
        if not found:
            raise CodecError(
                f"`{device}`: the device map `{self.name}` has only single bits of {device.kind}",
                hint=f"write `{device}.0`",
            )
        return found

    def device(self, table: Table, address: int) -> Device | None:
        """Return the device that stands at this address, None where the map knows nothing."""
        for row in self.ranges:
            if row.table == table and row.base <= address < row.end:
                offset, inside = divmod(address - row.base, row.stride)
                is_group = table.is_bits and row.stride == WORD_BITS
                return row.name(row.first + offset, inside if is_group else None)
        return None

    def covers(self, span: Span) -> bool:
        """Tell whether the whole span lies inside one range, so that it may be read in one request."""
        return any(row.table == span.table and row.base <= span.address and span.end <= row.end for row in self.ranges)

    def kinds(self) -> Iterable[str]:
        """Kinds of device in the map's order, each once."""
        return dict.fromkeys(row.kind for row in self.ranges)
