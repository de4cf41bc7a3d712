"""Which double words of I_MV follow which quantity: where a firmware keeps the PV of the last execution, and the rest.

The manual names two of them and calls the others the system's. This file counts agreements; it explains no execution.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any, NamedTuple

from ahgateway.codec import block
from ahgateway.codec.station import Loop
from ahgateway.core.dialect import PvWord
from ahgateway.core.real import from_bits
from ahgateway.lockstep.picture import Picture

CHANGES_MIN = 8
"""Fewer changes of a word than this are no evidence."""

SHARE_MIN = 0.9
"""A word that agrees less often follows something else."""

NEAR = 0.05
"""PV moves on between execution and picture: so near, as a share of all that it moved, a word agrees with it."""


class Followed(NamedTuple):
    """One double word of I_MV that follows a quantity.

    Attributes:
        dword: Its place, double words from the first.
        quantity: What it follows, in the manual's terms.
        agreed: How often it held that quantity when it had changed.
        changes: How often it changed.
    """

    dword: int
    quantity: str
    agreed: int
    changes: int


def followed(loop: Loop, pictures: Sequence[Picture]) -> tuple[Followed, ...]:
    """Return the double words of I_MV that follow a quantity, each with its evidence, in their order."""
    found = []
    held = [picture for picture in pictures if "I_MV" in picture.words]
    moved = _moved(held)
    # The first is the integral, which the manual names.
    for dword in range(1, len(held[0].words["I_MV"]) // 2 if held else 0):
        changes = [pair for pair in pairwise(held) if _word(pair[0], dword) != _word(pair[1], dword)]
        if len(changes) < CHANGES_MIN:
            continue
        agreed: dict[str, int] = {}
        for before, after in changes:
            value = float(from_bits(_word(after, dword)))
            for name, candidates in _quantities(before, after).items():
                is_near = any(abs(value - float(each)) <= NEAR * moved[name] for each in candidates)
                agreed[name] = agreed.get(name, 0) + is_near
        best = max(agreed, key=lambda name: agreed[name])
        if agreed[best] >= SHARE_MIN * len(changes):
            found.append(Followed(dword, best, agreed[best], len(changes)))
    return tuple(found)


def _moved(pictures: Sequence[Picture]) -> dict[str, float]:
    """How far each quantity moved over all pictures."""
    found: dict[str, list[float]] = {}
    for picture in pictures:
        for name, candidates in _quantities(picture, picture).items():
            found.setdefault(name, []).append(float(candidates[0]))
    return {name: max(values) - min(values) for name, values in found.items()}


def _word(picture: Picture, dword: int) -> int:
    words = picture.words["I_MV"]
    return words[2 * dword] | words[2 * dword + 1] << 16


def _quantities(before: Picture, after: Picture) -> dict[str, list[Any]]:
    """What a word may hold behind an execution between two pictures."""
    read = [before.inputs, after.inputs]
    return {
        "PV": [each.pv for each in read],
        "SV - PV": [each.sv - each.pv for each in read],
        "PV - SV": [each.pv - each.sv for each in read],
        "MV": [after.seen["MV"]],
    }


def pv_placed(loop: Loop, pictures: Sequence[Picture]) -> tuple[Loop, list[Picture]]:
    """Return the loop with the word that holds PV, and the pictures seen so; unchanged where it is the manual's."""
    places = [each.dword for each in followed(loop, pictures) if each.quantity == "PV"]
    if not places or loop.controller.pv_dword in places:
        return loop, list(pictures)
    placed = replace(loop, dialect=loop.dialect._replace(pv_word=PvWord(places[0])))
    return placed, [replace(each, seen=block.seen(placed, each.words)) for each in pictures]
