"""Where a trace to tune from comes from: a CSV file, or a loop of a recording.

This file alone reads them. A CSV file has one line of names and then numbers; comma, semicolon or tab, decimal point,
or decimal comma where the separator is none; time in s, in ms where its name says so, or as date and time of ISO 8601.
Names may have their unit behind them in brackets.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping
from datetime import datetime
from pathlib import Path

import numpy as np

from ahgateway.apps.replay import picture_of
from ahgateway.clock import SECOND
from ahgateway.core.operands import Kind
from ahgateway.errors import ProfileError
from ahgateway.lockstep.follow import output_of, process_value_of, target_of
from ahgateway.recording.reader import Recording
from ahgateway.tuning.blocks import BLOCKS, Params
from ahgateway.tuning.record import Array, Record, polled

NAMES = ("time", "SV", "PV", "MV")
ALSO = {
    "time": ("time", "t", "t_s", "time_s", "seconds", "timestamp", "datetime", "t_ms", "time_ms"),
    "SV": ("sv", "sp", "setpoint"),
    "PV": ("pv", "cv", "value"),
    "MV": ("mv", "op", "output", "mout"),
}
"""Names that a column may have where no --map says it, in small letters."""
UNIT = re.compile(r"\s*[\[(].*$")
"""A unit behind a column's name: `PV [°C]`."""
MILLISECONDS = re.compile(r"_ms$|[\[(]\s*ms\s*[\])]")
"""A time column whose name says that it counts ms."""
UTF16_MARKS = (b"\xff\xfe", b"\xfe\xff")
SQLITE = b"SQLite format 3\x00"


def is_recording(path: Path) -> bool:
    """Tell whether a file is a recording, by its first bytes."""
    with path.open("rb") as handle:
        return handle.read(len(SQLITE)) == SQLITE


def read_csv(path: Path, columns: Mapping[str, str] | None = None) -> Record:
    """Return the trace in a CSV file.

    Args:
        path: The file.
        columns: `time`, `SV`, `PV` or `MV` to the name of its column; what is missing is found by its usual names.

    Raises:
        ProfileError: A column is not there, or a cell is no number.
    """
    file = str(path)
    lines = [line for line in _text(path).splitlines() if line.strip()]
    if len(lines) < 2:
        raise ProfileError(
            "has no samples" if lines else "is empty",
            file=file,
            hint="the first line names the columns, such as time,SV,PV,MV; numbers follow",
        )
    separator = max(";\t,", key=lambda sign: (lines[0].count(sign), -";\t,".index(sign)))
    rows = list(csv.reader(lines, delimiter=separator))
    head = [name.strip() for name in rows[0]]
    places = {name: _column(name, head, dict(columns or {}), file) for name in NAMES}
    values: dict[str, list[float]] = {name: [] for name in NAMES}
    for number, row in enumerate(rows[1:], start=2):
        for name, place in places.items():
            if place is None:
                values[name].append(float("nan"))
                continue
            cell = row[place].strip() if place < len(row) else ""
            values[name].append(_number(cell, separator, name == "time", f"{file}:{number}", head[place]))
    arrays = {name: np.array(column, dtype=np.float64) for name, column in values.items()}
    place = places["time"]
    assert place is not None
    unit = 1e-3 if MILLISECONDS.search(head[place].lower()) else 1.0
    return Record((arrays["time"] - arrays["time"][0]) * unit, arrays["SV"], arrays["PV"], arrays["MV"], file)


def _text(path: Path) -> str:
    """What stands in a text file, whichever of the usual encodings a trend program chose."""
    raw = path.read_bytes()
    for encoding in ("utf-16",) if raw[:2] in UTF16_MARKS else ("utf-8-sig", "cp1252"):
        try:
            text = raw.decode(encoding)
        except UnicodeDecodeError:
            continue
        if "\0" not in text:
            return text
    raise ProfileError("is no text file", file=str(path), hint="save it as CSV in UTF-8")


def _column(name: str, head: list[str], columns: Mapping[str, str], file: str) -> int | None:
    """Place of a column; SV may be missing."""
    if name in columns:
        if columns[name] in head:
            return head.index(columns[name])
        raise ProfileError(
            f"has no column `{columns[name]}` for {name}, it has {', '.join(head)}", file=file, key=f"--map {name}"
        )
    small = [UNIT.sub("", each.lower()) for each in head]
    for also in ALSO[name]:
        if also in small:
            return small.index(also)
    if name == "SV":
        return None
    named = any(each and not each.lstrip("+-").replace(",", ".").replace(".", "", 1).isdigit() for each in head)
    raise ProfileError(
        f"no column looks like {name}, there are {', '.join(head)}",
        file=file,
        hint=f"name it: --map {name}=COLUMN" if named else "the first line must name the columns: time,SV,PV,MV",
    )


def _number(cell: str, separator: str, is_time: bool, where: str, column: str) -> float:
    text = cell.replace(",", ".") if separator != "," else cell
    try:
        return float(text) if cell else float("nan")
    except ValueError:
        pass
    if is_time:
        try:
            return datetime.fromisoformat(cell).timestamp()
        except ValueError:
            pass
    if is_time:
        hint = "time in s, or as date and time of ISO 8601: 2026-03-01T12:00:00.250"
    else:
        hint = "decimal comma only where semicolon or tab separates, and no sign between thousands"
    raise ProfileError(f"`{cell}` is no number", file=where, key=column, hint=hint)


def read_recording(path: Path, name: str | None = None) -> tuple[Record, str, Params]:
    """Return the trace of a loop in a recording, its instruction, and its settings as they stood last.

    Raises:
        ProfileError: The recording has no such loop, several and none was named, or no samples of it.
    """
    with Recording(path) as recording:
        loops = {loop.name: loop for loop in recording.station.loops}
        if name is None and len(loops) > 1:
            raise ProfileError(
                f"holds {len(loops)} loops: {', '.join(loops)}", file=str(path), hint="choose one with --loop NAME"
            )
        loop = loops.get(name) if name is not None else next(iter(loops.values()))
        if loop is None:
            raise ProfileError(f"has no loop `{name}`, it has {', '.join(loops)}", file=str(path))
        times: list[float] = []
        values: list[tuple[float, float, float]] = []
        picture = None
        for row in recording.rows({loop.name}):
            picture = picture_of(loop, row)
            times.append(row.last_ns / SECOND)
            now = (target_of(loop, picture), process_value_of(loop, picture), output_of(loop, picture))
            values.append((float(now[0]), float(now[1]), float(now[2])))
        if picture is None:
            raise ProfileError(f"holds no samples of loop {loop.name}", file=str(path))
    settings = settings_of(loop.controller.name, picture.inputs)
    return _deduplicated(times, values, str(path)), loop.controller.name, settings


def settings_of(instruction: str, inputs: object) -> Params:
    """Return an instruction's settings by the manual's names, from what an execution read."""
    return {name: _plain(getattr(inputs, name.lower())) for name in BLOCKS[instruction].defaults}


def _plain(value: object) -> float | int | bool:
    if isinstance(value, bool | int):
        return value
    assert isinstance(value, np.floating), Kind.REAL
    return float(value)


def _deduplicated(times: list[float], values: list[tuple[float, float, float]], file: str) -> Record:
    """Samples with rising time; of several at one time the last counts."""
    t = np.array(times, dtype=np.float64)
    table: Array = np.array(values, dtype=np.float64).reshape(-1, 3)
    kept = np.concatenate([np.diff(t) > 0.0, [True]])
    t, table = t[kept], table[kept]
    return polled(Record(t - t[0], table[:, 0], table[:, 1], table[:, 2], file))
