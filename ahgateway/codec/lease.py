"""The block of words by which a PLC keeps the lease of a loop, word by word. No I/O.

This file alone decides the layout; the snippet for the PLC (`lease_text`), the fake PLC and the gate share it.

Theory of operation: a gateway claims, the PLC grants to one claim at a time, and only a beat with the granted owner's
word counts. Each operand that may be written has a slot with what was found there, and what can stand there because of
us before and behind the write under way. When the beat stands still for too long, the PLC puts back what holds one of
those two, and nothing at all when the mode, or the manual value in manual, holds neither: then somebody took over.
"""

from __future__ import annotations

from dataclasses import dataclass

from ahgateway.codec.devices import Device
from ahgateway.codec.station import Const, LeaseSpec, Loop
from ahgateway.core.operands import Kind, Operand

CLAIM, BEAT_OWNER, BEAT, OWNER, LAST, CALLS, EXPIRED, RESULT, ALIVE, LAYOUT = range(10)
"""Offsets of the head's words. The gateway writes the first three, the PLC all others."""

HEAD_WORDS = 10
GATEWAY_WORDS = 3
PUT_BACK, TAKEN_OVER = 1, 2
"""RESULT of the last lease that ran out."""

COUNT_MAX = 30_000
"""Counters of the snippet end here, far from where a signed word would overflow."""

HEAD = (
    ("CLAIM", "gateway", "owner word that asks for the lease; the PLC sets it to 0 at each call"),
    ("BEAT_OWNER", "gateway", "owner word whose beat stands behind it"),
    ("BEAT", "gateway", "changes at each beat, 1 to 30000; 0 gives the lease back"),
    ("OWNER", "PLC", "owner word that has the lease, 0 for nobody"),
    ("LAST", "PLC", "the beat that was seen last"),
    ("CALLS", "PLC", "calls of the snippet since the beat changed"),
    ("EXPIRED", "PLC", "owner word whose lease ran out last"),
    ("RESULT", "PLC", "what was done then: 1 put back, 2 nothing, because somebody had taken over"),
    ("ALIVE", "PLC", "counts the calls of the snippet"),
    ("LAYOUT", "PLC", "number of this layout; a gateway with another one refuses to arm"),
)


@dataclass(frozen=True, slots=True)
class Slot:
    """One operand in the block: a word that is 1 when it counts, then found, before and after, low word first.

    Attributes:
        operand: The manual's name.
        kind: BOOL and INT take one word each time, the others two.
        device: Where the operand stands.
        at: Offset of the first word.
        is_restored: It may be written; otherwise it only tells whether somebody has taken over.
    """

    operand: str
    kind: Kind
    device: Device
    at: int
    is_restored: bool

    @property
    def size(self) -> int:
        """Words of one value."""
        return 1 if self.kind in (Kind.BOOL, Kind.INT) else 2

    @property
    def length(self) -> int:
        """Words of the slot."""
        return 1 + 3 * self.size

    def words(self, found: tuple[int, ...], before: tuple[int, ...], after: tuple[int, ...]) -> tuple[int, ...]:
        """Return the slot's words when it counts."""
        return (1, *found, *before, *after)


@dataclass(frozen=True, slots=True)
class Layout:
    """The block of one loop.

    Attributes:
        spec: Where it begins, and its times.
        slots: Operands in the instruction's order.
    """

    spec: LeaseSpec
    slots: tuple[Slot, ...]

    @property
    def length(self) -> int:
        """Words of the block."""
        return HEAD_WORDS + sum(slot.length for slot in self.slots)

    @property
    def calls_max(self) -> int:
        """Calls without a new beat after which the lease has run out."""
        return -(-self.spec.timeout_ms // self.spec.task_ms)

    def device(self, at: int) -> Device:
        """Return the word device at an offset."""
        return Device(self.spec.data.kind, self.spec.data.index + at)


def layout(loop: Loop) -> Layout:
    """Return the block of a loop with a lease: a slot for what may be written, and for what tells of a takeover."""
    assert loop.lease is not None
    slots: list[Slot] = []
    at = HEAD_WORDS
    for row in loop.controller.operands:
        binding = loop.bindings[row.name]
        if isinstance(binding, Const) or not _wanted(loop, row):
            continue
        slot = Slot(row.name, row.kind, binding, at, row.name in loop.writes)
        slots.append(slot)
        at += slot.length
    return Layout(loop.lease, tuple(slots))


def _wanted(loop: Loop, row: Operand) -> bool:
    return row.name in loop.writes or row.name in loop.controller.roles.modes
