"""Operands that get in each other's way: inside a loop and between loops of one station.

Sharing a whole operand is legal and common (one SV for two loops, MV of a master as SV of a slave). Overlapping in
part is always a mistake, and the instruction's memory belongs to one instruction alone (MANUAL, spec ah500 §1.1).
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from ahgateway.codec.access import Table
from ahgateway.codec.devices import Device
from ahgateway.codec.station import Const
from ahgateway.core.operands import Access
from ahgateway.schema.binding import Bound
from ahgateway.schema.findings import Findings


@dataclass(frozen=True, slots=True)
class _Use:
    loop: str
    bound: Bound
    device: Device
    table: Table
    start: int
    end: int
    bit: int | None

    @property
    def name(self) -> str:
        return self.bound.row.name

    def __str__(self) -> str:
        last = self.end - self.start - 1
        until = f"…{Device(self.device.kind, self.device.index + last)}" if last else ""
        return f"{self.name} of loop {self.loop} at {self.device}{until}"


def shared(loops: Mapping[str, Mapping[str, Bound]], findings: Findings) -> dict[str, frozenset[str]]:
    """Return, for each loop, the operands whose device another loop uses too; mistakes go to `findings`."""
    found: dict[str, set[str]] = defaultdict(set)
    told: set[tuple[str, str]] = set()
    for left, right in _meetings(_uses(loops)):
        mistake = _mistake(left, right)
        if mistake is not None:
            if (left.bound.key, right.bound.key) not in told:  # two layouts that meet are one mistake, not thirty
                findings.add(right.bound.key, *mistake)
            told.add((left.bound.key, right.bound.key))
        elif left.loop != right.loop:
            found[left.loop].add(left.name)
            found[right.loop].add(right.name)
    return {loop: frozenset(found[loop]) for loop in loops}


def _uses(loops: Mapping[str, Mapping[str, Bound]]) -> list[_Use]:
    uses = []
    for loop, bounds in loops.items():
        for bound in bounds.values():
            place, device = bound.place, bound.binding
            if place is None or isinstance(device, Const):
                continue
            end = place.address + max(1, bound.row.words)
            uses.append(_Use(loop, bound, device, place.table, place.address, end, place.bit))
    return uses


def _meetings(uses: list[_Use]) -> Iterator[tuple[_Use, _Use]]:
    """Pairs that touch the same word or bit, the one written earlier in the profile first."""
    order = {id(use): position for position, use in enumerate(uses)}
    ordered = sorted(uses, key=lambda use: (use.table.value, use.start))
    for position, first in enumerate(ordered):
        for second in ordered[position + 1 :]:
            if second.table is not first.table or second.start >= first.end:
                break
            if first.bit is None or second.bit is None or first.bit == second.bit:
                yield (first, second) if order[id(first)] < order[id(second)] else (second, first)


def _mistake(left: _Use, right: _Use) -> tuple[str, str | None] | None:
    both = (left.bound.row.access, right.bound.row.access)
    if Access.STATE in both:
        memory = left if left.bound.row.access is Access.STATE else right
        return f"{right} overlaps {left}; {memory.name} belongs to its instruction alone", "move one of them"
    if (left.start, left.end, left.bit) != (right.start, right.end, right.bit):
        return f"{right} overlaps {left} in part", "a 32-bit value takes two words, the next free one is two on"
    if left.loop != right.loop:
        if both == (Access.OUT, Access.OUT):
            return f"{right}: loop {left.loop} writes its {left.name} there too", "two loops cannot drive one output"
        return None
    if Access.OUT in both and Access.IN_OUT not in both:
        return f"{right} is also {left.name}, and the instruction writes one of the two", None
    return None
