"""What a screen or a page says of a loop and of the link, as data: every view shows the same, each in its own way."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ahgateway.apps.board import Board, Note
from ahgateway.apps.health import label
from ahgateway.apps.lines import clock_time, event_line, shown
from ahgateway.apps.monitor import Report, Watch
from ahgateway.apps.report import hexadecimal
from ahgateway.clock import MILLISECOND
from ahgateway.codec.station import Const, Loop
from ahgateway.core.operands import Kind, Operand
from ahgateway.core.real import same_bits, ulp_distance
from ahgateway.core.verdict import Counts, Proof
from ahgateway.lockstep.events import Change
from ahgateway.lockstep.follow import is_automatic, output_of, process_value_of, target_of
from ahgateway.lockstep.picture import Picture
from ahgateway.transports.tracer import line_maker

DELTA_TERMS = ("e", "p", "i", "d", "bias", "raw", "mv")
EDGES_MS = (0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1000)
"""Classes of round trips."""
NO_FRAMES = "no frames: a link without wires has none, a recording only those kept with --record-frames"
FRAME_HEAD_MAX = 63
"""Time, direction and the first 15 bytes of a frame."""


@dataclass(frozen=True, slots=True)
class LoopRow:
    """One loop in one line.

    Attributes:
        word: Its verdict, or why there is none.
        values: SV, PV, MV as text; `-` before the first picture.
        mode: auto, manual, tuning, off; `-` before the first picture.
        way: How its executions are seen.
        age_ns: Of the values; None before the first picture.
        is_stale: The values are old: they must not look live.
        health: The worst figure of its health in a few words.
        notes: What a person should look at.
        needs_a_look: It diverged, swings or has notes, is stale, or nothing of it was proven yet.
    """

    name: str
    instruction: str
    word: str
    counts: Counts
    values: tuple[str, str, str]
    mode: str
    way: str
    age_ns: int | None
    is_stale: bool
    health: str
    notes: str
    needs_a_look: bool

    @property
    def coverage(self) -> str:
        """Share of the executions that is proven, never more than it is: 100% is every one."""
        return f"{math.floor(100.0 * self.counts.coverage)}%"


def loop_row(board: Board, watch: Watch) -> LoopRow:
    """Return a loop as it stands."""
    loop, picture, fresh = watch.loop, watch.follower.picture, board.freshness(watch)
    counts, figures = watch.follower.summary(), board.known_health(loop.name)
    notes = watch.refused or ", ".join(watch.follower.findings)
    values, mode = ("-", "-", "-"), "-"
    if picture is not None and fresh.age_ns is not None:
        sv, pv, mv = target_of(loop, picture), process_value_of(loop, picture), output_of(loop, picture)
        values = (shown(sv), shown(pv), shown(mv))
        mode = mode_word(loop, picture)
    return LoopRow(
        loop.name,
        loop.controller.name,
        board.word(watch),
        counts,
        values,
        mode,
        watch.way(board.monitor.station).value,
        fresh.age_ns,
        fresh.is_stale,
        label(figures),
        notes,
        bool(
            counts.diverged
            or not counts.proven
            or fresh.is_stale
            or notes
            or (figures is not None and figures.oscillates)
        ),
    )


def mode_word(loop: Loop, picture: Picture) -> str:
    """Return `auto`, `manual`, `tuning` or `off`."""
    inputs = picture.inputs
    if not getattr(inputs, "pid_run", True):
        return "off"
    if getattr(inputs, "pid_mode", 0) == 1:
        return "tuning"
    if loop.controller.begin is not None:
        return "auto" if is_automatic(loop, picture) else "manual"
    return "manual" if getattr(inputs, "pid_man", False) else "auto"


@dataclass(frozen=True, slots=True)
class TermRow:
    """One term of the last execution, PLC beside reference.

    Attributes:
        plc: As it stands in the PLC's memory; None for what the instruction keeps to itself, or without a picture.
        ref: As the reference computed it; None without an execution.
        is_open: The reference's last bits are not settled.
        is_same: Both are known and equal by bits, or not; None where one is not known, or nobody judged them.
        compared: How they differ, as text.
    """

    name: str
    plc: Any
    ref: Any
    is_open: bool
    is_same: bool | None
    compared: str


def term_rows(watch: Watch) -> list[TermRow]:
    """Return every term of the last execution in the order in which the law computes them."""
    loop, picture, last = watch.loop, watch.follower.picture, watch.follower.last
    terms = last.terms if last is not None else None
    words = {word.attr: word for word in loop.controller.seen}
    rows = []
    for name in _names(loop, terms):
        plc = known_by_plc(loop, picture, name)
        ref = getattr(terms, name) if terms is not None else None
        if ref is not None and name in words and words[name].kind is Kind.INT:
            ref = words[name].stored(None, terms)
        is_open = last is not None and name in last.open_terms
        is_same, text = compared(plc, ref)
        if is_same is False and last is not None and last.proof is Proof.BITS:
            # A match by bits holds for all that was judged: the rest is hidden as yet, such as the phase of a pulse.
            is_same, text = None, "not judged"
        rows.append(TermRow(name.upper(), plc, ref, is_open, is_same, text))
    return rows


def _names(loop: Loop, terms: Any) -> list[str]:
    """Terms that a person looks at: Delta's own, of other blocks every REAL and whatever stands in memory."""
    if loop.controller.begin is None:
        return [name for name in DELTA_TERMS if terms is None or hasattr(terms, name)]
    shows = [word.attr for word in loop.controller.seen]
    if terms is None:
        return shows
    return [
        name
        for name, value in zip(terms._fields, terms, strict=True)
        if isinstance(value, np.floating) or name in shows
    ]


def known_by_plc(loop: Loop, picture: Picture | None, name: str) -> Any:
    """Return a term as it stands in the PLC's memory, None for what the instruction keeps to itself."""
    if picture is None:
        return None
    if name == "bias":
        return getattr(picture.inputs, "bias", None)
    return next((picture.seen.get(word.name) for word in loop.controller.seen if word.attr == name), None)


def compared(plc: Any, ref: Any) -> tuple[bool | None, str]:
    """Say whether two values are equal by bits, and how they differ: the distance and both bit patterns."""
    if plc is None or ref is None:
        return None, ""
    if not isinstance(plc, np.floating):
        return (True, "same bits") if plc == ref else (False, f"{hexadecimal(plc)} {hexadecimal(ref)}")
    if same_bits(plc, ref):
        return True, "same bits"
    distance = ulp_distance(plc, ref)
    apart = f"{distance} ULP" if distance is not None else "NaN"
    return False, f"{apart} {hexadecimal(plc)} {hexadecimal(ref)}"


@dataclass(frozen=True, slots=True)
class OperandRow:
    """One operand; `change` is when somebody last changed it and how, with the values before and after."""

    name: str
    device: str
    value: str
    unit: str
    change: tuple[int, Change] | None


def operand_rows(board: Board, watch: Watch) -> list[OperandRow]:
    """Return every operand with its device; `-` for a value that nobody has seen."""
    picture, loop = watch.follower.picture, watch.loop
    changes = board.changes[loop.name]
    rows = []
    for operand in loop.controller.operands:
        if operand.kind is Kind.BLOCK:
            continue
        value = getattr(picture.inputs, operand.attr, None) if picture is not None else None
        if value is None and picture is not None:
            value = picture.seen.get(operand.name)
        text = "-" if value is None else shown(value)
        rows.append(
            OperandRow(operand.name, where(loop, operand), text, unit(loop, operand), changes.get(operand.name))
        )
    return rows


def where(loop: Loop, operand: Operand) -> str:
    """The operand's device as the program writes it; a literal has none."""
    binding = loop.bindings.get(operand.name)
    if binding is None:
        return "-"
    return "literal" if isinstance(binding, Const) else str(binding)


def unit(loop: Loop, operand: Operand) -> str:
    """The operand's unit, the loop's own where it is PV or MV."""
    return {"PV": loop.pv_unit, "MV": loop.mv_unit}.get(operand.unit, operand.unit)


def log_line(event: Report | Note) -> str | None:
    """Return what happened, or what somebody wrote, as a line; None for what a log leaves out."""
    if isinstance(event, Note):
        return f"{clock_time(event.utc_ns)} note: {event.text}"
    return event_line(event)


def round_trip_classes(round_trips_ns: Iterable[int]) -> list[tuple[float, float | None, int]]:
    """Return (from ms, below ms or None, count) of each class that holds something or lies between such."""
    counts = [0] * (len(EDGES_MS) + 1)
    for each in round_trips_ns:
        counts[sum(each >= edge * MILLISECOND for edge in EDGES_MS)] += 1
    filled = [index for index, count in enumerate(counts) if count]
    if not filled:
        return []
    return [
        (EDGES_MS[index - 1] if index else 0.0, EDGES_MS[index] if index < len(EDGES_MS) else None, counts[index])
        for index in range(filled[0], filled[-1] + 1)
    ]


def frame_lines(board: Board, count: int) -> list[str]:
    """Return the last frames of the link, decoded, oldest first; each reply is read with its request."""
    frames = list(board.frames)[-count:]
    while frames and frames[0].direction == "<":
        del frames[0]
    station = board.monitor.station
    line = line_maker(board.monitor.scheme, station.can, station.devices)
    return [_shortened(line(frame)) for frame in frames]


def _shortened(line: str) -> str:
    """A frame's line with no more bytes than leave room for what they mean."""
    head, gap, meaning = line.partition("  ")
    return line if len(head) <= FRAME_HEAD_MAX else f"{head[:FRAME_HEAD_MAX]}…{gap}{meaning}"
