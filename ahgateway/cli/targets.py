"""From the text of a target to a link: the one place that joins transports with the fake PLC."""

from __future__ import annotations

import contextlib
from collections.abc import AsyncIterator
from dataclasses import replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ahgateway.clock import Clock
    from ahgateway.codec.station import Station
    from ahgateway.transports.base import Link, Tap


def resolved(station: Station, target: str | None) -> Station:
    """Return the station with the target that counts and the unit that stands in it: typed beats the profile.

    Raises:
        ProfileError: The target is no legal URI.
    """
    from ahgateway.transports.uri import parse_uri

    parsed = parse_uri(target or station.target)
    return replace(station, target=parsed.text, unit=station.unit if parsed.unit is None else parsed.unit)


@contextlib.asynccontextmanager
async def open_target(station: Station, clock: Clock, tap: Tap | None = None) -> AsyncIterator[Link]:
    """Yield the link to a station's target.

    `fake://PROFILE` runs that profile's fake PLC in this process, `replay://FILE` reads what a recording saw.

    Raises:
        ProfileError: The target is no legal URI, or the fake's profile is wrong.
        StateError: This version has no such link.
    """
    from ahgateway.transports.uri import open_link, parse_uri

    target = parse_uri(station.target)
    if target.scheme == "fake":
        from ahgateway.fake.plc import FakePlc
        from ahgateway.schema.profile import load
        from ahgateway.transports.memory import MemoryLink

        loaded = load(target.path)
        plc = FakePlc(loaded.station(), loaded.fake_setup(), clock=clock)
        link: Link = MemoryLink(plc, clock, tap=tap, pacing=station.pacing, target=target.text)
    elif target.scheme == "replay":
        from ahgateway.recording.parts import opened
        from ahgateway.transports.replay import ReplayLink

        link = ReplayLink(opened(target.path), clock, float(target.options.get("speed", 1.0)))
    else:
        link = open_link(target, clock, station.pacing, tap, can=station.can)
    try:
        yield link
    finally:
        await link.close()
