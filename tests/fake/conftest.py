"""A small station laid out by hand: a DPID at D100, a DPIDE at D300, both as in the manual's examples."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from ahgateway.codec.access import Table
from ahgateway.codec.devices import DeviceMap, DeviceRange, parse_device
from ahgateway.codec.station import Const, FakeLoop, Loop, Station
from ahgateway.core.controllers import DPID, DPIDE
from ahgateway.fake.plc import FakePlc

MAP = DeviceMap(
    "small",
    "A small AH500",
    (
        DeviceRange("D", 0, 999, Table.HOLDING, 0x0000),
        DeviceRange("M", 0, 99, Table.COIL, 0x0000),
        DeviceRange("SM", 0, 499, Table.COIL, 0x4000, writable=False),
        DeviceRange("X", 0, 3, Table.DISCRETE, 0x6000, stride=16, writable=False),
        DeviceRange("X", 0, 3, Table.INPUT, 0x8000, writable=False),
        DeviceRange("Y", 0, 3, Table.COIL, 0xA000, stride=16),
        DeviceRange("Y", 0, 3, Table.HOLDING, 0xA000),
        DeviceRange("T", 0, 9, Table.COIL, 0xE000, writable=False),
        DeviceRange("T", 0, 9, Table.HOLDING, 0xE000),
    ),
)


def places(text: str) -> dict[str, str]:
    words = text.split()
    return dict(zip(words[::2], words[1::2], strict=True))


DPID_AT_D100 = places("""
    PID_RUN M1  PID_MAN M2  MOUT_AUTO M3  PID_DIR M4
    SV D100  PV D102  PID_MODE D104  CYCLE D106  Kp D108  Ki D110  Kd D112
    ERR_DBW D114  MV_MAX D116  MV_MIN D118  MOUT D120  I_MV D122  MV D200
""")
DPIDE_AT_D300 = places("""
    PID_RUN M11  PID_MAN M12  MOUT_AUTO M13  PID_EQ M14  PID_DE M15  PID_DIR M16
    SV D300  PV D302  PID_MODE D304  CYCLE D306  Kc_Kp D308  Ti_Ki D310  Td_Kd D312  Tf D314
    ERR_DBW D316  MV_MAX D318  MV_MIN D320  MOUT D322  BIAS D324  I_MV D326  MV D400
""")


def loop(name: str, controller, places: dict[str, str], **changes) -> Loop:
    bindings = {operand: parse_device(text) for operand, text in places.items()}
    constants = changes.pop("constants", {})
    bindings.update({operand: Const(value) for operand, value in constants.items()})
    return Loop(name, controller, bindings, **changes)


def dpid(**changes) -> Loop:
    return loop("LIC-201", DPID, DPID_AT_D100, **changes)


def dpide(**changes) -> Loop:
    return loop("TIC-101", DPIDE, DPIDE_AT_D300, **changes)


@pytest.fixture
def make_plc() -> Callable[..., FakePlc]:
    """Build a PLC: `make_plc([loops], {name: FakeLoop}, **arguments of FakePlc)`; DPID and DPIDE by default."""

    def make(loops: list[Loop] | None = None, setups: dict[str, FakeLoop] | None = None, **arguments) -> FakePlc:
        station = Station("Small", "memory://", 1, MAP, tuple(loops or (dpid(), dpide())))
        return FakePlc(station, setups, **arguments)

    return make


@pytest.fixture
def make_dpid() -> Callable[..., Loop]:
    return dpid


@pytest.fixture
def make_dpide() -> Callable[..., Loop]:
    return dpide


@pytest.fixture
def small_map() -> DeviceMap:
    return MAP
