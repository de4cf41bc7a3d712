"""The lease as Structured Text for ISPSoft: what the PLC does when the beat of a gateway stands still. No I/O.

Only word devices and flags, assignments, comparisons for equality, AND, OR, NOT, and counting up to a fixed number are
used: nothing of it depends on types, arrays or timers. Every value is moved word by word, so that bits stay bits.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterable

from ahgateway import __version__
from ahgateway.codec import lease
from ahgateway.codec.lease import Layout, Slot
from ahgateway.codec.station import Loop, Station
from ahgateway.core.operands import Kind


def heartbeat(station: Station, loop: Loop) -> str:
    """Return the snippet of one loop, with a header that documents the block word by word."""
    block = lease.layout(loop)
    return "\n".join([*_header(station, loop, block), "", *_body(loop, block), ""])


def number(loop: Loop, block: Layout) -> int:
    """Return the number of this layout, 1…30000: it follows from every line of the snippet but its own."""
    return zlib.crc32("\n".join(_steps(loop, block)).encode("utf-8")) % lease.COUNT_MAX + 1


def _header(station: Station, loop: Loop, block: Layout) -> list[str]:
    spec = block.spec
    lines = [
        f"Lease of loop {loop.name} of station {station.name}, made by ahgateway {__version__}.",
        "It was never compiled by Delta's tool: read it, and try it on a bench before a plant depends on it.",
        "",
        f"Call it in an interval task with a period of {spec.task_ms} ms, and nowhere else.",
        f"When the beat stands still for {spec.timeout_ms} ms ({block.calls_max} calls), it puts back what still holds",
        "what the gateway wrote, and nothing at all when somebody has taken the loop over.",
        f"Nothing else may use {block.device(0)} to {block.device(block.length - 1)}.",
        "",
        "Of two words the low one stands first. The gateway writes a slot before it writes the operand.",
        "",
        "word     written by  meaning",
    ]
    lines += [f"{block.device(at)!s:8} {who:11} {name}: {text}" for at, (name, who, text) in enumerate(lease.HEAD)]
    for slot in block.slots:
        does = "put back" if slot.is_restored else "only looked at"
        last = block.device(slot.at + slot.length - 1)
        lines.append(
            f"{block.device(slot.at)!s:8} gateway     {slot.operand} ({slot.device}, {does}) to {last}: "
            f"1 when it counts, then found, before, after, {slot.size} word{'s' if slot.size > 1 else ''} each"
        )
    return ["(*", *(f"  {line}".rstrip() for line in lines), "*)"]


def _body(loop: Loop, block: Layout) -> list[str]:
    alive = block.device(lease.ALIVE)
    return [
        "(* 1. The snippet is called, and this is its layout. *)",
        f"IF {alive} < {lease.COUNT_MAX} THEN {alive} := {alive} + 1; ELSE {alive} := 1; END_IF;",
        f"{block.device(lease.LAYOUT)} := {number(loop, block)};",
        "",
        *_steps(loop, block),
    ]


def _steps(loop: Loop, block: Layout) -> list[str]:
    claim, beat_owner, beat, owner, last, calls, expired, result = (block.device(at) for at in range(8))
    return [
        "(* 2. A free lease goes to whoever claims it; what stood in the slots counts no more. *)",
        f"IF ({owner} = 0) AND ({claim} <> 0) THEN",
        f"  {owner} := {claim};",
        f"  {last} := 0;",
        f"  {calls} := 0;",
        *(f"  {block.device(slot.at)} := 0;" for slot in block.slots),
        "END_IF;",
        f"{claim} := 0;",
        "",
        "(* 3. Only the owner's beat counts; a beat of 0 gives the lease back. *)",
        f"IF ({beat_owner} = {owner}) AND ({beat} <> {last}) THEN",
        f"  {last} := {beat};",
        f"  {calls} := 0;",
        "ELSE",
        f"  IF {calls} < {lease.COUNT_MAX} THEN {calls} := {calls} + 1; END_IF;",
        "END_IF;",
        f"IF ({beat_owner} = {owner}) AND ({beat} = 0) THEN {owner} := 0; END_IF;",
        "",
        "(* 4. The beat stands still: put the loop back, unless somebody has taken it over. *)",
        f"IF ({owner} <> 0) AND ({calls} >= {block.calls_max}) THEN",
        f"  {expired} := {owner};",
        f"  {owner} := 0;",
        f"  {result} := {lease.PUT_BACK};",
        *_takeovers(loop, block),
        f"  IF {result} = {lease.PUT_BACK} THEN",
        *(f"    {line}" for slot in block.slots if slot.is_restored for line in _putting_back(slot, block)),
        "  END_IF;",
        "END_IF;",
    ]


def _takeovers(loop: Loop, block: Layout) -> list[str]:
    roles = loop.controller.roles
    lines = []
    for slot in block.slots:
        counts = f"({block.device(slot.at)} = 1)"
        if slot.operand == roles.mout:
            manual = loop.bindings[roles.manual]
            counts += f" AND ({manual} = {'TRUE' if roles.is_manual_when else 'FALSE'})"
        elif slot.operand not in roles.modes:
            continue
        taken = f"{block.device(lease.RESULT)} := {lease.TAKEN_OVER};"
        lines.append(f"  IF {counts} AND NOT ({_is_ours(slot, block)}) THEN {taken} END_IF;  (* {slot.operand} *)")
    return lines


def _putting_back(slot: Slot, block: Layout) -> list[str]:
    found = [block.device(slot.at + 1 + word) for word in range(slot.size)]
    if slot.kind is Kind.BOOL:
        does = f"{slot.device} := ({found[0]} = 1);"
    else:
        does = " ".join(f"{target} := {source};" for target, source in zip(_targets(slot), found, strict=True))
    return [f"IF ({block.device(slot.at)} = 1) AND ({_is_ours(slot, block)}) THEN {does} END_IF;  (* {slot.operand} *)"]


def _is_ours(slot: Slot, block: Layout) -> str:
    """It holds what stood there before, or behind, the write under way."""
    texts = []
    for which in (1, 2):
        words = [block.device(slot.at + 1 + which * slot.size + word) for word in range(slot.size)]
        if slot.kind is Kind.BOOL:
            texts.append(f"({slot.device} = ({words[0]} = 1))")
        else:
            texts.append(_all(f"({target} = {word})" for target, word in zip(_targets(slot), words, strict=True)))
    return " OR ".join(texts)


def _all(parts: Iterable[str]) -> str:
    found = list(parts)
    return found[0] if len(found) == 1 else f"({' AND '.join(found)})"


def _targets(slot: Slot) -> list[str]:
    return [f"{slot.device.kind}{slot.device.index + word}" for word in range(slot.size)]
