"""From wanted values to requests: rounding, limits, what lands together, in which order. No I/O.

This file alone decides what one write may hold. A value is rounded to the operand's own kind first, and it is the
rounded value that is compared with limits and shown to people. Registers that only make sense together go out in one
request or not at all; a flag has a request of its own.

Source:
    MANUAL MV_MAX below MV_MIN are exchanged, so that the two are written together (spec ah500 §1.2).
    MANUAL MOUT follows MV while MOUT_AUTO is TRUE, in automatic (spec ah500 §1.2).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any

import numpy as np

from ahgateway.codec import block
from ahgateway.codec.access import Span, Write
from ahgateway.codec.block import Raw
from ahgateway.codec.station import Const, Loop, Station, WriteLimit
from ahgateway.codec.words import decode, encode
from ahgateway.core.controllers import Roles
from ahgateway.core.operands import Access, Kind
from ahgateway.core.real import REAL
from ahgateway.errors import CodecError, StateError

SYSTEM = frozenset({"SM", "SR"})
"""Kinds of device that hold RUN and STOP, communication and the rest of the system: never written."""

DVP_RUN = ("M", 1072)
"""MANUAL DVP: M1072 is RUN/STOP there, an ordinary flag elsewhere; never written anywhere (spec ah500 §3.6)."""


@dataclass(frozen=True, slots=True)
class Item:
    """One operand before and after, as words, low word first; a BOOL is one 0 or 1."""

    operand: str
    device: str
    kind: Kind
    span: Span
    old: tuple[int, ...]
    new: tuple[int, ...]

    @property
    def old_value(self) -> Any:
        """What stands there now, typed."""
        return decode(self.kind, self.old)

    @property
    def new_value(self) -> Any:
        """What will stand there, typed and rounded."""
        return decode(self.kind, self.new)

    def facts(self) -> dict[str, Any]:
        """Return the change as the journal keeps it."""
        return {
            "operand": self.operand, "device": self.device, "old": list(self.old), "new": list(self.new),
            "old_value": shown(self.old_value), "new_value": shown(self.new_value),
        }  # fmt: skip


@dataclass(frozen=True, slots=True)
class Step:
    """One request, and the operands in it."""

    items: tuple[Item, ...]
    request: Write


def shown(value: Any) -> str:
    """Return a value for people: a REAL by the fewest digits that give its bits, a BOOL as TRUE or FALSE."""
    if isinstance(value, bool):
        return "TRUE" if value else "FALSE"
    if isinstance(value, np.floating):
        return np.format_float_positional(value, unique=True, trim="0") if np.isfinite(value) else str(float(value))
    return str(value)


def hexadecimal(words: Iterable[int]) -> str:
    """Return words as `00A4 4145`, in the order in which they stand."""
    return " ".join(f"{word:04X}" for word in words)


def line(item: Item) -> str:
    """Return `SV D100: 80.0 -> 82.0  [0000 42A0 -> 0000 42A4]`."""
    words = f"[{hexadecimal(item.old)} -> {hexadecimal(item.new)}]"
    return f"{item.operand} {item.device}: {shown(item.old_value)} -> {shown(item.new_value)}  {words}"


def parsed(loop: Loop, operand: str, text: str) -> bool | int | float:
    """Return a value that a person typed, as the operand's kind takes it.

    Raises:
        StateError: No such operand, or its kind cannot be read from this text.
    """
    kind = loop.controller.operand(_known(loop, operand)).kind
    if kind is Kind.BOOL:
        meaning = {"1": True, "true": True, "on": True, "0": False, "false": False, "off": False}
        if text.lower() in meaning:
            return meaning[text.lower()]
        raise StateError(f"{operand} is a BOOL, `{text}` is none of {', '.join(meaning)}")
    try:
        return float(text) if kind is Kind.REAL else int(text)
    except ValueError:
        wanted = "a number" if kind is Kind.REAL else "a whole number"
        raise StateError(f"{operand} is a {kind.value} and takes {wanted}, `{text}` is none") from None


def _known(loop: Loop, operand: str) -> str:
    names = [row.name for row in loop.controller.operands]
    if operand in names:
        return operand
    near = get_close_matches(operand, names, 1, 0.5)
    raise StateError(
        f"loop {loop.name}: {loop.controller.name} has no operand `{operand}`, it has {', '.join(names)}",
        hint=f"did you mean `{near[0]}`?" if near else None,
    )


def allowed(loop: Loop, station: Station, operand: str) -> WriteLimit:
    """Return the limits within which an operand may be written.

    Raises:
        StateError: It may not be written at all; the message says why.
    """
    row = loop.controller.operand(_known(loop, operand))
    binding = loop.bindings[operand]
    if operand not in loop.writes:
        listed = ", ".join(loop.writes) or "nothing"
        raise StateError(
            f"loop {loop.name}: {operand} is not on the list of what may be written, which holds {listed}",
            hint=f"[loops.{loop.name}.write] in the profile is that list",
        )
    if isinstance(binding, Const):
        raise StateError(f"loop {loop.name}: {operand} is a constant of the program and stands nowhere")
    if row.access in (Access.OUT, Access.STATE):
        raise StateError(f"loop {loop.name}: {operand} is written by the instruction itself")
    if operand in loop.shared:
        raise StateError(f"loop {loop.name}: {operand} at `{binding}` is shared with another loop and never written")
    if operand in ("PV", "PID_RUN") and not station.bench:
        raise StateError(f'loop {loop.name}: {operand} may be written only on a station of kind = "bench"')
    if binding == station.running or binding.kind in SYSTEM or (binding.kind, binding.index) == DVP_RUN:
        raise StateError(f"loop {loop.name}: {operand} at `{binding}` can stop the PLC and is never written")
    place = station.devices.address(binding, bits=row.kind is Kind.BOOL)
    if place.bit is not None:
        raise StateError(f"loop {loop.name}: {operand} at `{binding}` is a bit inside a word, which holds other bits")
    return loop.writes[operand]


def item(loop: Loop, station: Station, operand: str, value: Any, now: Raw, *, reference: Any = None) -> Item:
    """Return one operand's change, rounded and within its limits.

    Args:
        loop: The loop.
        station: Its station.
        operand: The manual's name.
        value: Typed value, not yet rounded.
        now: Words that stand in the PLC.
        reference: What the step is measured from, when it is not what stands there.

    Raises:
        StateError: It may not be written, or a limit forbids it; the message has value and limit.
        CodecError: The kind cannot hold the value.
    """
    limit = allowed(loop, station, operand)
    row = loop.controller.operand(operand)
    try:
        words = encode(row.kind, value)
    except CodecError as error:
        raise CodecError(f"loop {loop.name}: {operand}: {error.message}", hint=error.hint) from error
    made = Item(
        operand, str(loop.bindings[operand]), row.kind, block.spans(loop, station.devices)[operand], now[operand], words
    )
    if row.kind is not Kind.BOOL:
        _check(loop, made, limit, made.old_value if reference is None else reference)
    return made


def _check(loop: Loop, made: Item, limit: WriteLimit, reference: Any) -> None:
    new, where = made.new_value, f"loop {loop.name}: {made.operand}"
    if not math.isfinite(new):
        raise StateError(f"{where} = {shown(new)} is no finite number")
    assert limit.minimum is not None
    assert limit.maximum is not None
    assert limit.step_max is not None
    low, high = _rounded(made.kind, limit.minimum), _rounded(made.kind, limit.maximum)
    if not low <= new <= high:
        raise StateError(
            f"{where} = {shown(new)} is outside {limit.minimum:g}…{limit.maximum:g}, which the profile allows"
        )
    if made.new == made.old:
        return
    if not math.isfinite(reference):
        raise StateError(
            f"{where} holds {shown(reference)}, so that the step to {shown(new)} has no size",
            hint="put a number there with the PLC's own tools first",
        )
    # Both ends are rounded already: a step of exactly step_max may come out one unit of the last place longer.
    slack = float(np.spacing(REAL(max(abs(new), abs(reference))))) if made.kind is Kind.REAL else 0.0
    distance = abs(float(new) - float(reference))
    if distance > limit.step_max + slack:
        raise StateError(
            f"{where}: {shown(reference)} -> {shown(new)} is a step of {distance:g}, "
            f"allowed is {limit.step_max:g} at once",
            hint=f"go there in steps of {limit.step_max:g}",
        )


def _rounded(kind: Kind, limit: float) -> Any:
    return REAL(limit) if kind is Kind.REAL else limit


def steps(loop: Loop, station: Station, items: Sequence[Item], *, is_return: bool = False) -> tuple[Step, ...]:
    """Return the requests that carry these changes: registers merged where they touch, flags one by one.

    What stands there already is left out, unless it lies between two changes of one request. A return to what was
    found is never refused: where it cannot land together, it lands one by one.

    Raises:
        StateError: Operands that must land together do not stand together.
    """
    words = sorted((each for each in items if each.kind is not Kind.BOOL), key=lambda each: each.span.address)
    groups: list[list[Item]] = []
    length_max = station.pacing.words_per_request_max
    for each in words:
        last = groups[-1] if groups else []
        touches = bool(last) and last[-1].span.table is each.span.table and last[-1].span.end == each.span.address
        if touches and each.span.end - last[0].span.address <= length_max:
            last.append(each)
        else:
            groups.append([each])
    trimmed = [kept for group in groups if (kept := _trimmed(group))]
    if not is_return:
        _check_together(loop, trimmed)
    trimmed += [[each] for each in items if each.kind is Kind.BOOL and each.old != each.new]
    return tuple(_step(station, group) for group in trimmed)


def _trimmed(group: list[Item]) -> list[Item]:
    """Cut off what does not change at both ends."""
    changed = [position for position, each in enumerate(group) if each.old != each.new]
    return group[changed[0] : changed[-1] + 1] if changed else []


def _check_together(loop: Loop, groups: Sequence[Sequence[Item]]) -> None:
    for family in loop.controller.roles.together:
        parts = [group for group in groups if any(each.operand in family and each.old != each.new for each in group)]
        if len(parts) > 1:
            names = [each.operand for group in parts for each in group if each.operand in family]
            raise StateError(
                f"loop {loop.name}: {', '.join(names)} must land together, but one request cannot hold them",
                hint="name the operands between them too, or write one of them alone",
            )


def single(station: Station, change: Item) -> Step:
    """Return the request that carries one change, whether anything changes or not."""
    return _step(station, [change])


def _step(station: Station, group: Sequence[Item]) -> Step:
    first = group[0].span
    values = tuple(word for each in group for word in each.new)
    return Step(tuple(group), Write(station.unit, first.table, first.address, values))


def stages(loop: Loop, values: Mapping[str, Any], now: Raw) -> list[dict[str, Any]]:
    """Order what is wanted so that every moment between two requests is a legal one.

    Into manual: the manual value takes over the output first, then the loop goes to manual, then the rest, a wanted
    manual value last. Out of manual: the loop goes back last. A manual value of None stands for the output of then.
    """
    roles = loop.controller.roles
    rest = {name: value for name, value in values.items() if name not in (roles.manual, roles.mout)}
    mout = {roles.mout: values[roles.mout]} if roles.mout in values else {}
    if roles.manual not in values:
        return [{**rest, **mout}]
    man = {roles.manual: values[roles.manual]}
    found: list[dict[str, Any]]
    if bool(man[roles.manual]) is roles.is_manual_when and not in_manual(roles, now):
        found = [{roles.mout: None} if roles.mout else {}, man, rest, mout]
    else:
        found = [rest, mout, man]
    return [stage for stage in found if stage]


def in_manual(roles: Roles, now: Raw) -> bool:
    """Tell whether the loop is in manual; False where the controller has none."""
    return bool(roles.manual) and bool(now[roles.manual][0]) is roles.is_manual_when


def follows_mv(roles: Roles, now: Raw) -> bool:
    """Tell whether the instruction itself writes the manual value now, so that nobody else can."""
    return bool(roles.follows) and bool(now[roles.follows][0]) and not in_manual(roles, now)
