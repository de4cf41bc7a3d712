"""From a station to a monitor and its clock: live, or out of a recording when the target is `replay://FILE`."""

from __future__ import annotations

import contextlib
from collections.abc import AsyncIterator
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ahgateway.apps.monitor import Monitor
    from ahgateway.clock import Clock
    from ahgateway.codec.station import Station
    from ahgateway.recording.reader import Recording
    from ahgateway.transports.base import Frame, Tap


class Taps:
    """Hands each frame to everybody who wants it; who wants it may come later than the link."""

    def __init__(self, taps: list[Tap]) -> None:
        self._taps = taps

    def more(self, tap: Tap) -> None:
        """Hand frames to this one too."""
        self._taps.append(tap)

    def __call__(self, frame: Frame) -> None:
        for tap in self._taps:
            tap(frame)


@contextlib.asynccontextmanager
async def followed(
    station: Station, tap: Tap | None = None, *, plays: bool = False
) -> AsyncIterator[tuple[Monitor, Clock]]:
    """Yield a monitor of the station's loops and the clock that it lives by.

    A recording goes as fast as it can, or as its target says; one that `plays` has a player, goes at the speed of the
    time and stays open at its end.

    Raises:
        ProfileError: The target is no legal URI.
        StateError: There is no such recording, or it lacks one of the loops.
    """
    from ahgateway.apps.monitor import Monitor
    from ahgateway.cli.stepping import steps
    from ahgateway.cli.targets import open_target
    from ahgateway.clock import WallClock
    from ahgateway.transports.uri import parse_uri

    target = parse_uri(station.target)
    if target.scheme != "replay":
        wall = WallClock()
        async with open_target(station, wall, tap) as link, steps(station, link, wall) as let_through:
            yield Monitor(station, link, wall, let_through), wall
        return
    from ahgateway.apps.player import Player
    from ahgateway.apps.replay import Replay, ReplayMonitor
    from ahgateway.recording.parts import opened
    from ahgateway.transports.replay import RecordedClock, ReplayLink

    with opened(target.path) as recording:
        speed = float(target.options["speed"]) if "speed" in target.options else (1.0 if plays else None)
        clock = recorded_clock(recording, speed)
        player = None
        if plays and isinstance(clock, RecordedClock) and speed is not None:
            _, _, last_utc_ns = recording.totals()
            first_ns = clock.now_ns()
            last_ns = first_ns if last_utc_ns is None else last_utc_ns - clock.utc_offset_ns
            player = Player(clock, first_ns, last_ns, speed)
        yield ReplayMonitor(Replay(recording, station), ReplayLink(recording, clock), clock, player), clock


def recorded_clock(recording: Recording, speed: float | None) -> Clock:
    """Return a clock that starts with the recording; without a speed it jumps to whatever comes next."""
    from ahgateway.clock import VirtualClock, WallClock
    from ahgateway.transports.replay import RecordedClock

    first = next(recording.rows(), None)
    start_ns, utc_ns = (first.sent_ns, first.utc_ns - (first.last_ns - first.sent_ns)) if first else (0, 0)
    if speed is None:
        return VirtualClock(start_ns, utc_ns)
    return RecordedClock(WallClock(), start_ns, utc_ns, speed)
