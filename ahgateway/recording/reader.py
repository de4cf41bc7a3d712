"""A recording being read, also while another process writes it."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from itertools import chain
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple

from ahgateway.codec.station import Station
from ahgateway.errors import CodecError, StateError
from ahgateway.recording import layout
from ahgateway.recording.packing import (
    IMPORTED,
    RUNNING_ON,
    RUNNING_UNKNOWN,
    Block,
    concatenated,
    unpack,
    unpack_frames,
    unpack_verdicts,
)
from ahgateway.recording.station_text import station_from

SECONDS_PER_BLOCK = 60
"""So many seconds are joined when columns are asked for: enough rows for numpy, few enough for memory."""


class Row(NamedTuple):
    """One loop at one tick, as it was seen.

    Attributes:
        loop: The loop's name.
        tick: Number of the picture in its loop.
        sent_ns: Monotonic time when the first request left.
        last_ns: Monotonic time when the last reply was complete.
        utc_ns: UTC of `last_ns`.
        aligned_since_ns: Since when the line had been proven aligned.
        running: The PLC was in RUN; None where nobody asked.
        words: Raw words by operand; a BOOL is one 0 or 1.
    """

    loop: str
    tick: int
    sent_ns: int
    last_ns: int
    utc_ns: int
    aligned_since_ns: int
    running: bool | None
    words: Mapping[str, tuple[int, ...]]


class Event(NamedTuple):
    """Something said during the run; `found` is the JSON object of docs/reference/recording.md."""

    utc_ns: int
    loop: str
    tick: int
    kind: str
    found: dict[str, Any]


@dataclass(frozen=True, slots=True)
class Damage:
    """What a check of the whole file found; sound when `texts` is empty."""

    seconds: int
    texts: list[str] = field(default_factory=list)


class Recording:
    """An open recording; a context manager.

    Raises:
        StateError: There is no such file, it is no recording, or of a newer version than this program.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        if not self.path.is_file():
            raise StateError(f"{path}: there is no such recording", hint="the name is that given to --record")
        try:
            uri = self.path.absolute().as_uri() + "?mode=ro"
            self._base = sqlite3.connect(uri, uri=True, isolation_level=None, check_same_thread=False)
            application = self._base.execute("PRAGMA application_id").fetchone()[0]
            version = self._base.execute("PRAGMA user_version").fetchone()[0]
        except sqlite3.Error as error:
            raise StateError(f"{path}: is no recording: {error}") from error
        if application != layout.APPLICATION_ID:
            self._base.close()
            raise StateError(f"{path}: is a SQLite file, but no recording of ahgateway")
        if version > layout.SCHEMA_VERSION:
            self._base.close()
            raise StateError(
                f"{path}: has schema version {version}, this program reads up to {layout.SCHEMA_VERSION}",
                hint="install a newer ahgateway",
            )
        self.schema_version: int = version

    def __enter__(self) -> Recording:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Release the file. May be called twice."""
        self._base.close()

    @cached_property
    def meta(self) -> dict[str, str]:
        """Facts of the run by name, as they stood when first asked for."""
        return dict(self._rows("SELECT key, value FROM meta"))

    @cached_property
    def station(self) -> Station:
        """The station that was recorded, with dialects and tolerances as they were then."""
        return station_from(json.loads(self.meta["station"]))

    @property
    def is_closed(self) -> bool:
        """True when the run ended cleanly; False while it is written or after a kill."""
        return bool(self._rows("SELECT 1 FROM meta WHERE key = 'content_hash'"))

    @cached_property
    def names(self) -> list[str]:
        """Names of the loops by their numbers."""
        return [loop.name for loop in self.station.loops]

    def totals(self) -> tuple[int, int | None, int | None]:
        """Return how many rows there are now, and UTC of the first and the last in ns."""
        rows = self._rows("SELECT TOTAL(rows), MIN(first_utc_ns), MAX(last_utc_ns) FROM seconds")
        count, first, last = rows[0]
        return int(count), first, last

    def rows(self, loops: set[str] | None = None, since_ns: int | None = None) -> Iterator[Row]:
        """Yield every row in the order in which it was seen.

        Args:
            loops: Keeps those of the named loops only.
            since_ns: UTC; whole seconds before it are not read, rows just before it may come.
        """
        shapes = [layout.columns(loop) for loop in self.station.loops]
        where, moments = _between(since_ns, None)
        for (blob,) in self._each(f"SELECT words FROM seconds WHERE rows > 0{where} ORDER BY id", *moments):
            found: list[Row] = []
            for block in unpack(blob):
                name = self.names[block.loop]
                if loops is None or name in loops:
                    found.extend(_rows_of(name, shapes[block.loop], block))
            found.sort(key=lambda row: row.last_ns)
            yield from found

    def blocks(self, loop: str, since_ns: int | None = None, until_ns: int | None = None) -> Iterator[Block]:
        """Yield the rows of one loop as columns, about a minute at a time.

        With moments in ns UTC only the seconds that touch them are read; their rows outside are not taken away.
        """
        number = self.names.index(loop)
        waiting: list[Block] = []
        where, moments = _between(since_ns, until_ns)
        statement = f"SELECT words FROM seconds WHERE rows > 0{where} ORDER BY id"
        for count, (blob,) in enumerate(self._each(statement, *moments), 1):
            waiting.extend(block for block in unpack(blob) if block.loop == number)
            if count % SECONDS_PER_BLOCK == 0 and waiting:
                joined = concatenated(waiting)
                waiting = []
                if joined is not None:
                    yield joined
        joined = concatenated(waiting)
        if joined is not None:
            yield joined

    def verdicts(
        self, since_ns: int | None = None, until_ns: int | None = None
    ) -> Iterator[tuple[str, int, dict[str, Any]]]:
        """Yield (loop, tick, verdict as it was given then), second by second; terms are not in it.

        With moments in ns UTC only the seconds whose rows touch them are read.
        """
        texts: dict[int, dict[str, Any]] = {}
        where, moments = _between(since_ns, until_ns)
        for (blob,) in self._each(f"SELECT verdicts FROM seconds WHERE 1{where} ORDER BY id", *moments):
            for loop, tick, number in unpack_verdicts(blob):
                if number not in texts:
                    rows = self._rows("SELECT json FROM verdicts WHERE id = ?", number)
                    texts[number] = json.loads(rows[0][0])
                yield self.names[loop], tick, texts[number]

    def events(self, kind: str | None = None) -> Iterator[Event]:
        """Yield what was said, in order; `kind` keeps one kind only."""
        where, arguments = ("WHERE kind = ?", (kind,)) if kind else ("", ())
        for utc_ns, loop, tick, name, text in self._each(
            f"SELECT utc_ns, loop, tick, kind, json FROM events {where} ORDER BY id", *arguments
        ):
            yield Event(utc_ns, loop, tick, name, json.loads(text))

    def writes(self) -> Iterator[tuple[int, str, str, dict[str, Any]]]:
        """Yield (utc_ns, loop, operand, object) of every write to the PLC."""
        for utc_ns, loop, operand, text in self._each("SELECT utc_ns, loop, operand, json FROM writes ORDER BY id"):
            yield utc_ns, loop, operand, json.loads(text)

    def notes(self) -> list[tuple[int, str]]:
        """Return (utc_ns, text) of every note."""
        return list(self._rows("SELECT utc_ns, text FROM notes ORDER BY id"))

    def frames(self, since_ns: int | None = None) -> Iterator[tuple[int, int, str, bytes]]:
        """Yield (now_ns, utc_ns, `>` or `<`, bytes) of every frame that was kept.

        Args:
            since_ns: UTC; those before the first second whose rows reach it are not read.
        """
        first, moments = "", []
        if since_ns is not None:
            first, moments = " WHERE id >= (SELECT MIN(id) FROM seconds WHERE last_utc_ns >= ?)", [since_ns]
        for (blob,) in self._each(f"SELECT frames FROM seconds{first} ORDER BY id", *moments):
            yield from unpack_frames(blob)

    def check(self) -> Damage:
        """Read the whole file and hold every second against its seal."""
        try:
            (sound,) = self._rows("PRAGMA integrity_check(5)")[0]
        except sqlite3.DatabaseError as error:
            return Damage(0, [f"SQLite cannot read it: {error}"])
        texts = [] if sound == "ok" else [f"SQLite finds: {sound}"]
        seal, count = self._check_heading(texts), 0
        known = -1
        for second, words, verdicts, frames, kept in self._each(
            "SELECT id, words, verdicts, frames, chain FROM seconds ORDER BY id"
        ):
            count += 1
            used = [number for _, _, number in unpack_verdicts(verdicts)]
            rows = self._rows("SELECT id, json FROM verdicts WHERE id > ? AND id <= ?", known, max(used, default=known))
            known = max(known, *used) if used else known
            rows += self._rows("SELECT utc_ns, loop, tick, kind, json FROM events WHERE second = ? ORDER BY id", second)
            rows += self._rows("SELECT utc_ns, loop, operand, json FROM writes WHERE second = ? ORDER BY id", second)
            rows += self._rows("SELECT utc_ns, text FROM notes WHERE second = ? ORDER BY id", second)
            seal = layout.link_of_chain(seal, (words, verdicts, frames), rows)
            if seal != kept:
                texts.append(f"second {second} does not match its seal: something in it was changed afterwards")
                break
        closed = self.meta.get("content_hash")
        if closed is not None and not texts and closed != seal.hex():
            texts.append(f"the last seal is {seal.hex()[:16]}…, the file was closed with {closed[:16]}…")
        return Damage(count, texts)

    def _check_heading(self, texts: list[str]) -> bytes:
        late = {"heading_hash", "content_hash", *_CLOSING}
        meta = {key: value for key, value in self.meta.items() if key not in late}
        rows: list[Any] = [sorted(meta.items())]
        rows += self._rows("SELECT * FROM loops ORDER BY id")
        rows += self._rows("SELECT * FROM operands ORDER BY loop, position")
        seal = layout.link_of_chain(layout.CHAIN_START, (b"", b"", b""), rows)
        if seal.hex() != self.meta.get("heading_hash"):
            texts.append("the heading does not match its seal: station, profile or versions were changed afterwards")
        return seal

    def _each(self, statement: str, *arguments: Any) -> Iterator[Any]:
        try:
            # Not `yield from`: a reader that stops early may be collected after the file was closed.
            cursor = self._base.execute(statement, arguments)
            while (row := cursor.fetchone()) is not None:
                yield row
        except sqlite3.Error as error:
            raise CodecError(
                f"{self.path}: cannot be read: {error}", hint="`ahgateway info --check` says more"
            ) from error

    def _rows(self, statement: str, *arguments: Any) -> list[Any]:
        return self._base.execute(statement, arguments).fetchall()


_CLOSING = ("closed_utc_ns", "dropped", "trouble")
"""Facts that are written when the run ends."""


def _between(since_ns: int | None, until_ns: int | None) -> tuple[str, list[int]]:
    """A condition for seconds whose rows reach into a time, and what it asks with; empty without moments."""
    where, moments = "", []
    if since_ns is not None:
        where, moments = " AND last_utc_ns >= ?", [since_ns]
    if until_ns is not None:
        where, moments = f"{where} AND first_utc_ns <= ?", [*moments, until_ns]
    return where, moments


def _rows_of(name: str, shape: list[tuple[str, int]], block: Block) -> Iterator[Row]:
    times = zip(
        block.ticks.tolist(),
        block.sent_ns.tolist(),
        block.last_ns.tolist(),
        block.utc_ns.tolist(),
        block.aligned_since_ns.tolist(),
        block.quality.tolist(),
        block.words.tolist(),
        strict=True,
    )
    spans = _spans(shape)
    for tick, sent, last, utc, aligned, quality, words in times:
        state = quality & ~IMPORTED
        running = None if state == RUNNING_UNKNOWN else state == RUNNING_ON
        values = {operand: tuple(words[first:end]) for operand, first, end in spans}
        yield Row(name, tick, sent, last, utc, aligned, running, values)


def _spans(shape: list[tuple[str, int]]) -> list[tuple[str, int, int]]:
    ends = list(chain((0,), _running_sum(count for _, count in shape)))
    return [(operand, ends[place], ends[place + 1]) for place, (operand, _) in enumerate(shape)]


def _running_sum(counts: Iterator[int]) -> Iterator[int]:
    total = 0
    for count in counts:
        total += count
        yield total


def spans(shape: list[tuple[str, int]]) -> dict[str, tuple[int, int]]:
    """Return the first word and the word behind the last of every column in a row."""
    return {operand: (first, end) for operand, first, end in _spans(shape)}
