"""A link that asks a busy PLC again. *Busy* is an answer: nothing was carried out, so that it is no blind repeat."""

from __future__ import annotations

from ahgateway.clock import MILLISECOND, Clock
from ahgateway.codec.access import Request
from ahgateway.errors import PlcRefusedError
from ahgateway.transports.base import Link, Reply

BUSY = 6
"""MANUAL exception code 06, server device busy (MODBUS Application Protocol V1.1b3, §7)."""
TRIES = 5
PAUSE_NS = 20 * MILLISECOND


class Patient:
    """A `transports.base.Link` in front of another.

    Args:
        link: The link.
        clock: Waits between two tries.
        pause_ns: How long.
    """

    def __init__(self, link: Link, clock: Clock, pause_ns: int = PAUSE_NS) -> None:
        self.target, self.figures = link.target, link.figures
        self._link, self._clock, self._pause_ns = link, clock, pause_ns

    async def exchange(self, request: Request) -> Reply:
        """Send a request, again while the PLC is busy, `TRIES` times in all; see `base.Link.exchange`."""
        for _ in range(TRIES - 1):
            try:
                return await self._link.exchange(request)
            except PlcRefusedError as error:
                if error.code != BUSY:
                    raise
            await self._clock.sleep_ns(self._pause_ns)
        return await self._link.exchange(request)

    async def close(self) -> None:
        """Close the link behind."""
        await self._link.close()
