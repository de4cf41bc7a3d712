"""Columns of raw words as columns of values, named as the manual names them, with units: what exports are made of."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ahgateway.codec.station import Loop
from ahgateway.core.operands import Kind
from ahgateway.recording import layout
from ahgateway.recording.packing import RUNNING_OFF, RUNNING_ON, Block, Words
from ahgateway.recording.reader import Recording, spans


@dataclass(frozen=True, slots=True)
class Field:
    """One column of an export.

    Attributes:
        name: Operand in the manual's spelling, `I_MV+6` for a REAL inside a block, `I_MV_words` for its raw words.
        unit: Engineering unit, empty for none.
        kind: BOOL, REAL, INT, DINT; BLOCK for raw words.
        first: First word in the row.
        length: Number of words.
    """

    name: str
    unit: str
    kind: Kind
    first: int
    length: int


@dataclass(frozen=True, slots=True)
class Part:
    """Some rows of one loop: `values` by `Field.name`, in the order of the fields; BLOCK has shape (rows, words)."""

    ticks: NDArray[np.int64]
    utc_ns: NDArray[np.int64]
    running: list[bool | None]
    values: dict[str, NDArray[Any]]
    verdicts: list[dict[str, Any] | None]


def fields(loop: Loop) -> list[Field]:
    """Return the columns of a loop: operands in the instruction's order, then REALs in its memory, then raw blocks."""
    places = spans(layout.columns(loop))
    found, inside, blocks = [], [], []
    for row in loop.controller.operands:
        unit = layout.unit_of(row.unit, loop)
        first, end = places[row.name]
        if row.kind is Kind.BLOCK:
            blocks.append(Field(f"{row.name}_words", "", Kind.BLOCK, first, end - first))
            inside += [
                Field(each.name, loop.pv_unit if each.attr == "pv1" else unit, Kind.REAL, first + 2 * each.dword, 2)
                for each in sorted(loop.controller.seen, key=lambda seen: seen.dword)
                if each.operand == row.name
            ]
        else:
            found.append(Field(row.name, unit, row.kind, first, end - first))
    return [*found, *inside, *blocks]


def parts(recording: Recording, loop: Loop) -> Iterator[Part]:
    """Yield the rows of one loop, about a minute at a time, each with the verdict that was given at its tick."""
    columns = fields(loop)
    verdicts = {tick: text for name, tick, text in recording.verdicts() if name == loop.name}
    for block in recording.blocks(loop.name):
        values = {field.name: column(block.words, field.kind, field.first, field.length) for field in columns}
        found = [verdicts.get(tick) for tick in block.ticks.tolist()]
        yield Part(block.ticks, block.utc_ns, _running(block), values, found)


def column(words: Words, kind: Kind, first: int, length: int = 2) -> NDArray[Any]:
    """Return the values in these words of every row: REALs with every bit, BLOCKs as words."""
    part = np.ascontiguousarray(words[:, first : first + max(1, length)], "<u2")
    if kind is Kind.BLOCK:
        return part
    if kind is Kind.BOOL:
        switches: NDArray[np.bool_] = part[:, 0] != 0
        return switches
    if kind is Kind.INT:
        return np.ascontiguousarray(part[:, 0]).view("<i2")
    values: NDArray[Any] = part.view("<f4" if kind is Kind.REAL else "<i4")
    return values[:, 0]


def _running(block: Block) -> list[bool | None]:
    known = {RUNNING_ON: True, RUNNING_OFF: False}
    return [known.get(quality & 0x7F) for quality in block.quality.tolist()]
