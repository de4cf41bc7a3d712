"""A recording for other programs: CSV, Parquet or MCAP, absolute time, units, operands in the manual's spelling."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from ahgateway.clock import SECOND
from ahgateway.codec.station import Loop
from ahgateway.core.operands import Kind
from ahgateway.errors import StateError
from ahgateway.recording.reader import Recording
from ahgateway.recording.values import Field, Part, fields, parts

VERDICT = ("verdict", "proof", "class")


def export(recording: Recording, to: str, out: Path, loops: tuple[str, ...] = ()) -> list[Path]:
    """Write a recording in another format and return the files that were made.

    Args:
        recording: What is written.
        to: `csv`, `parquet` (one file per loop) or `mcap` (one file, a channel per loop).
        out: The file for one loop or MCAP, otherwise the directory for the files.
        loops: Names of the loops; () for all.

    Raises:
        StateError: A loop is not there, a file exists, or a library is missing.
    """
    wanted = [loop for loop in recording.station.loops if not loops or loop.name in loops]
    unknown = set(loops) - {loop.name for loop in wanted}
    if unknown:
        known = ", ".join(recording.names)
        raise StateError(f"{recording.path}: has no loop `{sorted(unknown)[0]}`, it has {known}")
    if to == "mcap":
        _need("mcap", "MCAP")
        from ahgateway.apps.export_mcap import write_mcap

        write_mcap(recording, wanted, _new(out))
        return [out]
    write: Callable[[Recording, Loop, Path], None] = write_csv
    if to == "parquet":
        _need("pyarrow", "Parquet")
        from ahgateway.apps.export_parquet import write_parquet

        write = write_parquet
    if len(wanted) == 1 and out.suffix:
        write(recording, wanted[0], _new(out))
        return [out]
    out.mkdir(parents=True, exist_ok=True)
    made = []
    for loop in wanted:
        path = _new(out / f"{recording.path.stem}-{_safe(loop.name)}.{to}")
        write(recording, loop, path)
        made.append(path)
    return made


def write_csv(recording: Recording, loop: Loop, path: Path) -> None:
    """Write one loop as CSV: a head line with units in brackets, then a line per picture.

    REALs have the fewest digits that give their bits back; NaN, inf and -inf are written so. Time is UTC in the form
    that Excel, pandas and DuckDB take for a date; `utc_ns` has all of its digits.
    """
    columns = fields(loop)
    has_signs = any(not field.unit.isascii() for field in columns)
    # Excel takes a file for UTF-8 only when it starts with the mark; others take it off.
    with path.open("w", encoding="utf-8-sig" if has_signs else "utf-8", newline="") as handle:
        writer = csv.writer(handle)
        writer.writerow(["time", "utc_ns", "tick", "running", *map(_title, columns), *VERDICT])
        for part in parts(recording, loop):
            writer.writerows(_csv_rows(part, columns))


def _csv_rows(part: Part, columns: list[Field]) -> Iterator[list[Any]]:
    texts = [_texts(field, part.values[field.name]) for field in columns]
    running = ["" if each is None else int(each) for each in part.running]
    verdicts = [[each.get(key) or "" for key in VERDICT] if each else ["", "", ""] for each in part.verdicts]
    rows = zip(part.utc_ns.tolist(), part.ticks.tolist(), running, verdicts, *texts, strict=True)
    for utc_ns, tick, state, verdict, *values in rows:
        yield [iso(utc_ns), utc_ns, tick, state, *values, *verdict]


def iso(utc_ns: int) -> str:
    """Return `2026-11-22 03:04:05.123456`, UTC."""
    moment = datetime.fromtimestamp(utc_ns // SECOND, UTC)
    return f"{moment:%Y-%m-%d %H:%M:%S}.{utc_ns % SECOND // 1000:06d}"


def _title(field: Field) -> str:
    return f"{field.name} [{field.unit}]" if field.unit else field.name


def _texts(field: Field, values: Any) -> list[Any]:
    if field.kind is Kind.REAL:
        # The text of a float32 is the shortest that reads back to its bits.
        return [str(value) for value in values]
    if field.kind is Kind.BLOCK:
        return [" ".join(f"{word:04x}" for word in row) for row in values.tolist()]
    return list(values.astype(np.int64).tolist())


def _new(path: Path) -> Path:
    if path.exists():
        raise StateError(f"{path}: exists already", hint="give another name with --out")
    return path


def _safe(name: str) -> str:
    return "".join(sign if sign.isalnum() or sign in "-_." else "_" for sign in name)


def _need(module: str, what: str) -> None:
    if find_spec(module) is None:
        raise StateError(
            f"{what} needs the library {module}, which is not installed",
            hint="`pip install ahgateway[export]`, or --to csv, which needs nothing",
        )


def about(recording: Recording, loop: Loop) -> dict[str, str]:
    """Return what an export carries beside its rows, as text."""
    kept = ("ahgateway", "target", "created_utc_ns", "clock_offset_ns", "content_hash", "profile")
    meta = {name: recording.meta[name] for name in kept if name in recording.meta}
    units = {field.name: field.unit for field in fields(loop) if field.unit}
    return {
        **meta,
        "station": recording.station.name,
        "loop": loop.name,
        "instruction": loop.controller.name,
        "units": json.dumps(units, ensure_ascii=False),
    }
