"""`--record` on every live command: its options, and the tape that its reports run through."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from pathlib import Path

    from ahgateway.apps.monitor import Report
    from ahgateway.apps.record import Tape
    from ahgateway.apps.witness import Witness
    from ahgateway.clock import Clock
    from ahgateway.codec.station import Loop, Station
    from ahgateway.transports.base import Frame, Tap

Record = Annotated[
    str | None, typer.Option("--record", help="Keep everything seen in this file, such as run.ahrec; it must be new.")
]
RecordFrames = Annotated[bool, typer.Option("--record-frames", help="Keep every frame of the link in it too.")]
RollMb = Annotated[float | None, typer.Option(help="Begin a new file after so many megabytes.", min=0.1)]
RollHours = Annotated[float | None, typer.Option(help="Begin a new file after so many hours.", min=0.001)]
Keep = Annotated[int | None, typer.Option(help="Keep so many of these files, the newest.", min=1)]


@dataclass(frozen=True, slots=True)
class Recorded:
    """What the options of a command say."""

    path: str | None = None
    frames: bool = False
    roll_mb: float | None = None
    roll_hours: float | None = None
    keep: int | None = None
    profile_text: str = ""


class Sink:
    """Takes reports and frames; does nothing when nothing is recorded."""

    def __init__(self, tape: Tape | None, wants_frames: bool, say: Callable[[str], object]) -> None:
        self._tape = tape
        self._wants_frames = wants_frames
        self._say = say

    def take(self, report: Report) -> None:
        """Keep one report; say what the recorder has to say."""
        if self._tape is not None:
            self._tape.take(report)
            for line in self._tape.news():
                self._say(line)

    def note(self, utc_ns: int, text: str) -> None:
        """Keep what a person says of the run."""
        if self._tape is not None:
            self._tape.recorder.note(utc_ns, text)

    @property
    def path(self) -> Path | None:
        """The first file that is still there; None when nothing is recorded."""
        paths = self._tape.recorder.figures.paths if self._tape is not None else []
        return paths[0] if paths else None

    @property
    def tap(self) -> Tap | None:
        """What a link hands its frames to; None when nobody wants them."""
        return self.frame if self._tape is not None and self._wants_frames else None

    def witness(self, loop: Loop) -> Witness:
        """Return who keeps the pictures and writes of a command that has no monitor."""
        from ahgateway.apps.witness import Witness

        return Witness(loop, self._tape)

    def frame(self, frame: Frame) -> None:
        """Keep one frame when frames are wanted."""
        if self._tape is not None and self._wants_frames:
            self._tape.tap(frame)


def one_loop(station: Station, loop: Loop) -> Station:
    """Return the station with this loop alone: what a command that looks at one loop records."""
    return replace(station, loops=(loop,))


@contextlib.contextmanager
def recorded(options: Recorded, station: Station, clock: Clock, say: Callable[[str], object]) -> Iterator[Sink]:
    """Yield where a run's reports go; the file is closed cleanly however the run ends.

    Raises:
        StateError: The file exists or cannot be made.
    """
    if options.path is None:
        yield Sink(None, False, say)
        return
    from ahgateway.apps.record import Tape
    from ahgateway.clock import SECOND
    from ahgateway.recording.recorder import MEBIBYTE, Rolling

    rolling = Rolling(
        round((options.roll_mb or 0) * MEBIBYTE), round((options.roll_hours or 0) * 3600 * SECOND), options.keep or 0
    )
    command = " ".join(["ahgateway", *sys.argv[1:]])
    tape = Tape(options.path, station, clock, profile_text=options.profile_text, command=command, rolling=rolling)
    try:
        with tape:
            yield Sink(tape, options.frames, say)
    finally:
        for line in tape.news():
            typer.echo(line, err=True)
        typer.echo(tape.summary(), err=True)
