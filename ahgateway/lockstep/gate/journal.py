"""The journal: every write with who, why, before and after, one JSON object a line, each chained to the one before.

This file alone decides the form of the chain. A line is a record's canonical JSON (keys sorted, no blanks, UTF-8); its
`hash` is the SHA-256 of the same without `hash`, its `prev` the hash of the record before, 64 zeros for the first. So
no byte can change without a trace, not even a blank or a key that stands twice. Each record is on the disk before
`append` returns. A power cut can cut the last line short: the next append ends that line and adds a record `torn` with
the hash of its bytes, so that every byte of the file is vouched for. What a full disk took of a line is cut off again.

The chain alone shows a change to whoever does not rewrite all that follows; a hash that stands elsewhere, on a sheet
or in a recording, shows every change before it. That is the anchor.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from io import FileIO
from pathlib import Path
from typing import Any

from ahgateway.clock import Clock
from ahgateway.errors import ProfileError, StateError

FIRST = "0" * 64
TORN = "torn"

Record = Mapping[str, Any]

Told = Callable[[Path, Record], None]
"""Told of every record once it is on the disk: the journal's file, and the record."""


@dataclass(frozen=True, slots=True)
class Checked:
    """What a journal is worth.

    Attributes:
        records: The records of the unbroken chain, in order.
        last: Hash of the last of them; 64 zeros for none.
        fault: Where and why the chain breaks, empty when it does not.
        anchor_at: Number of the record that the anchor names, None when there is none or no anchor was given.
        tail: Bytes of an unfinished last line.
    """

    records: tuple[Record, ...]
    last: str
    fault: str = ""
    anchor_at: int | None = None
    tail: bytes = b""


def digest(record: Record) -> str:
    """Return the hash of a record, over everything but its own `hash`."""
    return hashlib.sha256(_canonical({key: value for key, value in record.items() if key != "hash"})).hexdigest()


def _canonical(record: Record) -> bytes:
    return json.dumps(record, sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False).encode(
        "utf-8"
    )


def check(data: bytes, anchor: str | None = None) -> Checked:
    """Follow the chain through a journal's bytes; stops at the first record that does not fit."""
    *lines, tail = data.split(b"\n")
    records: list[Record] = []
    last, fault = FIRST, ""
    torn: bytes | None = None
    for number, line in enumerate(lines, 1):
        record = _parsed(line)
        if record is None:
            fault = f"line {number} is no record"
            if torn is not None or number == len(lines):
                break
            torn, fault = line, ""
            continue
        fault = _fault(record, line, last, len(records), torn)
        if fault:
            fault = f"line {number}: {fault}"
            break
        torn = None
        records.append(record)
        last = str(record["hash"])
    at = next((int(each["n"]) for each in records if anchor is not None and each["hash"] == anchor), None)
    return Checked(tuple(records), last, fault, at, tail)


def _parsed(line: bytes) -> Record | None:
    try:
        found = json.loads(line)
    except (ValueError, RecursionError):
        return None
    return found if isinstance(found, dict) and "hash" in found else None


def _fault(record: Record, line: bytes, last: str, number: int, torn: bytes | None) -> str:
    try:
        right = digest(record)
    except ValueError:
        return "holds what JSON cannot"
    if record["hash"] != right:
        return f"its content gives the hash {right[:12]}…, it says {str(record['hash'])[:12]}…"
    if line != _canonical(record):
        return "is not written as the gate writes it: a blank, an order or a key that stands twice was changed"
    if record.get("prev") != last:
        return "does not follow the record before it"
    if record.get("n") != number:
        return f"is number {record.get('n')}, expected {number}"
    if torn is not None and (record.get("kind") != TORN or record.get("sha256") != hashlib.sha256(torn).hexdigest()):
        return "the line before it is no record, and nothing vouches for it"
    return ""


def verify(path: Path, anchor: str | None = None) -> Checked:
    """Check the journal in a file.

    Raises:
        ProfileError: It cannot be read.
    """
    try:
        return check(path.read_bytes(), anchor)
    except OSError as error:
        raise ProfileError(f"cannot be read: {error.strerror}", file=str(path)) from error


class Journal:
    """One loop's journal, open for appending.

    Args:
        path: The file; it is made when it does not exist.
        clock: Gives UTC.
        told: Told of every record that is added.

    Raises:
        StateError: The file cannot be opened, or its chain is broken.
    """

    def __init__(self, path: Path, clock: Clock, told: Told | None = None) -> None:
        self.path = path
        self._told = told
        self._clock = clock
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            data = path.read_bytes() if path.exists() else b""
        except OSError as error:
            raise StateError(f"journal {path}: cannot be opened: {error.strerror}") from error
        found = check(data)
        if found.fault:
            raise StateError(
                f"journal {path}: {found.fault}; nothing is written while the journal cannot be trusted",
                hint="keep the file as evidence, move it away, and look at the loop before the next write",
            )
        self.records: list[Record] = list(found.records)
        self.last = found.last
        if found.tail:
            self._put(b"\n")
            self.append(TORN, bytes=len(found.tail), sha256=hashlib.sha256(found.tail).hexdigest())

    def append(self, kind: str, **facts: Any) -> Record:
        """Add a record and return it when it is on the disk.

        Raises:
            StateError: It could not be written.
        """
        record: dict[str, Any] = {"n": len(self.records), "utc_ns": self._clock.utc_ns(), "kind": kind, **facts}
        record["prev"] = self.last
        record["hash"] = digest(record)
        self._put(_canonical(record) + b"\n")
        self.records.append(record)
        self.last = record["hash"]
        if self._told is not None:
            self._told(self.path, record)
        return record

    def _put(self, data: bytes) -> None:
        try:
            with self.path.open("ab", buffering=0) as file:
                write_whole(file, data)
        except OSError as error:
            raise StateError(
                f"journal {self.path}: cannot be written: {error.strerror}",
                hint="is the disk full, or write-protected?",
            ) from error


def write_whole(file: FileIO, data: bytes) -> None:
    """Write all of it to the disk or nothing of it: behind half a record the next one would stand on its line."""
    begins = file.tell()
    try:
        while data:
            data = data[file.write(data) :]
        os.fsync(file.fileno())
    except OSError:
        with contextlib.suppress(OSError):
            file.truncate(begins)
        raise
