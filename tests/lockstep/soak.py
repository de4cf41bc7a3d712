"""A long run with operators who meddle: what every soak asks of a world, over memory or over a socket."""

from __future__ import annotations

import random
from dataclasses import dataclass
from typing import Any

from lockstep.bench_world import World

from ahgateway.clock import VirtualClock
from ahgateway.codec.access import Request
from ahgateway.core.verdict import Counts
from ahgateway.fake.plc import FakePlc
from ahgateway.transports.base import Link, LinkFigures, Reply

GAINS: dict[str, dict[str, Any]] = {
    "DPIDE": {"Kc_Kp": 2.0, "Ti_Ki": 0.3, "Td_Kd": 0.4, "Tf": 0.5},
    "DPID": {"Kp": 2.0, "Ki": 0.3, "Kd": 0.1},
}


@dataclass
class Timed:
    """A real link on which virtual time passes with each request, so that executions fall between them."""

    inner: Link
    clock: VirtualClock
    latency_ns: int = 400_000

    @property
    def target(self) -> str:
        return self.inner.target

    @property
    def figures(self) -> LinkFigures:
        return self.inner.figures

    async def exchange(self, request: Request) -> Reply:
        self.clock.advance_ns(self.latency_ns // 2)
        reply = await self.inner.exchange(request)
        self.clock.advance_ns(self.latency_ns - self.latency_ns // 2)
        return reply

    async def close(self) -> None:
        await self.inner.close()


def write_something(plc: FakePlc, controller: str, rng: random.Random) -> None:
    """Change one operand as an operator or another program would."""
    switches = {"PID_MAN": 0.3, "MOUT_AUTO": 0.4, "PID_RUN": 0.85, "PID_DIR": 0.8}
    if controller == "DPIDE":
        switches |= {"PID_EQ": 0.4, "PID_DE": 0.4}
    choices: dict[str, Any] = {
        **{name: rng.random() < share for name, share in switches.items()},
        **{name: rng.choice([0.0, rng.uniform(0, 1), rng.uniform(0, 3)]) for name in GAINS[controller]},
        "SV": rng.uniform(20, 90),
        "MOUT": rng.uniform(-10, 110),
        "MV_MAX": rng.choice([100.0, 80.0, 60.0]),
        "MV_MIN": rng.choice([0.0, 10.0, 70.0]),
        "ERR_DBW": rng.choice([0.0, 1.0, 2.0]),
        "CYCLE": rng.choice([10, 12, 15] if controller == "DPID" else [100, 120, 150]),
        "PID_MODE": rng.choice([0, 0, 2]),
    }
    operand = rng.choice(sorted(choices))
    plc.write("L1", operand, choices[operand])


async def soak(world: World, executions: int, *, seed: int, share: float = 0.08) -> Counts:
    """Follow a loop until the PLC has executed so often, with at most one write between two pictures."""
    rng = random.Random(seed)
    controller = world.loop.controller.name
    may_write = True
    while world.plc.executed("L1") < executions:
        if may_write and rng.random() < share:
            moment = world.plc.now_ns + rng.randrange(world.poll_ns)
            world.plc.at(moment, lambda plc: write_something(plc, controller, rng))
            may_write = False
        else:
            may_write = True
        await world.poll()
        world.events.clear()
    return world.follower.summary()
