"""The gate on MELSEC PID, PID_REG_CE and PID_Temp: identity, order, together, takeover, the lease in the PLC."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from lockstep.other_world import OtherWorld

from ahgateway.clock import SECOND
from ahgateway.codec.access import Table
from ahgateway.codec.devices import parse_device
from ahgateway.codec.station import LeaseSpec, WriteLimit
from ahgateway.errors import StateError
from ahgateway.lockstep.gate.gate import Gate
from ahgateway.lockstep.gate.place import journal_path

FREE = WriteLimit(-1e6, 1e6, 1e6, 0.0)
FLAG = WriteLimit(interval_s=0.0)
WHOLE = WriteLimit(-1000, 1000, 2000, 0.0)
WRITES: dict[str, dict[str, WriteLimit]] = {
    "MELSEC_PID": {"SV": WHOLE, "KP": WHOLE, "TI": WHOLE, "S22": WHOLE, "S23": WHOLE, "EN": FLAG},
    "PID_REG_CE": {"SET_POINT": FREE, "KP": FREE, "TN": FREE, "REG_AVT": FLAG},
    "PID_Temp": {
        "Setpoint": FREE,
        "Heat_Gain": FREE,
        "Heat_Ti": FREE,
        "ManualValue": WriteLimit(-100.0, 100.0, 5.0, 0.0),
        "ManualEnable": FLAG,
    },
}
CHANGES: dict[str, dict[str, Any]] = {
    "MELSEC_PID": {"SV": 450, "KP": 200},
    "PID_REG_CE": {"SET_POINT": 50.0, "REG_AVT": False},
    "PID_Temp": {"Setpoint": 70.0, "ManualEnable": True},
}
NAMES = list(WRITES)


class Bench(OtherWorld):
    """A world in which the lease stands from D500 on, and which has run until its output is quiet."""

    def __init__(self, controller: str, folder: Path, initial: dict[str, Any] | None = None) -> None:
        changes = {"writes": WRITES[controller], "lease": LeaseSpec(parse_device("D500"), 2000, 100)}
        start = {"ModeActivate": True} if controller == "PID_Temp" else {}
        super().__init__(controller, {**start, **(initial or {})}, loop_changes=changes)
        self.controller, self.folder = controller, folder
        self.later(3 if controller != "PID_Temp" else 30)

    def later(self, seconds: float) -> None:
        self.clock.advance_ns(round(seconds * SECOND))
        self.plc.advance(self.clock.now_ns() - self.plc.now_ns)

    def gate(self) -> Gate:
        return Gate(self.station, self.loop, self.link, self.clock, self.folder)

    def holds(self) -> dict[str, Any]:
        return {name: self.plc.read("L1", name) for name in WRITES[self.controller] if name != "ManualValue"}


@pytest.fixture(params=NAMES)
def bench(request, tmp_path) -> Bench:
    return Bench(request.param, tmp_path)


async def test_it_writes_reads_back_and_puts_back(bench: Bench) -> None:
    found, wanted = bench.holds(), CHANGES[bench.controller]
    async with bench.gate().armed("test") as gate:
        await gate.write(wanted)
        assert wanted == {name: bench.plc.read("L1", name) for name in wanted}
    assert found == bench.holds()


async def test_killed_the_plc_alone_puts_back(bench: Bench) -> None:
    found = bench.holds()
    gate = bench.gate()
    await gate.arm("test")
    await gate.write(CHANGES[bench.controller])
    gate._papers.close()
    assert found != bench.holds()
    bench.later(3)
    assert found == bench.holds()


@pytest.mark.parametrize(
    ("controller", "operand", "value"),
    [("MELSEC_PID", "EN", False), ("PID_REG_CE", "REG_AVT", True), ("PID_Temp", "Mode", 4)],
)
async def test_an_operator_takes_over_by_the_operands_of_the_mode(tmp_path, controller, operand, value) -> None:
    bench = Bench(controller, tmp_path)
    with pytest.raises(StateError, match="an operator has taken over, nothing was touched"):
        async with bench.gate().armed("test") as gate:
            await gate.write(CHANGES[controller])
            bench.plc.write("L1", operand, value, who="operator")
            held = bench.holds()
    assert held == bench.holds()


@pytest.mark.parametrize(
    ("controller", "place"), [("MELSEC_PID", "MV"), ("PID_REG_CE", "Y"), ("PID_Temp", "PidOutputSum")]
)
def test_a_loop_is_told_from_all_others_by_the_place_of_its_output(tmp_path, controller: str, place: str) -> None:
    bench = Bench(controller, tmp_path)
    other = replace(bench.loop, name="renamed")
    moved = replace(bench.loop, bindings={**bench.loop.bindings, place: parse_device("D8000")})
    assert journal_path(tmp_path, bench.station, bench.loop) == journal_path(tmp_path, bench.station, other)
    assert journal_path(tmp_path, bench.station, bench.loop) != journal_path(tmp_path, bench.station, moved)


async def test_pid_temp_goes_to_manual_with_the_output_of_then(tmp_path) -> None:
    bench = Bench("PID_Temp", tmp_path)
    bench.later(60)
    output = float(bench.plc.read("L1", "PidOutputSum"))
    async with bench.gate().armed("test") as gate:
        await gate.write({"ManualEnable": True})
        bench.later(0.2)
        assert 4 == bench.plc.read("L1", "State")
        assert abs(float(bench.plc.read("L1", "PidOutputSum")) - output) < 5.0
    bench.later(0.2)
    assert 3 == bench.plc.read("L1", "State")


async def test_pid_temp_is_not_put_in_manual_where_it_would_not_come_back(tmp_path) -> None:
    """Mode says 0 while State is 3: the falling edge of ManualEnable would switch the block off."""
    bench = Bench("PID_Temp", tmp_path)
    bench.plc.write("L1", "Mode", 0)
    with pytest.raises(StateError, match="State is 3 but Mode is 0, which it takes when ManualEnable falls"):
        await bench.gate().preview({"ManualEnable": True})


async def test_gains_of_melsec_land_in_one_request(tmp_path) -> None:
    bench = Bench("MELSEC_PID", tmp_path)
    bench.plc.writes.clear()
    async with bench.gate().armed("test", keep=True) as gate:
        await gate.write({"KP": 200, "TI": 40})
    place = bench.station.devices.address(bench.loop.bindings["KP"]).address
    sent = [
        (each.address, each.values) for each in bench.plc.writes if each.table is Table.HOLDING and each.address < 500
    ]
    assert [(place, (200, 40))] == sent
