"""Runs scenarios on a real PLC: the process is simulated here, PV streamed into the PLC, MV read, in step with it.

Nothing is written but through the write gate: the time line as ordinary writes, PV as the class of its own that only a
bench has, after proving that the PLC program does not write it. Behind each scenario everything is put back as found;
what a killed run left is put back at the next start, by the gate's journal.

Theory of operation: twice in each CYCLE a step is due. It does what the time line asks, takes a picture, lets the
process move on by the time that really passed, with the MV that was seen last, and writes PV. So at most one PV comes
between two pictures, and the follower knows both that an execution can have used.
"""

from __future__ import annotations

import random
from collections.abc import AsyncIterator, Sequence
from dataclasses import dataclass, replace
from math import isfinite
from typing import Any

from ahgateway.apps.check.keep import Recordings, kept
from ahgateway.apps.check.pace import Pace, sentence
from ahgateway.apps.check.result import Floor
from ahgateway.apps.check.run import Bench
from ahgateway.apps.check.timeline import TimeLine
from ahgateway.apps.check.watch import CutLink, Seen, Watch, believed, loop_for
from ahgateway.apps.witness import Witness
from ahgateway.clock import SECOND, Clock
from ahgateway.codec.block import Raw
from ahgateway.codec.station import Const, Loop, Station
from ahgateway.codec.words import encode
from ahgateway.core.operands import Access, Kind
from ahgateway.core.real import REAL
from ahgateway.errors import AhGatewayError, StateError, TransportError
from ahgateway.fake.rigs import make_rig
from ahgateway.lockstep.follow import cycle_ns
from ahgateway.lockstep.gate.gate import ARM_MAX_NS, Gate
from ahgateway.lockstep.gate.place import Place, bench_path
from ahgateway.lockstep.picture import Picture
from ahgateway.plants.rig import Rig
from ahgateway.schema.scenario import Scenario
from ahgateway.transports.base import Link
from ahgateway.transports.machine_lock import MachineLock, hold

STEPS_PER_CYCLE = 2
PROOF_CYCLES = 3
"""So long a written PV must stand: a program overwrites it within one scan, a slow copy within a few CYCLEs."""

ARM_MARGIN_NS = 120 * SECOND
"""Beyond the scenario itself: the proof, the beginning, and a link that comes back late."""

HOLD_SHARE = 0.01
"""Of MV's range: where a loop is held in manual before it starts; not at its end, which a dead register might show."""

FLOOR_S = 3.0
"""How long the bench is tried before the first scenario."""

INSTRUCTIONS = ("DPID", "DPIDE")


def bench_lease(folder: Place, target: str, who: str) -> MachineLock:
    """Take a bench for as long as the process lives; one PLC, one run.

    Raises:
        StateError: Another run on this machine has it.
    """
    taken = f"bench {target} is taken by another run on this machine"
    return hold(bench_path(folder, target), taken, "wait for its end; one bench, one run", who=who)


def only_virtual(scenario: Scenario) -> str:
    """Say why a scenario cannot run on a real PLC; empty when it can."""
    deeds = {each.do for each in scenario.actions} & {"stop", "restart"}
    if deeds:
        return f"it asks for {' and '.join(sorted(deeds))}, and nothing here stops a real PLC"
    if scenario.expect.fresh_pv:
        return "fresh_pv needs a picture of every scan"
    values = [*scenario.initial.values(), *(value for each in scenario.actions for value in each.set.values())]
    if not all(isfinite(value) for value in values):
        return "it sets what is no finite number, and the write gate sends none"
    if scenario.controller.name not in INSTRUCTIONS:
        return f"a real PLC is driven for {' and '.join(INSTRUCTIONS)} only"
    return ""


@dataclass(frozen=True)
class LiveBench:
    """A real PLC that nothing but our simulation hangs on.

    Attributes:
        station: The PLC, of `kind = "bench"`.
        link: The way there.
        clock: Real time.
        folder: Where journals and leases stand.
        loop: Loop to use; empty for the first with the scenario's instruction.
        who: Who asks, for the journal.
        recordings: Keeps what is seen and written of each scenario; None keeps nothing.
    """

    station: Station
    link: Link
    clock: Clock
    folder: Place
    loop: str = ""
    who: str = ""
    recordings: Recordings | None = None

    @property
    def target(self) -> str:
        """What people call the PLC."""
        return self.station.target

    @property
    def is_repeatable(self) -> bool:
        """False: when an execution falls between two pictures is nobody's choice."""
        return False

    async def floors(self, scenarios: Sequence[Scenario], seed: int, wall: Clock) -> AsyncIterator[tuple[str, Floor]]:
        """Try our side against itself in memory, then PV and pace on the PLC, for each instruction."""
        virtual = Bench(self.station, self.station, self.loop)
        async for name, floor in virtual.floors(scenarios, seed, wall):
            if not floor.is_sound:
                yield name, floor
                return
            first = next(each for each in scenarios if each.controller.name == name)
            calm = first.expect.model_copy(update={"response": [], "recovery": None})
            found = await self._floor(replace(first, duration_s=FLOOR_S, actions=(), expect=calm), seed, wall)
            yield name, found
            if not found.is_sound:
                return

    async def _floor(self, scenario: Scenario, seed: int, wall: Clock) -> Floor:
        """Hold the scenario's beginning for a while: every PV that was written must stand, pace must be kept."""
        seen = await replace(self, recordings=None).run(scenario, seed, wall)
        if seen.troubles:
            return Floor(False, seen.troubles[0].text)
        return Floor(True, f"each PV written stood until the next; {sentence(seen.pace)}", 0.0, seen.counts.compared)

    async def run(self, scenario: Scenario, seed: int, wall: Clock) -> Seen:
        """Run a scenario in real time; the PLC is put back however it ends.

        Raises:
            StateError: The scenario or the profile does not allow it, or something could not be put back.
            TransportError: The link failed before the scenario began.
        """
        loop = allowed_loop(self.station, scenario, self.loop)
        station = replace(self.station, loops=(loop,))
        duration_ns = min(round((scenario.duration_s + scenario.limit_s) * SECOND) + ARM_MARGIN_NS, ARM_MAX_NS)
        with kept(self.recordings, scenario, station, self.clock) as witness:
            course = LiveCourse(self, scenario, station, seed, witness)
            async with course.gate.armed(f"check {scenario.name}", duration_ns=duration_ns):
                return await course.run()


class LiveCourse:
    """One scenario under way on a real PLC.

    Attributes:
        gate: The door to the PLC.
    """

    def __init__(self, bench: LiveBench, scenario: Scenario, station: Station, seed: int, witness: Witness) -> None:
        loop = station.loops[0]
        self._scenario, self._loop, self._clock, self._witness = scenario, loop, bench.clock, witness
        self._pv = loop.controller.roles.pvs[0]
        self._link = CutLink(bench.link, bench.clock)
        self._watch = Watch(scenario, station, self._link, bench.clock, bench.clock.now_ns(), witness.see)
        self.gate = Gate(
            station, loop, bench.link, bench.clock, bench.folder,
            who=bench.who, sees=self._glimpse, told=witness.told,
        )  # fmt: skip
        self._rig = self._process(seed)
        self._line = TimeLine(scenario, self._pv)
        self._stands: Raw = {}
        self._is_watching = False

    async def run(self) -> Seen:
        """Prove PV, begin, keep pace to the end; the gate is armed."""
        assert self.gate.as_found is not None
        picture = self.gate.as_found
        period_ns = cycle_ns(self._loop, picture)
        try:
            took_ns = await self._prove(picture, period_ns)
            if self._is_too_slow(took_ns):
                return self._watch.done()
            picture = await self._begin()
        except TransportError as error:
            self._watch.trouble_first(f"link down: {error.message}")
            return self._watch.done()
        await self._keep_pace(picture)
        return self._watch.done()

    def _is_too_slow(self, took_ns: int) -> bool:
        """Tell whether a picture and a write do not fit into a step, before the loop is made faster than the line."""
        assert self.gate.as_found is not None
        inputs = self.gate.as_found.inputs
        cycle = _starting(self._loop, self._scenario).get("CYCLE", inputs.cycle)
        ts = float(self._loop.controller.nominal_ts(inputs._replace(cycle=cycle)))
        step_ns = round(ts * SECOND) // STEPS_PER_CYCLE
        if took_ns > step_ns:
            self._watch.trouble_first(
                f"a picture and a write take {took_ns / SECOND:.3g} s, more than a step of {step_ns / SECOND:g} s: the "
                "line or this computer is too slow for this CYCLE"
            )
        return took_ns > step_ns

    async def _prove(self, picture: Picture, period_ns: int) -> int:
        """Prove that nobody else writes PV: two values, each of which stands for some CYCLEs.

        Returns:
            How long a write with the picture behind it takes, the shorter of two.

        Raises:
            StateError: Something else came to stand there.
        """
        first = self._reading()
        now = float(picture.inputs.pv)
        limit = self._loop.writes[self._pv]
        assert limit.minimum is not None
        assert limit.maximum is not None
        other = min(max(first + 0.01 * (limit.maximum - limit.minimum), limit.minimum), limit.maximum)
        self._stands = {self._pv: picture.words[self._pv]}
        took: list[int] = []
        for value in (other if other != now else first, first):
            begun_ns = self._clock.now_ns()
            await self._stream(value)
            await self._watch.look()
            took.append(self._clock.now_ns() - begun_ns)
            until_ns = self._clock.now_ns() + PROOF_CYCLES * period_ns
            while self._clock.now_ns() < until_ns:
                await self._clock.sleep_ns(period_ns // STEPS_PER_CYCLE)
                seen = await self._watch.look()
                if seen is not None and not self._holds(seen):
                    raise StateError(self._overwritten(seen), hint="on a bench nothing but the simulation may write PV")
        return min(took)

    async def _begin(self) -> Picture:
        """Bring the loop to the scenario's start: in manual while the operands change, then as it wants to be."""
        wanted = _starting(self._loop, self._scenario)
        mode: dict[str, Any] = {name: wanted.pop(name) for name in ("PID_MAN", "MOUT") if name in wanted}
        low, high = sorted((float(wanted.get("MV_MIN", 0.0)), float(wanted.get("MV_MAX", 100.0))))
        held = mode["MOUT"] if mode.get("PID_MAN") else low + HOLD_SHARE * (high - low)
        can_hold = len(mode) == len(("PID_MAN", "MOUT"))
        if can_hold:
            await self.gate.write({"PID_MAN": True, "MOUT": held}, "check: hold still")
        await self.gate.write(wanted, "check: begin")
        # D and its filter come to rest before the loop is let go.
        await self._clock.sleep_ns(PROOF_CYCLES * cycle_ns(self._loop, await self._looked()))
        picture = await self._looked()
        if can_hold and float(picture.seen["MV"]) != float(REAL(min(max(held, low), high))):
            raise StateError(
                f"MV at {self._loop.bindings['MV']} holds {float(picture.seen['MV']):g} in manual, MOUT is {held:g}: "
                "wrong profile, or the program stands still",
                hint="`ahgateway commission` settles the map of a loop",
            )
        if mode.get("PID_MAN") is False:
            await self.gate.write({"PID_MAN": False}, "check: begin")
        return await self._looked()

    async def _looked(self) -> Picture:
        picture = await self._watch.look()
        if picture is None:
            raise StateError(f"loop {self._loop.name}: no picture of it can be taken")
        return picture

    async def _keep_pace(self, first: Picture) -> None:
        watch = self._watch
        period_ns = cycle_ns(self._loop, first) // STEPS_PER_CYCLE
        watch.origin_ns = moved_ns = self._clock.now_ns()
        pace = Pace(watch.origin_ns, period_ns)
        ends_ns = watch.origin_ns + round(self._scenario.duration_s * SECOND)
        limit_ns = ends_ns + round(self._scenario.limit_s * SECOND)
        is_first = self._is_watching = True
        for begin_s, end_s in self._line.cuts:
            self._link.cuts.append((watch.origin_ns + round(begin_s * SECOND), watch.origin_ns + round(end_s * SECOND)))
        while (now_ns := self._clock.now_ns()) < ends_ns:
            if now_ns < pace.due_ns:
                await self._clock.sleep_ns(pace.due_ns - now_ns)
            begun_ns = self._clock.now_ns()
            pace.begin(begun_ns)
            try:
                if await self._act():
                    pace.restart(self._clock.now_ns())
                picture = await watch.look()
                if picture is None:
                    if not self._link.is_cut():
                        # Silence has its own trouble, and takes longer than a step.
                        pace.restart(self._clock.now_ns())
                elif (is_first and watch.is_wrong(picture)) or not self._is_ours(picture):
                    break
                else:
                    is_first = False
                    moved_ns = await self._move_on(picture, moved_ns)
            except TransportError as error:
                watch.trouble(f"link down: {error.message}")
                pace.restart(self._clock.now_ns())
            except AhGatewayError as error:
                watch.trouble(error.message)
                break
            if watch.is_lost or self._clock.now_ns() > limit_ns:
                break
            pace.end(begun_ns, self._clock.now_ns())
        self._is_watching = False
        self._judge_pace(pace)

    def _judge_pace(self, pace: Pace) -> None:
        self._watch.seen.pace = pace.figures()
        if not pace.is_kept:
            self._watch.trouble_first(
                f"{pace.late} of {pace.steps + pace.late} steps of {pace.period_ns / SECOND:g} s came too late: the "
                "line or this computer is too slow for this CYCLE"
            )

    async def _act(self) -> bool:
        """Do what the time line asks by now; tell whether the gate had to wait for it."""
        t_s = self._watch.now_s()
        if self._rig is not None:
            self._rig.load = self._line.load(t_s)
        values = self._line.due(t_s)
        if not values:
            return False
        await self.gate.write(values, f"check: at {t_s:.2f} s")
        return True

    async def _move_on(self, picture: Picture, moved_ns: int) -> int:
        """Let the process go on to now with the MV of before, take over the MV that was seen, write PV."""
        self._watch.take(picture)
        now_ns = self._clock.now_ns()
        if self._rig is not None:
            self._rig.advance(now_ns - moved_ns)
            self._rig.ask(self._watch.seen.moments[-1].mv)
        pv = self._line.sensor(self._watch.now_s(), self._reading)
        if pv is not None and not self._link.is_cut():
            await self._stream(pv)
        return now_ns

    def _glimpse(self, picture: Picture) -> None:
        """What the gate sees while it writes is judged like any other picture."""
        self._witness.see(picture)
        if self._is_watching:
            self._watch.take(picture)

    def _is_ours(self, picture: Picture) -> bool:
        if not self._holds(picture):
            self._watch.trouble(self._overwritten(picture))
            return False
        self.gate.look(picture)
        return True

    # PV.

    def _process(self, seed: int) -> Rig | None:
        spec = self._scenario.plant
        return None if spec is None else make_rig(self._loop, spec, random.Random(seed))

    def _reading(self) -> float:
        """PV as the sensor would show it now; without a process, as the scenario sets it."""
        shown = float(self._scenario.initial.get(self._pv, 0.0)) if self._rig is None else self._rig.reading()
        limit = self._loop.writes[self._pv]
        assert limit.minimum is not None
        assert limit.maximum is not None
        # A sensor ends where its register's limits do.
        return min(max(shown, limit.minimum), limit.maximum)

    async def _stream(self, value: float) -> None:
        self._stands = {self._pv: await self.gate.stream(self._pv, value, self._stands)}

    def _holds(self, picture: Picture) -> bool:
        return tuple(picture.words[self._pv]) == tuple(self._stands[self._pv])

    def _overwritten(self, picture: Picture) -> str:
        return (
            f"{self._pv} at {self._loop.bindings[self._pv]} holds {list(picture.words[self._pv])}, "
            f"{list(self._stands[self._pv])} was written: the PLC program or another master writes it too"
        )


def allowed_loop(station: Station, scenario: Scenario, name: str = "") -> Loop:
    """Return the loop of a real bench for a scenario, once everything that it will write is known to be allowed.

    Raises:
        StateError: It cannot run on a real PLC, or the profile does not let something be written.
    """
    refused = only_virtual(scenario)
    if refused:
        raise StateError(f"scenario {scenario.name}: {refused}", hint="it runs on `--target fake://PROFILE`")
    loop = believed(loop_for(station, scenario.controller.name, name), scenario)
    _check_allowed(station, loop, scenario)
    return loop


def _starting(loop: Loop, scenario: Scenario) -> dict[str, Any]:
    """What the scenario starts with: its own values, and the default of all else that may be written."""
    found: dict[str, Any] = {}
    for row in loop.controller.operands:
        if row.name in loop.controller.roles.pvs or isinstance(loop.bindings[row.name], Const):
            continue
        if row.name in scenario.initial:
            found[row.name] = scenario.initial[row.name]
        elif row.name in loop.writes and row.default is not None and row.access in (Access.IN, Access.IN_OUT):
            found[row.name] = row.default
    return found


def _check_allowed(station: Station, loop: Loop, scenario: Scenario) -> None:
    """Refuse at once what the gate would refuse in the middle.

    Raises:
        StateError: The station is no bench, or its profile does not let something be written.
    """
    if not station.bench:
        raise StateError(
            f'station {station.name} is no bench, and a process is simulated on one of kind = "bench" only',
            hint="never say so of a PLC that a plant hangs on",
        )
    wanted = dict.fromkeys([loop.controller.roles.pvs[0], *scenario.initial])
    for action in scenario.actions:
        wanted |= dict.fromkeys([*action.set, *action.ramp])
    missing = [name for name in wanted if name not in loop.writes and not _stands(loop, scenario, name)]
    if missing:
        raise StateError(
            f"scenario {scenario.name} writes {', '.join(missing)}, which [loops.{loop.name}.write] does not list",
            hint="list each with its limits; those of a bench may be wide, with interval_s = 0.0",
        )


def _stands(loop: Loop, scenario: Scenario, name: str) -> bool:
    """Tell whether an operand is a constant of the program that has the wanted value already."""
    binding = loop.bindings[name]
    if not isinstance(binding, Const) or name not in scenario.initial:
        return False
    kind: Kind = loop.controller.operand(name).kind
    return encode(kind, binding.value) == encode(kind, scenario.initial[name])
