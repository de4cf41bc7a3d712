"""What an execution between two pictures can have read: each operand that changed, before it was written or behind.

This file alone decides which sets of inputs are possible; `shadow` says which of them explain what was seen.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations
from typing import Any

from ahgateway.codec.station import Loop
from ahgateway.core.dialect import Clamped, Limits
from ahgateway.core.real import bits
from ahgateway.lockstep.picture import Picture

CHANGED_MAX = 4
"""Up to this many operands changed in one interval, every order of their writes and the execution is tried."""


def input_variants(loop: Loop, before: Picture, after: Picture) -> list[Any]:
    """Every set of inputs that an execution between two pictures can have read, likeliest first.

    Each changed operand was written before or after the execution. The PV that was used is what the instruction
    recorded, or what the register held at either end where it records none.
    """
    if after.is_exact:
        changed = [name for name in changed_inputs(loop, before, after) if name in written_back(loop, after)]
        before = after if not changed else replace(before, inputs=_unchanged(before, after, changed))
    else:
        changed = changed_inputs(loop, before, after)
    recorded = [after.seen[word.name] for word in loop.controller.seen if word.attr == "pv1"]
    pvs = {bits(pv): pv for pv in (*recorded, after.inputs.pv, before.inputs.pv)}
    variants: list[Any] = []
    for subset in orders(changed):
        mixed = before.inputs._replace(**{name: getattr(after.inputs, name) for name in subset})
        variants.extend(mixed._replace(pv=pv) for pv in pvs.values())
    return variants


def orders(changed: list[str]) -> list[tuple[str, ...]]:
    """Which of the changed operands can have been written before they were read: all or none first, then parts."""
    if len(changed) > CHANGED_MAX:
        return [tuple(changed), ()]
    found = [subset for size in range(len(changed), -1, -1) for subset in combinations(changed, size)]
    return sorted(found, key=lambda subset: min(len(subset), len(changed) - len(subset)))


def changed_inputs(loop: Loop, before: Picture, after: Picture) -> list[str]:
    """Names of the inputs, PV apart, whose bits differ between two pictures."""
    if before.words == after.words:
        return []
    return [
        operand.attr
        for operand in loop.controller.operands
        if operand.name in before.words
        and before.words[operand.name] != after.words[operand.name]
        and operand.attr in loop.controller.input_names
        and operand.attr != "pv"
    ]


def written_back(loop: Loop, picture: Picture) -> frozenset[str]:
    """Names of inputs that an execution itself can have overwritten with something else than it read."""
    names = {"mout"} if getattr(picture.inputs, "mout_auto", False) else set()
    if getattr(loop.dialect, "limits", None) == Limits.WRITTEN_BACK:
        names |= {"mv_max", "mv_min"}
    if getattr(loop.dialect, "clamped", None) == Clamped.WRITTEN_BACK:
        names |= set(loop.controller.input_names) - {"pv"}
    return frozenset(names)


def _unchanged(before: Picture, after: Picture, changed: list[str]) -> Any:
    """Inputs that are those of `after` but for what is named, which is as it was before."""
    return after.inputs._replace(**{name: getattr(before.inputs, name) for name in changed})
