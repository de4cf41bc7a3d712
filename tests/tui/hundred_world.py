"""A hundred loops on one fake PLC, each followed for real twice a CYCLE, shown, in virtual time."""

from __future__ import annotations

from dataclasses import replace

from ahgateway.apps.board import Board
from ahgateway.apps.monitor import Monitor
from ahgateway.clock import MILLISECOND, SECOND, VirtualClock
from ahgateway.codec.devices import Device
from ahgateway.codec.station import FakeLoop, Loop
from ahgateway.fake.plc import FakePlc
from ahgateway.schema.profile import load
from ahgateway.transports.memory import MemoryLink
from ahgateway.tui.app import MonitorApp

LOOPS = 100
STRIDE = 150
SCAN_MS = 50
EXECUTIONS_KEPT = 4
"""Of each loop in the fake PLC's own log: what is measured is the monitor's memory, not the fake's."""


def moved(device: Device, number: int) -> Device:
    """The same operand of another loop: words far enough apart, switches behind each other."""
    step = {"D": STRIDE, "M": 10}[device.kind]
    return replace(device, index=device.index + step * number)


class HundredWorld:
    """The demo's level loop a hundred times.

    Args:
        capacity: Samples kept of each loop.
        cycle_s: CYCLE of every loop, whole seconds.
    """

    def __init__(self, *, capacity: int, cycle_s: int = 1) -> None:
        loaded = load("demo")
        demo = loaded.station()
        first = next(loop for loop in demo.loops if loop.name == "LIC-201")
        loops = tuple(self._loop(first, number) for number in range(LOOPS))
        station = replace(demo, loops=loops, pacing=replace(demo.pacing, poll_ms=500 * cycle_s))
        setup = loaded.fake_setup()[first.name]
        fakes = {
            loop.name: FakeLoop({**setup.initial, "SV": 40.0 + number % 20, "CYCLE": 100 * cycle_s}, setup.plant)
            for number, loop in enumerate(loops)
        }
        self.clock = VirtualClock()
        self.plc = FakePlc(station, fakes, clock=self.clock, scan_ns=SCAN_MS * MILLISECOND, log_max=EXECUTIONS_KEPT)
        self.monitor = Monitor(station, MemoryLink(self.plc, self.clock, target="memory:hundred"), self.clock)
        self.board = Board(self.monitor, self.clock, capacity=capacity)
        self.app = MonitorApp(self.board, "hundred", encoding="utf-8", is_ticking=False)

    def _loop(self, first: Loop, number: int) -> Loop:
        bindings = {
            name: moved(binding, number) if isinstance(binding, Device) else binding
            for name, binding in first.bindings.items()
        }
        return replace(first, name=f"LIC-{number:03d}", bindings=bindings)

    async def run(self, seconds: float) -> int:
        """Follow for so long, drawn once a second; return how many reports came."""
        end_ns = self.clock.now_ns() + round(seconds * SECOND)
        drawn_ns, count = self.clock.now_ns(), 0
        async for report in self.monitor.reports():
            self.board.take(report)
            count += 1
            if self.clock.now_ns() - drawn_ns >= SECOND:
                drawn_ns = self.clock.now_ns()
                self.app.redraw()
            if self.clock.now_ns() >= end_ns:
                break
        return count
