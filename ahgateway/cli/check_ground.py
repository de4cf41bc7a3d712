"""From options to what scenarios run on: a fake in virtual time, or a real bench behind a link, with one owner."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import AsyncIterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ahgateway.apps.check.keep import Recordings
    from ahgateway.apps.check.run import Bench
    from ahgateway.apps.check.suite import Ground
    from ahgateway.codec.station import Station
    from ahgateway.schema.scenario import Scenario
    from ahgateway.transports.uri import Target


@dataclass(frozen=True, slots=True)
class Asked:
    """What was typed of the bench; see the options of `check`."""

    profile: str | None = None
    target: str | None = None
    loop: str = ""
    over: str = "memory"
    is_armed: bool = False
    directory: Path | None = None
    record: Path | None = None


@contextlib.asynccontextmanager
async def ground(asked: Asked) -> AsyncIterator[Ground]:
    """Yield what scenarios run on; a real bench is ours alone until the end, and the link is closed then.

    Raises:
        ProfileError: A file, a target or a wire is wrong, or a real bench is not armed.
        StateError: Another run on this machine has the bench.
    """
    from ahgateway.schema.profile import load
    from ahgateway.schema.scenario import library
    from ahgateway.transports.uri import parse_uri

    shipped = str(library() / "bench.toml")
    station = load(asked.profile or shipped).station()
    wanted = parse_uri(asked.target or station.target)
    if wanted.scheme == "fake":
        yield _virtual(asked, station, wanted, shipped)
        return
    async with _live(asked, station, wanted) as found:
        yield found


def _virtual(asked: Asked, station: Station, wanted: Target, shipped: str) -> Bench:
    from ahgateway.apps.check.run import Bench
    from ahgateway.apps.check.wires import WIRES
    from ahgateway.errors import ProfileError
    from ahgateway.schema.profile import load

    if asked.over not in WIRES:
        raise ProfileError(f"`{asked.over}` is no wire, allowed are {', '.join(WIRES)}", key="--over")
    fake = station if asked.target is None else load(shipped if wanted.path == "bench" else wanted.path).station()
    return Bench(station, fake, asked.loop, wire=WIRES[asked.over], recordings=_recordings(asked))


def _recordings(asked: Asked) -> Recordings | None:
    if asked.record is None:
        return None
    from ahgateway.apps.check.keep import Recordings

    return Recordings(asked.record, " ".join(["ahgateway", *sys.argv[1:]]))


@contextlib.asynccontextmanager
async def _live(asked: Asked, station: Station, wanted: Target) -> AsyncIterator[Ground]:
    from ahgateway.apps.check.live import LiveBench, bench_lease
    from ahgateway.cli.gate_place import gate_directory, who_asks
    from ahgateway.cli.targets import open_target, resolved
    from ahgateway.clock import WallClock
    from ahgateway.errors import ProfileError

    station = resolved(station, wanted.text)
    if not station.bench:
        raise ProfileError(
            f'station {station.name} is no bench; a process is simulated on one of kind = "bench" only',
            file=asked.profile, hint="never say so of a PLC that a plant hangs on",
        )  # fmt: skip
    if not asked.is_armed:
        raise ProfileError(
            f"{wanted.text} is a real PLC: its operands would be set and PV written all the time; nothing was sent",
            hint="--arm does it, within what [loops.TAG.write] allows, and puts everything back",
        )
    if wanted.scheme == "replay":
        raise ProfileError(f"{wanted.text} is a recording, and takes no writes", key="--target")
    who = who_asks(None)
    with gate_directory(station, asked.directory) as folder:
        lease = bench_lease(folder, station.target, who)
        try:
            clock = WallClock()
            async with open_target(station, clock) as link:
                yield LiveBench(station, link, clock, folder, asked.loop, who, _recordings(asked))
        finally:
            lease.release()


def runnable(scenarios: list[Scenario], ground: Ground) -> tuple[list[Scenario], list[tuple[str, str]]]:
    """Return the scenarios that this ground can carry out, and names and reasons of the others."""
    from ahgateway.apps.check.live import only_virtual

    if ground.is_repeatable:
        return scenarios, []
    reasons = [(each, only_virtual(each)) for each in scenarios]
    return [each for each, reason in reasons if not reason], [(each.name, reason) for each, reason in reasons if reason]
