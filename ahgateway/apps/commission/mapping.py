"""Step 2, settle the map: do the operands stand where the profile says, in the word order it says? Reads only.

A hypothesis is a device map, an offset and a word order. Each reading is scored by how many operands look like those
of a PID instruction; the profile's own must be the best, else the best one is named. The strongest witness is the
instruction's own memory: it keeps the PV of the last execution.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ahgateway.apps.commission.checks import Check, Outcome, failed, judged, passed, skipped, unclear
from ahgateway.codec import block
from ahgateway.codec.access import Read, Span, Table
from ahgateway.codec.devices import Device, DeviceMap, DeviceRange
from ahgateway.codec.plan import plan
from ahgateway.codec.station import Const, Loop, Station
from ahgateway.codec.words import decode, words_real
from ahgateway.core.operands import Kind
from ahgateway.errors import AhGatewayError, CodecError, PlcRefusedError
from ahgateway.lockstep.gate.gate import Gate
from ahgateway.lockstep.gate.scratch import MARKER, SCRATCH
from ahgateway.transports.base import Link

CLEARLY = 3
"""Another hypothesis must fit so many operands more than the profile's own before it is named."""
BEYOND = frozenset({2, 3})
"""MANUAL Modbus application protocol §7: illegal data address; some PLCs call it an illegal value."""
SMALL, LARGE = 1e-6, 1e7
"""A REAL of a real loop is 0 or lies between these; swapped words nearly never do."""


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """One way in which the operands may stand in the PLC."""

    devices: DeviceMap
    offset: int = 0
    is_high_first: bool = False

    @property
    def text(self) -> str:
        """Name it for people."""
        order = "high word first" if self.is_high_first else "low word first"
        return f"map {self.devices.name}, offset {self.offset:+d}, {order}"


@dataclass(frozen=True, slots=True)
class Fit:
    """How well a hypothesis fits: `score` of `best` looks good; the values for people."""

    hypothesis: Hypothesis
    score: int
    best: int
    values: Mapping[str, Any]
    is_empty: bool = False


async def settle(station: Station, loop: Loop, link: Link, others: Sequence[DeviceMap] = ()) -> list[Check]:
    """Return the checks of step 2.

    Args:
        station: The station.
        loop: The loop.
        link: The way there.
        others: Device maps to try when the profile's own does not fit.

    Raises:
        TransportError: The link failed.
    """
    own = await _fit(station, loop, link, Hypothesis(station.devices))
    checks = _judge(own, await _others(station, loop, link, own, others))
    fits = all(check.outcome is not Outcome.FAIL for check in checks)
    d_range = await _d_range(station, link) if fits else skipped("d-range", "not before the map fits")
    return [*checks, d_range, await _system_flags(station, link)]


async def _others(station: Station, loop: Loop, link: Link, own: Fit | None, others: Sequence[DeviceMap]) -> list[Fit]:
    if own is not None and own.score == own.best:
        return []
    hypotheses = [
        Hypothesis(station.devices, offset, is_high_first)
        for offset in (0, -1, 1)
        for is_high_first in (False, True)
        if offset or is_high_first
    ]
    hypotheses += [Hypothesis(devices) for devices in others if devices.name != station.devices.name]
    fits = [await _fit(station, loop, link, hypothesis) for hypothesis in hypotheses]
    return [fit for fit in fits if fit is not None]


def _judge(own: Fit | None, others: Sequence[Fit]) -> list[Check]:
    names = ("swapped-word-order", "off-by-one", "wrong-device-map", "no-loop-there")
    # Zeros look legal everywhere and prove nothing.
    best = max((fit for fit in others if not fit.is_empty), key=lambda fit: fit.score, default=None)
    mine = own.score if own is not None else -1
    if best is not None and best.score >= mine + CLEARLY and 2 * best.score > best.best:
        return [_named(name, best, own) for name in names]
    if own is None:
        return [*(skipped(name, "the registers cannot be read") for name in names[:3]),
                failed("no-loop-there", "the PLC refuses the operands' addresses")]  # fmt: skip
    if own.is_empty:
        return [*(skipped(name, "every operand but PV reads 0") for name in names[:3]),
                failed("no-loop-there", "every operand but PV reads 0")]  # fmt: skip
    text = f"{own.score} of {own.best} signs of a PID instruction as the profile says"
    if 3 * own.score < 2 * own.best:
        return [*(skipped(name, "no other reading fits better") for name in names[:3]),
                failed("no-loop-there", text, **own.values)]  # fmt: skip
    return [passed(name, text, **own.values) for name in names]


def _named(name: str, best: Fit, own: Fit | None) -> Check:
    found = best.hypothesis
    is_it = {
        "swapped-word-order": found.is_high_first,
        "off-by-one": found.offset != 0,
        "wrong-device-map": own is None or found.devices is not own.hypothesis.devices,
        "no-loop-there": False,
    }[name]
    if name == "wrong-device-map" and own is None:
        is_it = found.offset == 0 and not found.is_high_first
    text = f"it reads as {found.text}: {best.score} of {best.best} signs of a PID instruction"
    text += f", against {own.score} as the profile says" if own is not None else ""
    return judged(name, not is_it, text, **best.values)


async def _fit(station: Station, loop: Loop, link: Link, hypothesis: Hypothesis) -> Fit | None:
    """Read the block as the hypothesis says; None when the PLC or the map refuses it."""
    try:
        spans = {
            name: Span(span.table, span.address + (hypothesis.offset if not span.table.is_bits else 0), span.count)
            for name, span in block.spans(loop, hypothesis.devices).items()
            if not span.table.is_bits
        }
        if any(span.address < 0 for span in spans.values()):
            return None
        image = block.Image()
        limits = station.pacing
        for read in plan(
            spans.values(), unit=station.unit, words_max=limits.words_per_request_max, gap_max=limits.gap_words_max
        ):
            image.put(read, (await link.exchange(read)).values)
    except (CodecError, PlcRefusedError):
        return None
    words = {name: image.words(span) for name, span in spans.items()}
    if hypothesis.is_high_first:
        words = {name: _swapped(each) for name, each in words.items()}
    return _scored(loop, hypothesis, words)


def _swapped(words: tuple[int, ...]) -> tuple[int, ...]:
    if len(words) < 2:
        return words
    return tuple(words[at ^ 1] for at in range(len(words)))


def _scored(loop: Loop, hypothesis: Hypothesis, words: Mapping[str, tuple[int, ...]]) -> Fit:
    signs: list[bool] = []
    values: dict[str, Any] = {}
    for row in loop.controller.operands:
        if row.name not in words or row.kind is Kind.BLOCK:
            continue
        value = decode(row.kind, words[row.name])
        values[row.name] = float(value) if row.kind is Kind.REAL else value
        if row.kind is Kind.REAL:
            signs.append(_is_usual(float(value)))
        else:
            low = row.minimum if row.minimum is not None else -(2**31)
            signs.append(low <= value <= (row.maximum if row.maximum is not None else 2**31))
    signs += _sense(loop, values, words)
    shown = {name: value if math.isfinite(value) else str(value) for name, value in values.items()}
    # The program fills PV from its input, whether an instruction stands there or not.
    is_empty = not any(any(each) for name, each in words.items() if name not in loop.controller.roles.pvs)
    return Fit(hypothesis, sum(signs), len(signs), shown, is_empty)


def _is_usual(value: float) -> bool:
    return value == 0.0 or SMALL <= abs(value) <= LARGE


def _sense(loop: Loop, values: Mapping[str, Any], words: Mapping[str, tuple[int, ...]]) -> list[bool]:
    """Signs that need several operands."""
    signs: list[bool] = []
    roles = loop.controller.roles
    mv = loop.controller.operand_of(roles.mv)
    if {"MV", "MV_MIN", "MV_MAX"} <= values.keys():
        low, high = sorted((values["MV_MIN"], values["MV_MAX"]))
        signs += [low < high, low <= values["MV"] <= high or values["MV"] == 0.0]
    for name, bounds in ((roles.pvs[0], loop.pv_range), (roles.sv, loop.pv_range), (mv, loop.mv_range)):
        if bounds is not None and name in values:
            signs.append(bounds[0] - 0.1 * (bounds[1] - bounds[0]) <= values[name] <= 1.1 * bounds[1])
    for seen in loop.controller.seen:
        if seen.attr == "pv1" and "PV" in values and not isinstance(loop.bindings[seen.operand], Const):
            at = 2 * seen.dword
            recorded = float(words_real(words[seen.operand][at], words[seen.operand][at + 1]))
            near = abs(recorded - values["PV"]) <= 0.05 * max(abs(values["PV"]), 1.0)
            # The strongest sign counts as much as it takes to be named by.
            signs += [near] * CLEARLY
    return signs


async def mark(gate: Gate, link: Link) -> Check:
    """Write the marker through the gate, read each scratch word by itself, and put back what stood there."""
    place = gate.station.scratch
    if place is None:
        return skipped("marker", "the profile names no scratch words")
    address = gate.station.devices.address(place).address
    try:
        async with gate.armed("marker in the scratch words"):
            await gate.write({SCRATCH: MARKER}, "marker")
            reads = [Read(gate.station.unit, Table.HOLDING, address + at, 1) for at in (0, 1)]
            words = [(await link.exchange(read)).values[0] for read in reads]
    except AhGatewayError as error:
        return failed("marker", error.message)
    low, high = words
    text = f"{MARKER:#010x} at {place} reads {low:04X} {high:04X}; ISPSoft shows {MARKER} there while it stands"
    return judged("marker", (low, high) == (MARKER & 0xFFFF, MARKER >> 16), text)


async def _d_range(station: Station, link: Link) -> Check:
    """How far D answers: the map is the family's, a smaller CPU has fewer. What the profile uses must lie inside."""
    rows = [row for row in station.devices.ranges if row.kind == "D"]
    if not rows:
        return skipped("d-range", f"the device map {station.devices.name} has no D")
    said, gone = [], []
    try:
        for row in rows:
            last = await _last_of(row, station.unit, link)
            whole = f"{row.name(row.first)}…{row.name(row.last)}"
            if last == row.last:
                said.append(f"{whole} answers to its end")
                continue
            said.append(f"{whole} is refused {'whole' if last is None else f'behind {row.name(last)}'}")
            gone.append((row, row.first if last is None else last + 1))
    except CodecError as error:
        return skipped("d-range", f"this wire reads only what it was told of: {error.message}")
    except PlcRefusedError as error:
        return unclear("d-range", error.message)
    used = [span for loop in station.loops for span in block.spans(loop, station.devices).values()]
    if station.scratch is not None:
        place = station.devices.address(station.scratch)
        used.append(Span(place.table, place.address, 2))
    lost = [span for span in used if any(_reaches(span, row, first) for row, first in gone)]
    text = ", ".join(said)
    if not lost:
        return passed("d-range", text)
    names = ", ".join(str(station.devices.device(span.table, span.address)) for span in lost)
    return failed("d-range", f"{text}; the profile uses {names}")


async def _last_of(row: DeviceRange, unit: int, link: Link) -> int | None:
    """Return the highest number of a range that can be read, None when not even the first can."""

    async def answers(number: int) -> bool:
        try:
            await link.exchange(Read(unit, row.table, row.base + (number - row.first) * row.stride, 1))
        except PlcRefusedError as error:
            if error.code not in BEYOND:
                raise
            return False
        return True

    if await answers(row.last):
        return row.last
    if not await answers(row.first):
        return None
    low, high = row.first, row.last
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if await answers(middle) else (low, middle)
    return low


def _reaches(span: Span, row: DeviceRange, first: int) -> bool:
    begins = row.base + (first - row.first) * row.stride
    return span.table is row.table and span.address < row.end and begins < span.end


async def _system_flags(station: Station, link: Link) -> Check:
    """SM400 on and SM401 off prove the flags' part of the map, and RUN."""
    try:
        places = [station.devices.address(Device("SM", number), bits=True) for number in (400, 401)]
    except CodecError:
        return skipped("system-flags", f"the device map {station.devices.name} has no SM400")
    bits = []
    for place in places:
        try:
            bits.append((await link.exchange(Read(station.unit, Table.COIL, place.address, 1))).values[0])
        except PlcRefusedError as error:
            return unclear("system-flags", f"the PLC refuses to read SM: {error.message}")
    text = f"SM400 is {bits[0]}, SM401 is {bits[1]}"
    if bits == [0, 0]:
        return unclear("system-flags", f"{text}: the PLC is in STOP, or SM stands elsewhere")
    return judged("system-flags", bits == [1, 0], text)
