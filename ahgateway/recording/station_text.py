"""A station as JSON and back: what a recording must know to be followed again without its profile.

The profile's text is kept beside it for people. This form belongs to the file format: old files must open when
profiles have changed, so it names every field by itself.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, fields
from difflib import get_close_matches
from typing import Any

from ahgateway.codec.access import Span, Table
from ahgateway.codec.can_objects import CanMap, CanObject, Pdo, Sync
from ahgateway.codec.devices import DeviceMap, DeviceRange, parse_device
from ahgateway.codec.station import Binding, Const, LeaseSpec, Loop, Pacing, Station, Tolerance, WriteLimit
from ahgateway.codec.ways import Each, Place, Recorder, Trigger, Way
from ahgateway.core.controllers import CONTROLLERS, Controller
from ahgateway.errors import CodecError

Json = dict[str, Any]

_LOOP_PLAIN = ("scan_ms_max", "pv_unit", "mv_unit")
_TRIGGER = ("coil", "counter")
_RECORDER_PLAIN = (
    "records", "length", "sequence", "sequence_words", "sequence_range", "sequence_end", "time", "time_words",
    "time_range", "time_unit_ns", "is_last",
)  # fmt: skip
_PACING = tuple(field.name for field in fields(Pacing))
_LIMIT = tuple(field.name for field in fields(WriteLimit))
_RANGE_PLAIN = ("kind", "first", "last", "base", "stride", "confidence", "writable", "octal", "operands")


def station_json(station: Station) -> Json:
    """Return everything that following a loop needs, device map included, as plain JSON values."""
    return {
        "name": station.name,
        "target": station.target,
        "unit": station.unit,
        "bench": station.bench,
        "running": str(station.running) if station.running else None,
        "pacing": asdict(station.pacing),
        "poll_ms": station.pacing.poll_ms,
        "scratch": str(station.scratch) if station.scratch else None,
        "can": _can_json(station.can) if station.can else None,
        "devices": {
            "name": station.devices.name,
            "title": station.devices.title,
            "ranges": [_range_json(row) for row in station.devices.ranges],
        },
        "loops": [_loop_json(loop) for loop in station.loops],
    }


def station_from(text: Json) -> Station:
    """Return the station of `station_json`; what an older version did not write has its default.

    Raises:
        CodecError: It names an instruction, dialect axis or device that this version does not know.
    """
    devices = text["devices"]
    ranges = tuple(
        DeviceRange(
            table=Table(row["table"]), functions=tuple(row["functions"]), **{name: row[name] for name in _RANGE_PLAIN}
        )
        for row in devices["ranges"]
    )
    return Station(
        text["name"],
        text["target"],
        text["unit"],
        DeviceMap(devices["name"], devices["title"], ranges),
        tuple(_loop_from(row) for row in text["loops"]),
        parse_device(text["running"]) if text["running"] else None,
        text["bench"],
        _pacing_from(text.get("pacing") or {"poll_ms": text["poll_ms"]}),
        parse_device(text["scratch"]) if text.get("scratch") else None,
        _can_from(text["can"]) if text.get("can") else None,
    )


def dialect_json(controller: Controller, dialect: Any) -> dict[str, Any]:
    """Return the value of every axis by its name in a profile; axes that are numbers as numbers."""
    found: dict[str, Any] = {
        axis: values(getattr(dialect, axis)).name.lower() for axis, values in controller.axes.items()
    }
    return found | {axis: getattr(dialect, axis) for axis in controller.numbers}


def dialect_from(controller: Controller, text: Mapping[str, Any], where: str) -> Any:
    """Return the dialect; axes that are not named have their defaults.

    Raises:
        CodecError: An axis or value is not known; `where` stands in the message.
    """
    chosen: dict[str, Any] = {}
    for axis, value in text.items():
        if axis in controller.numbers:
            chosen[axis] = type(getattr(controller.dialect, axis))(value)
            continue
        values = controller.axes.get(axis)
        if values is None:
            known = [*controller.axes, *controller.numbers]
            raise CodecError(f"{where}: unknown dialect axis `{axis}`", hint=_nearest(axis, known))
        allowed = {member.name.lower(): member for member in values}
        if value not in allowed:
            raise CodecError(f"{where}: {axis} = `{value}` is not known, allowed are {', '.join(allowed)}")
        chosen[axis] = allowed[value]
    return controller.dialect._replace(**chosen)


def _nearest(name: str, known: list[str]) -> str:
    near = get_close_matches(name, known, 1, 0.5)
    return f"did you mean `{near[0]}`?" if near else f"known are {', '.join(known)}"


def _range_json(row: DeviceRange) -> Json:
    return {
        "table": row.table.value,
        "functions": list(row.functions),
        **{name: getattr(row, name) for name in _RANGE_PLAIN},
    }


def _loop_json(loop: Loop) -> Json:
    return {
        "name": loop.name,
        "instruction": loop.controller.name,
        "bindings": {name: _binding_json(binding) for name, binding in loop.bindings.items()},
        "en": str(loop.en) if loop.en else None,
        "dialect": dialect_json(loop.controller, loop.dialect),
        "ulp_max": loop.tolerance.ulp_max,
        "mv_tolerance": loop.tolerance.mv_max,
        "pv_range": loop.pv_range,
        "mv_range": loop.mv_range,
        "counter": str(loop.counter) if loop.counter else None,
        "pv_held": loop.pv_held,
        "shared": sorted(loop.shared),
        "interval_ms": loop.interval_ms,
        "pv_rate_max": loop.pv_rate_max,
        "way": loop.way.value,
        "recorder": _recorder_json(loop.recorder) if loop.recorder else None,
        "lease": {**asdict(loop.lease), "data": str(loop.lease.data)} if loop.lease else None,
        "trigger": {name: str(getattr(loop.trigger, name)) for name in _TRIGGER} if loop.trigger else None,
        "writes": {operand: asdict(limit) for operand, limit in loop.writes.items()},
        **{name: getattr(loop, name) for name in _LOOP_PLAIN},
    }


def _binding_json(binding: Binding) -> Any:
    return {"const": binding.value} if isinstance(binding, Const) else str(binding)


def _loop_from(row: Json) -> Loop:
    name = row["name"]
    if row["instruction"] not in CONTROLLERS:
        raise CodecError(f"loop {name}: unknown instruction `{row['instruction']}`, known are {', '.join(CONTROLLERS)}")
    return Loop(
        name=name,
        controller=CONTROLLERS[row["instruction"]],
        bindings={
            operand: Const(binding["const"]) if isinstance(binding, dict) else parse_device(binding)
            for operand, binding in row["bindings"].items()
        },
        en=parse_device(row["en"]) if row["en"] else None,
        dialect=dialect_from(CONTROLLERS[row["instruction"]], row["dialect"], f"loop {name}"),
        tolerance=Tolerance(row["ulp_max"], row["mv_tolerance"]),
        pv_range=_pair(row["pv_range"]),
        mv_range=_pair(row["mv_range"]),
        counter=parse_device(row["counter"]) if row.get("counter") else None,
        pv_held=row.get("pv_held"),
        shared=frozenset(row.get("shared", ())),
        interval_ms=row.get("interval_ms"),
        pv_rate_max=row.get("pv_rate_max"),
        way=Way(row.get("way", Way.POLLED.value)),
        recorder=_recorder_from(row["recorder"]) if row.get("recorder") else None,
        lease=_lease_from(row["lease"]) if row.get("lease") else None,
        trigger=Trigger(*(parse_device(row["trigger"][name]) for name in _TRIGGER)) if row.get("trigger") else None,
        writes={
            operand: WriteLimit(**{name: value for name, value in limit.items() if name in _LIMIT})
            for operand, limit in row.get("writes", {}).items()
        },
        **{field: row[field] for field in _LOOP_PLAIN},
    )


def _lease_from(text: Json) -> LeaseSpec:
    return LeaseSpec(**{**text, "data": parse_device(text["data"])})


def _recorder_json(recorder: Recorder) -> Json:
    return {
        "ring": str(recorder.ring),
        "head": str(recorder.head),
        "each": recorder.each.value,
        "unrecorded": sorted(recorder.unrecorded),
        "first": str(recorder.first) if recorder.first else None,
        "fields": {name: str(place) for name, place in recorder.fields.items()},
        **{name: getattr(recorder, name) for name in _RECORDER_PLAIN},
    }


def _recorder_from(text: Json) -> Recorder:
    return Recorder(
        ring=parse_device(text["ring"]),
        head=parse_device(text["head"]),
        each=Each(text["each"]),
        unrecorded=frozenset(text["unrecorded"]),
        first=_place_from(text["first"]) if text["first"] else None,
        fields={name: _place_from(place) for name, place in text["fields"].items()},
        **{name: text[name] for name in _RECORDER_PLAIN},
    )


def _place_from(text: str) -> Place:
    offset, dot, bit = text.partition(".")
    return Place(int(offset), int(bit) if dot else None)


def _pacing_from(text: Json) -> Pacing:
    return Pacing(**{name: value for name, value in text.items() if name in _PACING})


def _can_json(can: CanMap) -> Json:
    return {
        "objects": [{"span": _span_json(each.span), "index": each.index, "sub": each.sub} for each in can.objects],
        "pdos": [_pdo_json(each) for each in can.pdos],
        "takes": [_pdo_json(each) for each in can.takes],
        "sync": asdict(can.sync),
        "confidence": can.confidence,
    }


def _can_from(text: Json) -> CanMap:
    return CanMap(
        tuple(CanObject(_span_from(each["span"]), each["index"], each["sub"]) for each in text["objects"]),
        tuple(_pdo_from(each) for each in text["pdos"]),
        Sync(**text["sync"]),
        text["confidence"],
        tuple(_pdo_from(each) for each in text.get("takes", ())),
    )


def _pdo_json(pdo: Pdo) -> Json:
    return {"cob_id": pdo.cob_id, "spans": [_span_json(span) for span in pdo.spans]}


def _pdo_from(text: Json) -> Pdo:
    return Pdo(text["cob_id"], tuple(_span_from(span) for span in text["spans"]))


def _span_json(span: Span) -> list[Any]:
    return [span.table.value, span.address, span.count]


def _span_from(text: list[Any]) -> Span:
    return Span(Table(text[0]), text[1], text[2])


def _pair(value: list[float] | None) -> tuple[float, float] | None:
    return (value[0], value[1]) if value else None
