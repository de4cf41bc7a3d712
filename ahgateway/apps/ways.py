"""Which way of seeing executions is possible for each loop on this line, what to expect of it, what to change for more.

Measured, not assumed, where there is something to measure: how long a picture takes, how fast the ring fills, how many
words the line carries. Nothing is written. This file judges; it prints nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median
from typing import Any

from ahgateway.clock import MILLISECOND, SECOND, Clock
from ahgateway.codec.access import Read
from ahgateway.codec.devices import Device
from ahgateway.codec.record_layout import standard
from ahgateway.codec.station import Loop, Station
from ahgateway.codec.ways import Each, Recorder, Way
from ahgateway.lockstep.follow import cycle_ns, is_automatic, output_of
from ahgateway.lockstep.picture import Picture, Sampler
from ahgateway.lockstep.ring import drain_plan
from ahgateway.transports.base import Link

ROUNDS = 5
FILL_NS = SECOND
"""So long is looked at how fast a ring fills."""
NOWHERE = Device("D", 0)


@dataclass(frozen=True, slots=True)
class Coverage:
    """Shares of all executions, 0…1, that are to be expected in each class; together 1.

    Attributes:
        informative: Proven, and another law would have failed.
        trivial: Proven, but at rest, limited or in manual, as the loop stands now.
        unobservable: Not proven, because two explanations are alike in all that is seen.
        lost: Never seen.
    """

    informative: float = 0.0
    trivial: float = 0.0
    unobservable: float = 0.0
    lost: float = 0.0


@dataclass(frozen=True, slots=True)
class WayPlan:
    """One way for one loop.

    Attributes:
        way: The way.
        is_possible: It works as the profile and the line are now.
        coverage: What to expect of it, or would be to expect where it is not possible.
        text: Why, with the figures.
        hint: What to change for it, or for more of it; empty when nothing.
        words_per_s: Words that the line must carry for it; 0 where that is not what limits it.
    """

    way: Way
    is_possible: bool
    coverage: Coverage
    text: str
    hint: str = ""
    words_per_s: float = 0.0


@dataclass(frozen=True, slots=True)
class LoopPlan:
    """Every way for one loop, best first.

    Attributes:
        loop: Its name.
        chosen: How it would be followed now.
        cycle_ns: Its CYCLE, or the interval of its task.
        look_ns: Time from one look at it to the next, when all loops share the line.
        carried_per_s: Words that the line carries in a second.
        ways: In the order of `Way`.
    """

    loop: str
    chosen: Way
    cycle_ns: int
    look_ns: int
    carried_per_s: float
    ways: tuple[WayPlan, ...]


@dataclass(frozen=True, slots=True)
class _Measured:
    loop: Loop
    picture: Picture
    picture_ns: int
    ns_per_word: float
    records_per_s: float
    is_torn: bool

    @property
    def cycle_ns(self) -> int:
        return cycle_ns(self.loop, self.picture)


async def planned(station: Station, link: Link, clock: Clock) -> list[LoopPlan]:
    """Measure the line with the profile's own requests, and plan.

    Raises:
        TransportError: The link failed.
        PlcRefusedError: The PLC refused a request.
    """
    found = [await _measured(loop, station, link, clock) for loop in station.loops]
    round_ns = sum(each.picture_ns for each in found)
    return [_of_loop(each, station, round_ns) for each in found]


async def _measured(loop: Loop, station: Station, link: Link, clock: Clock) -> _Measured:
    sampler = Sampler(loop, station, link, clock)
    took: list[int] = []
    picture: Picture | None = None
    for _ in range(ROUNDS):
        started_ns = clock.now_ns()
        picture = await sampler.picture() or picture
        took.append(clock.now_ns() - started_ns)
    words = sum(read.count for read in sampler.plan.requests)
    per_word = median(took) / words
    rate = 0.0
    if loop.recorder is not None:
        rate, per_word = await _filling(loop, loop.recorder, station, link, clock)
    is_torn = picture is None
    return _Measured(loop, picture or await sampler.glimpse(), round(median(took)), per_word, rate, is_torn)


async def _filling(loop: Loop, layout: Recorder, station: Station, link: Link, clock: Clock) -> tuple[float, float]:
    """Records made in a second, and ns that one word of the ring takes; a ring that stands still makes 0."""
    plan, place = drain_plan(loop, station), station.devices.address(layout.ring)
    request = Read(station.unit, place.table, place.address, plan.slots * layout.length)
    started = await link.exchange(plan.head)
    took: list[int] = []
    seen, last, now_ns = 0, started.values[0], started.last_ns
    while now_ns - started.last_ns < FILL_NS or len(took) < 2:
        await clock.sleep_ns(MILLISECOND)
        before_ns = clock.now_ns()
        await link.exchange(request)
        took.append(clock.now_ns() - before_ns)
        head = await link.exchange(plan.head)
        seen += (head.values[0] - last) % layout.records
        last, now_ns = head.values[0], head.last_ns
    return seen * SECOND / (now_ns - started.last_ns), median(took) / request.count


def _of_loop(found: _Measured, station: Station, round_ns: int) -> LoopPlan:
    loop = found.loop
    wanted_ns = station.pacing.poll_ms * MILLISECOND or min(max(found.cycle_ns // 4, 5 * MILLISECOND), SECOND)
    look_ns = max(round(round_ns / station.pacing.line_share_max), wanted_ns)
    carried = SECOND / found.ns_per_word * station.pacing.line_share_max if found.ns_per_word else 0.0
    ways = (
        _stepped(found, station),
        _recorded(found, station, carried),
        _polled(found, look_ns),
        _counted(found, look_ns),
    )
    chosen = loop.way
    if chosen is Way.POLLED and look_ns >= found.cycle_ns:
        chosen = Way.COUNTED
    return LoopPlan(loop.name, chosen, found.cycle_ns, look_ns, carried, ways)


def _proven(found: _Measured, share: float, *, lost: float = 0.0) -> Coverage:
    """So much proven, split by what the loop does now; the rest is unobservable, but for what is lost."""
    picture, loop = found.picture, found.loop
    limits = [float(getattr(picture.inputs, name)) for name in ("mv_min", "mv_max") if hasattr(picture.inputs, name)]
    mv = float(output_of(loop, picture))
    is_moving = is_automatic(loop, picture) and not (limits and (mv <= min(limits) or mv >= max(limits)))
    rest = max(0.0, 1.0 - share - lost)
    return Coverage(share, 0.0, rest, lost) if is_moving else Coverage(0.0, share, rest, lost)


def _stepped(found: _Measured, station: Station) -> WayPlan:
    loop, missing = found.loop, []
    if loop.trigger is None:
        missing.append(f"[loops.{loop.name}.trigger] in the profile and `plc-code trigger` in the program")
    if not station.bench:
        missing.append('a station of kind = "bench"')
    coverage = _proven(found, 1.0)
    if missing:
        return WayPlan(
            Way.STEPPED, False, coverage, "nothing lets executions through one by one", " and ".join(missing)
        )
    return WayPlan(Way.STEPPED, True, coverage, "each execution is triggered", f"`--arm {loop.name}` asks for it")


def _recorded(found: _Measured, station: Station, carried: float) -> WayPlan:
    loop = found.loop
    layout = loop.recorder
    if layout is None:
        layout = standard(loop, NOWHERE, NOWHERE, 64, Each.SCAN)
    per_s = found.records_per_s or _expected_rate(found, layout)
    need = per_s * layout.length
    share = min(1.0, carried / need) if need else 1.0
    figures = f"{per_s:.3g} records/s of {layout.length} words are {need:.0f} words/s, the line carries {carried:.0f}"
    rest = (
        ""
        if share == 1.0
        else "; record calls of an interval task or changes, leave operands out, or take a faster line"
    )
    if loop.recorder is None:
        hint = f"[loops.{loop.name}.recorder] in the profile and `plc-code recorder` in the program{rest}"
        return WayPlan(Way.RECORDED, False, _proven(found, share, lost=1.0 - share), figures, hint, need)
    if not found.records_per_s and layout.each is not Each.CHANGE:
        return WayPlan(
            Way.RECORDED,
            False,
            Coverage(lost=1.0),
            "the ring stands still",
            "is the snippet in the program, the PLC in RUN?",
        )
    unknown = f"; {', '.join(sorted(layout.unrecorded))} stay unknown between two drains" if layout.unrecorded else ""
    return WayPlan(
        Way.RECORDED,
        share == 1.0,
        _proven(found, share, lost=1.0 - share),
        figures + unknown,
        rest.removeprefix("; "),
        need,
    )


def _expected_rate(found: _Measured, layout: Recorder) -> float:
    """Records in a second, where none can be counted: one per CYCLE in an interval task, else one per longest scan."""
    if found.loop.interval_ms is not None or layout.each is not Each.SCAN:
        return SECOND / found.cycle_ns
    return 1000 / found.loop.scan_ms_max


def _polled(found: _Measured, look_ns: int) -> WayPlan:
    cycle = found.cycle_ns
    figures = f"a look every {look_ns / MILLISECOND:.3g} ms, CYCLE is {cycle / MILLISECOND:.3g} ms"
    slack_ns = found.picture_ns + found.loop.scan_ms_max * MILLISECOND
    if found.is_torn:
        figures += ", and an execution falls into every picture"
    if look_ns >= cycle or found.is_torn:
        return WayPlan(
            Way.POLLED,
            False,
            Coverage(unobservable=1.0),
            f"{figures}: too slow",
            "poll fewer loops on this line, a faster line, or a recorder",
        )
    # Two executions fit into an interval that is longer than CYCLE less what a look and a scan may shift them.
    share = 1.0 if look_ns + slack_ns <= cycle else max(0.0, (cycle - slack_ns) / look_ns)
    hint = "" if share == 1.0 else "a faster line, or a CYCLE of more than twice a look"
    return WayPlan(Way.POLLED, True, _proven(found, min(1.0, share)), figures, hint)


def _counted(found: _Measured, look_ns: int) -> WayPlan:
    per_look = max(1.0, look_ns / found.cycle_ns)
    figures = f"about {per_look:.3g} executions lie between two looks"
    if look_ns < found.cycle_ns:
        return WayPlan(Way.COUNTED, False, Coverage(), "not needed: looks are faster than CYCLE")
    known = found.loop.pv_rate_max == 0 and not found.is_torn
    hint = "" if known else "say `pv_rate_max` when PV can stand still; a counter in the program leaves one count only"
    share = 1.0 if known and per_look <= 12 else 0.0
    return WayPlan(Way.COUNTED, True, _proven(found, share), f"{figures}; proven while PV stands still", hint)


def as_json(plan: LoopPlan) -> dict[str, Any]:
    """Return a loop's plan as one JSON object."""
    return {
        "kind": "plan",
        "loop": plan.loop,
        "way": plan.chosen.value,
        "cycle_s": plan.cycle_ns / SECOND,
        "look_s": plan.look_ns / SECOND,
        "line_words_per_s": round(plan.carried_per_s),
        "ways": [
            {
                "way": each.way.value,
                "possible": each.is_possible,
                "coverage": {
                    "informative": each.coverage.informative, "trivial": each.coverage.trivial,
                    "unobservable": each.coverage.unobservable, "lost": each.coverage.lost,
                },
                "words_per_s": round(each.words_per_s),
                "text": each.text,
                "hint": each.hint,
            }
            for each in plan.ways
        ],
    }  # fmt: skip


def lines(plans: Sequence[LoopPlan]) -> list[str]:
    """Return the plans for people."""
    found = []
    for plan in plans:
        found.append(f"{plan.loop}: CYCLE {plan.cycle_ns / MILLISECOND:g} ms, followed now as `{plan.chosen.value}`")
        for each in plan.ways:
            coverage = each.coverage
            shares = (
                f"informative {coverage.informative:4.0%}  trivial {coverage.trivial:4.0%}  "
                f"unobservable {coverage.unobservable:4.0%}  lost {coverage.lost:4.0%}"
            )
            mark = "possible" if each.is_possible else "not now "
            found.append(f"  {each.way.value:8}  {mark}  {shares}  {each.text}")
            if each.hint:
                found.append(f"            {'more' if each.is_possible else 'needs'}: {each.hint}")
    return found


def is_enough(plans: Sequence[LoopPlan]) -> bool:
    """Tell whether every loop, as it would be followed now, can have something proven."""
    return all(
        any(each.way is plan.chosen and each.coverage.informative + each.coverage.trivial > 0 for each in plan.ways)
        for plan in plans
    )
