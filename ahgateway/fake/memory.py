"""The fake PLC's memory: words and bits laid out as a device map says, with the refusals a PLC gives.

This file alone decides what aliases what: X0.3 is a bit of the word X0, D100.3 a bit of the word D100, while the
contact of T0 and its value are two things. It knows no loop and no time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from ahgateway.codec.access import Table
from ahgateway.codec.devices import WORD_BITS, Address, DeviceMap, DeviceRange
from ahgateway.errors import PlcRefusedError

ILLEGAL_FUNCTION = 1
ILLEGAL_ADDRESS = 2
ILLEGAL_COUNT = 3
BUSY = 6

Words = npt.NDArray[np.uint16]


@dataclass(frozen=True, slots=True)
class Limits:
    """Most items in one request; MODBUS Application Protocol V1.1b3 §6 allows no more than the defaults."""

    read_words_max: int = 125
    write_words_max: int = 123
    read_bits_max: int = 2000
    write_bits_max: int = 1968

    @classmethod
    def of_words(cls, words_max: int) -> Limits:
        """Limits of a PLC that takes `words_max` words, or as many bits as fit into them, at most."""
        return cls(
            min(words_max, 125), min(words_max, 123), min(words_max * WORD_BITS, 2000), min(words_max * WORD_BITS, 1968)
        )


@dataclass(frozen=True, slots=True)
class _Area:
    """One range of the map with what stands behind it; `bit0` is the first bit of an area of bits inside words."""

    row: DeviceRange
    words: Words | None
    bits: bytearray | None
    bit0: int = 0


class BitCell:
    """One bit of the memory, found once and then read and written without searching."""

    __slots__ = ("_bits", "_index", "_mask", "_words")

    def __init__(self, words: Words | None, bits: bytearray | None, index: int, bit: int) -> None:
        self._words, self._bits, self._index, self._mask = words, bits, index, 1 << bit

    def get(self) -> bool:
        if self._bits is not None:
            return self._bits[self._index] != 0
        assert self._words is not None
        return int(self._words[self._index]) & self._mask != 0

    def put(self, value: bool) -> None:
        if self._bits is not None:
            self._bits[self._index] = 1 if value else 0
            return
        assert self._words is not None
        word = int(self._words[self._index])
        self._words[self._index] = word | self._mask if value else word & ~self._mask


class Memory:
    """Every device of a map, all 0 at first.

    Attributes:
        devices: The map.
        limits: Most items in one request.
        generation: Grows with each write from outside; a program item re-reads what it keeps when it has grown.
    """

    def __init__(self, devices: DeviceMap, limits: Limits | None = None) -> None:
        self.devices = devices
        self.limits = limits or Limits()
        self.generation = 0
        self._areas: dict[Table, list[_Area]] = {table: [] for table in Table}
        word_areas: list[_Area] = []
        for row in devices.ranges:
            if not row.table.is_bits:
                area = _Area(row, np.zeros(row.end - row.base, "<u2"), None)
                word_areas.append(area)
                self._areas[row.table].append(area)
        for row in devices.ranges:
            if row.table.is_bits:
                self._areas[row.table].append(_bits_area(row, word_areas))

    def read(self, table: Table, address: int, count: int) -> tuple[int, ...]:
        """Return `count` bits or words as the PLC would send them.

        Raises:
            PlcRefusedError: Code 3 for a count outside 1…limit, 2 where any item is outside the map.
        """
        most = self.limits.read_bits_max if table.is_bits else self.limits.read_words_max
        _check_count(table, address, count, most)
        area = self._area(table, address, count)
        offset = address - area.row.base
        if area.bits is not None:
            return tuple(area.bits[offset : offset + count])
        assert area.words is not None
        if not table.is_bits:
            return tuple(area.words[offset : offset + count].tolist())
        first = area.bit0 + offset
        last_word = (first + count - 1) // WORD_BITS
        words = area.words[first // WORD_BITS : last_word + 1].tolist()
        skip = first % WORD_BITS
        return tuple((words[at // WORD_BITS] >> (at % WORD_BITS)) & 1 for at in range(skip, skip + count))

    def write(self, table: Table, address: int, values: Sequence[int]) -> None:
        """Take bits or words from outside, all or none.

        Raises:
            PlcRefusedError: Code 1 for a table that nothing can write, 3 for a count outside 1…limit, 2 where any
                item is outside the map or the map says it takes no writes.
        """
        if table in (Table.DISCRETE, Table.INPUT):
            raise PlcRefusedError(
                f"{_where(table, address, len(values))}: no function writes there", code=ILLEGAL_FUNCTION
            )
        most = self.limits.write_bits_max if table.is_bits else self.limits.write_words_max
        _check_count(table, address, len(values), most)
        area = self._area(table, address, len(values))
        if not area.row.writable:
            raise PlcRefusedError(
                f"{_where(table, address, len(values))}: {area.row} take no writes", code=ILLEGAL_ADDRESS
            )
        self._store(area, table, address, values)
        self.generation += 1

    def words_at(self, place: Address, count: int) -> Words:
        """Return a live view of `count` words; what is assigned to it stands in the memory.

        Raises:
            PlcRefusedError: Code 2 where any of them is outside the map.
        """
        area = self._area(place.table, place.address, count)
        assert area.words is not None
        offset = place.address - area.row.base
        return area.words[offset : offset + count]

    def bit_at(self, place: Address) -> BitCell:
        """Return the bit at an address, of a table of bits or inside a word; PlcRefusedError code 2 outside the map."""
        area = self._area(place.table, place.address, 1)
        offset = place.address - area.row.base
        if area.bits is not None:
            return BitCell(None, area.bits, offset, 0)
        if place.bit is not None:
            return BitCell(area.words, None, offset, place.bit)
        word, bit = divmod(area.bit0 + offset, WORD_BITS)
        return BitCell(area.words, None, word, bit)

    def clear(self) -> None:
        """Set every device to 0, as a power cut without latched areas does."""
        for areas in self._areas.values():
            for area in areas:
                if area.words is not None:
                    area.words[:] = 0
                if area.bits is not None:
                    area.bits[:] = bytes(len(area.bits))
        self.generation += 1

    def _store(self, area: _Area, table: Table, address: int, values: Sequence[int]) -> None:
        offset = address - area.row.base
        if area.bits is not None:
            area.bits[offset : offset + len(values)] = bytes(1 if value else 0 for value in values)
        elif not table.is_bits:
            assert area.words is not None
            area.words[offset : offset + len(values)] = np.asarray(values, "<u2")
        else:
            for index, value in enumerate(values):
                self.bit_at(Address(table, address + index)).put(bool(value))

    def _area(self, table: Table, address: int, count: int) -> _Area:
        for area in self._areas[table]:
            if area.row.base <= address and address + count <= area.row.end:
                return area
        raise PlcRefusedError(
            f"{_where(table, address, count)}: outside the device map `{self.devices.name}`", code=ILLEGAL_ADDRESS
        )


def _bits_area(row: DeviceRange, word_areas: list[_Area]) -> _Area:
    """Bits in groups of 16 are those of the words of the same kind, where the map has them."""
    if row.stride == WORD_BITS:
        for area in word_areas:
            if area.row.kind == row.kind and area.row.first <= row.first and row.last <= area.row.last:
                return _Area(row, area.words, None, (row.first - area.row.first) * WORD_BITS)
    return _Area(row, None, bytearray(row.end - row.base))


def _check_count(table: Table, address: int, count: int, most: int) -> None:
    if not 1 <= count <= most:
        raise PlcRefusedError(
            f"{_where(table, address, count)}: one request takes 1…{most} {'bits' if table.is_bits else 'words'}",
            code=ILLEGAL_COUNT,
        )


def _where(table: Table, address: int, count: int) -> str:
    return f"{count} × {table.value} from {address:#06x}"


def real_view(words: Words) -> Any:
    """Return the first two words as a live view of one REAL, low word first, bits kept."""
    return words[:2].view("<f4")
