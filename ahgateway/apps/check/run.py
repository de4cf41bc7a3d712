"""Runs one scenario in virtual time: a fake PLC with its plant, a link, a follower; everything seen is kept.

Each scenario has a fake of its own, so that nothing has to be put back behind it. The time line acts on the fake from
inside, as the rest of a PLC program would: no write of it goes over the link, and the write gate has no part in it.
Pictures are taken over the link like those of any PLC. Time is the fake's; the seed decides the noise, so equal
scenarios give equal words.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from ahgateway.apps.check.result import Trouble
from ahgateway.apps.check.wires import Wire, memory
from ahgateway.clock import MILLISECOND, SECOND, Clock, VirtualClock
from ahgateway.codec.access import Request
from ahgateway.codec.station import Const, FakeLoop, Loop, Station, Tolerance
from ahgateway.codec.words import encode
from ahgateway.core.operands import Access
from ahgateway.core.verdict import Counts
from ahgateway.errors import LinkError, PlcRefusedError, StateError, TransportError
from ahgateway.fake.plc import FakePlc
from ahgateway.lockstep.events import Finding
from ahgateway.lockstep.follow import ALL_ZERO, NO_EXECUTION, Follower, cycle_ns
from ahgateway.lockstep.judge import Execution
from ahgateway.lockstep.picture import Picture, Sampler
from ahgateway.schema.scenario import Action, Scenario
from ahgateway.transports.base import Link, LinkFigures, Reply

POLLS_PER_CYCLE = 2
RAMP_NS = 50 * MILLISECOND
RETRY_NS = 100 * MILLISECOND
RESTART_NS = SECOND
"""How long a restarted PLC does not answer."""

UNREACHABLE_MAX = 20
"""After so many silent tries in a row that the scenario did not ask for, it is ended."""


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
    """

    station: Station
    fake: Station
    loop: str = ""
    fault: str | None = None
    scan_ns: int = 10 * MILLISECOND
    wire: Wire = memory
    prepare: Callable[[FakePlc], None] | None = None


@dataclass(frozen=True, slots=True)
class Moment:
    """A picture, when it was taken in s from the start, and what the follower made of it."""

    t_s: float
    picture: Picture
    executions: tuple[Execution, ...]


@dataclass
class Seen:
    """Everything that was seen of one scenario.

    Attributes:
        loop: The loop, with the scenario's tolerance.
        moments: Pictures in order.
        counts: Executions by verdict.
        troubles: What was wrong with the bench.
        digests: CRC32 of the words that each execution left.
        link_up_s: When a link that the scenario cut answered again.
    """

    loop: Loop
    moments: list[Moment] = field(default_factory=list)
    counts: Counts = field(default_factory=Counts)
    troubles: list[Trouble] = field(default_factory=list)
    digests: list[int] = field(default_factory=list)
    link_up_s: list[float] = field(default_factory=list)
    simulated_s: float = 0.0


class CutLink:
    """A link that is silent while the scenario says so."""

    def __init__(self, link: Link, clock: Clock) -> None:
        self.target = link.target
        self.figures: LinkFigures = link.figures
        self.cuts: list[tuple[int, int]] = []
        self._link = link
        self._clock = clock

    def is_cut(self) -> bool:
        """Tell whether the link is silent now."""
        now_ns = self._clock.now_ns()
        return any(begin <= now_ns < end for begin, end in self.cuts)

    async def exchange(self, request: Request) -> Reply:
        if self.is_cut():
            raise LinkError(f"{self.target}: cut by the scenario")
        return await self._link.exchange(request)

    async def close(self) -> None:
        await self._link.close()


def loop_for(station: Station, instruction: str, name: str = "") -> Loop:
    """Return the loop of a station that a scenario for this instruction uses.

    Raises:
        StateError: There is none.
    """
    fitting = [loop for loop in station.loops if loop.controller.name == instruction]
    if name:
        fitting = [loop for loop in fitting if loop.name == name]
    if not fitting:
        has = ", ".join(f"{loop.name} ({loop.controller.name})" for loop in station.loops)
        what = f"loop `{name}` with {instruction}" if name else f"loop with {instruction}"
        raise StateError(f"station {station.name} has no {what}, it has {has}", hint="name another --profile")
    return fitting[0]


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
    loop = _believed(loop_for(bench.station, scenario.controller.name, bench.loop), scenario)
    station = replace(bench.station, loops=(loop,))
    plc = _plc(scenario, bench, seed, clock)
    async with bench.wire(plc, clock) as link:
        return await _Course(scenario, station, loop, plc, CutLink(link, clock), clock, wall).run()


def _believed(loop: Loop, scenario: Scenario) -> Loop:
    """The loop with the scenario's own tolerance: what a profile tolerates is not what a check does."""
    expect = scenario.expect
    limits = {"ulp": Tolerance(ulp_max=expect.ulp_max), "tolerance": Tolerance(mv_max=expect.mv_max)}
    return replace(loop, tolerance=limits.get(expect.shadow, Tolerance()))


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


class _Course:
    """One scenario under way."""

    def __init__(
        self, scenario: Scenario, station: Station, loop: Loop, plc: FakePlc, link: CutLink, clock: Clock, wall: Clock
    ) -> None:
        self._scenario = scenario
        self._plc = plc
        self._link = link
        self._clock = clock
        self._wall = wall
        self._sampler = Sampler(loop, station, link, clock)
        self._follower = Follower(loop)
        self._seen = Seen(loop)
        self._stops: list[tuple[float, float]] = []
        self._silent = 0
        self._name = next(iter(plc.items))
        self._end_ns = round(scenario.duration_s * SECOND)
        for action in scenario.actions:
            self._schedule(action)

    async def run(self) -> Seen:
        """Take pictures until the end."""
        begun_ns = self._wall.now_ns()
        limit_ns = round(self._scenario.limit_s * SECOND)
        is_first = True
        while (now_ns := self._clock.now_ns()) < self._end_ns:
            if self._wall.now_ns() - begun_ns > limit_ns:
                self._trouble(f"the limit of {self._scenario.limit_s:g} s of real time is over")
                break
            picture = await self._picture()
            if picture is not None:
                if is_first and self._is_wrong(picture):
                    break
                is_first = False
                self._take(picture)
            elif self._silent > UNREACHABLE_MAX:
                break
            await self._clock.sleep_ns(min(self._pause_ns(picture), self._end_ns - now_ns))
        self._seen.counts = self._follower.summary()
        self._seen.simulated_s = self._clock.now_ns() / SECOND
        return self._seen

    # The time line.

    def _schedule(self, action: Action) -> None:
        at_ns = round(action.at_s * SECOND)
        until_ns = None if action.until_s is None else round(action.until_s * SECOND)
        if action.set:
            self._plc.at(at_ns, partial(self._set, action.set))
        for operand, target in action.ramp.items():
            assert until_ns is not None, "the schema asks for the end of a ramp"
            self._plc.at(at_ns, partial(self._begin_ramp, operand, target, at_ns, until_ns))
        if "PV" in action.set and until_ns is not None:
            self._plc.at(until_ns, partial(self._freeze, False))
        if action.do == "freeze-pv":
            self._plc.at(at_ns, partial(self._freeze, True))
            if until_ns is not None:
                self._plc.at(until_ns, partial(self._freeze, False))
        elif action.do == "stop":
            self._plc.at(at_ns, FakePlc.stop)
            if until_ns is not None:
                self._plc.at(until_ns, FakePlc.run)
            self._stops.append((action.at_s, float("inf") if action.until_s is None else action.until_s))
        elif action.do == "restart":
            self._plc.at(at_ns, lambda plc: plc.restart(is_retained=True))
            # No picture may straddle it.
            self._link.cuts.append((at_ns - self._plc.scan_ns, at_ns + RESTART_NS))
        elif action.do == "link-down":
            assert until_ns is not None, "the schema asks for the end of a cut"
            self._link.cuts.append((at_ns, until_ns))

    def _set(self, values: Mapping[str, Any], plc: FakePlc) -> None:
        for operand, value in values.items():
            if operand == "PV":
                self._freeze(True, plc)
            plc.write(self._name, operand, value, who="scenario")

    def _freeze(self, is_frozen: bool, plc: FakePlc) -> None:
        """The sensor stands still; without a plant it always does."""
        if self._name in plc.processes:
            plc.freeze_pv(self._name, is_frozen)

    def _begin_ramp(self, operand: str, target: float, at_ns: int, until_ns: int, plc: FakePlc) -> None:
        first = float(plc.read(self._name, operand))
        count = max(1, -(-(until_ns - at_ns) // RAMP_NS))
        for number in range(1, count + 1):
            value = first + (target - first) * number / count
            when_ns = at_ns + (until_ns - at_ns) * number // count
            plc.at(when_ns, partial(self._set, {operand: value}))

    # What is seen.

    async def _picture(self) -> Picture | None:
        try:
            picture = await self._sampler.picture()
        except TransportError as error:
            if self._link.is_cut():
                self._silent = 0
            else:
                self._silent += 1
                self._trouble(f"link down: {error.message}")
            return None
        except PlcRefusedError as error:
            self._silent += 1
            self._trouble(f"the PLC refuses: {error.message}")
            return None
        self._silent = 0
        if picture is None:
            self._trouble("an execution falls into every picture: the line is too slow")
        return picture

    def _pause_ns(self, picture: Picture | None) -> int:
        if picture is None:
            return RETRY_NS
        scan_ns = self._plc.scan_ns
        if self._scenario.expect.fresh_pv:
            return scan_ns
        return max(cycle_ns(self._seen.loop, picture) // POLLS_PER_CYCLE // scan_ns, 1) * scan_ns

    def _take(self, picture: Picture) -> None:
        t_s = picture.last_ns / SECOND
        before = self._follower.picture
        moments = self._seen.moments
        gap_ns = picture.last_ns - round(moments[-1].t_s * SECOND) if moments else 0
        was_cut = any(
            begin < picture.last_ns and moments and moments[-1].t_s * SECOND < end for begin, end in self._link.cuts
        )
        if was_cut:
            self._follower.lost(gap_ns / cycle_ns(self._seen.loop, picture))
            self._seen.link_up_s.append(t_s)
            before = None
        events = self._follower.see(picture)
        for event in events:
            if isinstance(event, Finding) and not event.is_over:
                self._found(event, t_s)
        if picture.running is False and not any(begin <= t_s <= end + 1.0 for begin, end in self._stops):
            self._trouble("the PLC is in STOP, and the scenario did not ask for it")
        if before is not None and left_by(before) != left_by(picture):
            self._seen.digests.append(zlib.crc32(left_by(picture)))
        moments.append(Moment(t_s, picture, tuple(each for each in events if isinstance(each, Execution))))

    def _found(self, finding: Finding, t_s: float) -> None:
        is_stopped = any(begin <= t_s <= end + 1.0 for begin, end in self._stops)
        if finding.name == ALL_ZERO or (finding.name == NO_EXECUTION and not is_stopped):
            self._trouble(finding.text)

    def _is_wrong(self, picture: Picture) -> bool:
        """Prove by the first picture that what is read is what the scenario started with: the right PLC, the right map.

        A profile that looks elsewhere shows itself here, before anything can be taken for the product's fault.
        """
        for name, value in self._scenario.initial.items():
            row = self._scenario.controller.operand(name)
            binding = self._seen.loop.bindings[name]
            if row.access is not Access.IN or name == "PV" or isinstance(binding, Const):
                continue
            wanted = (int(value),) if not row.words else encode(row.kind, value)
            if tuple(picture.words[name]) != tuple(wanted):
                self._trouble(
                    f"{name} at {binding} reads {list(picture.words[name])}, {list(wanted)} was set: wrong profile"
                )
                return True
        return False

    def _trouble(self, text: str) -> None:
        if all(each.text != text for each in self._seen.troubles):
            self._seen.troubles.append(Trouble(self._clock.now_ns() / SECOND, text))


def left_by(picture: Picture) -> bytes:
    """Return the words that the instruction is known to write, as bytes, bits kept."""
    return b"".join(
        value.tobytes() if isinstance(value, np.floating) else struct.pack("<i", int(value))
        for value in picture.seen.values()
    )
