"""A skid that somebody else programmed, on the fake: one loop, one defect, commissioned in virtual time."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from ahgateway.apps.commission.checks import Check, Outcome, Progress, Step
from ahgateway.apps.commission.link import Patience
from ahgateway.apps.commission.run import Commission, Wishes
from ahgateway.clock import MILLISECOND, SECOND, VirtualClock
from ahgateway.codec.access import Read, Request, Table
from ahgateway.codec.devices import DeviceMap
from ahgateway.codec.station import Loop, Pacing, PlantSpec, Station
from ahgateway.errors import AhGatewayError, LinkError
from ahgateway.fake.plc import FakePlc
from ahgateway.schema import device_map
from ahgateway.schema.profile import parse
from ahgateway.transports.base import Link, Reply
from ahgateway.transports.memory import MemoryLink

PLANT = PlantSpec("fopdt", 1.2, 2.0, 0.1, 10.0, 0.02, 58.0)
PROFILE = """
[station]
name = "Skid"
target = "modbus+tcp://192.0.2.10"
{running}
device_map = "{map}"
[station.pacing]
reply_timeout_ms = 50
[loops.L]
instruction = "DPIDE"
layout = "manual"
ranges = {{ pv = [0.0, 200.0], mv = [0.0, 100.0] }}
units = {{ pv = "°C" }}
[loops.L.write]
MOUT = {{ min = 0.0, max = 100.0, step_max = 5.0, interval_s = 0.5 }}
PID_MAN = {{ interval_s = 0.5 }}
MV_MAX = {{ min = 0.0, max = 100.0, step_max = 100.0, interval_s = 0.5 }}
MV_MIN = {{ min = 0.0, max = 100.0, step_max = 100.0, interval_s = 0.5 }}
[loops.L.fake.initial]
SV = 58.0
CYCLE = 100
Kc_Kp = 0.8
Ti_Ki = 0.4
Td_Kd = 0.05
"""
ALLOWED = {(Table.HOLDING, 118), (Table.HOLDING, 120), (Table.HOLDING, 122), (Table.COIL, 2)}
"""MV_MAX, MV_MIN, MOUT at D118, D120, D122 and PID_MAN at M2."""

WISHES = Wishes(
    executions=25, observe_ns=12 * SECOND, coverage_min=0.3, is_armed=True, answer_ns=6 * SECOND, total_ns=120 * SECOND,
    patience=Patience(60 * SECOND, 0),
)  # fmt: skip
NOT_ASKED = {"wrong-line", "wrong-port", "slow-adapter", "idle-disconnect", "marker"}
"""Checks of a serial line, and those that nobody asked for."""


def text(map_name: str) -> str:
    running = "" if map_name == "dvp" else 'running = "SM400"'
    return PROFILE.format(map=map_name, running=running)


def station(map_name: str = "ah500") -> Station:
    return parse(text(map_name), "skid.toml").station()


class Weather:
    """A link that can be told to fail, to swap words, to shift addresses, to stay silent."""

    def __init__(self, inner: MemoryLink, bench: Bench) -> None:
        self.target, self.figures, self.inner, self.bench = inner.target, inner.figures, inner, bench

    async def exchange(self, request: Request) -> Reply:
        for effect in self.bench.effects:
            effect(request)
        sent = request
        if self.bench.shift and isinstance(request, Read) and not request.table.is_bits:
            sent = Read(request.unit, request.table, request.address + self.bench.shift, request.count)
        reply = await self.inner.exchange(sent)
        values = reply.values
        if self.bench.is_swapping and isinstance(request, Read) and not request.table.is_bits:
            # A converter that swaps the words of each aligned pair.
            cells = dict(enumerate(values, request.address))
            values = tuple(cells.get(address ^ 1, 0) for address in cells)
        return Reply(request, values, reply.sent_ns, reply.first_ns, reply.last_ns, reply.aligned_since_ns)

    async def close(self) -> None:
        await self.inner.close()


@dataclass
class Bench:
    """The PLC as it is, the profile as somebody wrote it, and what is wrong between them."""

    folder: Path
    initial: Mapping[str, Any] = field(default_factory=dict)
    plant: PlantSpec = PLANT
    map_name: str = "ah500"
    changes: Mapping[str, Any] = field(default_factory=dict)
    words_max: int = 125
    latency_ns: int = MILLISECOND
    shift: int = 0
    is_swapping: bool = False
    only_scheme: str = ""
    effects: list[Callable[[Request], None]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.clock = VirtualClock()
        real = station(self.map_name)
        setup = parse(text(self.map_name), "skid.toml").fake_setup()["L"]
        setup = replace(setup, initial={**setup.initial, **self.initial}, plant=self.plant)
        self.plc = FakePlc(
            real, {"L": setup}, seed=3, scan_ns=10 * MILLISECOND, clock=self.clock, words_max=self.words_max
        )
        self.plc.warm_up(15 * SECOND)
        self.plc.writes.clear()
        self.station = replace(station(), **self.changes)

    def loop(self) -> Loop:
        return self.station.loops[0]

    def later(self, seconds: float, act: Callable[[FakePlc], None], every_s: float = 0.0) -> None:
        """Do something at a time from now, and again."""

        def again(plc: FakePlc) -> None:
            act(plc)
            if every_s:
                plc.at(plc.now_ns + round(every_s * SECOND), again)

        self.plc.at(self.plc.now_ns + round(seconds * SECOND), again)

    def lose_link(self, from_s: float, to_s: float) -> None:
        start_ns = self.clock.now_ns()

        def lost(request: Request) -> None:
            if from_s * SECOND <= self.clock.now_ns() - start_ns < to_s * SECOND:
                self.clock.advance_ns(50 * MILLISECOND)
                raise LinkError("unplugged")

        self.effects.append(lost)

    async def open(self, variant: Station) -> Link:
        scheme = variant.target.partition("://")[0]
        unit = None if scheme.startswith(self.only_scheme) else 300
        pacing = Pacing(reply_timeout_ms=50)
        return Weather(
            MemoryLink(self.plc, self.clock, unit, self.latency_ns, pacing=pacing, target=variant.target), self
        )

    def work(self, progress: Progress | None = None, maps: tuple[DeviceMap, ...] = ()) -> Commission:
        known = maps or tuple(device_map.load(name) for name in ("ah500", "as500", "dvp"))
        self.progress = progress or Progress("L", "hash")
        return Commission(
            self.station, self.loop(), self.open, self.clock, self.progress,
            path=self.folder / "state.json", gates=self.folder / "gates", maps=known, who="test",
        )  # fmt: skip

    async def commission(self, wishes: Wishes = WISHES, *, consents: bool = True) -> dict[str, Check]:
        """Run the whole list; return the checks by name."""
        try:
            await self.work().run(wishes, lambda step, checks: None, consent=lambda bounds: consents)
        except AhGatewayError as error:
            raise AssertionError(f"the weather came through: {error}") from error
        return {check.name: check for check in self.progress.checks}

    def failed(self) -> set[str]:
        return {check.name for check in self.progress.checks if check.outcome is Outcome.FAIL}

    def touched(self) -> set[tuple[Table, int]]:
        """Where writes came from the link."""
        return {(each.table, each.address) for each in self.plc.writes if each.who == "link"}

    def done(self) -> list[int]:
        return [step.value for step in Step if step in self.progress.steps]
