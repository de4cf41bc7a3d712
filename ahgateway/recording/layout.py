"""The tables of a recording and what each column holds; normative text in docs/reference/recording.md.

This file alone knows the file's schema and its version. A reader opens every version up to its own.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from ahgateway.codec import block
from ahgateway.codec.station import Const, Loop, Station
from ahgateway.core.operands import Kind

APPLICATION_ID = 0x41484757
"""`AHGW` in the SQLite header, so that `file` and our own door know a recording."""

SCHEMA_VERSION = 1

TABLES = """
CREATE TABLE meta (key TEXT PRIMARY KEY, value TEXT NOT NULL) WITHOUT ROWID;
CREATE TABLE loops (
  id INTEGER PRIMARY KEY, name TEXT NOT NULL UNIQUE, instruction TEXT NOT NULL, dialect TEXT NOT NULL,
  pv_unit TEXT NOT NULL, mv_unit TEXT NOT NULL, columns TEXT NOT NULL);
CREATE TABLE operands (
  loop INTEGER NOT NULL, position INTEGER NOT NULL, name TEXT NOT NULL, kind TEXT NOT NULL, unit TEXT NOT NULL,
  words INTEGER NOT NULL, device TEXT, "table" TEXT, address INTEGER, bit INTEGER, constant TEXT,
  PRIMARY KEY (loop, name)) WITHOUT ROWID;
CREATE TABLE seconds (
  id INTEGER PRIMARY KEY, now_ns INTEGER NOT NULL, utc_ns INTEGER NOT NULL, rows INTEGER NOT NULL,
  first_utc_ns INTEGER, last_utc_ns INTEGER, words BLOB NOT NULL, verdicts BLOB NOT NULL, frames BLOB NOT NULL,
  chain BLOB NOT NULL);
CREATE TABLE verdicts (id INTEGER PRIMARY KEY, json TEXT NOT NULL UNIQUE);
CREATE TABLE events (
  id INTEGER PRIMARY KEY, second INTEGER NOT NULL, utc_ns INTEGER NOT NULL, loop TEXT NOT NULL,
  tick INTEGER NOT NULL, kind TEXT NOT NULL, json TEXT NOT NULL);
CREATE TABLE writes (
  id INTEGER PRIMARY KEY, second INTEGER NOT NULL, utc_ns INTEGER NOT NULL, loop TEXT NOT NULL,
  operand TEXT NOT NULL, json TEXT NOT NULL);
CREATE TABLE notes (
  id INTEGER PRIMARY KEY, second INTEGER NOT NULL, utc_ns INTEGER NOT NULL, text TEXT NOT NULL);
"""

CHAIN_START = b"\x00" * 32

Blobs = tuple[bytes, bytes, bytes]


def columns(loop: Loop) -> list[tuple[str, int]]:
    """Return what stands in a row of this loop, in order: operand (and `EN`, `COUNTER` where bound) and its words."""
    found = [(row.name, max(1, row.words)) for row in loop.controller.operands]
    if loop.en is not None:
        found.append((block.EN, 1))
    if loop.counter is not None:
        found.append((block.COUNTER, 1))
    return found


def loop_rows(station: Station) -> list[tuple[Any, ...]]:
    """Return the rows of the table `loops`."""
    from ahgateway.recording.station_text import dialect_json

    return [
        (
            number,
            loop.name,
            loop.controller.name,
            json.dumps(dialect_json(loop.controller, loop.dialect), default=float),
            loop.pv_unit,
            loop.mv_unit,
            json.dumps(columns(loop)),
        )
        for number, loop in enumerate(station.loops)
    ]


def operand_rows(station: Station) -> list[tuple[Any, ...]]:
    """Return the rows of the table `operands`: where each stands, or which constant it is."""
    found: list[tuple[Any, ...]] = []
    for number, loop in enumerate(station.loops):
        for position, row in enumerate(loop.controller.operands):
            binding = loop.bindings[row.name]
            place: tuple[Any, ...]
            if isinstance(binding, Const):
                place = (None, None, None, None, json.dumps(binding.value, default=float))
            else:
                address = station.devices.address(binding, bits=row.kind is Kind.BOOL)
                place = (str(binding), address.table.value, address.address, address.bit, None)
            unit = unit_of(row.unit, loop)
            found.append((number, position, row.name, row.kind.value, unit, max(1, row.words), *place))
    return found


def unit_of(unit: str, loop: Loop) -> str:
    """Return an operand's engineering unit for this loop: `PV` and `MV` stand for the loop's own units."""
    own = {"PV": loop.pv_unit, "MV": loop.mv_unit}
    return own.get(unit, unit)


def link_of_chain(before: bytes, blobs: Blobs, texts: Iterable[Sequence[Any]]) -> bytes:
    """Return the hash that seals one second: over the seal before, its blobs, and its rows of text."""
    digest = hashlib.sha256(before)
    for blob in blobs:
        digest.update(len(blob).to_bytes(8, "little") + blob)
    for text in texts:
        digest.update(json.dumps(list(text), ensure_ascii=False).encode("utf-8") + b"\n")
    return digest.digest()


def heading(meta: Mapping[str, str], station: Station) -> list[Sequence[Any]]:
    """Return what the first seal covers: the station and everything known of the run at its start."""
    return [sorted(meta.items()), *loop_rows(station), *operand_rows(station)]
