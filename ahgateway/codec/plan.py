"""Read plans: which requests fetch a set of spans.

Fewer requests beat every other optimisation of the client (MEASURED, spec speed).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

from ahgateway.codec.access import Read, Span, Table
from ahgateway.errors import CodecError

WORDS_MAX = 100
"""Words per request: Delta's own block size, within its 240 data bytes (MANUAL, spec ah500 §3.2)."""

BITS_MAX = 1600
"""Bits per request: the same 200 data bytes (ASSUMED; Modbus itself ends at 2000)."""

GAP_BITS_PER_WORD = 16
_ORDER = {table: position for position, table in enumerate(Table)}


def plan(
    spans: Iterable[Span],
    *,
    unit: int,
    words_max: int = WORDS_MAX,
    bits_max: int = BITS_MAX,
    gap_max: int = 16,
    exists: Callable[[Span], bool] | None = None,
) -> tuple[Read, ...]:
    """Return the requests that fetch every span, each span whole in at least one of them.

    Args:
        spans: In any order; they may overlap.
        unit: Station number for every request.
        words_max: Most words in one request.
        bits_max: Most bits in one request.
        gap_max: Words that may be read in vain to save a request; sixteen times as many in a table of bits.
        exists: Tells whether the PLC can read a span in one request (`DeviceMap.covers`); nothing is merged across
            a seam. None: the whole table is there.

    Returns:
        Coils, discrete inputs, holding registers, input registers; ascending in each.

    Raises:
        CodecError: A span alone is longer than a request may be.
    """
    reads: list[Span] = []
    for span in sorted(set(spans), key=lambda each: (_ORDER[each.table], each.address, each.count)):
        length_max = bits_max if span.table.is_bits else words_max
        if span.count > length_max:
            raise CodecError(
                f"{span.count} from {span.table.value} {span.address:#06x} belong together, "
                f"but a request may hold {length_max}",
                hint="raise words_per_request_max in [station.pacing]",
            )
        merged = _merged(reads[-1], span, gap_max) if reads else None
        if merged is None or merged.count > length_max or (exists is not None and not exists(merged)):
            reads.append(span)
        else:
            reads[-1] = merged
    return tuple(Read(unit, read.table, read.address, read.count) for read in reads)


def _merged(left: Span, right: Span, gap_max: int) -> Span | None:
    """One span over both, None when they are too far apart or in two tables."""
    gap = gap_max * (GAP_BITS_PER_WORD if left.table.is_bits else 1)
    if left.table is not right.table or right.address - left.end > gap:
        return None
    return Span(left.table, left.address, max(left.end, right.end) - left.address)
