"""Which CANopen object holds which devices, and which of them travel in PDOs: data of the profile, no bus.

This file alone turns spans of PLC memory into objects and their bytes. It knows no object of any product: what
AH10COPM-5A publishes where is not in a manual that we have (spec ah500 §4), so every row comes from the profile, with
its confidence, and commissioning proves it.

Source:
    MANUAL CiA 301 v4.2 §7.1.4: little-endian. A Delta REAL stands low word first, so its bytes need no exchange
    (spec ah500 §4).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ahgateway.codec.access import Span, Table
from ahgateway.codec.can_frame import SYNC
from ahgateway.errors import CodecError

PDO_SIZE_MAX = 8


def span_size(span: Span) -> int:
    """Bytes of a span in an object: two a word, a bit each for bits and the rest of the last byte 0."""
    return (span.count + 7) // 8 if span.table.is_bits else 2 * span.count


def span_bytes(span: Span, values: Sequence[int]) -> bytes:
    """Return the bytes of a span's words (0…65535, little-endian) or bits (first bit lowest)."""
    if not span.table.is_bits:
        return b"".join(value.to_bytes(2, "little") for value in values)
    packed = sum((value & 1) << place for place, value in enumerate(values))
    return packed.to_bytes(span_size(span), "little")


def span_values(span: Span, packed: bytes) -> tuple[int, ...]:
    """Return the words or bits of a span from its bytes.

    Raises:
        CodecError: The number of bytes is not that of the span.
    """
    if len(packed) != span_size(span):
        raise CodecError(
            f"{span.count} × {span.table.value} from {span.address:#06x} are {span_size(span)} bytes, "
            f"{len(packed)} bytes came"
        )
    if not span.table.is_bits:
        return tuple(int.from_bytes(packed[at : at + 2], "little") for at in range(0, len(packed), 2))
    whole = int.from_bytes(packed, "little")
    return tuple(whole >> place & 1 for place in range(span.count))


@dataclass(frozen=True, slots=True)
class CanObject:
    """One object that holds a span of PLC memory whole.

    Attributes:
        span: Words or bits that it holds.
        index: Object index.
        sub: Sub-index.
    """

    span: Span
    index: int
    sub: int

    @property
    def size(self) -> int:
        """Its bytes."""
        return span_size(self.span)

    def __str__(self) -> str:
        return f"{self.index:#06x}:{self.sub:02x}"


@dataclass(frozen=True, slots=True)
class Pdo:
    """One PDO that the PLC sends after each SYNC, or takes: COB-ID and what it carries, in the order of its bytes."""

    cob_id: int
    spans: tuple[Span, ...]

    @property
    def size(self) -> int:
        """Bytes of the frame."""
        return sum(span_size(span) for span in self.spans)

    def encoded(self, read: Sequence[Sequence[int]]) -> bytes:
        """Return the data field for the values of each span, in order."""
        return b"".join(span_bytes(span, values) for span, values in zip(self.spans, read, strict=True))

    def decoded(self, data: bytes) -> list[tuple[Span, tuple[int, ...]]]:
        """Return each span with its values; CodecError when the frame has another length than the mapping."""
        if len(data) != self.size:
            raise CodecError(f"PDO {self.cob_id:03X} has {len(data)} bytes, the profile maps {self.size}")
        found, at = [], 0
        for span in self.spans:
            found.append((span, span_values(span, data[at : at + span_size(span)])))
            at += span_size(span)
        return found


@dataclass(frozen=True, slots=True)
class Sync:
    """How the tick of the cyclic role looks.

    Attributes:
        cob_id: Identifier of SYNC.
        period_us: Time between two, in µs.
        window_us: A PDO that comes later behind its SYNC is not believed.
    """

    cob_id: int = SYNC
    period_us: int = 20_000
    window_us: int = 10_000


@dataclass(frozen=True)
class CanMap:
    """What a station publishes on CAN.

    Attributes:
        objects: Ordered by table and address; no two hold the same word.
        pdos: Sent by the PLC after each SYNC; empty when there is no cyclic role.
        takes: Taken by the PLC, each with one operand of a bench; a write of just that goes out in one frame.
        sync: The tick.
        confidence: V read in the module's manual or EDS, S decoded, I inferred, R remembered.
    """

    objects: tuple[CanObject, ...]
    pdos: tuple[Pdo, ...] = ()
    sync: Sync = Sync()
    confidence: str = "R"
    takes: tuple[Pdo, ...] = ()

    def taking(self, span: Span) -> Pdo | None:
        """Return the PDO by which the PLC takes exactly this span, None when there is none."""
        return next((pdo for pdo in self.takes if pdo.spans == (span,)), None)

    def holding(self, span: Span) -> tuple[CanObject, ...]:
        """Return the objects that hold a span together, in the order of their addresses.

        Raises:
            CodecError: A word or bit of it stands in no object.
        """
        found, at = [], span.address
        for each in self.objects:
            here = each.span
            if here.table is span.table and here.address <= at < here.end:
                found.append(each)
                at = here.end
                if at >= span.end:
                    return tuple(found)
        raise CodecError(
            f"{span.table.value} {at:#06x} stands in no CANopen object of the profile",
            hint="name it in a row of [[station.can.objects]]",
        )

    def is_whole(self, span: Span) -> bool:
        """Tell whether one object holds the whole span, so that it cannot be read in two halves."""
        try:
            return len(self.holding(span)) == 1
        except CodecError:
            return False

    def at(self, index: int, sub: int) -> CanObject | None:
        """Return the object with this index and sub-index."""
        return self._by_index().get((index, sub))

    def subs(self, index: int) -> int:
        """Return the highest sub-index at an index, 0 when there is none."""
        return max((sub for held, sub in self._by_index() if held == index), default=0)

    def _by_index(self) -> dict[tuple[int, int], CanObject]:
        known: dict[tuple[int, int], CanObject] | None = self.__dict__.get("_known")
        if known is None:
            known = {(each.index, each.sub): each for each in self.objects}
            object.__setattr__(self, "_known", known)
        return known


def table_order(each: CanObject) -> tuple[int, int]:
    """Sort key of a map's objects."""
    return list(Table).index(each.span.table), each.span.address
