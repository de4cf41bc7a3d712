"""Time that passes only while nothing happens: a busy machine that lets a test stand still makes nothing late.

Between two ends in one process nothing is on its way that the event loop does not see at its next look. So a look that
finds something takes no more than a glance, one that finds nothing takes what it was willing to wait, and work takes
no time at all. Deadlines of some milliseconds then hold on any machine, and still pass when an answer really is
missing. A module whose tests run so says `LOOP = PatientLoop`, and hands a `PatientClock` to what it tests.
"""

from __future__ import annotations

import asyncio
import selectors
import time

from ahgateway.clock import SECOND, WallClock

GLANCE_S = 0.001
START_S = 1000.0


class PatientSelector(selectors.DefaultSelector):
    """Looks for what has happened, and counts the time."""

    def __init__(self) -> None:
        super().__init__()
        self.now_s = START_S

    def select(self, timeout: float | None = None):
        began_s = time.perf_counter()
        found = super().select(timeout)
        if found or timeout is None:
            self.now_s += min(time.perf_counter() - began_s, GLANCE_S)
        else:
            self.now_s += max(0.0, timeout)
        return found


class PatientLoop(asyncio.SelectorEventLoop):
    """An event loop on that time."""

    def __init__(self) -> None:
        self._patience = PatientSelector()
        super().__init__(self._patience)

    def time(self) -> float:
        return self._patience.now_s


class PatientClock(WallClock):
    """The time of the running loop; UTC goes on with it."""

    def __init__(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._offset_ns = time.time_ns() - self.now_ns()

    def now_ns(self) -> int:
        return round(self._loop.time() * SECOND)

    def utc_ns(self) -> int:
        return self._offset_ns + self.now_ns()


class PatientPolicy(asyncio.DefaultEventLoopPolicy):
    """Makes such loops where a program starts its own."""

    def new_event_loop(self) -> asyncio.AbstractEventLoop:
        return PatientLoop()
