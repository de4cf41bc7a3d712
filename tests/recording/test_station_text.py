"""A station in a recording: every field survives, and what older files do not say has its default."""

from __future__ import annotations

import json
from dataclasses import MISSING, Field, fields, replace
from typing import Any

import pytest
from lockstep.bench_world import DEVICES, World, bindings

from ahgateway.codec.access import Span, Table
from ahgateway.codec.can_objects import CanMap, CanObject, Pdo, Sync
from ahgateway.codec.devices import parse_device
from ahgateway.codec.station import LeaseSpec, Loop, Pacing, Station, Tolerance, WriteLimit
from ahgateway.codec.ways import Each, Place, Recorder, Trigger, Way
from ahgateway.core.controllers import CONTROLLERS
from ahgateway.recording.station_text import station_from, station_json
from ahgateway.schema.profile import load

DPIDE = CONTROLLERS["DPIDE"]
LOOP = Loop(
    "TIC-1",
    DPIDE,
    bindings(DPIDE, 100, 1, 200, {"PID_EQ": True, "Tf": 0.5}),
    en=parse_device("M50"),
    dialect=DPIDE.dialect._replace(),
    tolerance=Tolerance(3, 0.25),
    scan_ms_max=17,
    pv_unit="°C",
    mv_unit="kW",
    shared=frozenset({"SV", "PV"}),
    pv_range=(-20.0, 150.0),
    mv_range=(0.0, 80.0),
    writes={"SV": WriteLimit(20.0, 120.0, 5.0, 2.0), "PID_MAN": WriteLimit(interval_s=0.5)},
    counter=parse_device("D900"),
    pv_held=True,
    lease=LeaseSpec(parse_device("D700"), 2500, 50),
    pv_rate_max=0.5,
    interval_ms=250,
    recorder=Recorder(
        parse_device("D2000"),
        32,
        40,
        parse_device("D1990"),
        {"SV": Place(4), "PID_MAN": Place(3, 2)},
        1,
        2,
        30_000,
        39,
        0,
        1,
        20_000,
        100_000,
        Place(3, 15),
        Each.CHANGE,
        True,
        frozenset({"ERR_DBW"}),
    ),
    trigger=Trigger(parse_device("M50"), parse_device("D901")),
    way=Way.RECORDED,
)
WORDS = Span(Table.HOLDING, 100, 2)
STATION = Station(
    "line 3",
    "canopen://socketcan/can0?node=3",
    7,
    DEVICES,
    (LOOP, replace(LOOP, name="TIC-2", pv_held=False)),
    running=parse_device("SM400"),
    bench=True,
    pacing=Pacing(*range(2, 2 + len(fields(Pacing)))),
    scratch=parse_device("D990"),
    can=CanMap(
        (CanObject(WORDS, 0x2000, 1),),
        (Pdo(0x181, (WORDS, Span(Table.COIL, 1, 8))),),
        Sync(1, 2, 3),
        "V",
        (Pdo(0x203, (WORDS,)),),
    ),
)


def through_json(station: Station) -> Station:
    return station_from(json.loads(json.dumps(station_json(station))))


def default_of(field: Field[Any]) -> Any:
    return field.default_factory() if field.default_factory is not MISSING else field.default


@pytest.mark.parametrize(
    "whole",
    [STATION, LOOP, LOOP.recorder, STATION.pacing, LOOP.writes["SV"], LOOP.tolerance],
    ids=lambda each: type(each).__name__,
)
def test_the_example_has_no_field_left_at_its_default(whole: Any) -> None:
    usual = [field.name for field in fields(whole) if getattr(whole, field.name) == default_of(field)]
    assert [] == usual


@pytest.mark.parametrize("field", [field.name for field in fields(Station)])
def test_every_field_of_a_station_survives(field: str) -> None:
    assert getattr(STATION, field) == getattr(through_json(STATION), field)


@pytest.mark.parametrize("field", [field.name for field in fields(Loop)])
def test_every_field_of_a_loop_survives(field: str) -> None:
    assert getattr(LOOP, field) == getattr(through_json(STATION).loops[0], field)


@pytest.mark.parametrize("name", ["demo", "can", "melsec_pid", "pid_temp"])
def test_the_station_of_a_shipped_example_survives_whole(name: str) -> None:
    station = load(name).station()
    assert station == through_json(station)


def test_a_dialect_other_than_the_default_survives() -> None:
    axis, values = next(iter(DPIDE.axes.items()))
    other = next(value for value in values if value is not getattr(DPIDE.dialect, axis))
    loop = replace(LOOP, dialect=DPIDE.dialect._replace(**{axis: other}))
    assert loop == through_json(replace(STATION, loops=(loop,))).loops[0]


def test_what_an_older_file_does_not_say_has_its_default() -> None:
    text = station_json(World().station)
    for name in ("pacing", "scratch", "can"):
        del text[name]
    for name in ("shared", "writes", "counter", "pv_held"):
        del text["loops"][0][name]
    found = station_from(text)
    assert (Pacing(), None, None) == (found.pacing, found.scratch, found.can)
    assert World().station.loops == found.loops
