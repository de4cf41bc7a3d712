"""Sees executions one at a time: triggers each through the write gate and takes a picture behind it.

Between two executions the instruction stands still, so that no picture is torn and none is missed.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from dataclasses import replace

from ahgateway.clock import Clock
from ahgateway.codec.station import Loop, Station
from ahgateway.lockstep.events import Lost
from ahgateway.lockstep.picture import Picture, Sampler, Sees
from ahgateway.transports.base import Link

PER_TRIGGER = 2
"""In the cyclic task the contact opens behind the first execution that changes a word, or behind CYCLE and a little."""


Step = Callable[[], Awaitable[int]]
"""Handed in by the roof: what looks at a loop cannot reach the write gate by itself."""


class Stepper:
    """One loop whose executions we trigger.

    Args:
        loop: The loop, with a trigger.
        station: Its station, a bench.
        link: The way there.
        clock: Gives the times.
        step: Lets one execution through and returns how many the PLC counted: `Gate.step` of an armed gate.
        sees: Shown every picture.
    """

    def __init__(
        self, loop: Loop, station: Station, link: Link, clock: Clock, step: Step, sees: Sees | None = None
    ) -> None:
        self._loop, self._step = loop, step
        self._sampler = Sampler(loop, station, link, clock, sees)
        self._is_begun = False

    @property
    def torn_count(self) -> int:
        """Pictures into which something fell."""
        return self._sampler.torn_count

    def poll_ns(self, cycle_ns: int) -> int:
        """The next execution may come at once."""
        return 0

    async def pictures(self) -> list[Picture | Lost]:
        """Trigger one execution and return the picture behind it; the first time only a picture.

        Raises:
            StateError: The gate is not armed, somebody else writes too, or nothing executed.
            TransportError: The link failed.
            PlcRefusedError: The PLC refused a request.
        """
        if not self._is_begun:
            picture = await self._sampler.picture()
            self._is_begun = picture is not None
            return [] if picture is None else [replace(picture, enabled=None)]
        counted = await self._step()
        picture = await self._sampler.picture()
        if picture is None:
            return [Lost(float(counted), 0, "the picture behind a triggered execution was torn")]
        return [replace(picture, executions=executions_triggered(self._loop, counted), enabled=None)]


def executions_triggered(loop: Loop, counted: int) -> tuple[int, int]:
    """Least and most executions in so many triggers; one that changes no word is not told from none."""
    return (counted, counted) if loop.interval_ms is not None else (0, counted * PER_TRIGGER)
