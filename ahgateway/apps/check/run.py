"""Runs one scenario in virtual time: a fake PLC with its plant, a link, a watch.

Each scenario has a fake of its own, so that nothing has to be put back behind it. The time line acts on the fake from
inside, as the rest of a PLC program would: no write of it goes over the link, and the write gate has no part in it.
Pictures are taken over the link like those of any PLC. Time is the fake's; the seed decides the noise, so equal
scenarios give equal words. On a real PLC `live` does the same.
"""

from __future__ import annotations

from collections.abc import AsyncIterator, Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from ahgateway.apps.check.keep import Recordings, kept
from ahgateway.apps.check.result import Floor
from ahgateway.apps.check.watch import CutLink, Seen, Watch, believed, loop_for
from ahgateway.apps.check.wires import Wire, memory
from ahgateway.clock import MILLISECOND, SECOND, Clock, VirtualClock
from ahgateway.codec.station import FakeLoop, Loop, Station
from ahgateway.fake.plc import FakePlc
from ahgateway.lockstep.follow import cycle_ns
from ahgateway.lockstep.picture import Picture
from ahgateway.schema.scenario import Action, Scenario, baselines

POLLS_PER_CYCLE = 2
POLLS_PER_CALL = 2
"""A block that is called shows less at each call, and is looked at more often."""

RAMP_NS = 50 * MILLISECOND
RETRY_NS = 100 * MILLISECOND
RESTART_NS = SECOND
"""How long a restarted PLC does not answer."""


@dataclass(frozen=True)
class Bench:
    """What scenarios run on.

    Attributes:
        station: What we believe of the PLC: the reference's dialect, and where operands stand.
        fake: What the PLC is; another station than `station` when the two are to be held against each other.
        loop: Loop to use; empty for the first with the scenario's instruction.
        fault: Wrong arithmetic of the PLC (`fake.faults`); None for none.
        scan_ns: Time of one scan of the PLC.
        wire: How the PLC is reached.
        prepare: Called with the PLC before a scenario begins, to break the bench on purpose.
        recordings: Keeps what is seen of each scenario; None keeps nothing.
    """

    station: Station
    fake: Station
    loop: str = ""
    fault: str | None = None
    scan_ns: int = 10 * MILLISECOND
    wire: Wire = memory
    prepare: Callable[[FakePlc], None] | None = None
    recordings: Recordings | None = None

    @property
    def target(self) -> str:
        """What people call the PLC."""
        return self.fake.target

    @property
    def is_repeatable(self) -> bool:
        """True: time is the fake's own."""
        return True

    async def run(self, scenario: Scenario, seed: int, wall: Clock) -> Seen:
        """Run one scenario; see `run`."""
        return await run(scenario, self, seed, wall)

    async def floors(self, scenarios: Sequence[Scenario], seed: int, wall: Clock) -> AsyncIterator[tuple[str, Floor]]:
        """Run a short shipped scenario of each instruction against itself, up to the first that fails."""
        for baseline in baselines(scenarios):
            floor = await floor_of(baseline, self, seed, wall)
            yield baseline.controller.name, floor
            if not floor.is_sound:
                return


async def run(scenario: Scenario, bench: Bench, seed: int, wall: Clock) -> Seen:
    """Run a scenario from its start to its end, to its limit of real time, or until the bench is lost.

    Args:
        scenario: What to do.
        bench: What to do it on.
        seed: Of the noise and of the junk in the system's words.
        wall: Real time, for the limit.

    Raises:
        StateError: The bench has no such loop.
        CodecError: The scenario sets what is a constant of the PLC program.
    """
    clock = VirtualClock()
    loop = believed(loop_for(bench.station, scenario.controller.name, bench.loop), scenario)
    station = replace(bench.station, loops=(loop,))
    plc = _plc(scenario, bench, seed, clock)
    async with bench.wire(plc, clock) as link:
        with kept(bench.recordings, scenario, station, clock) as witness:
            watch = Watch(scenario, station, CutLink(link, clock), clock, sees=witness.see)
            return await _Course(scenario, plc, watch, clock, wall).run()


def _plc(scenario: Scenario, bench: Bench, seed: int, clock: Clock) -> FakePlc:
    own = loop_for(bench.fake, scenario.controller.name, bench.loop)
    plc = FakePlc(
        replace(bench.fake, loops=(own,)),
        {own.name: FakeLoop(scenario.initial, scenario.plant)},
        seed=seed,
        scan_ns=bench.scan_ns,
        clock=clock,
    )
    if bench.fault is not None:
        plc.fail(own.name, bench.fault)
    if bench.prepare is not None:
        bench.prepare(plc)
    return plc


def pause_ns(scenario: Scenario, loop: Loop, picture: Picture, scan_ns: int) -> int:
    """Return the time from one picture to the next, a whole number of scans."""
    if scenario.expect.fresh_pv:
        return scan_ns
    count = POLLS_PER_CYCLE if loop.controller.begin is None else POLLS_PER_CALL
    return max(cycle_ns(loop, picture) // count // scan_ns, 1) * scan_ns


class _Course:
    """One scenario under way."""

    def __init__(self, scenario: Scenario, plc: FakePlc, watch: Watch, clock: Clock, wall: Clock) -> None:
        self._scenario = scenario
        self._plc = plc
        self._watch = watch
        self._clock = clock
        self._wall = wall
        self._name = next(iter(plc.items))
        self._end_ns = round(scenario.duration_s * SECOND)
        for action in scenario.actions:
            self._schedule(action)

    async def run(self) -> Seen:
        """Take pictures until the end."""
        watch = self._watch
        begun_ns = self._wall.now_ns()
        limit_ns = round(self._scenario.limit_s * SECOND)
        is_first = True
        while (now_ns := self._clock.now_ns()) < self._end_ns:
            if self._wall.now_ns() - begun_ns > limit_ns:
                watch.trouble(f"the limit of {self._scenario.limit_s:g} s of real time is over")
                break
            picture = await watch.look()
            if picture is not None:
                if is_first and watch.is_wrong(picture):
                    break
                is_first = False
                watch.take(picture)
            elif watch.is_lost:
                break
            await self._clock.sleep_ns(min(self._pause_ns(picture), self._end_ns - now_ns))
        return watch.done()

    def _pause_ns(self, picture: Picture | None) -> int:
        if picture is None:
            return RETRY_NS
        return pause_ns(self._scenario, self._watch.seen.loop, picture, self._plc.scan_ns)

    # The time line.

    def _schedule(self, action: Action) -> None:
        at_ns = round(action.at_s * SECOND)
        until_ns = None if action.until_s is None else round(action.until_s * SECOND)
        if action.set:
            self._plc.at(at_ns, partial(self._set, action.set))
        for operand, target in action.ramp.items():
            assert until_ns is not None, "the schema asks for the end of a ramp"
            self._plc.at(at_ns, partial(self._begin_ramp, operand, target, at_ns, until_ns))
        if action.holds_pv:
            self._plc.at(at_ns, partial(self._freeze, True))
            if until_ns is not None and not action.ramp:
                self._plc.at(until_ns, partial(self._freeze, False))
        if action.load is not None:
            self._plc.at(at_ns, partial(self._load, action.load))
            if until_ns is not None:
                self._plc.at(until_ns, partial(self._load, 0.0))
        self._schedule_deed(action, at_ns, until_ns)

    def _schedule_deed(self, action: Action, at_ns: int, until_ns: int | None) -> None:
        if action.do == "stop":
            self._plc.at(at_ns, FakePlc.stop)
            if until_ns is not None:
                self._plc.at(until_ns, FakePlc.run)
            self._watch.stops.append((action.at_s, float("inf") if action.until_s is None else action.until_s))
        elif action.do == "restart":
            self._plc.at(at_ns, lambda plc: plc.restart(is_retained=True))
            # No picture may straddle it.
            self._watch.link.cuts.append((at_ns - self._plc.scan_ns, at_ns + RESTART_NS))
        elif action.do == "link-down":
            assert until_ns is not None, "the schema asks for the end of a cut"
            self._watch.link.cuts.append((at_ns, until_ns))

    def _set(self, values: Mapping[str, Any], plc: FakePlc) -> None:
        for operand, value in values.items():
            plc.write(self._name, operand, value, who="scenario")

    def _freeze(self, is_frozen: bool, plc: FakePlc) -> None:
        """The sensor stands still; without a plant it always does."""
        if self._name in plc.processes:
            plc.freeze_pv(self._name, is_frozen)

    def _load(self, load: float, plc: FakePlc) -> None:
        plc.processes[self._name].rig.load = load

    def _begin_ramp(self, operand: str, target: float, at_ns: int, until_ns: int, plc: FakePlc) -> None:
        first = float(plc.read(self._name, operand))
        count = max(1, -(-(until_ns - at_ns) // RAMP_NS))
        for number in range(1, count + 1):
            value = first + (target - first) * number / count
            when_ns = at_ns + (until_ns - at_ns) * number // count
            plc.at(when_ns, partial(self._set, {operand: value}))


async def floor_of(scenario: Scenario, bench: Bench, seed: int, wall: Clock) -> Floor:
    """Run a scenario twice on a healthy PLC like the one that we believe in, with one seed, and compare everything.

    Any difference between the two, any divergence of either, any lost reply condemns the bench.
    """
    healthy = replace(bench, fake=bench.station, fault=None, recordings=None)
    first, second = [await run(scenario, healthy, seed, wall) for _ in range(2)]
    for each in (first, second):
        if each.troubles:
            return Floor(False, each.troubles[0].text)
        if each.counts.diverged:
            return Floor(False, f"{each.counts.diverged} executions of the reference diverged from itself")
    if not first.counts.informative:
        return Floor(False, "the bench saw no execution that proves anything")
    noise = _apart(first, second)
    if first.digests != second.digests:
        return Floor(False, f"two equal runs differ, by {noise:.3g} of MV", noise, first.counts.compared)
    count = first.counts.compared + second.counts.compared
    return Floor(True, f"{count} executions of the reference against itself agree by bits", noise, count)


def _apart(first: Seen, second: Seen) -> float:
    pairs = zip(first.moments, second.moments, strict=False)
    return max((abs(a.mv - b.mv) for a, b in pairs), default=0.0)
