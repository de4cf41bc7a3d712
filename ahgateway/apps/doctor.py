"""Is this laptop, this line, this PLC good enough for what the profile asks? Measured, not assumed; nothing is written.

The line is measured with the profile's own requests: how long each takes against the least that the wire allows, how
long a picture of each loop takes, and whether that is quick enough for the loop's CYCLE. This file judges; it prints
nothing.
"""

from __future__ import annotations

from collections.abc import AsyncIterator
from dataclasses import dataclass, field
from enum import Enum
from statistics import median

from ahgateway.clock import MILLISECOND, SECOND, Clock
from ahgateway.codec.access import Read, Table
from ahgateway.codec.can_cycle import MICROSECOND
from ahgateway.codec.station import Loop, Station
from ahgateway.errors import AhGatewayError, LinkError, PlcRefusedError, TransportError
from ahgateway.lockstep.follow import cycle_ns
from ahgateway.lockstep.picture import Sampler, picture_plan
from ahgateway.transports.adapter import LATENCY_MS_GOOD, adapter_of, adapters
from ahgateway.transports.base import Link, LinkFigures
from ahgateway.transports.floor import floor_ns, round_trip_floor_ns
from ahgateway.transports.line import Line, open_port
from ahgateway.transports.uri import Target, line_of, parse_uri

ROUNDS = 30
BUDGET_NS = 10 * SECOND
"""So long a loop is measured at most, and so often; two rounds at least."""
SLEEPS = 20
LATE_NS_MAX = 3 * MILLISECOND
UTC_SENSIBLE_NS = 1_735_689_600 * SECOND
"""2025-01-01: a clock before that has not been set."""
SERIAL = ("modbus+rtu", "modbus+ascii")
CYCLES_BAD_MAX = 0.01
"""Share of the cycles of PDOs that may be missed or incomplete before it is said."""


class Outcome(Enum):
    """What a check came to; NOTE is a fact that is neither good nor bad."""

    GOOD = "good"
    NOTE = "note"
    WARN = "warn"
    FAIL = "fail"


@dataclass(frozen=True, slots=True)
class Check:
    """One finding: what was looked at, what was found, what to do."""

    name: str
    outcome: Outcome
    text: str
    hint: str = ""


@dataclass(frozen=True, slots=True)
class RequestTime:
    """One request and how long it took.

    Attributes:
        read: The request.
        floor_ns: The least that the wire allows from the first byte out to the last byte in; None where its speed is
            not known.
        took_ns: Time from the first byte out to the last byte in, each time it was measured.
    """

    read: Read
    floor_ns: int | None
    took_ns: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class LoopTime:
    """How quickly one loop can be looked at.

    Attributes:
        loop: Its name.
        requests: Its distinct requests.
        sent: How many requests one picture takes, those that are sent twice counted twice.
        picture_ns: Median time of a picture; 0 when it was not measured.
        floor_ns: The least time that the wire allows for it, None where not known.
        cycle_ns: The loop's CYCLE, None when it could not be read.
    """

    loop: str
    requests: tuple[RequestTime, ...]
    sent: int
    picture_ns: int = 0
    floor_ns: int | None = None
    cycle_ns: int | None = None


@dataclass(slots=True)
class Findings:
    """Everything that was found, in the order in which it was found."""

    checks: list[Check] = field(default_factory=list)
    loops: list[LoopTime] = field(default_factory=list)

    @property
    def is_good(self) -> bool:
        """True when nothing failed; warnings do not count."""
        return all(check.outcome is not Outcome.FAIL for check in self.checks)

    @property
    def round_ns(self) -> int:
        """Time of one picture of every loop, one after the other: what a monitor needs for one round."""
        return sum(loop.picture_ns for loop in self.loops)


async def check_clock(clock: Clock) -> AsyncIterator[Check]:
    """Look at this machine's clock and at how late it wakes a sleeper."""
    if clock.utc_ns() < UTC_SENSIBLE_NS:
        yield Check("clock", Outcome.WARN, "this machine's date has not been set", "set it: records carry UTC")
    late = []
    for _ in range(SLEEPS):
        due_ns = clock.now_ns() + MILLISECOND
        await clock.sleep_ns(MILLISECOND)
        late.append(clock.now_ns() - due_ns)
    text = f"a sleep of 1 ms ends {median(late) / MILLISECOND:.2f} ms late, at worst {max(late) / MILLISECOND:.2f} ms"
    is_late = median(late) > LATE_NS_MAX
    hint = "close other programs, and leave the laptop's power saving: pauses between requests get longer"
    yield Check("clock", Outcome.WARN if is_late else Outcome.GOOD, text, hint if is_late else "")


def check_ports() -> list[Check]:
    """List the serial ports of this machine with their adapters; nothing is opened."""
    found = adapters()
    if not found:
        return [Check("ports", Outcome.NOTE, "this machine has no serial port")]
    return [check for each in found for check in check_adapter(each.port)]


def check_adapter(port: str) -> list[Check]:
    """Look at the adapter behind a port and at its latency timer."""
    if "://" in port:
        return [Check("adapter", Outcome.NOTE, f"{port} is a port of another computer")]
    adapter = adapter_of(port)
    driver = f", driver {adapter.driver}" if adapter.driver else ""
    checks = [Check("adapter", Outcome.NOTE, f"{adapter.port}: {adapter.product}{driver}")]
    if adapter.latency_ms is not None:
        is_good = adapter.latency_ms <= LATENCY_MS_GOOD
        text = f"{adapter.port}: the adapter keeps bytes back for up to {adapter.latency_ms} ms"
        hint = "" if is_good else f"echo {LATENCY_MS_GOOD} | sudo tee {adapter.timer_file}"
        checks.append(Check("latency timer", Outcome.GOOD if is_good else Outcome.WARN, text, hint))
    return checks


def check_port(line: Line) -> list[Check]:
    """Open a serial port and close it again: is it there, may we have it, is it free?"""
    try:
        open_port(line).close()
    except LinkError as error:
        return [Check("port", Outcome.FAIL, error.message, error.hint or "")]
    return [Check("port", Outcome.GOOD, f"{line} can be opened"), *check_adapter(line.port)]


def line_behind(target: Target) -> Line | None:
    """Return the serial line of a target, None where it has none that we know the speed of."""
    return line_of(target) if target.scheme in SERIAL else None


async def check_answer(link: Link, unit: int) -> Check:
    """Ask one unit for one register: any answer will do, a refusal too."""
    try:
        await link.exchange(Read(unit, Table.HOLDING, 0, 1))
    except PlcRefusedError as error:
        return Check("answer", Outcome.GOOD, f"unit {unit} answers (it refused: exception {error.code:02d})")
    except TransportError as error:
        return Check("answer", Outcome.FAIL, error.message, error.hint or "")
    return Check("answer", Outcome.GOOD, f"unit {unit} answers")


async def measure(station: Station, loop: Loop, link: Link, clock: Clock) -> tuple[LoopTime, list[Check]]:
    """Measure one loop's requests and judge nothing but whether they are answered."""
    target = parse_uri(station.target)
    line = line_behind(target)
    requests = picture_plan(loop, station).requests
    is_rtu = target.scheme == SERIAL[0]
    floors = {read: None if line is None else round_trip_floor_ns(read, line, is_rtu=is_rtu) for read in requests}
    took: dict[Read, list[int]] = {read: [] for read in requests}
    pictures: list[int] = []
    ends_ns = clock.now_ns() + BUDGET_NS
    try:
        cycle = await _cycle_ns(station, loop, link, clock)
        while len(pictures) < ROUNDS and (len(pictures) < 2 or clock.now_ns() < ends_ns):
            started_ns = clock.now_ns()
            for read in requests:
                reply = await link.exchange(read)
                took[read].append(reply.last_ns - reply.sent_ns)
            if link.figures.cycles is not None and station.can is not None:
                # Answers come from the last cycle at once; there is one picture a SYNC and no more.
                await clock.sleep_ns(station.can.sync.period_us * MICROSECOND)
            pictures.append(clock.now_ns() - started_ns)
    except AhGatewayError as error:
        times = tuple(RequestTime(read, floors[read], tuple(each)) for read, each in took.items())
        failed = Check(f"loop {loop.name}", Outcome.FAIL, error.message, error.hint or "")
        return LoopTime(loop.name, times, len(requests)), [failed]
    times = tuple(RequestTime(read, floors[read], tuple(each)) for read, each in took.items())
    least = None if line is None else sum(floor_ns(read, line, is_rtu=is_rtu) for read in requests)
    return LoopTime(loop.name, times, len(requests), round(median(pictures)), least, cycle), []


def check_cycles(figures: LinkFigures) -> list[Check]:
    """Say how regularly SYNC and the PDOs behind it came, and ours left; nothing on a link without PDOs."""
    cycles = figures.cycles
    if cycles is None or not cycles.syncs:
        return []
    closed = cycles.complete + cycles.incomplete + cycles.contradicted
    bad = cycles.syncs_missed + closed - cycles.complete
    text = (
        f"{cycles.syncs} SYNC, at worst {cycles.jitter_ns_max / MILLISECOND:.2f} ms off their period, "
        f"{cycles.syncs_missed} missed; {cycles.complete} of {closed} cycles complete, {cycles.late} PDOs outside "
        "their window"
    )
    if cycles.sent:
        text += f"; PDOs of ours leave within {cycles.sent_jitter_ns / MILLISECOND:.2f} ms of each other behind SYNC"
    if bad <= CYCLES_BAD_MAX * cycles.syncs:
        return [Check("cycles", Outcome.GOOD, text)]
    hint = "the load of the bus, period_ms and window_ms of the profile, another program on this computer"
    return [Check("cycles", Outcome.WARN, text, hint)]


async def _cycle_ns(station: Station, loop: Loop, link: Link, clock: Clock) -> int | None:
    picture = await Sampler(loop, station, link, clock).picture()
    return None if picture is None else round(cycle_ns(loop, picture), -3)  # the sampling time is a REAL


def judge(found: Findings) -> list[Check]:
    """Say of every measured loop whether its executions can be followed, all loops being polled in turn.

    An execution that falls into a picture tears it; then it is taken again. So a round and one picture more must fit
    into CYCLE, or executions are missed now and then; when a picture alone does not fit, none can be seen at all.
    """
    checks = []
    for loop in found.loops:
        if not loop.picture_ns:
            continue
        name, picture_ms = f"loop {loop.loop}", loop.picture_ns / MILLISECOND
        taken = f"{loop.sent} request{'s' if loop.sent != 1 else ''} a picture, {picture_ms:.1f} ms"
        if loop.cycle_ns is None:
            checks.append(Check(name, Outcome.FAIL, f"{taken}; an execution falls into every picture", HINT))
            continue
        cycle_ms = loop.cycle_ns / MILLISECOND
        least_ms = (found.round_ns + (loop.picture_ns if loop.sent > 1 else 0)) / MILLISECOND
        text = f"{taken}; CYCLE {cycle_ms:g} ms, a round of all loops {found.round_ns / MILLISECOND:.1f} ms"
        if least_ms <= cycle_ms:
            checks.append(Check(name, Outcome.GOOD, f"{text}: every execution can be seen"))
        elif picture_ms < cycle_ms:
            checks.append(Check(name, Outcome.WARN, f"{text}: executions will be missed", HINT))
        else:
            checks.append(Check(name, Outcome.FAIL, f"{text}: no execution can be followed", HINT))
    return checks


HINT = (
    "fewer loops in the profile, a faster line, the latency timer, operands closer together, "
    "what never changes as const, a longer CYCLE"
)
