"""From the operand table of one loop to its bindings: names, devices, constants, each checked against the device map.

Decides where an operand may stand. Whether two of them get in each other's way is `overlap`'s business.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ahgateway.codec.access import Span
from ahgateway.codec.devices import Address, Device, DeviceMap, parse_device
from ahgateway.codec.station import Binding, Const
from ahgateway.codec.words import encode
from ahgateway.core.controllers import Controller
from ahgateway.core.operands import Access, Kind, Operand
from ahgateway.errors import CodecError
from ahgateway.schema import layout
from ahgateway.schema.findings import Findings, near, shown
from ahgateway.schema.forms import LoopForm, OperandForm

PROFILE, LAYOUT = "profile", "layout"


@dataclass(frozen=True, slots=True)
class Bound:
    """One operand in its place.

    Attributes:
        row: The operand.
        binding: Device or constant.
        origin: `profile` when a person wrote it, `layout` when the layout placed it.
        key: Dotted key that a message should name.
        place: Address of the first word or of the bit; None for a constant.
    """

    row: Operand
    binding: Binding
    origin: str
    key: str
    place: Address | None


def bind(
    name: str, form: LoopForm, controller: Controller, devices: DeviceMap, findings: Findings
) -> dict[str, Bound] | None:
    """Return every operand of the loop in its place, None when some have none; what is wrong goes to `findings`."""
    top = f"loops.{name}"
    placed = _layout(top, form, controller, findings)
    rows = {row.name: row for row in controller.operands}
    for written in form.operands:
        if written not in rows:
            findings.add(
                f"{top}.operands.{written}",
                f"{controller.name} has no such operand, it has {', '.join(rows)}",
                near(written, rows),
            )
    bound: dict[str, Bound] = {}
    missing: list[str] = []
    for row in controller.operands:
        made: Bound | None = None
        if row.name in form.operands:
            made = _written(row, form.operands[row.name], f"{top}.operands.{row.name}", devices, findings)
        elif placed is not None and row.name in placed:
            key = f"{top}.{_layout_key(form, row)}"
            if not findings.has(key):  # the first operand that does not fit says enough about a whole layout
                made = _on_device(row, placed[row.name], LAYOUT, key, devices, findings)
        elif form.layout is None:
            missing.append(row.name)
        if made is not None:
            bound[row.name] = made
    if missing:
        hint = 'or `layout = "manual"`' if controller.name in layout.INSTRUCTIONS else None
        findings.add(
            f"{top}.operands", f"{controller.name} also needs {', '.join(missing)}", hint and f"name them, {hint}"
        )
    return bound if len(bound) == len(rows) else None


def _layout_key(form: LoopForm, row: Operand) -> str:
    key = "flags" if row.kind is Kind.BOOL else "data"
    return key if getattr(form, key) is not None else "layout"


def _layout(top: str, form: LoopForm, controller: Controller, findings: Findings) -> dict[str, Device] | None:
    """Places that the layout gives; None without one, or when it is wrong."""
    if form.layout is None:
        for key in ("data", "flags"):
            if getattr(form, key) is not None:
                findings.add(f"{top}.{key}", "moves a layout, and this loop has none", 'add `layout = "manual"`')
        return None
    if controller.name not in layout.INSTRUCTIONS:
        findings.add(
            f"{top}.layout",
            f"the manual has no example registers for {controller.name}, only for {', '.join(layout.INSTRUCTIONS)}",
            "name every operand under operands",
        )
        return None
    starts: dict[str, Device] = {}
    for key, default in (("data", layout.DATA), ("flags", layout.FLAGS)):
        text = getattr(form, key)
        device = default if text is None else parsed(text, f"{top}.{key}", findings)
        if device is not None:
            starts[key] = device
    if len(starts) < 2:
        return None
    return layout.manual(controller, starts["data"], starts["flags"])


def parsed(text: str, key: str, findings: Findings) -> Device | None:
    """Return the device that is spelled so, or None and a finding."""
    try:
        return parse_device(text)
    except CodecError as error:
        findings.add(key, error.message, error.hint)
        return None


def bit_device(text: str | None, what: str, key: str, devices: DeviceMap, findings: Findings) -> Device | None:
    """Return the single bit that is spelled so; None without a text, or with a finding."""
    device = None if text is None else parsed(text, key, findings)
    if device is None:
        return None
    place = _address(device, True, key, devices, findings)
    if place is not None and not place.is_bit:
        findings.add(key, f"{what} is a bit, `{device}` is a word", f"a bit of it is `{device}.0`")
        return None
    return device if place is not None else None


def _address(device: Device, bits: bool, key: str, devices: DeviceMap, findings: Findings) -> Address | None:
    try:
        return devices.address(device, bits=bits)
    except CodecError as error:
        findings.add(key, error.message, error.hint)
        return None


def _written(row: Operand, entry: OperandForm, key: str, devices: DeviceMap, findings: Findings) -> Bound | None:
    if (entry.device is None) == (entry.const is None):
        findings.add(key, "needs either a device or a const", '`"D100"` or `{ const = 0.0 }`')
        return None
    if entry.device is None:
        return _constant(row, entry.const, key, findings)
    device = parsed(entry.device, key, findings)
    return None if device is None else _on_device(row, device, PROFILE, key, devices, findings)


def _constant(row: Operand, value: Any, key: str, findings: Findings) -> Bound | None:
    if row.access in (Access.OUT, Access.STATE):
        findings.add(
            key, f"{row.name} is written by the instruction, so it is no constant {shown(value)}", "name its device"
        )
        return None
    typed = typed_value(row, value, key, findings)
    if typed is None:
        return None
    if row.kind in (Kind.DINT, Kind.INT) and not _in_range(row, typed):
        findings.add(key, f"{row.name} is {typed}, allowed {_range(row)}{_unit(row)}")
        return None
    return Bound(row, Const(typed), PROFILE, key, None)


def _in_range(row: Operand, value: float) -> bool:
    return (row.minimum is None or value >= row.minimum) and (row.maximum is None or value <= row.maximum)


def _range(row: Operand) -> str:
    low = "" if row.minimum is None else f"{row.minimum:g}"
    high = "" if row.maximum is None else f"{row.maximum:g}"
    return f"{low}…{high}"


def _unit(row: Operand) -> str:
    return f" in units of {row.unit}" if row.unit else ""


def typed_value(row: Operand, value: Any, key: str, findings: Findings) -> float | int | bool | None:
    """Return a written value as the operand's kind holds it, None and a finding when it cannot."""
    wanted = {
        Kind.BOOL: "true or false",
        Kind.REAL: "a number",
        Kind.DINT: "a whole number",
        Kind.INT: "a whole number",
    }
    is_bool, is_int, is_float = isinstance(value, bool), isinstance(value, int), isinstance(value, float)
    fits = {
        Kind.BOOL: is_bool,
        Kind.REAL: (is_int or is_float) and not is_bool,
        Kind.DINT: is_int and not is_bool,
        Kind.INT: is_int and not is_bool,
    }
    if row.kind not in fits:
        findings.add(key, f"{row.name} is the instruction's memory and takes no value")
        return None
    if not fits[row.kind]:
        findings.add(key, f"{row.name} is a {row.kind.value}, {shown(value)} is not; it takes {wanted[row.kind]}")
        return None
    made: float | int | bool = float(value) if row.kind is Kind.REAL else value
    if not math.isfinite(made):
        findings.add(key, f"{row.name} is {value}, allowed is a finite number")
        return None
    try:
        encode(row.kind, made)
    except CodecError as error:
        findings.add(key, error.message, error.hint)
        return None
    return made


def _on_device(
    row: Operand, device: Device, origin: str, key: str, devices: DeviceMap, findings: Findings
) -> Bound | None:
    is_bool = row.kind is Kind.BOOL
    place = _address(device, is_bool, key, devices, findings)
    if place is None:
        return None
    if is_bool and not place.is_bit:
        findings.add(key, f"{row.name} is a BOOL, `{device}` is a word", f"a bit of it is `{device}.0`")
        return None
    if not is_bool and place.is_bit:
        findings.add(
            key, f"{row.name} is a {row.kind.value} of {_words(row)}, `{device}` is a bit", "a word device is `D100`"
        )
        return None
    return Bound(row, device, origin, key, place) if _fits(row, device, place, key, devices, findings) else None


def _words(row: Operand) -> str:
    return "one word" if row.words == 1 else f"{row.words} words"


def _fits(row: Operand, device: Device, place: Address, key: str, devices: DeviceMap, findings: Findings) -> bool:
    allowed = devices.range_of(device, bits=row.kind is Kind.BOOL)
    usable = [str(each) for each in devices.ranges if each.kind == device.kind and each.operands]
    if not allowed.operands:
        findings.add(key, f"{row.name} at `{device}`: PID operands belong in {', '.join(usable)}")
        return False
    if not devices.covers(Span(place.table, place.address, max(1, row.words))):
        findings.add(key, f"{row.name} takes {_words(row)} from `{device}` on, but {allowed} ends before that")
        return False
    if row.access in (Access.OUT, Access.STATE) and not allowed.writable:
        findings.add(key, f"{row.name} is written by the instruction, but {allowed} is read-only")
        return False
    return True


def constants(bound: Mapping[str, Bound]) -> frozenset[str]:
    """Names of the operands that are literals."""
    return frozenset(name for name, each in bound.items() if isinstance(each.binding, Const))
