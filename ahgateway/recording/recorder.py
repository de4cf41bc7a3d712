"""Keeps what is seen without ever holding up who sees it: a bounded queue, a thread, one commit a second.

Whoever reports only appends to a queue. When the disk is full or too slow, what does not fit is dropped, counted and
said, and recording goes on as soon as it can; the run itself never waits and never fails because of its recording.
"""

from __future__ import annotations

import contextlib
import secrets
import sqlite3
import threading
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path
from struct import Struct
from typing import Any

from ahgateway.clock import Clock
from ahgateway.codec.station import Station
from ahgateway.errors import StateError
from ahgateway.recording import layout
from ahgateway.recording.packing import RUNNING_OFF, RUNNING_ON, RUNNING_UNKNOWN, Entry
from ahgateway.recording.parts import part_path
from ahgateway.recording.reader import Row
from ahgateway.recording.runfile import Batch, RunFile

QUEUE_MAX = 50_000
"""Most things that wait for the disk, about a minute of a hundred loops at ten pictures a second."""

COMMIT_S = 1.0
MEBIBYTE = 1 << 20


@dataclass(frozen=True, slots=True)
class Rolling:
    """When a new part is begun and how many are kept; 0 means never, or all.

    Attributes:
        size_max: Bytes of one part.
        duration_ns: Time of one part on the clock of the run.
        keep: Number of parts that stay, the one being written included.
    """

    size_max: int = 0
    duration_ns: int = 0
    keep: int = 0

    @property
    def is_on(self) -> bool:
        """True when there can be more than one part."""
        return bool(self.size_max or self.duration_ns)


@dataclass(slots=True)
class Figures:
    """Running totals of a recorder; `dropped` counts what could not be kept."""

    rows: int = 0
    commits: int = 0
    dropped: int = 0
    parts: int = 0
    paths: list[Path] = field(default_factory=list)


Put = Callable[[Batch], None]


class Recorder:
    """One run's recording. Every method but `close` returns at once and may be called from any thread."""

    def __init__(
        self,
        path: Path,
        station: Station,
        clock: Clock,
        meta: Mapping[str, str],
        *,
        rolling: Rolling | None = None,
        queue_max: int = QUEUE_MAX,
        pages_max: int = 0,
    ) -> None:
        """Make the first file; raises StateError when it exists or cannot be made.

        Args:
            path: Name of the file; with rolling, `-0001` and so on is put before its suffix.
            station: The loops that will be recorded.
            clock: The clock of the run.
            meta: Facts of the run for every part.
            rolling: None: one file.
            queue_max: Most things that wait for the disk.
            pages_max: Largest size of a part in pages of 4096 bytes, as on a full disk; 0 for none.
        """
        self.figures = Figures()
        self._path = path
        self._station = station
        self._clock = clock
        self._meta = {**meta, "run": f"{clock.utc_ns()}-{secrets.token_hex(8)}"}
        self._rolling = rolling or Rolling()
        self._queue: deque[Put] = deque()
        self._queue_max = queue_max
        self._pages_max = pages_max
        self._numbers = {loop.name: number for number, loop in enumerate(station.loops)}
        self._shapes = [_shape(layout.columns(loop)) for loop in station.loops]
        self._news: deque[str] = deque(maxlen=64)
        self._trouble = ""
        self._unsaid = 0
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None
        self._file = self._next_part()
        self._begun_ns = clock.now_ns()

    def start(self) -> None:
        """Commit once a second from now on, in a thread of its own."""
        self._thread = threading.Thread(target=self._run, name="recorder", daemon=True)
        self._thread.start()

    def row(self, row: Row) -> None:
        """Keep one loop's words; the mapping must not be changed afterwards."""
        self._put(lambda batch: batch.entries.append(self._entry(row)))

    def verdict(self, loop: str, tick: int, text: str) -> None:
        """Keep a verdict; `text` is its JSON without loop, tick and terms, so that most are alike."""
        self._put(lambda batch: batch.verdicts.append((self._numbers[loop], tick, text)))

    def event(self, utc_ns: int, loop: str, tick: int, kind: str, found: Mapping[str, Any]) -> None:
        """Keep something said: a finding, an operand's change, a link's failure, a diverged execution whole."""
        self._put(lambda batch: batch.events.append((utc_ns, loop, tick, kind, found)))

    def write(self, utc_ns: int, loop: str, operand: str, found: Mapping[str, Any]) -> None:
        """Keep a write to the PLC: old and new words, outcome, hash of its journal entry."""
        self._put(lambda batch: batch.writes.append((utc_ns, loop, operand, found)))

    def note(self, utc_ns: int, text: str) -> None:
        """Keep what a person says of the run."""
        self._put(lambda batch: batch.notes.append((utc_ns, text)))

    def frame(self, direction: str, data: bytes, now_ns: int, utc_ns: int) -> None:
        """Keep a frame as it crossed the wire."""
        self._put(lambda batch: batch.frames.append((now_ns, utc_ns, direction, data)))

    def news(self) -> list[str]:
        """Return what a person should be told since the last call: disk full, things dropped, recording again."""
        found = []
        with contextlib.suppress(IndexError):
            while True:
                found.append(self._news.popleft())
        return found

    def flush(self) -> None:
        """Commit what waits; what the thread does once a second. Not while the thread runs."""
        batch, taken = Batch(), 0
        for _ in range(min(len(self._queue), self._queue_max)):
            self._queue.popleft()(batch)
            taken += 1
        now_ns, utc_ns = self._clock.now_ns(), self._clock.utc_ns()
        if self._unsaid:
            gap = {"dropped": self._unsaid, "why": self._trouble or "the disk is too slow"}
            batch.events.append((utc_ns, "", 0, "recorder", gap))
        if not batch:
            return
        try:
            self._file.commit(batch, now_ns, utc_ns)
        except sqlite3.Error as error:
            self._lost(taken, str(error))
            return
        self.figures.commits += 1
        self.figures.rows += len(batch.entries)
        self._unsaid = 0
        if self._trouble:
            self._news.append(f"{self._file.path}: recording again")
            self._trouble = ""
        self._roll(now_ns)

    def close(self) -> None:
        """Keep what waits and leave one file; what cannot be kept is counted and said."""
        if self._thread is not None:
            self._stop.set()
            self._thread.join()
            self._thread = None
        while self._queue:
            self.flush()
        if self._unsaid:
            self.flush()
        self._close_part()

    def _put(self, put: Put) -> None:
        if len(self._queue) >= self._queue_max:
            self.figures.dropped += 1
            self._unsaid += 1
            if self._unsaid == 1:
                self._news.append(f"{self._file.path}: the disk is too slow, {self._queue_max} things wait: dropping")
            return
        self._queue.append(put)

    def _run(self) -> None:
        while not self._stop.wait(COMMIT_S):
            self.flush()

    def _entry(self, row: Row) -> Entry:
        number = self._numbers[row.loop]
        names, words = self._shapes[number]
        running = RUNNING_UNKNOWN if row.running is None else (RUNNING_ON if row.running else RUNNING_OFF)
        packed = words.pack(*chain.from_iterable([row.words[name] for name in names]))
        return Entry(number, row.tick, row.sent_ns, row.last_ns, row.utc_ns, row.aligned_since_ns, running, packed)

    def _lost(self, taken: int, why: str) -> None:
        self.figures.dropped += taken
        self._unsaid += taken
        if why != self._trouble:
            self._trouble = why
            self._news.append(f"{self._file.path}: cannot be written: {why}; the run goes on, what comes now is lost")

    def _roll(self, now_ns: int) -> None:
        limits = self._rolling
        is_full = limits.size_max and self._file.size >= limits.size_max
        is_old = limits.duration_ns and now_ns - self._begun_ns >= limits.duration_ns
        if not (is_full or is_old):
            return
        self._close_part()
        try:
            self._file = self._next_part()
        except StateError as error:
            self._lost(0, error.message)
        self._begun_ns = now_ns
        while limits.keep and len(self.figures.paths) > limits.keep:
            oldest = self.figures.paths.pop(0)
            with contextlib.suppress(OSError):
                oldest.unlink()

    def _next_part(self) -> RunFile:
        number = self.figures.parts + 1
        path = self._path
        if self._rolling.is_on:
            path = part_path(path, number)
        clock = {
            "created_utc_ns": str(self._clock.utc_ns()),
            "clock_offset_ns": str(self._clock.utc_ns() - self._clock.now_ns()),
        }
        made = RunFile(path, self._station, {**self._meta, **clock, "part": str(number)})
        if self._pages_max:
            made.limit_pages(self._pages_max)
        self.figures.parts = number
        self.figures.paths.append(path)
        return made

    def _close_part(self) -> None:
        last = {"closed_utc_ns": str(self._clock.utc_ns()), "dropped": str(self.figures.dropped)}
        try:
            self._file.close({**last, "trouble": self._trouble} if self._trouble else last)
        except sqlite3.Error as error:
            self._news.append(f"{self._file.path}: could not be closed: {error}; what was committed stays readable")


def _shape(columns: list[tuple[str, int]]) -> tuple[tuple[str, ...], Struct]:
    return tuple(name for name, _ in columns), Struct(f"<{sum(count for _, count in columns)}H")
