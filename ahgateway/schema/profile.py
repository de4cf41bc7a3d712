"""A profile: the file in which a person says which PLC, which loops, and where every operand stands.

This module joins the checks and makes the `Station` that everything below works with. Nothing is sent to a PLC
before all of them have passed; what is wrong is reported all together.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlsplit

from pydantic import ValidationError

from ahgateway.codec.devices import Device, DeviceMap
from ahgateway.codec.station import FakeLoop, Loop, Pacing, Station, Tolerance
from ahgateway.core.controllers import CONTROLLERS, Controller
from ahgateway.core.operands import Kind
from ahgateway.core.real import REAL
from ahgateway.errors import CodecError, ProfileError
from ahgateway.schema import device_map, files
from ahgateway.schema.binding import Bound, bind, bit_device, constants, parsed, typed_value
from ahgateway.schema.can import with_can
from ahgateway.schema.findings import Findings, near, pruned, shown
from ahgateway.schema.forms import FakeForm, LoopForm, ProfileForm, RangesForm, StationForm
from ahgateway.schema.leases import with_leases
from ahgateway.schema.overlap import shared
from ahgateway.schema.plant import plant_spec
from ahgateway.schema.recorders import with_recorders
from ahgateway.schema.writes import with_writes

SCHEMES = (
    "modbus+tcp",
    "modbus+rtu",
    "modbus+ascii",
    "modbus+rtu+tcp",
    "modbus+ascii+tcp",
    "canopen",
    "fake",
    "replay",
    "memory",
)
SERIAL = ("modbus+rtu", "modbus+ascii", "modbus+rtu+tcp", "modbus+ascii+tcp")
SERIAL_UNIT_MAX = 247
"""Largest address on a serial line, and 0 is a broadcast (Modbus over serial line 1.02, §2.2)."""


@dataclass(frozen=True)
class Profile:
    """A profile that has passed every check.

    Attributes:
        file: Its name in messages.
        text: The file as it was read; recordings keep it.
        form: The tables as a person wrote them, defaults filled in.
        bound: Loop name, operand name to where it stands and who said so.
    """

    file: str
    text: str
    form: ProfileForm
    bound: Mapping[str, Mapping[str, Bound]]
    _station: Station
    _fakes: Mapping[str, FakeLoop]

    def station(self) -> Station:
        """Return the station and its loops, immutable and checked."""
        return self._station

    def fake_setup(self) -> dict[str, FakeLoop]:
        """Return, for every loop, what the fake PLC starts with."""
        return dict(self._fakes)


def load(path_or_name: str) -> Profile:
    """Return the profile in a file, or a shipped example by its name, `demo`.

    Raises:
        ProfileError: There is none, or it is wrong; all errors together.
    """
    path = files.find(path_or_name, files.shipped() / "examples", "examples")
    return parse(files.read(path, str(path)), str(path), beside=path.parent)


def parse(text: str, file: str, *, beside: Path | None = None) -> Profile:
    """Return the profile in a TOML text.

    Args:
        text: The profile.
        file: Its name in messages.
        beside: Directory to which the path of a device map refers; None: the working directory.

    Raises:
        ProfileError: The text is no TOML, or anything in it is wrong; all errors together.
    """
    findings = Findings(file)
    form = _shape(files.tables(text, file), findings)
    profile = None if form is None else _profile(form, text, file, beside, findings)
    findings.raise_any()
    assert profile is not None, "a profile without findings is complete"
    return profile


def _shape(data: dict[str, Any], findings: Findings) -> ProfileForm | None:
    """Read the tables; wrong ones are reported and left out, so that the rest is judged in the same run."""
    try:
        return ProfileForm.model_validate(data)
    except ValidationError as error:
        findings.add_all(error, ProfileForm)
        rest = pruned(data, error)
    try:
        return ProfileForm.model_validate(rest)
    except ValidationError:
        return _station_alone(rest)


def _station_alone(rest: Mapping[str, Any]) -> ProfileForm | None:
    """What can still be judged when no loop is left."""
    try:
        return ProfileForm.model_construct(station=StationForm.model_validate(rest.get("station")), loops={})
    except ValidationError:
        return None


def _profile(form: ProfileForm, text: str, file: str, beside: Path | None, findings: Findings) -> Profile | None:
    _check_station(form.station, findings)
    devices = _devices(form.station, beside, findings)
    if devices is None:
        return None
    running = bit_device(form.station.running, "running", "station.running", devices, findings)
    bounds: dict[str, dict[str, Bound]] = {}
    fakes: dict[str, FakeLoop] = {}
    dialects: dict[str, Any] = {}
    for name, loop in form.loops.items():
        controller = _controller(name, loop, findings)
        if controller is not None:
            dialects[name] = _dialect(name, loop, controller, findings)
            _check_contact(name, loop, controller, findings)
        _counter(name, loop, devices, findings)
        _check_ranges(name, loop.ranges, findings)
        bit_device(loop.en, "EN", f"loops.{name}.en", devices, findings)
        if controller is None:
            continue
        bound = bind(name, loop, controller, devices, findings)
        _check_request_length(name, form.station, controller, findings)
        fakes[name] = _fake(name, loop.fake, controller, bound, findings)
        if bound is not None:
            bounds[name] = bound
    together = shared(bounds, findings)
    if findings:
        return None
    loops = tuple(
        _loop(name, loop, bounds[name], devices, dialects[name], together[name], findings)
        for name, loop in form.loops.items()
    )
    station = Station(
        form.station.name,
        form.station.target,
        _unit(form.station),
        devices,
        loops,
        running,
        form.station.kind == "bench",
        Pacing(**form.station.pacing.model_dump()),
    )
    station = with_leases(with_writes(station, form, bounds, findings), form, findings)
    station = with_recorders(with_can(station, form, bounds, findings), form, findings)
    return Profile(file, text, form, bounds, station, fakes)


def _loop(
    name: str,
    form: LoopForm,
    bound: Mapping[str, Bound],
    devices: DeviceMap,
    dialect: Any,
    also_elsewhere: frozenset[str],
    findings: Findings,
) -> Loop:
    ranges = form.ranges
    return Loop(
        name=name,
        controller=CONTROLLERS[form.instruction],
        bindings={operand: each.binding for operand, each in bound.items()},
        en=bit_device(form.en, "EN", f"loops.{name}.en", devices, findings),
        dialect=dialect,
        tolerance=Tolerance(form.tolerance.ulp_max, form.tolerance.mv_max),
        scan_ms_max=form.scan_ms_max,
        pv_unit=form.units.pv,
        mv_unit=form.units.mv,
        shared=also_elsewhere,
        pv_range=(ranges.pv[0], ranges.pv[1]) if ranges.pv else None,
        mv_range=(ranges.mv[0], ranges.mv[1]) if ranges.mv else None,
        counter=_counter(name, form, devices, findings),
        pv_held=form.pv_held,
    )


def _uri_unit(target: str) -> str | None:
    values = parse_qs(urlsplit(target).query).get("unit")
    return values[0] if values else None


def _unit(station: StationForm) -> int:
    """Station number: the key, else the URI's, else 1."""
    if station.unit is not None:
        return station.unit
    text = _uri_unit(station.target)
    return int(text) if text is not None else 1


def _check_station(station: StationForm, findings: Findings) -> None:
    scheme, separator, _ = station.target.partition("://")
    if not separator or scheme not in SCHEMES:
        findings.add(
            "station.target",
            f"{shown(station.target)} starts with none of {', '.join(f'{known}://' for known in SCHEMES)}",
            near(scheme, SCHEMES) if separator else "`modbus+tcp://192.0.2.10:502`",
        )
        return
    try:
        written = _uri_unit(station.target)
    except ValueError as error:
        findings.add("station.target", f"{shown(station.target)} is no URI: {error}")
        return
    if written is not None and not (written.isascii() and written.isdigit() and int(written) <= 255):
        findings.add("station.target", f"unit={written}, allowed 0…255")
    elif written is not None and station.unit is not None and int(written) != station.unit:
        findings.add("station.unit", f"is {station.unit}, but the target says unit={written}", "keep one of the two")
    elif scheme in SERIAL and not 1 <= _unit(station) <= SERIAL_UNIT_MAX:
        findings.add("station.unit", f"is {_unit(station)}, allowed on a serial line are 1…{SERIAL_UNIT_MAX}")


def _devices(station: StationForm, beside: Path | None, findings: Findings) -> DeviceMap | None:
    try:
        return device_map.load(station.device_map, beside)
    except ProfileError as error:
        findings.add("station.device_map", error.message, error.hint)
        return None


def _controller(name: str, form: LoopForm, findings: Findings) -> Controller | None:
    controller = CONTROLLERS.get(form.instruction)
    if controller is None:
        findings.add(
            f"loops.{name}.instruction",
            f"{shown(form.instruction)} is no instruction we know, known are {', '.join(CONTROLLERS)}",
            near(form.instruction, CONTROLLERS),
        )
    return controller


def _check_contact(name: str, form: LoopForm, controller: Controller, findings: Findings) -> None:
    if form.en is not None and any(row.name == "EN" for row in controller.operands):
        findings.add(f"loops.{name}.en", f"{controller.name} has its contact EN among the operands", "write it there")


def _counter(name: str, form: LoopForm, devices: DeviceMap, findings: Findings) -> Device | None:
    """The word that counts executions; None without one, or with a finding."""
    key = f"loops.{name}.counter"
    device = None if form.counter is None else parsed(form.counter, key, findings)
    if device is None:
        return None
    try:
        place = devices.address(device)
    except CodecError as error:
        findings.add(key, error.message, error.hint)
        return None
    if place.is_bit:
        findings.add(key, f"a counter is a word, `{device}` is a bit", "a word device is `D900`")
        return None
    return device


def _dialect(name: str, form: LoopForm, controller: Controller, findings: Findings) -> Any:
    chosen: dict[str, Any] = {}
    for axis, value in form.dialect.items():
        key = f"loops.{name}.dialect.{axis}"
        if axis in controller.numbers:
            if isinstance(value, str) or not value >= 0:
                findings.add(key, f"is {shown(value)}, allowed is a number from 0 on")
            else:
                chosen[axis] = REAL(value)
            continue
        if axis not in controller.axes:
            known = (*controller.axes, *controller.numbers)
            findings.add(key, f"unknown axis, known are {', '.join(known)}", near(axis, known))
            continue
        allowed = {member.name.lower(): member for member in controller.axes[axis]}
        if value not in allowed:
            hint = near(str(value), allowed)
            findings.add(key, f"{shown(value)} is not known, allowed are {', '.join(allowed)}", hint)
            continue
        chosen[axis] = allowed[value]
        words = next((row.words for row in controller.operands if row.name == "I_MV"), 0)
        if axis == "pv_word" and 2 * int(allowed[value]) >= words:
            fits = ", ".join(each for each, member in allowed.items() if 2 * int(member) < words)
            findings.add(key, f"{shown(value)} lies behind the {words} words of I_MV, allowed are {fits}")
    return controller.dialect._replace(**chosen)


def _check_ranges(name: str, ranges: RangesForm, findings: Findings) -> None:
    for key in ("pv", "mv"):
        pair = getattr(ranges, key)
        if pair is not None and not pair[0] < pair[1]:
            findings.add(f"loops.{name}.ranges.{key}", f"{pair[0]:g} is not below {pair[1]:g}")


def _check_request_length(name: str, station: StationForm, controller: Controller, findings: Findings) -> None:
    longest = max(controller.operands, key=lambda row: row.words)
    if station.pacing.words_per_request_max < longest.words:
        findings.add(
            "station.pacing.words_per_request_max",
            f"is {station.pacing.words_per_request_max}, but {longest.name} of loop {name} takes {longest.words} "
            f"words in one request",
        )


def _fake(
    name: str, form: FakeForm, controller: Controller, bound: Mapping[str, Bound] | None, findings: Findings
) -> FakeLoop:
    rows = {row.name: row for row in controller.operands if row.kind is not Kind.BLOCK}
    literals = constants(bound) if bound is not None else frozenset()
    initial: dict[str, float | int | bool] = {}
    for operand, value in form.initial.items():
        key = f"loops.{name}.fake.initial.{operand}"
        if operand not in rows:
            findings.add(
                key,
                f"{controller.name} has no operand of that name that takes a value, it has {', '.join(rows)}",
                near(operand, rows),
            )
        elif operand in literals:
            findings.add(key, f"{operand} is a constant of the program and takes no other value")
        else:
            typed = typed_value(rows[operand], value, key, findings)
            if typed is not None:
                initial[operand] = typed
    plant = None if form.plant is None else plant_spec(form.plant, f"loops.{name}.fake.plant", controller, findings)
    return FakeLoop(initial, plant)
