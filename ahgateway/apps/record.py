"""A run's reports on their way into a recording: what is kept of each, for every command that follows loops."""

from __future__ import annotations

import hashlib
import json
import platform
from collections import Counter
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

import ahgateway
from ahgateway import __version__
from ahgateway.apps.monitor import LinkChange, Report, Sample
from ahgateway.apps.report import as_json
from ahgateway.clock import Clock
from ahgateway.codec.station import Station
from ahgateway.core.verdict import Verdict
from ahgateway.lockstep.judge import Execution
from ahgateway.lockstep.picture import Picture
from ahgateway.recording.reader import Row
from ahgateway.recording.recorder import Recorder, Rolling
from ahgateway.transports.base import Frame


class Tape:
    """Records reports into a file; a context manager around the run.

    Args:
        path: File to make; it must not exist.
        station: The loops that are followed.
        clock: The clock of the run.
        profile_text: The profile as it was read, for people.
        command: What the user typed, without secrets.
        rolling: When to begin a new part; None for one file.

    Raises:
        StateError: The file exists or cannot be made.
    """

    def __init__(
        self,
        path: str | Path,
        station: Station,
        clock: Clock,
        *,
        profile_text: str = "",
        command: str = "",
        rolling: Rolling | None = None,
    ) -> None:
        meta = {**versions(), "profile": profile_text, "command": command, "target": station.target}
        self.recorder = Recorder(Path(path), station, clock, meta, rolling=rolling)
        self._texts: dict[tuple[Any, ...], str] = {}
        self._wholes: Counter[str] = Counter()

    def __enter__(self) -> Tape:
        self.recorder.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.recorder.close()

    def take(self, report: Report) -> None:
        """Keep one report."""
        event = report.event
        if isinstance(event, Sample):
            self.recorder.row(row_of(report.loop, event.picture))
        elif isinstance(event, Execution):
            self._execution(report, event)
        else:
            found = as_json(report)
            assert found is not None
            if isinstance(event, LinkChange) and event.lost:
                found["lost"] = [list(each) for each in event.lost]
            self.recorder.event(report.utc_ns, report.loop, report.tick, found["kind"], found)

    def tap(self, frame: Frame) -> None:
        """Keep one frame; hand this to a link as its tap."""
        self.recorder.frame(frame.direction, frame.data, frame.now_ns, frame.utc_ns)

    def news(self) -> list[str]:
        """Return what a person should be told of the recording since the last call."""
        return self.recorder.news()

    def summary(self) -> str:
        """One sentence on what was kept."""
        figures = self.recorder.figures
        files = ", ".join(str(path) for path in figures.paths)
        lost = f", {figures.dropped} things LOST" if figures.dropped else ""
        return f"recorded {figures.rows} pictures in {files}{lost}"

    def _execution(self, report: Report, event: Execution) -> None:
        if event.verdict is Verdict.DIVERGED:
            whole = as_json(report)
            assert whole is not None
            self._wholes[report.loop] += 1
            if self._wholes[report.loop] <= WHOLE_MAX:
                self.recorder.event(report.utc_ns, report.loop, report.tick, "execution", whole)
            self.recorder.verdict(report.loop, report.tick, verdict_text(whole))
            return
        # Nearly all executions say the same, so the text is made once.
        key = (event.verdict, event.proof, event.weight, event.reason, event.count)
        if key not in self._texts:
            found = as_json(report)
            assert found is not None
            self._texts[key] = verdict_text(found)
        self.recorder.verdict(report.loop, report.tick, self._texts[key])


def row_of(loop: str, picture: Picture) -> Row:
    """Return what is kept of a picture."""
    return Row(
        loop,
        picture.tick,
        picture.sent_ns,
        picture.last_ns,
        picture.utc_ns,
        picture.aligned_since_ns,
        picture.running,
        picture.words,
    )


def verdict_text(found: Mapping[str, Any]) -> str:
    """Return what replay must find again of an execution's JSON object, as text."""
    return json.dumps({name: found[name] for name in KEPT}, ensure_ascii=False)


JUDGING = {"core": "core", "judge": "lockstep"}
"""Facts of a recording that say which sources computed its verdicts: the laws, and who follows and judges."""


@cache
def _sources(package: str) -> str:
    """Return 16 hexadecimal digits of SHA-256 over a package's sources, whatever their line ends; "" without any."""
    top = Path(ahgateway.__file__).parent
    digest = hashlib.sha256()
    paths = sorted((top / package).rglob("*.py"))
    for path in paths:
        text = path.read_bytes().replace(b"\r\n", b"\n")
        digest.update(f"{path.relative_to(top).as_posix()} {len(text)}\n".encode() + text)
    return digest.hexdigest()[:16] if paths else ""


KEPT = ("verdict", "proof", "class", "count", "reason", "term", "plc", "ref", "plc_bits", "ref_bits", "cause")
"""Keys of a verdict that are recorded; the terms come back with the replay."""

WHOLE_MAX = 100
"""So many diverged executions of a loop are kept with terms and every cause; a fault that stays fills no disk."""


def versions() -> dict[str, str]:
    """Return what computed the verdicts: this program, its laws and its judge by their sources, numbers, machine."""
    return {
        **{name: _sources(package) for name, package in JUDGING.items()},
        "ahgateway": __version__,
        "python": platform.python_version(),
        "numpy": np.__version__,
        "machine": f"{platform.system()} {platform.machine()}",
    }
