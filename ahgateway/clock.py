"""Time as an argument: integer nanoseconds from a clock that the composition root hands in.

Only this file and the command line may ask the operating system what time it is.
"""

from __future__ import annotations

import asyncio
import time
from datetime import UTC, datetime
from typing import Protocol

MILLISECOND = 1_000_000
SECOND = 1_000_000_000


def utc_text(utc_ns: int) -> str:
    """Return the time of day of a UTC time, `12:00:00.000123`."""
    seconds, rest_ns = divmod(utc_ns, SECOND)
    return f"{datetime.fromtimestamp(seconds, UTC):%H:%M:%S}.{rest_ns // 1000:06d}"


class Clock(Protocol):
    """What the rest of the house knows of time."""

    def now_ns(self) -> int:
        """Monotonic time in ns; only differences mean anything."""

    def utc_ns(self) -> int:
        """Time since 1970-01-01T00:00Z in ns."""

    async def sleep_ns(self, duration_ns: int) -> None:
        """Return after `duration_ns` of this clock; at the next turn of the loop when it is not positive."""


class WallClock:
    """The clock of this machine. UTC is anchored once, so that it never jumps against monotonic time.

    The performance counter is the monotonic clock itself on Linux; on Windows the other one moves only 64 times a
    second up to Python 3.12, which is nine times the silence between two RTU frames.
    """

    def __init__(self) -> None:
        self._offset_ns = time.time_ns() - time.perf_counter_ns()

    def now_ns(self) -> int:
        return time.perf_counter_ns()

    def utc_ns(self) -> int:
        return self._offset_ns + time.perf_counter_ns()

    async def sleep_ns(self, duration_ns: int) -> None:
        await asyncio.sleep(max(0, duration_ns) / SECOND)


class VirtualClock:
    """A clock that moves only when told to, or when a sleeper is all that is left to wait for.

    `sleep_ns` moves the time itself: whoever sleeps last wakes first in order of due time. It serves one
    sleeper at a time, which is what a poller in lockstep with a fake PLC is; several sleepers need
    `advance_ns` from outside.
    """

    def __init__(self, start_ns: int = 0, utc_start_ns: int = 1_767_225_600 * SECOND) -> None:
        self._now_ns = start_ns
        self._utc_offset_ns = utc_start_ns - start_ns

    def now_ns(self) -> int:
        return self._now_ns

    def utc_ns(self) -> int:
        return self._utc_offset_ns + self._now_ns

    def advance_ns(self, duration_ns: int) -> None:
        """Move the time on by `duration_ns`, which must not be negative."""
        if duration_ns < 0:
            raise ValueError(f"a clock does not run backwards: {duration_ns} ns")
        self._now_ns += duration_ns

    async def sleep_ns(self, duration_ns: int) -> None:
        self.advance_ns(max(0, duration_ns))
        await asyncio.sleep(0)
