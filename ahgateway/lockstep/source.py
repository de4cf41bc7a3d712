"""Where the pictures of a loop come from: chosen by the way in which its executions are seen."""

from __future__ import annotations

from typing import Protocol

from ahgateway.clock import Clock
from ahgateway.codec.station import Loop, Station
from ahgateway.codec.ways import Way
from ahgateway.errors import StateError
from ahgateway.lockstep.events import Lost
from ahgateway.lockstep.picture import Picture, Sampler, Sees
from ahgateway.lockstep.ring import Ring, executions_in
from ahgateway.lockstep.stepper import Step, Stepper, executions_triggered
from ahgateway.transports.base import Link


class Source(Protocol):
    """Looks at one loop."""

    @property
    def torn_count(self) -> int:
        """How often a picture or record was being changed while it was read."""

    async def pictures(self) -> list[Picture | Lost]:
        """Look once, and return what there is, oldest first; nothing when it was torn.

        Raises:
            TransportError: The link failed.
            PlcRefusedError: The PLC refused one of the requests.
        """

    def poll_ns(self, cycle_ns: int) -> int:
        """How long to wait between two looks at a loop with this CYCLE."""


def executions_told(loop: Loop, *, enabled: bool | None) -> tuple[int, int] | None:
    """Least and most executions between two pictures that followed each other in the loop's way; None: time tells."""
    if loop.way is Way.RECORDED:
        return executions_in(loop, enabled=enabled)
    return executions_triggered(loop, 1) if loop.way is Way.STEPPED else None


def source(
    loop: Loop, station: Station, link: Link, clock: Clock, sees: Sees | None = None, step: Step | None = None
) -> Source:
    """Return what looks at a loop in its way; `step` lets one execution through, for a loop that is triggered.

    Raises:
        StateError: Executions are to be triggered and nothing does.
    """
    if loop.way is Way.STEPPED:
        if step is None:
            text = f"loop {loop.name}: executions are triggered through the write gate only"
            raise StateError(text, hint=f"`--arm {loop.name}`")
        return Stepper(loop, station, link, clock, step, sees)
    kind = Ring if loop.way is Way.RECORDED else Sampler
    return kind(loop, station, link, clock, sees)
