"""One recording for each scenario of a run, in a folder: what `replay`, `export` and `info` open."""

from __future__ import annotations

import contextlib
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from ahgateway.apps.record import Tape
from ahgateway.apps.witness import Witness
from ahgateway.clock import Clock
from ahgateway.codec.station import Station
from ahgateway.errors import StateError
from ahgateway.schema.scenario import Scenario


class Recordings:
    """Makes the recordings of one run.

    Args:
        folder: Where they go; it is made when it is not there.
        command: What the user typed.

    Raises:
        StateError: The folder cannot be made.
    """

    def __init__(self, folder: Path, command: str) -> None:
        self._folder, self._command = folder, command
        self._counts: Counter[str] = Counter()
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise StateError(f"{folder}: cannot be made: {error.strerror}") from error

    @contextlib.contextmanager
    def of(self, scenario: Scenario, station: Station, clock: Clock) -> Iterator[Witness]:
        """Yield who keeps this scenario's pictures and writes; a repetition has its number in the file's name.

        Raises:
            StateError: The file exists or cannot be made.
        """
        self._counts[scenario.name] += 1
        count = self._counts[scenario.name]
        name = scenario.name.replace("/", "-") + (f"-{count}" if count > 1 else "")
        with Tape(self._folder / f"{name}.ahrec", station, clock, command=self._command) as tape:
            tape.recorder.note(clock.utc_ns(), f"scenario {scenario.name}: {scenario.title}")
            yield Witness(station.loops[0], tape)


@contextlib.contextmanager
def kept(recordings: Recordings | None, scenario: Scenario, station: Station, clock: Clock) -> Iterator[Witness]:
    """Yield the scenario's witness; one that keeps nothing when nothing is recorded."""
    if recordings is None:
        yield Witness(station.loops[0], None)
        return
    with recordings.of(scenario, station, clock) as witness:
        yield witness
