"""A fake PLC, a link without wires and a follower, on one virtual clock: the ground for tests of lockstep."""

from __future__ import annotations

import random
import shutil
import tempfile
import weakref
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ahgateway.clock import MILLISECOND, VirtualClock
from ahgateway.codec.access import Request, Table
from ahgateway.codec.devices import DeviceMap, DeviceRange, parse_device
from ahgateway.codec.station import Binding, Const, FakeLoop, Loop, PlantSpec, Station
from ahgateway.codec.ways import Way
from ahgateway.core.controllers import CONTROLLERS, Controller
from ahgateway.core.operands import Kind
from ahgateway.errors import ReplyTimeoutError
from ahgateway.fake.plc import FakePlc
from ahgateway.lockstep.follow import Event, Follower
from ahgateway.lockstep.gate.gate import ARM_MAX_NS, Gate
from ahgateway.lockstep.gate.states import State
from ahgateway.lockstep.judge import Execution
from ahgateway.lockstep.picture import Picture
from ahgateway.lockstep.source import Source, source
from ahgateway.lockstep.stepper import Step
from ahgateway.transports.base import LinkFigures, Reply

DEVICES = DeviceMap(
    "test",
    "D and M only",
    (
        DeviceRange("D", 0, 29999, Table.HOLDING, 0),
        DeviceRange("M", 0, 8191, Table.COIL, 0),
        DeviceRange("SM", 0, 2047, Table.COIL, 0x4000),
    ),
)


def bindings(controller: Controller, first: int, flag: int, mv: int, consts: Mapping[str, Any]) -> dict[str, Binding]:
    """Words from D`first` in the instruction's order, bits from M`flag`, MV at D`mv`."""
    found: dict[str, Binding] = {}
    for operand in controller.operands:
        if operand.name in consts:
            found[operand.name] = Const(consts[operand.name])
        elif operand.kind is Kind.BOOL:
            found[operand.name] = parse_device(f"M{flag}")
            flag += 1
        elif operand.name == "MV":
            found[operand.name] = parse_device(f"D{mv}")
        else:
            found[operand.name] = parse_device(f"D{first}")
            first += operand.words
    return found


@dataclass
class DirectLink:
    """Hands requests to the PLC; every request and every reply takes half of `latency_ns`."""

    plc: FakePlc
    clock: VirtualClock
    latency_ns: int = 400_000
    target: str = "memory:"
    figures: LinkFigures = field(default_factory=LinkFigures)
    is_down: bool = False

    async def exchange(self, request: Request) -> Reply:
        sent_ns = self.clock.now_ns()
        self.figures.requests += 1
        self.clock.advance_ns(self.latency_ns // 2)
        values = None if self.is_down else self.plc.answer(request)
        if values is None:
            raise ReplyTimeoutError("memory: no reply")
        self.clock.advance_ns(self.latency_ns - self.latency_ns // 2)
        self.figures.replies += 1
        now_ns = self.clock.now_ns()
        return Reply(request, values, sent_ns, now_ns, now_ns, 0)

    async def close(self) -> None:
        self.is_down = True


class Watched:
    """A loop that is polled in virtual time and followed, whatever PLC and link stand behind it."""

    clock: VirtualClock
    sampler: Source
    follower: Follower
    poll_ns: int
    events: list[tuple[Picture, Event]]

    async def poll(self) -> list[Event]:
        """Wait for one polling interval, look, return what the follower makes of it."""
        self.clock.advance_ns(self.poll_ns)
        found: list[Event] = []
        for each in await self.sampler.pictures():
            events = self.follower.take(each)
            if isinstance(each, Picture):
                self.events.extend((each, event) for event in events)
            found.extend(events)
        return found

    async def follow(self, polls: int) -> list[Execution]:
        """Poll so often and return the executions seen."""
        found: list[Execution] = []
        for _ in range(polls):
            found.extend(event for event in await self.poll() if isinstance(event, Execution))
        return found


def _dispose(gate: Gate, folder: Path) -> None:
    gate._papers.close()
    shutil.rmtree(folder, ignore_errors=True)


class World(Watched):
    """One loop on a fake PLC, followed picture by picture."""

    gate_of_steps: Gate | None = None

    def __init__(
        self,
        controller: str = "DPIDE",
        initial: Mapping[str, Any] | None = None,
        *,
        plant: PlantSpec | None = None,
        consts: Mapping[str, Any] | None = None,
        seed: int = 1,
        cycle_ms: int = 100,
        poll_ms: int = 25,
        mv: int = 200,
        scan_ms: float = 5,
        latency_ns: int = 400_000,
        is_restless: bool = False,
        en: str | None = None,
        loop_changes: Mapping[str, Any] | None = None,
        is_bench: bool = False,
    ) -> None:
        law = CONTROLLERS[controller]
        self.clock = VirtualClock()
        loop = Loop(
            "L1",
            law,
            bindings(law, 100, 1, mv, consts or {}),
            **{"en": parse_device(en) if en else None, **(loop_changes or {})},
        )
        self.station = Station("test", "memory:", 1, DEVICES, (loop,), running=parse_device("SM400"), bench=is_bench)
        cycle = cycle_ms // 10 if controller == "DPID" else cycle_ms
        start = {"SV": 50.0, "CYCLE": cycle, "PID_RUN": True, "PID_DIR": True, **(initial or {})}
        plant = plant or PlantSpec("fopdt", 1.2, 3.0, 0.2, 10.0, 0.05, 20.0)
        self.plc = FakePlc(
            self.station,
            {"L1": FakeLoop(start, plant)},
            seed=seed,
            scan_ns=round(scan_ms * MILLISECOND),
            clock=self.clock,
            is_restless=is_restless,
        )
        self.rng = random.Random(seed)
        self.loop = loop
        self.link = DirectLink(self.plc, self.clock, latency_ns)
        self.sampler = source(loop, self.station, self.link, self.clock, step=self._step())
        self.follower = Follower(loop)
        self.poll_ns = poll_ms * MILLISECOND
        self.events = []
        self.looks: list[Picture] = []

    def _step(self) -> Step | None:
        """What triggers an execution: a gate in a directory of its own."""
        if self.station.loops[0].way is not Way.STEPPED:
            return None
        folder = Path(tempfile.mkdtemp(prefix="ahgateway-"))
        self.gate_of_steps = Gate(self.station, self.loop, self.link, self.clock, folder, who="test")
        weakref.finalize(self, _dispose, self.gate_of_steps, folder)
        return self.gate_of_steps.step

    async def poll(self) -> list[Event]:
        """As `Watched.poll`; where executions are triggered, armed as long as a gate can be."""
        if self.gate_of_steps is not None and self.gate_of_steps.state is State.DISARMED:
            await self.gate_of_steps.arm("test", duration_ns=ARM_MAX_NS)
        return await super().poll()
