"""Ctrl-C at chosen moments of what `tune` does at a loop, in virtual time: exchanges, before and behind, and pauses.

The first Ctrl-C cancels the command's task (`cli/gate_place.until_stopped`); so does this. One PLC serves all moments
of one kind: where everything has been put back, the next finds it as the first did.
"""

from __future__ import annotations

import asyncio
import json
from collections.abc import Awaitable, Callable, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from lockstep.gate.gate_world import WRITES, GateWorld, is_write
from tuning_data import answered

from ahgateway.apps.tune import Tuning, tune
from ahgateway.apps.tune_apply import Trial
from ahgateway.apps.tune_experiment import Experiment, Kind, Wanted
from ahgateway.apps.tune_sitting import Envelope
from ahgateway.clock import SECOND
from ahgateway.codec.access import Read, Request, Table
from ahgateway.codec.station import PlantSpec, WriteLimit
from ahgateway.errors import StateError
from ahgateway.lockstep.gate.gate import Gate
from ahgateway.lockstep.picture import Sampler
from ahgateway.transports.base import Reply
from ahgateway.tuning import models
from ahgateway.tuning.record import Record
from ahgateway.tuning.rules import RULES

INITIAL = {
    "SV": 80.0, "CYCLE": 200, "Kc_Kp": 1.0, "Ti_Ki": 0.15, "Td_Kd": 0.0, "MV_MAX": 100.0, "MV_MIN": 0.0,
}  # fmt: skip
HELD = ("SV", "PID_MODE", "PID_MAN", "Kc_Kp", "Ti_Ki", "Td_Kd", "Tf", "MV_MAX", "MV_MIN")
LISTED = WRITES | {
    "SV": WriteLimit(20.0, 120.0, 10.0, 0.0), "Ti_Ki": WriteLimit(0.0, 2.0, 1.0, 0.0),
    "PID_MODE": WriteLimit(0, 1, 1, 0.0),
}  # fmt: skip
BOUNDS = Envelope((60.0, 100.0), (20.0, 60.0), time_s=600.0)
KINDS = {
    "step": Wanted(Kind.STEP, 2.0, hold_s=1.0),
    "doublet": Wanted(Kind.DOUBLET, 2.0, hold_s=1.0),
    "sv": Wanted(Kind.SV, 2.0, hold_s=1.0),
    "relay": Wanted(Kind.RELAY, 2.0, hysteresis=0.2),
    "autotune": Wanted(Kind.AUTOTUNE),
}
GAINS = "gains"
ROLLBACK = "rollback"
EVERY = (*KINDS, GAINS, ROLLBACK)
REST_S = 40
"""How long PV is given between two moments."""
RESTS = 4
"""How often that is tried: noise alone makes one rest in some hundreds look like a movement."""


@dataclass
class Moments:
    """Counts what passes and cancels a task at one of it; a clock and a link at once.

    Attributes:
        world: The loop and its PLC.
        passed: What has passed since `begin`: `before read`, `behind write`, `pause` and so on.
    """

    world: GateWorld
    passed: list[str] = field(default_factory=list)
    _task: asyncio.Task[object] | None = None
    _at: int = -1

    def begin(self, task: asyncio.Task[object], at: int) -> None:
        """Start counting; cancel `task` at the moment with this number, at none when it is negative."""
        self.passed, self._task, self._at = [], task, at

    async def _pass(self, what: str) -> None:
        self.passed.append(what)
        if len(self.passed) - 1 == self._at and self._task is not None:
            self._task.cancel()
        await asyncio.sleep(0)

    # A link.

    @property
    def target(self) -> str:
        return self.world.link.target

    @property
    def figures(self) -> object:
        return self.world.link.figures

    async def exchange(self, request: Request) -> Reply:
        what = "write" if is_write(request) else "read"
        await self._pass(f"before {what}")
        reply = await self.world.link.exchange(request)
        await self._pass(f"behind {what}")
        return reply

    async def close(self) -> None:
        await self.world.link.close()

    # A clock.

    def now_ns(self) -> int:
        return self.world.clock.now_ns()

    def utc_ns(self) -> int:
        return self.world.clock.utc_ns()

    async def sleep_ns(self, duration_ns: int) -> None:
        await self._pass("pause")
        await self.world.clock.sleep_ns(duration_ns)


def tuned() -> Tuning:
    """Gains for the loop of the bench, from a doublet of its process."""
    mv = np.full(160, 40.0)
    mv[20:70] += 5.0
    mv[70:120] -= 5.0
    record = answered(models.Model(models.Kind.FOPDT, 1.5, 1.0, 6.0), mv, ts_s=0.2, noise=0.02)
    settings = {name: value for name, value in INITIAL.items() if name != "SV"} | {"PID_DIR": True}
    trace = Record(record.t_s, record.sv, record.pv, record.mv)
    return tune(trace, "DPIDE", settings, kind=models.Kind.FOPDT, rules=RULES[:1])


@dataclass
class Bench:
    """A loop at rest and what is to be stopped at it."""

    kind: str
    folder: Path
    result: Tuning
    moments: Moments = field(init=False)

    def __post_init__(self) -> None:
        plant = PlantSpec("fopdt", 1.5, 6.0, 1.0, 20.0, 0.02, 80.0)
        world = GateWorld(self.folder, INITIAL, plant=plant, scan_ms=50, writes=LISTED)
        self.moments = Moments(world)
        self.rest(120)

    def rest(self, seconds: int) -> None:
        """Let the loop come to rest."""
        self.moments.world.clock.advance_ns(seconds * SECOND)
        self.moments.world.plc.answer(Read(1, Table.HOLDING, 100, 1))

    def holds(self) -> list[object]:
        """What stands in the PLC of all that is ever written, MOUT apart, which in automatic nobody reads."""
        return self.moments.world.holds(*HELD)

    def work(self) -> Awaitable[object]:
        """What is stopped, ready to begin."""
        world, moments = self.moments.world, self.moments
        gate = Gate(world.station, world.loop, moments, moments, self.folder)  # type: ignore[arg-type]
        sampler = Sampler(world.loop, world.station, moments, moments)  # type: ignore[arg-type]
        if self.kind == ROLLBACK:
            return gate.recover("rolled back")
        if self.kind == GAINS:
            return Trial(world.loop, gate, sampler, moments, BOUNDS).apply(self.result, "SIMC PI", 2.0, 2.5)
        return Experiment(world.loop, gate, sampler, moments, BOUNDS).run(KINDS[self.kind])

    async def keep(self) -> None:
        """Let gains be kept, undisturbed."""
        world = self.moments.world
        sampler = Sampler(world.loop, world.station, world.link, world.clock)
        found = await Trial(world.loop, world.gate(), sampler, world.clock, BOUNDS).apply(
            self.result, "SIMC PI", 2.0, 2.5
        )
        assert found.is_kept, found.reason

    def ended(self) -> str:
        """How the journal says that the last arming ended; empty where there was none."""
        for path in self.folder.glob("*.jsonl"):
            last = json.loads(path.read_text(encoding="utf-8").splitlines()[-1])
            return str(last.get("how", last["kind"]))
        return ""


async def stopped(bench: Bench, choose: Callable[[list[str]], Iterable[int]]) -> list[str]:
    """Stop the work once at each chosen moment; return a line for each that left anything changed.

    Args:
        bench: A loop at rest.
        choose: From what passes in an undisturbed run to the numbers of the moments.
    """
    assert "" == await left_by(bench, -1)
    return [line for number in list(choose(bench.moments.passed)) if (line := await left_by(bench, number))]


async def left_by(bench: Bench, number: int) -> str:
    """Do the work once and stop it at this moment; return what that left changed, in words."""
    before, moments = bench.holds(), bench.moments
    if bench.kind == ROLLBACK:
        await bench.keep()
        bench.rest(REST_S)
    error: BaseException | None = StateError("not begun")
    for _ in range(RESTS):
        task = asyncio.ensure_future(bench.work())
        moments.begin(task, number)
        await asyncio.wait({task})
        error = None if task.cancelled() else task.exception()
        if "not at rest" not in str(error):
            break
        bench.rest(REST_S)
    if bench.kind == GAINS and not task.cancelled() and error is None:
        # The end came too late: proven gains stay, and are put back by hand here.
        assert bench.holds() != before
        await moments.world.gate().recover("next moment")
    now, ended = bench.holds(), bench.ended()
    bench.rest(REST_S)
    if now == before and ended in ("", "restored") and error is None:
        return ""
    await moments.world.gate().recover("next moment")
    what = moments.passed[number] if 0 <= number < len(moments.passed) else "the end"
    changed = ", ".join(f"{name} {was} → {is_}" for name, was, is_ in zip(HELD, before, now, strict=True) if was != is_)
    return f"{bench.kind} at {number}, {what}: {changed} {ended} {error or ''}"


def around_writes(passed: list[str]) -> Iterator[int]:
    """Before and behind each write, and at the first pause after it."""
    for number, what in enumerate(passed):
        if what.endswith("write"):
            yield number
            if what.startswith("behind") and "pause" in passed[number:]:
                yield passed.index("pause", number)


def every(passed: list[str]) -> Iterator[int]:
    """All of them, from the last reading of the rest before on."""
    first = next(number for number, what in enumerate(passed) if what.endswith("write"))
    yield from range(max(0, first - 20), len(passed))
