"""The layout of our own recorder: made from a loop's operands, so that a profile needs to say only where the ring is.

A record is: its number, the time, words of flags, the operands in the instruction's order and what is known of its
memory, its number again. The snippet's own words follow the head.
"""

from __future__ import annotations

from ahgateway.codec import block
from ahgateway.codec.devices import WORD_BITS, Device
from ahgateway.codec.station import Const, Loop
from ahgateway.codec.ways import Each, Place, Recorder
from ahgateway.core.operands import Kind

RANGE = 30_000
"""Numbers and times count from 0 to one less: no word that counts so ever changes its sign."""

TIME_UNIT_NS = 10_000_000
"""An interval task of this period counts the time: the only clock of a program that some manual describes."""

FLAG_BITS = WORD_BITS - 1
"""Flags in a word: all but the one that would be its sign."""

SEQUENCE, TIME, FLAGS = 0, 1, 2
SNIPPET_WORDS = 7
"""Words from the head on that the snippet uses: next slot, number, time, and four for itself."""


def recordable(loop: Loop) -> tuple[str, ...]:
    """Return what a record of this loop can hold, in order: operands, seen parts of its memory, `EN` where bound."""
    found: list[str] = []
    for row in loop.controller.operands:
        if isinstance(loop.bindings[row.name], Const):
            continue
        if row.kind is Kind.BLOCK:
            parts = [seen for seen in loop.controller.seen if seen.operand == row.name]
            found.extend(seen.name for seen in sorted(parts, key=lambda seen: seen.dword))
        else:
            found.append(row.name)
    return (*found, block.EN) if loop.en is not None and block.EN not in found else tuple(found)


def watched_words(loop: Loop) -> list[tuple[str, int]]:
    """Return what shows an execution, word by word: the name of each seen value and which of its words."""
    return [
        (seen.name, word)
        for seen in loop.controller.seen
        if not isinstance(loop.bindings[seen.operand], Const)
        for word in range(block.field_words(loop, seen.name))
    ]


def trigger_words(loop: Loop) -> int:
    """Return how many words the trigger takes from its counter on."""
    return 1 if loop.interval_ms is not None else 3 + len(watched_words(loop))


def standard(
    loop: Loop, ring: Device, head: Device, records: int, each: Each, unrecorded: frozenset[str] = frozenset()
) -> Recorder:
    """Return the layout of our own snippet for this loop."""
    names = [name for name in recordable(loop) if name not in unrecorded]
    bits = [name for name in names if block.field_words(loop, name) == 0]
    fields = {name: Place(FLAGS + at // FLAG_BITS, at % FLAG_BITS) for at, name in enumerate(bits)}
    first = Place(FLAGS + len(bits) // FLAG_BITS, len(bits) % FLAG_BITS)
    offset = first.offset + 1
    for name in names:
        words = block.field_words(loop, name)
        if words:
            fields[name] = Place(offset)
            offset += words
    return Recorder(
        ring, records, offset + 1, head, fields, SEQUENCE, 1, RANGE, offset, TIME, 1, RANGE, TIME_UNIT_NS, first, each,
        False, unrecorded,
    )  # fmt: skip
