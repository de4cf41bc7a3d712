"""A fake PLC with one of the three other blocks, a memory link and a follower, on one virtual clock."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from lockstep.bench_world import Watched

from ahgateway.clock import MILLISECOND, VirtualClock
from ahgateway.codec.access import Table
from ahgateway.codec.devices import DeviceMap, DeviceRange, parse_device
from ahgateway.codec.station import Binding, Const, FakeLoop, Loop, PlantSpec, Station
from ahgateway.core.controllers import CONTROLLERS, Controller
from ahgateway.core.operands import Kind
from ahgateway.fake.plc import FakePlc
from ahgateway.lockstep.follow import Follower
from ahgateway.lockstep.picture import Sampler
from ahgateway.transports.base import Link
from ahgateway.transports.memory import MemoryLink

DEVICES = DeviceMap(
    "test",
    "D and M only",
    (
        DeviceRange("D", 0, 29999, Table.HOLDING, 0),
        DeviceRange("M", 0, 8191, Table.COIL, 0),
        DeviceRange("SM", 0, 2047, Table.COIL, 0x4000),
    ),
)

TEMP: dict[str, Any] = {
    "Setpoint": 60.0, "InputPerOn": False, "Mode": 3, "Heat_Gain": 4.0, "Heat_Ti": 12.0, "Heat_Cycle": 0.1,
}  # fmt: skip
PULSES: dict[str, Any] = {
    "SET_POINT": 55.0, "KP": 3.0, "D_ZONE": 0.3, "TN": 20.0, "TV": 0.2, "PT_MIN_IMP": 0.4, "PT_LUFT": 0.5,
    "T_PERIOD": 6.0,
}  # fmt: skip
WHOLE: dict[str, Any] = {
    "SV": 500, "TS": 100, "ACT": 33, "KP": 150, "TI": 30, "S22": 1000, "S23": 0, "EN": True,
}  # fmt: skip
START = {"PID_Temp": TEMP, "PID_REG_CE": PULSES, "MELSEC_PID": WHOLE}

PLANTS = {
    "PID_Temp": PlantSpec("heat_cool", 0.9, 8.0, 0.3, 20.0, 0.03, 20.0, cool_gain=0.5),
    "PID_REG_CE": PlantSpec("fopdt", 1.0, 6.0, 0.2, 5.0, 0.02, 40.0, stroke_s=30.0, backlash=1.0, position=30.0),
    "MELSEC_PID": PlantSpec("fopdt", 1.1, 5.0, 0.2, 20.0, 1.5, 200.0),
}


def bindings(controller: Controller, consts: Mapping[str, Any]) -> dict[str, Binding]:
    """Words from D100 in the block's order, bits from M1."""
    found: dict[str, Binding] = {}
    word, flag = 100, 1
    for operand in controller.operands:
        if operand.name in consts:
            found[operand.name] = Const(consts[operand.name])
        elif operand.kind is Kind.BOOL:
            found[operand.name] = parse_device(f"M{flag}")
            flag += 1
        else:
            found[operand.name] = parse_device(f"D{word}")
            word += operand.words
    return found


class OtherWorld(Watched):
    """One block on a fake PLC, followed picture by picture."""

    def __init__(
        self,
        controller: str,
        initial: Mapping[str, Any] | None = None,
        *,
        plant: PlantSpec | None = None,
        consts: Mapping[str, Any] | None = None,
        seed: int = 1,
        poll_ms: int = 25,
        counter: bool = False,
        link: Link | None = None,
        loop_changes: Mapping[str, Any] | None = None,
    ) -> None:
        law = CONTROLLERS[controller]
        self.clock = VirtualClock()
        changes: dict[str, Any] = {"pv_held": True, **(loop_changes or {})}
        self.loop = Loop(
            "L1",
            law,
            bindings(law, consts or {}),
            counter=parse_device("D900") if counter else None,
            **changes,
        )
        self.station = Station("test", "memory:", 1, DEVICES, (self.loop,), running=parse_device("SM400"))
        start = {**START[controller], **(initial or {})}
        setup = FakeLoop(
            {name: value for name, value in start.items() if name not in (consts or {})}, plant or PLANTS[controller]
        )
        self.plc = FakePlc(self.station, {"L1": setup}, seed=seed, scan_ns=5 * MILLISECOND, clock=self.clock)
        self.link = link or MemoryLink(self.plc, self.clock, latency_ns=400_000)
        self.sampler = Sampler(self.loop, self.station, self.link, self.clock)
        self.follower = Follower(self.loop)
        self.poll_ns = poll_ms * MILLISECOND
        self.events = []
