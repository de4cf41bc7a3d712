"""One recording being written: a SQLite file that opens after any kill, with everything of one second in one commit.

WAL mode and `synchronous=FULL`: what has been committed survives a power cut (MANUAL, SQLite documentation). A clean
close folds the log back, so that one file is left. Nothing here knows threads or when a second is over.
"""

from __future__ import annotations

import contextlib
import json
import sqlite3
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ahgateway.codec.station import Loop, Station
from ahgateway.errors import StateError
from ahgateway.recording import layout
from ahgateway.recording.packing import Entry, pack, pack_frames, pack_verdicts
from ahgateway.recording.station_text import station_json

Json = Mapping[str, Any]


@dataclass(slots=True)
class Batch:
    """Everything that one commit keeps.

    Attributes:
        entries: Rows of raw words.
        verdicts: (loop, tick, text of the verdict without its terms).
        events: (utc_ns, loop, tick, kind, object).
        writes: (utc_ns, loop, operand, object).
        notes: (utc_ns, text).
        frames: (now_ns, utc_ns, direction, bytes).
    """

    entries: list[Entry] = field(default_factory=list)
    verdicts: list[tuple[int, int, str]] = field(default_factory=list)
    events: list[tuple[int, str, int, str, Json]] = field(default_factory=list)
    writes: list[tuple[int, str, str, Json]] = field(default_factory=list)
    notes: list[tuple[int, str]] = field(default_factory=list)
    frames: list[tuple[int, int, str, bytes]] = field(default_factory=list)

    def __bool__(self) -> bool:
        return any((self.entries, self.verdicts, self.events, self.writes, self.notes, self.frames))


class RunFile:
    """A new recording; `commit` batches into it, then `close`."""

    def __init__(self, path: Path, station: Station, meta: Mapping[str, str]) -> None:
        """Make the file.

        Args:
            path: Must not exist: a recording is never overwritten.
            station: The loops in it, in the order of their numbers.
            meta: What else is known of the run; see docs/reference/recording.md.

        Raises:
            StateError: The file exists, or cannot be made.
        """
        self.path = path
        self._station = station
        if path.exists():
            raise StateError(
                f"{path}: there is a file of that name already, and a recording is never overwritten",
                hint="give another name, or move the old one away",
            )
        self._chain = layout.CHAIN_START
        self._second = 0
        self._texts: dict[str, int] = {}
        try:
            self._base = sqlite3.connect(path, isolation_level=None, check_same_thread=False)
            self._begin(dict(meta))
        except sqlite3.Error as error:
            raise StateError(f"{path}: cannot be made: {error}", hint="is the directory there and writable?") from error

    @property
    def loops(self) -> tuple[Loop, ...]:
        """The loops in it by their numbers."""
        return self._station.loops

    @property
    def size(self) -> int:
        """Bytes of the file once it is closed, nearly."""
        pages: int = self._base.execute("PRAGMA page_count").fetchone()[0]
        bytes_each: int = self._base.execute("PRAGMA page_size").fetchone()[0]
        return pages * bytes_each

    def limit_pages(self, pages_max: int) -> None:
        """Let the file grow to so many pages only: how a full disk is rehearsed."""
        self._base.execute(f"PRAGMA max_page_count={int(pages_max)}")

    def commit(self, batch: Batch, now_ns: int, utc_ns: int) -> None:
        """Keep a batch, all of it or, when this raises, nothing.

        Raises:
            sqlite3.Error: The disk is full or failed; the file stays as it was and may be tried again.
        """
        texts = [text for text in dict.fromkeys(text for _, _, text in batch.verdicts) if text not in self._texts]
        numbers = {**self._texts, **{text: len(self._texts) + place for place, text in enumerate(texts)}}
        blobs = (
            pack(batch.entries),
            pack_verdicts([(loop, tick, numbers[text]) for loop, tick, text in batch.verdicts]),
            pack_frames(batch.frames),
        )
        second = self._second + 1
        events = [(utc, loop, tick, kind, _text(found)) for utc, loop, tick, kind, found in batch.events]
        writes = [(utc, loop, operand, _text(found)) for utc, loop, operand, found in batch.writes]
        rows = [*((numbers[text], text) for text in texts), *events, *writes, *batch.notes]
        chain = layout.link_of_chain(self._chain, blobs, rows)
        times = [entry.utc_ns for entry in batch.entries]
        span = (min(times), max(times)) if times else (None, None)
        self._transact(
            [
                ("INSERT INTO verdicts VALUES (?,?)", [(numbers[text], text) for text in texts]),
                ("INSERT INTO events VALUES (NULL,?,?,?,?,?,?)", [(second, *row) for row in events]),
                ("INSERT INTO writes VALUES (NULL,?,?,?,?,?)", [(second, *row) for row in writes]),
                ("INSERT INTO notes VALUES (NULL,?,?,?)", [(second, *row) for row in batch.notes]),
                (
                    "INSERT INTO seconds VALUES (?,?,?,?,?,?,?,?,?,?)",
                    [(second, now_ns, utc_ns, len(times), *span, *blobs, chain)],
                ),
            ]
        )
        self._chain, self._second, self._texts = chain, second, numbers

    def close(self, meta: Mapping[str, str]) -> None:
        """Write the last facts and the hash of the content, and leave one file.

        Raises:
            sqlite3.Error: The disk is full or failed; what was committed stays readable.
        """
        try:
            last = {**meta, "content_hash": self._chain.hex()}
            self._transact([("INSERT OR REPLACE INTO meta VALUES (?,?)", sorted(last.items()))])
            self._base.execute("PRAGMA busy_timeout=200")
            self._base.execute("PRAGMA wal_checkpoint(TRUNCATE)")
            # Another process that reads just now keeps the log; whoever closes last folds it back.
            with contextlib.suppress(sqlite3.OperationalError):
                self._base.execute("PRAGMA journal_mode=DELETE")
        finally:
            self._base.close()

    def _begin(self, meta: dict[str, str]) -> None:
        execute = self._base.execute
        execute(f"PRAGMA application_id={layout.APPLICATION_ID}")
        execute(f"PRAGMA user_version={layout.SCHEMA_VERSION}")
        execute("PRAGMA journal_mode=WAL")
        execute("PRAGMA synchronous=FULL")
        meta["station"] = _text(station_json(self._station))
        meta["schema_version"] = str(layout.SCHEMA_VERSION)
        self._base.executescript(f"BEGIN;{layout.TABLES}COMMIT;")
        chain = layout.link_of_chain(self._chain, (b"", b"", b""), layout.heading(meta, self._station))
        self._transact(
            [
                ("INSERT INTO meta VALUES (?,?)", sorted(meta.items())),
                ("INSERT INTO loops VALUES (?,?,?,?,?,?,?)", layout.loop_rows(self._station)),
                ("INSERT INTO operands VALUES (?,?,?,?,?,?,?,?,?,?,?)", layout.operand_rows(self._station)),
                ("INSERT INTO meta VALUES (?,?)", [("heading_hash", chain.hex())]),
            ]
        )
        self._chain = chain

    def _transact(self, statements: list[tuple[str, list[tuple[Any, ...]]]]) -> None:
        execute = self._base.execute
        execute("BEGIN IMMEDIATE")
        try:
            for statement, rows in statements:
                if rows:
                    self._base.executemany(statement, rows)
            execute("COMMIT")
        except BaseException:
            # A full disk may have ended the transaction already.
            if self._base.in_transaction:
                execute("ROLLBACK")
            raise


def _text(found: Json) -> str:
    return json.dumps(found, ensure_ascii=False, default=float)
