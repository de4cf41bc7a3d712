"""The allow-list of a loop: which operands a person permits to be written, and within which limits.

An operand is refused here already when no limit could make a write of it right: what the instruction itself writes,
constants, operands of two loops, bits inside words, PV and PID_RUN outside a bench.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from ahgateway.codec.access import Table
from ahgateway.codec.devices import Device, DeviceMap
from ahgateway.codec.station import Const, Loop, Station, WriteLimit
from ahgateway.codec.words import encode
from ahgateway.core.operands import Access, Kind, Operand
from ahgateway.errors import CodecError
from ahgateway.schema.binding import Bound, parsed
from ahgateway.schema.findings import Findings, near
from ahgateway.schema.forms import ProfileForm, WriteForm

BENCH_ONLY = {
    "PV": "another program or an input writes it on a plant",
    "PID_RUN": "FALSE sets MV to 0 whatever the limits say",
}


def with_writes(
    station: Station, form: ProfileForm, bounds: Mapping[str, Mapping[str, Bound]], findings: Findings
) -> Station:
    """Return the station with every loop's allow-list and the scratch device; what is wrong goes to `findings`."""
    loops = tuple(
        _with_writes(loop, form.loops[loop.name].write, bounds[loop.name], station, findings) for loop in station.loops
    )
    scratch = _scratch(form.station.scratch, station.devices, findings)
    return replace(station, loops=loops, scratch=scratch)


def _with_writes(
    loop: Loop, forms: Mapping[str, WriteForm], bound: Mapping[str, Bound], station: Station, findings: Findings
) -> Loop:
    writes: dict[str, WriteLimit] = {}
    for name, form in forms.items():
        key = f"loops.{loop.name}.write.{name}"
        if name not in bound:
            findings.add(
                key, f"{loop.controller.name} has no such operand, it has {', '.join(bound)}", near(name, bound)
            )
            continue
        refused = _never(loop, bound[name], station)
        if refused:
            findings.add(key, refused)
            continue
        limit = _limit(bound[name].row, form, key, findings)
        if limit is not None:
            writes[name] = limit
    return replace(loop, writes=writes)


def _never(loop: Loop, each: Bound, station: Station) -> str:
    """Why this operand is never written, whatever the limits; empty when it may be."""
    row = each.row
    if isinstance(each.binding, Const) or each.place is None:
        return f"{row.name} is a constant of the program and stands nowhere"
    if row.access in (Access.OUT, Access.STATE):
        return f"{row.name} is written by the instruction itself"
    if row.name in loop.shared:
        return f"{row.name} is shared with another loop, and a write for one would reach the other"
    if row.name in BENCH_ONLY and not station.bench:
        return f'{row.name} may be written only on a station of kind = "bench": {BENCH_ONLY[row.name]}'
    if each.place.bit is not None:
        return f"{row.name} is a bit inside the word at `{each.binding}`, and a write would rewrite the other bits"
    return (
        ""
        if station.devices.range_of(each.binding, bits=row.kind is Kind.BOOL).writable
        else (f"`{each.binding}` takes no writes in the device map `{station.devices.name}`")
    )


def _limit(row: Operand, form: WriteForm, key: str, findings: Findings) -> WriteLimit | None:
    given = {"min": form.min, "max": form.max, "step_max": form.step_max}
    if row.kind is Kind.BOOL:
        for name, value in given.items():
            if value is not None:
                findings.add(f"{key}.{name}", f"{row.name} is a BOOL and has no limits")
        return WriteLimit(interval_s=form.interval_s)
    missing = [name for name, value in given.items() if value is None]
    if missing:
        findings.add(key, f"{row.name} also needs {', '.join(missing)}", "limits are what makes a write safe")
        return None
    assert form.min is not None
    assert form.max is not None
    if form.min > form.max:
        findings.add(key, f"min {form.min:g} is above max {form.max:g}")
        return None
    for name, value in (("min", form.min), ("max", form.max)):
        try:
            encode(row.kind, value)
        except CodecError as error:
            findings.add(f"{key}.{name}", error.message)
            return None
    return WriteLimit(form.min, form.max, form.step_max, form.interval_s)


def _scratch(text: str | None, devices: DeviceMap, findings: Findings) -> Device | None:
    device = None if text is None else parsed(text, "station.scratch", findings)
    if device is None:
        return None
    try:
        place = devices.address(device)
    except CodecError as error:
        findings.add("station.scratch", error.message, error.hint)
        return None
    if place.table is not Table.HOLDING or place.bit is not None:
        findings.add("station.scratch", f"`{device}` is no word that can be written", "a word device is `D900`")
        return None
    return device
