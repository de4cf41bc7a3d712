"""How the executions of a loop are seen, and what a recorder's ring in the PLC looks like: layouts as data, no I/O.

This file alone knows where in a record a value stands and how a record's words become the raw words of a picture. It
knows no program: the ring that our own snippet fills and that of somebody else are described alike.

A record is made behind the instruction, in the same scan or call; so it holds what the instruction read and what it
left. Its sequence number stands at its beginning and, where the program is careful, again at its end: a record whose
two numbers differ was being written while it was read.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum

from ahgateway.codec.devices import Device

COUNTS = 0x10000
"""A word that counts executions begins again here."""


class Way(Enum):
    """How executions are seen, best first."""

    STEPPED = "stepped"
    RECORDED = "recorded"
    POLLED = "polled"
    COUNTED = "counted"

    @property
    def text(self) -> str:
        """What it is, for people."""
        return _TEXTS[self]


_TEXTS = {
    Way.STEPPED: "each execution triggered through the write gate",
    Way.RECORDED: "every execution read from the recorder's ring in the PLC",
    Way.POLLED: "polled faster than CYCLE, from block to block",
    Way.COUNTED: "polled slower than CYCLE, executions between two pictures inferred",
}


class Each(Enum):
    """What makes a record: every scan, every call in an interval task, or every scan that changed a recorded word."""

    SCAN = "scan"
    CALL = "call"
    CHANGE = "change"


@dataclass(frozen=True, slots=True)
class Place:
    """Where a value stands in a record: offset of its first word from 0, and the bit where it is one."""

    offset: int
    bit: int | None = None

    def __str__(self) -> str:
        return str(self.offset) if self.bit is None else f"{self.offset}.{self.bit}"


@dataclass(frozen=True, slots=True)
class Recorder:
    """A ring buffer of records in D.

    Attributes:
        ring: First word of the ring.
        records: Records in the ring.
        length: Words from one record to the next.
        head: Word with the number, from 0, of the slot that is written next.
        fields: What stands where in a record, by the name of the operand, of the seen value (`I_MV+6`), or `EN`.
        sequence: Offset of the record's number; it grows by one from record to record.
        sequence_words: Words of that number, 1 or 2.
        sequence_range: It begins at 0 again behind this number less one; None: where its words end.
        sequence_end: Offset of the same number at the record's end; None where the program writes only one.
        time: Offset of the PLC's time; None where a record has none.
        time_words: Words of that time, 1 or 2.
        time_range: It begins at 0 again behind this number less one; None: where its words end.
        time_unit_ns: Unit of that time.
        first: Bit that is set in the first record behind STOP or power-up; None where nothing tells.
        each: What makes a record.
        is_last: `head` is the slot that was written last, not the next one.
        unrecorded: Operands that no record holds: they are read by themselves, and what changes them goes unseen.
    """

    ring: Device
    records: int
    length: int
    head: Device
    fields: Mapping[str, Place]
    sequence: int = 0
    sequence_words: int = 1
    sequence_range: int | None = None
    sequence_end: int | None = None
    time: int | None = None
    time_words: int = 2
    time_range: int | None = None
    time_unit_ns: int = 1_000_000
    first: Place | None = None
    each: Each = Each.SCAN
    is_last: bool = False
    unrecorded: frozenset[str] = frozenset()

    @property
    def sequences(self) -> int:
        """How many numbers there are before they begin again."""
        return self.sequence_range or 1 << 16 * self.sequence_words

    @property
    def times(self) -> int:
        """How many times there are, in their unit, before they begin again."""
        return self.time_range or 1 << 16 * self.time_words

    @property
    def words(self) -> int:
        """Words of the whole ring."""
        return self.records * self.length

    def slot(self, number: int) -> int:
        """Offset of a slot's first word from the ring's first word."""
        return number % self.records * self.length


@dataclass(frozen=True, slots=True)
class Trigger:
    """The instruction's EN contact as a coil that we set, and that the program clears behind the execution.

    Attributes:
        coil: The coil.
        counter: Word that the program counts up by one at each execution that the coil let through.
    """

    coil: Device
    counter: Device


@dataclass(frozen=True, slots=True)
class Record:
    """One record as its words say.

    Attributes:
        sequence: Its number.
        is_whole: Both numbers agree, or there is only one.
        time_ns: The PLC's time in ns, modulo its word's range; None where it has none.
        is_first: It is the first behind STOP or power-up.
        fields: Raw words by name; a bit is one 0 or 1.
    """

    sequence: int
    is_whole: bool
    time_ns: int | None
    is_first: bool
    fields: Mapping[str, tuple[int, ...]] = field(default_factory=dict)


def record(layout: Recorder, lengths: Mapping[str, int], words: Sequence[int]) -> Record:
    """Read one record.

    Args:
        layout: Where what stands.
        lengths: Words of each field by name; 0 for a bit.
        words: The `layout.length` words of its slot, at least up to the last field.
    """
    number = _whole(words, layout.sequence, layout.sequence_words)
    end = number if layout.sequence_end is None else _whole(words, layout.sequence_end, layout.sequence_words)
    time_ns = None
    if layout.time is not None:
        time_ns = _whole(words, layout.time, layout.time_words) * layout.time_unit_ns
    return Record(
        number,
        number == end,
        time_ns,
        layout.first is not None and bool(_bit(words, layout.first)),
        {name: _field(words, place, lengths[name]) for name, place in layout.fields.items()},
    )


def _field(words: Sequence[int], place: Place, length: int) -> tuple[int, ...]:
    if place.bit is not None:
        return (_bit(words, place),)
    if not length:
        return (int(words[place.offset] != 0),)
    return tuple(words[place.offset : place.offset + length])


def _bit(words: Sequence[int], place: Place) -> int:
    return words[place.offset] >> (place.bit or 0) & 1


def _whole(words: Sequence[int], offset: int, count: int) -> int:
    """A number without sign, low word first."""
    return sum(words[offset + position] << 16 * position for position in range(count))
