"""One observation of a loop for steps 3 and 4: pictures, what the follower made of them, and what the link did."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from ahgateway.clock import MILLISECOND, SECOND, Clock
from ahgateway.codec.station import Loop, Station
from ahgateway.core.verdict import Counts, Verdict
from ahgateway.errors import PlcRefusedError, TransportError
from ahgateway.lockstep.events import Change, Finding
from ahgateway.lockstep.follow import Event, Follower, cycle_ns, output_of, process_value_of, target_of
from ahgateway.lockstep.judge import Execution
from ahgateway.lockstep.patient import BUSY
from ahgateway.lockstep.picture import Picture, Sampler, Sees
from ahgateway.lockstep.suspects import Suspect
from ahgateway.transports.base import Link

POLLS_PER_CYCLE = 4
POLL_MIN_NS = 5 * MILLISECOND
POLL_MAX_NS = SECOND
RETRY_NS = 200 * MILLISECOND
GIVE_UP_NS = 10 * SECOND


@dataclass(slots=True)
class Observation:
    """What was seen of a loop.

    Attributes:
        pictures: In order of time.
        events: What the follower made of them.
        counts: Executions by verdict, unseen ones included.
        suspects: Causes that explain every divergence, likeliest first.
        busy: How often the PLC answered *busy*.
        outages: Why the link was lost, once for each time.
        refused: Why the loop's registers cannot be read, empty when they can.
        torn: Pictures into which an execution fell.
        diverged: The pictures before and behind each execution that diverged.
    """

    pictures: list[Picture] = field(default_factory=list)
    events: list[Event] = field(default_factory=list)
    counts: Counts = field(default_factory=Counts)
    suspects: tuple[Suspect, ...] = ()
    busy: int = 0
    outages: list[str] = field(default_factory=list)
    refused: str = ""
    torn: int = 0
    diverged: list[tuple[Picture, Picture]] = field(default_factory=list)

    @property
    def executions(self) -> list[Execution]:
        """The executions that were seen."""
        return [event for event in self.events if isinstance(event, Execution)]

    @property
    def changes(self) -> list[Change]:
        """What somebody else changed."""
        return [event for event in self.events if isinstance(event, Change)]

    def found(self, name: str) -> Finding | None:
        """Return the follower's first finding of this name."""
        for event in self.events:
            if isinstance(event, Finding) and event.name == name and not event.is_over:
                return event
        return None

    def trace(self, loop: Loop, points_max: int = 600) -> dict[str, list[float]]:
        """Return time in s, SV, PV and MV for a plot, thinned to `points_max`."""
        return trace(loop, self.pictures, points_max)


def trace(loop: Loop, pictures: Sequence[Picture], points_max: int = 600) -> dict[str, list[float]]:
    """Return time in s from the first picture, SV, PV and MV, thinned to `points_max` points."""
    every = max(1, -(-len(pictures) // points_max))
    kept = pictures[::every]
    start_ns = kept[0].last_ns if kept else 0
    return {
        "t": [(each.last_ns - start_ns) / SECOND for each in kept],
        "SV": [_finite(target_of(loop, each)) for each in kept],
        "PV": [_finite(process_value_of(loop, each)) for each in kept],
        "MV": [_finite(output_of(loop, each)) for each in kept],
    }


def _finite(value: Any) -> float:
    number = float(value)
    return number if abs(number) < float("inf") else 0.0


async def observe(
    station: Station,
    loop: Loop,
    link: Link,
    clock: Clock,
    *,
    executions: int = 50,
    duration_ns: int = 60 * SECOND,
    sees: Sees | None = None,
) -> Observation:
    """Follow a loop until so many executions were seen or the time is over; never raises what the weather does.

    Every picture is shown to `sees`.
    """
    seen, follower = Observation(), Follower(loop)
    sampler = Sampler(loop, station, link, clock, sees)
    started_ns = clock.now_ns()
    down_ns: int | None = None
    counted = 0
    while counted < executions and clock.now_ns() - started_ns < duration_ns:
        begun_ns = clock.now_ns()
        try:
            picture = await sampler.picture()
        except TransportError as error:
            if down_ns is None:
                down_ns = begun_ns
                seen.outages.append(error.message)
            if clock.now_ns() - down_ns > GIVE_UP_NS:
                break
            await clock.sleep_ns(RETRY_NS)
            continue
        except PlcRefusedError as error:
            if error.code != BUSY:
                seen.refused = error.message
                break
            seen.busy += 1
            await clock.sleep_ns(RETRY_NS)
            continue
        if down_ns is not None:
            last = follower.picture
            follower.lost((begun_ns - down_ns) / cycle_ns(loop, last) if last else 0.0)
            down_ns = None
        poll_ns = POLL_MIN_NS
        if picture is not None:
            seen.pictures.append(picture)
            events = follower.see(picture)
            seen.events.extend(events)
            if any(isinstance(event, Execution) and event.verdict is Verdict.DIVERGED for event in events):
                seen.diverged.append((seen.pictures[-2], picture))
            counted += sum(event.count for event in events if isinstance(event, Execution))
            poll_ns = min(max(cycle_ns(loop, picture) // POLLS_PER_CYCLE, POLL_MIN_NS), POLL_MAX_NS)
        await clock.sleep_ns(begun_ns + poll_ns - clock.now_ns())
    seen.counts, seen.suspects, seen.torn = follower.summary(), follower.suspects, sampler.torn_count
    return seen
