"""The table `[station.can]`: which CANopen object holds which devices, and which devices travel in PDOs.

What is wrong for any bus is found here, before anything is sent: devices outside the map, two rows for one word or one
index, operands in no object or in two halves, PDOs that no frame can carry.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

from ahgateway.codec import block
from ahgateway.codec.access import Span
from ahgateway.codec.can_objects import PDO_SIZE_MAX, CanMap, CanObject, Pdo, Sync, table_order
from ahgateway.codec.devices import DeviceMap
from ahgateway.codec.station import Const, Loop, Station
from ahgateway.core.operands import Kind
from ahgateway.errors import CodecError
from ahgateway.schema.binding import Bound, parsed
from ahgateway.schema.findings import Findings
from ahgateway.schema.forms import CanForm, CanItemForm, CanObjectForm, CanTakeForm, ProfileForm

TOP = "station.can"
SUB_MAX = 254
RESERVED_COB_IDS = (range(0x081), range(0x101, 0x180 + 1), range(0x580, 0x700), range(0x700, 0x800))
"""NMT, SYNC, and what else CiA 301 table 40 keeps from PDOs; the SDO and heartbeat ranges too."""


def with_can(
    station: Station, form: ProfileForm, bounds: Mapping[str, Mapping[str, Bound]], findings: Findings
) -> Station:
    """Return the station with its CANopen objects; what is wrong goes to `findings`."""
    written = form.station.can
    if written is None:
        if station.target.startswith("canopen:"):
            findings.add(TOP, "is missing, a canopen target needs it", "the shipped example `can` has one")
        return station
    objects = _objects(written, station.devices, findings)
    taken: dict[int, str] = {written.sync.cob_id: f"{TOP}.sync"}
    pdos = _pdos(written, taken, station.devices, findings)
    takes = _takes(written.takes, taken, station, findings)
    sync = written.sync
    if sync.window_ms >= sync.period_ms:
        findings.add(f"{TOP}.sync.window_ms", f"is {sync.window_ms:g}, not below the period of {sync.period_ms:g}")
    can = CanMap(
        objects,
        pdos,
        Sync(sync.cob_id, round(sync.period_ms * 1000), round(sync.window_ms * 1000)),
        written.confidence,
        takes,
    )
    if not findings:
        for loop in station.loops:
            _check_operands(loop, can, bounds[loop.name], station, findings)
    return replace(station, can=can)


def _objects(form: CanForm, devices: DeviceMap, findings: Findings) -> tuple[CanObject, ...]:
    found: list[CanObject] = []
    holders: dict[tuple[int, int], str] = {}
    for number, row in enumerate(form.objects):
        key = f"{TOP}.objects.{number}"
        for each in _row(row, key, devices, findings):
            if (each.index, each.sub) in holders:
                findings.add(key, f"object {each} stands already in {holders[each.index, each.sub]}")
            holders.setdefault((each.index, each.sub), key)
            found.append(each)
    found.sort(key=table_order)
    for left, right in pairwise(found):
        if left.span.table is right.span.table and right.span.address < left.span.end:
            device = devices.device(right.span.table, right.span.address)
            findings.add(f"{TOP}.objects", f"`{device}` stands in object {left} and in object {right}")
    return tuple(found)


def _row(row: CanObjectForm, key: str, devices: DeviceMap, findings: Findings) -> list[CanObject]:
    first = _span(row, key, devices, findings)
    if first is None:
        return []
    if row.sub + row.count - 1 > SUB_MAX:
        findings.add(key, f"sub-index {row.sub} and {row.count - 1} more end behind {SUB_MAX}")
        return []
    whole = Span(first.table, first.address, first.count * row.count)
    if not devices.covers(whole):
        findings.add(key, f"{whole.count} from `{row.device}` end outside the device map `{devices.name}`")
        return []
    return [
        CanObject(Span(first.table, first.address + number * first.count, first.count), row.index, row.sub + number)
        for number in range(row.count)
    ]


def _span(item: CanItemForm, key: str, devices: DeviceMap, findings: Findings) -> Span | None:
    device = parsed(item.device, key, findings)
    if device is None:
        return None
    try:
        place = devices.address(device)
    except CodecError as error:
        findings.add(key, error.message, error.hint)
        return None
    if place.bit is not None:
        findings.add(key, f"`{item.device}` is a bit inside a word, an object holds whole words or flags")
        return None
    span = Span(place.table, place.address, item.length or (1 if place.table.is_bits else 2))
    if not devices.covers(span):
        findings.add(key, f"{span.count} from `{item.device}` end outside the device map `{devices.name}`")
        return None
    return span


def _pdos(form: CanForm, taken: dict[int, str], devices: DeviceMap, findings: Findings) -> tuple[Pdo, ...]:
    found: list[Pdo] = []
    for number, row in enumerate(form.pdos):
        key = f"{TOP}.pdos.{number}"
        _check_cob_id(row.cob_id, key, taken, findings)
        spans = [_span(item, f"{key}.maps.{place}", devices, findings) for place, item in enumerate(row.maps)]
        pdo = Pdo(row.cob_id, tuple(span for span in spans if span is not None))
        if pdo.size > PDO_SIZE_MAX:
            findings.add(key, f"maps {pdo.size} bytes, a PDO carries {PDO_SIZE_MAX}")
        found.append(pdo)
    return tuple(found)


def _takes(rows: Sequence[CanTakeForm], taken: dict[int, str], station: Station, findings: Findings) -> tuple[Pdo, ...]:
    """Nobody answers a PDO, so that only what streams into a bench may go out in one."""
    values = {
        block.spans(loop, station.devices)[name]: f"{name} of {loop.name}"
        for loop in station.loops
        for name in loop.controller.roles.pvs
        if name in loop.bindings and not isinstance(loop.bindings[name], Const)
    }
    found: list[Pdo] = []
    for number, row in enumerate(rows):
        key = f"{TOP}.takes.{number}"
        _check_cob_id(row.cob_id, key, taken, findings)
        span = _span(row, key, station.devices, findings)
        if not station.bench:
            findings.add(key, "is for benches only: nobody answers a PDO", 'kind = "bench" in [station] says it is one')
        elif span is not None and span not in values:
            known = ", ".join(values.values()) or "none"
            findings.add(f"{key}.device", f"`{row.device}` is no loop's process value, those that may be sent: {known}")
        elif span is not None:
            found.append(Pdo(row.cob_id, (span,)))
    return tuple(found)


def _check_cob_id(cob_id: int, key: str, taken: dict[int, str], findings: Findings) -> None:
    if cob_id in taken or any(cob_id in each for each in RESERVED_COB_IDS):
        findings.add(f"{key}.cob_id", f"{cob_id:#05x} is taken by {taken.get(cob_id, 'CiA 301')}")
    taken.setdefault(cob_id, key)


def _check_operands(loop: Loop, can: CanMap, bound: Mapping[str, Bound], station: Station, findings: Findings) -> None:
    """Every operand must stand in objects, and a 32-bit value in one, so that it is never read in two halves."""
    for name, span in block.spans(loop, station.devices).items():
        key = bound[name].key if name in bound else f"loops.{loop.name}.en"
        try:
            held = can.holding(span)
        except CodecError as error:
            findings.add(key, f"{name}: {error.message}", error.hint)
            continue
        if name in bound and bound[name].row.kind is not Kind.BLOCK and len(held) > 1:
            both = " and ".join(str(each) for each in held)
            findings.add(key, f"{name} stands half in object {both}, and would be read in two halves")
    if station.running is not None:
        place = station.devices.address(station.running)
        if not can.is_whole(Span(place.table, place.address, 1)):
            findings.add("station.running", f"`{station.running}` stands in no CANopen object of the profile")
