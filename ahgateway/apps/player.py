"""Pause, speed and place of a recording that is played; whoever follows it asks here when the next picture is due.

A jump begins a new pass: the shadow is settled on the seconds before the place, as fast as it goes, and what is
counted is what this pass followed. Nothing here touches the recording.
"""

from __future__ import annotations

import asyncio

from ahgateway.clock import SECOND
from ahgateway.transports.replay import RecordedClock

SPEEDS = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0)
LEAD_NS = 20 * SECOND
"""So much before a place is followed, so that the shadow is settled there."""
PICTURES_AT_ONCE = 50
"""On the way to a place others get their turn after so many pictures."""


class Player:
    """Plays from `first_ns` to `last_ns` of a recording's monotonic time on its clock."""

    def __init__(self, clock: RecordedClock, first_ns: int, last_ns: int, speed: float = 1.0) -> None:
        self._clock = clock
        self.first_ns = first_ns
        self.last_ns = last_ns
        self.speed = speed
        self.is_paused = False
        self.is_over = False
        self._to_ns: int | None = None
        self._jumps = False
        self._passed = 0

    @property
    def moves(self) -> float:
        """How fast its time runs now against a real one; 0 while it stands."""
        return 0.0 if self.is_paused or self.is_over or self._to_ns is not None else self.speed

    @property
    def now_ns(self) -> int:
        """Where it stands."""
        return self._clock.now_ns() if self._to_ns is None else self._to_ns

    @property
    def first_utc_ns(self) -> int:
        """Where the recording begins, UTC."""
        return self.first_ns + self._clock.utc_offset_ns

    def text(self) -> str:
        """One line of what it does, understandable without colour."""
        at_s = (min(self.now_ns, self.last_ns) - self.first_ns) / SECOND
        whole_s = (self.last_ns - self.first_ns) / SECOND
        if self._to_ns is not None:
            state = "SEEKING"
        elif self.is_over:
            state = "END"
        else:
            state = "PAUSED" if self.is_paused else "playing"
        return f"{state} {at_s:.1f} of {whole_s:.1f} s at {self.speed:g}x"

    def begin(self) -> None:
        """Start from the beginning, however long the preparations took."""
        self._clock.jump(self.first_ns)

    def pause(self) -> None:
        """Stand still, or go on."""
        self.is_paused = not self.is_paused
        self._run()

    def faster(self, steps: int) -> None:
        """Take so many steps up, or down, in `SPEEDS`."""
        near = min(range(len(SPEEDS)), key=lambda index: abs(SPEEDS[index] - self.speed))
        self.speed = SPEEDS[min(max(near + steps, 0), len(SPEEDS) - 1)]
        self._run()

    def seek(self, to_ns: int) -> None:
        """Go to another place; outside of the recording it is the nearer end."""
        self._to_ns = min(max(to_ns, self.first_ns), self.last_ns)
        self._jumps = True
        self.is_over = False
        self._run()

    def seek_utc(self, utc_ns: int) -> None:
        """Go to a moment in UTC."""
        self.seek(utc_ns - self._clock.utc_offset_ns)

    def skip(self, duration_ns: int) -> None:
        """Go on or back by so much from where it stands."""
        self.seek(min(self.now_ns, self.last_ns) + duration_ns)

    def jump(self) -> int | None:
        """Return from where a new pass begins, once after each `seek`; None when there was none."""
        if not self._jumps:
            return None
        assert self._to_ns is not None
        self._jumps = False
        start_ns = max(self.first_ns, self._to_ns - LEAD_NS)
        self._clock.jump(start_ns)
        return start_ns

    async def reaches(self, due_ns: int, stop: asyncio.Event | None) -> bool:
        """Return True when a picture is due; False when there is another place to go to, or `stop` was set."""
        while not (self._jumps or (stop is not None and stop.is_set())):
            if self._to_ns is not None and due_ns <= self._to_ns:
                self._clock.jump(due_ns)
                self._passed += 1
                if self._passed % PICTURES_AT_ONCE == 0:
                    await asyncio.sleep(0)
                return True
            self._arrive()
            wait_ns = due_ns - self._clock.now_ns()
            if wait_ns <= 0:
                return True
            if self.moves:
                await self._clock.sleep_ns(min(wait_ns, round(self.speed * SECOND / 20)))
            else:
                await self._clock.slice()
        return False

    async def rests(self, stop: asyncio.Event | None) -> bool:
        """Stand at the end; return True when there is another place to go to, False when `stop` was set."""
        self._arrive()
        self._clock.jump(self.last_ns)
        self.is_over = True
        self._run()
        while not self._jumps:
            if stop is not None and stop.is_set():
                return False
            await self._clock.slice()
        return True

    def _arrive(self) -> None:
        if self._to_ns is not None:
            self._clock.jump(self._to_ns)
            self._to_ns = None
            self._run()

    def _run(self) -> None:
        self._clock.run(self.moves)
