"""The frames of a recording, handed out as their time comes, and what the link did then counted from them."""

from __future__ import annotations

from collections.abc import Callable

from ahgateway.apps.monitor import LinkChange
from ahgateway.clock import MILLISECOND
from ahgateway.recording.reader import Recording
from ahgateway.transports.base import Frame, LinkFigures
from ahgateway.transports.tally import Tally
from ahgateway.transports.tracer import framings


class FrameTape:
    """Plays the frames of one pass through a recording.

    Args:
        recording: Where they come from; without `--record-frames` it has none.
        since_ns: Begin with the second of this UTC; None for the first.

    Attributes:
        figures: What the frames so far say of a Modbus link; frames of CAN are shown, not counted.
    """

    def __init__(self, recording: Recording, since_ns: int | None = None) -> None:
        self._frames = recording.frames(since_ns)
        self._next = self._read()
        scheme = recorded_scheme(recording)
        self._tally = None
        if scheme != "canopen":
            self._tally = Tally(*framings(scheme), recording.station.pacing.reply_timeout_ms * MILLISECOND)
        self.figures = self._tally.figures if self._tally is not None else LinkFigures()

    def play(self, until_ns: int, tap: Callable[[Frame], None]) -> None:
        """Hand out and count every frame up to a moment of monotonic time."""
        while self._next is not None and self._next.now_ns <= until_ns:
            if self._tally is not None:
                self._tally.take(self._next)
            tap(self._next)
            self._next = self._read()

    def changed(self, change: LinkChange) -> None:
        """Count what the monitor of then said of the link."""
        if change.is_up:
            self.figures.reconnects += bool(self.figures.first_cause)
        elif not self.figures.first_cause:
            self.figures.first_cause = change.cause

    def _read(self) -> Frame | None:
        found = next(self._frames, None)
        return None if found is None else Frame(found[2], found[3], found[0], found[1])


def recorded_scheme(recording: Recording) -> str:
    """Return the scheme of the target that was recorded."""
    return recording.meta.get("target", "").partition(":")[0]
