"""What is seen of a loop while a scenario runs: pictures, what the follower makes of them, troubles of the bench.

Nothing here knows whether time is virtual, or how the time line acts: the fake's course and that of a real PLC look
through the same eyes, so that a scenario means the same on both.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ahgateway.apps.check.result import Trouble
from ahgateway.clock import SECOND, Clock
from ahgateway.codec.access import Request
from ahgateway.codec.station import Const, Loop, Station, Tolerance
from ahgateway.codec.words import encode
from ahgateway.core.operands import Access
from ahgateway.core.verdict import Counts
from ahgateway.errors import LinkError, PlcRefusedError, StateError, TransportError
from ahgateway.lockstep.events import Finding
from ahgateway.lockstep.follow import (
    ALL_ZERO,
    NO_EXECUTION,
    Follower,
    cycle_ns,
    output_of,
    process_value_of,
    target_of,
)
from ahgateway.lockstep.judge import Execution
from ahgateway.lockstep.picture import Picture, Sampler, Sees
from ahgateway.schema.scenario import Scenario
from ahgateway.transports.base import Link, LinkFigures, Reply

UNREACHABLE_MAX = 20
"""After so many silent tries in a row that the scenario did not ask for, it is ended."""

STOP_GRACE_S = 1.0
"""How long behind a STOP that the scenario asked for its traces are no trouble."""


@dataclass(frozen=True, slots=True)
class Moment:
    """A picture, when it was taken in s from the start, and what the follower made of it.

    Attributes:
        t_s: When.
        picture: The picture.
        executions: What happened since the one before.
        sv: Target value.
        pv: Process value as the instruction uses it.
        mv: Output.
    """

    t_s: float
    picture: Picture
    executions: tuple[Execution, ...]
    sv: float
    pv: float
    mv: float


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
        simulated_s: Time that passed in the PLC.
        pace: How well a real PLC was kept pace with, one sentence; empty in virtual time.
    """

    loop: Loop
    moments: list[Moment] = field(default_factory=list)
    counts: Counts = field(default_factory=Counts)
    troubles: list[Trouble] = field(default_factory=list)
    digests: list[int] = field(default_factory=list)
    link_up_s: list[float] = field(default_factory=list)
    simulated_s: float = 0.0
    pace: Mapping[str, float] = field(default_factory=dict)


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


def believed(loop: Loop, scenario: Scenario) -> Loop:
    """Return the loop with the scenario's own tolerance: what a profile tolerates is not what a check does."""
    expect = scenario.expect
    limits = {"ulp": Tolerance(ulp_max=expect.ulp_max), "tolerance": Tolerance(mv_max=expect.mv_max)}
    return replace(loop, tolerance=limits.get(expect.shadow, Tolerance()))


class Watch:
    """Takes and judges the pictures of one scenario.

    Args:
        scenario: What is run.
        station: What we believe of the PLC; its only loop is the scenario's.
        link: The way there.
        clock: Whose time the pictures carry.
        origin_ns: When the scenario began.
        sees: Shown every picture.

    Attributes:
        seen: Everything so far.
        stops: STOPs that the scenario asked for, from and until, in s.
        link: The way there, and when it is cut.
    """

    def __init__(
        self,
        scenario: Scenario,
        station: Station,
        link: CutLink,
        clock: Clock,
        origin_ns: int = 0,
        sees: Sees | None = None,
    ) -> None:
        loop = station.loops[0]
        self.seen = Seen(loop)
        self.stops: list[tuple[float, float]] = []
        self.origin_ns = origin_ns
        self._scenario = scenario
        self.link = link
        self._clock = clock
        self._sampler = Sampler(loop, station, link, clock, sees)
        self._follower = Follower(loop)
        self._silent = 0
        self._last_ns: int | None = None

    @property
    def is_lost(self) -> bool:
        """True when the PLC has been silent for too long."""
        return self._silent > UNREACHABLE_MAX

    def now_s(self) -> float:
        """Return the time since the scenario began."""
        return (self._clock.now_ns() - self.origin_ns) / SECOND

    async def look(self) -> Picture | None:
        """Take a picture; None, with the bench's trouble noted, when there is none to be had."""
        try:
            picture = await self._sampler.picture()
        except TransportError as error:
            if self.link.is_cut():
                self._silent = 0
            else:
                self._silent += 1
                self.trouble(f"link down: {error.message}")
            return None
        except PlcRefusedError as error:
            self._silent += 1
            self.trouble(f"the PLC refuses: {error.message}")
            return None
        self._silent = 0
        if picture is None:
            self.trouble("an execution falls into every picture: the line is too slow")
        return picture

    def take(self, picture: Picture) -> tuple[Execution, ...]:
        """Judge a picture and keep it; return the executions behind it."""
        t_s = (picture.last_ns - self.origin_ns) / SECOND
        before = self._follower.picture
        loop = self.seen.loop
        if self._was_cut(picture):
            assert self._last_ns is not None
            self._follower.lost((picture.last_ns - self._last_ns) / cycle_ns(loop, picture))
            self.seen.link_up_s.append(t_s)
            before = None
        events = self._follower.see(picture)
        self._last_ns = picture.last_ns
        for event in events:
            if isinstance(event, Finding) and not event.is_over:
                self._found(event, t_s)
        if picture.running is False and not self._is_stopped(t_s):
            self.trouble("the PLC is in STOP, and the scenario did not ask for it")
        if before is not None and left_by(before) != left_by(picture):
            self.seen.digests.append(zlib.crc32(left_by(picture)))
        executions = tuple(each for each in events if isinstance(each, Execution))
        values = (target_of(loop, picture), process_value_of(loop, picture), output_of(loop, picture))
        self.seen.moments.append(Moment(t_s, picture, executions, *(float(each) for each in values)))
        return executions

    def _was_cut(self, picture: Picture) -> bool:
        last_ns = self._last_ns
        return last_ns is not None and any(begin < picture.last_ns and last_ns < end for begin, end in self.link.cuts)

    def _is_stopped(self, t_s: float) -> bool:
        return any(begin <= t_s <= end + STOP_GRACE_S for begin, end in self.stops)

    def _found(self, finding: Finding, t_s: float) -> None:
        if finding.name == ALL_ZERO or (finding.name == NO_EXECUTION and not self._is_stopped(t_s)):
            self.trouble(finding.text)

    def is_wrong(self, picture: Picture) -> bool:
        """Prove by the first picture that what is read is what the scenario started with: the right PLC, the right map.

        A profile that looks elsewhere shows itself here, before anything can be taken for the product's fault.
        """
        loop = self.seen.loop
        for name, value in self._scenario.initial.items():
            row = self._scenario.controller.operand(name)
            binding = loop.bindings[name]
            if row.access is not Access.IN or name in loop.controller.roles.pvs or isinstance(binding, Const):
                continue
            wanted = (int(value),) if not row.words else encode(row.kind, value)
            if tuple(picture.words[name]) != tuple(wanted):
                self.trouble(
                    f"{name} at {binding} reads {list(picture.words[name])}, {list(wanted)} was set: wrong profile"
                )
                return True
        return False

    def trouble(self, text: str) -> None:
        """Note what is wrong with the bench; the same words once."""
        if all(each.text != text for each in self.seen.troubles):
            self.seen.troubles.append(Trouble(self.now_s(), text))

    def trouble_first(self, text: str) -> None:
        """Note what was wrong with the bench all the time: nothing that was seen is worth anything."""
        self.seen.troubles.insert(0, Trouble(0.0, text))

    def done(self) -> Seen:
        """Return everything that was seen, counted."""
        self.seen.counts = self._follower.summary()
        self.seen.simulated_s = self.now_s()
        return self.seen


def left_by(picture: Picture) -> bytes:
    """Return the words that the instruction is known to write, as bytes, bits kept."""
    return b"".join(_packed(value) for value in picture.seen.values())


def _packed(value: Any) -> bytes:
    return value.tobytes() if isinstance(value, np.floating) else struct.pack("<i", int(value))
