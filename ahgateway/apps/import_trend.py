"""Someone else's trend as a recording: a CSV file, and which of its columns is which operand.

What the CSV does not hold takes the values that were given, or the operand's default. What the instruction remembers
is seldom in a trend, so such a recording can be shown, exported and tuned from, and says so when it is to be judged.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from datetime import datetime
from difflib import get_close_matches
from pathlib import Path

from ahgateway.apps.moments import utc_ns
from ahgateway.apps.record import versions
from ahgateway.clock import SECOND
from ahgateway.codec import block
from ahgateway.codec.station import Loop, Station
from ahgateway.codec.words import encode
from ahgateway.core.controllers import CONTROLLERS, Controller
from ahgateway.core.operands import Kind, Operand
from ahgateway.errors import CodecError, ProfileError
from ahgateway.recording import layout
from ahgateway.recording.packing import IMPORTED, Entry
from ahgateway.recording.runfile import Batch, RunFile
from ahgateway.schema import device_map
from ahgateway.schema.layout import INSTRUCTIONS, manual

ROWS_PER_COMMIT = 1000
TIME = "time"
EXACT_TIME = "utc_ns"
"""What our own export adds: the time with all of its digits."""
ALSO = {
    TIME: ("time", "timestamp", "datetime", "date", "t", "seconds"),
    "SV": ("sv", "sp", "setpoint"),
    "PV": ("pv", "cv", "value"),
    "MV": ("mv", "op", "output", "co"),
}
"""Usual names of columns, in small letters."""
SWITCH = {"1": True, "true": True, "on": True, "0": False, "false": False, "off": False}
_TITLE = re.compile(r"(?P<name>.*?)\s*\[(?P<unit>[^\]]*)\]")


@dataclass(frozen=True, slots=True)
class Trend:
    """What is said about a CSV file.

    Attributes:
        instruction: DPID or DPIDE: which operands there are.
        loop: Name of the loop in the recording.
        columns: Operand, or `time`, to the name of its column; what is missing is found by its usual names.
        constants: Operand to the value that it had all the time.
        start_ns: UTC of second 0 where the column of times holds seconds.
    """

    instruction: str = "DPIDE"
    loop: str = "L1"
    columns: Mapping[str, str] | None = None
    constants: Mapping[str, str] | None = None
    start_ns: int = 0


def import_csv(source: Path, out: Path, trend: Trend) -> int:
    """Make a recording of a CSV file and return how many rows it has.

    Raises:
        ProfileError: A column is not there, a cell cannot be read, or times do not rise.
        StateError: `out` exists already, or cannot be made.
    """
    if trend.instruction not in INSTRUCTIONS:
        raise ProfileError(
            f"`{trend.instruction}` cannot be imported for, {' and '.join(INSTRUCTIONS)} can", key="--instruction"
        )
    controller = CONTROLLERS[trend.instruction]
    rows = _table(source)
    titles = next(rows, [])
    names, units = _titles(titles)
    places = _places(source, controller, names, dict(trend.columns or {}))
    loop = Loop(
        trend.loop,
        controller,
        dict(manual(controller)),
        pv_unit=_unit(places, units, "PV", ""),
        mv_unit=_unit(places, units, "MV", "%"),
    )
    station = Station(source.stem, f"replay://{out}", 1, device_map.load("ah500"), (loop,))
    meta = {**versions(), "origin": "import", "source": source.name, "profile": "", "part": "1"}
    file = RunFile(out, station, meta)
    try:
        count = _fill(file, source, controller, trend, places, rows)
    except BaseException:
        file.close({})
        out.unlink(missing_ok=True)
        raise
    file.close({})
    return count


def _fill(
    file: RunFile, source: Path, controller: Controller, trend: Trend, places: dict[str, int], rows: Iterator[list[str]]
) -> int:
    kinds = {row.name: row for row in controller.operands}
    base = dict(block.defaults(controller))
    for name, text in (trend.constants or {}).items():
        if name not in kinds:
            raise ProfileError(f"{controller.name} has no operand `{name}`", key="--set", hint=_near(name, list(kinds)))
        base[name] = _words(kinds[name], text, f"--set {name}")
    batch, count, before = Batch(), 0, -1
    for line, cells in enumerate(rows, 2):
        where = f"{source}:{line}"
        moment = _moment(cells, places, trend.start_ns, where)
        if moment <= before:
            raise ProfileError(f"{cells[places[TIME]]} is not later than the row before", file=where)
        before = moment
        words = dict(base)
        for name, place in places.items():
            if name not in (TIME, EXACT_TIME):
                if place >= len(cells):
                    raise ProfileError(f"has {len(cells)} cells, {name} should be cell {place + 1}", file=where)
                words[name] = _words(kinds[name], cells[place], where)
        packed = b"".join(
            word.to_bytes(2, "little") for name, _ in layout.columns(file.loops[0]) for word in words[name]
        )
        batch.entries.append(Entry(0, count, moment, moment, moment, 0, IMPORTED, packed))
        count += 1
        if len(batch.entries) == ROWS_PER_COMMIT:
            file.commit(batch, moment, moment)
            batch = Batch()
    if batch:
        file.commit(batch, before, before)
    return count


def _table(source: Path) -> Iterator[list[str]]:
    """Yield the rows of a CSV file with comma, semicolon or tab; decimal commas become points."""
    try:
        text = source.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        text = source.read_text(encoding="cp1252")
    except OSError as error:
        raise ProfileError(f"cannot be read: {error.strerror}", file=str(source)) from error
    lines = [line for line in text.splitlines() if line.strip()]
    if len(lines) < 2:
        raise ProfileError(f"has {len(lines)} lines, a line of names and one row are the least", file=str(source))
    separator = max(";\t,", key=lines[0].count)
    for row in csv.reader(lines, delimiter=separator):
        yield [cell.strip() for cell in row] if separator == "," else [_point(cell.strip()) for cell in row]


def _point(cell: str) -> str:
    return cell.replace(",", ".") if re.fullmatch(r"[-+0-9.,eE]+", cell) else cell


def _titles(titles: list[str]) -> tuple[list[str], list[str]]:
    """Names and units: `SV [°C]` is SV in °C."""
    found = [(match["name"], match["unit"]) if (match := _TITLE.fullmatch(title)) else (title, "") for title in titles]
    return [name for name, _ in found], [unit for _, unit in found]


def _places(source: Path, controller: Controller, names: list[str], columns: dict[str, str]) -> dict[str, int]:
    """Operand, or time, to the number of its column."""
    operands = {row.name: row for row in controller.operands}
    small = {name.lower(): place for place, name in reversed(list(enumerate(names)))}
    found: dict[str, int] = {}
    for name, title in columns.items():
        if name != TIME and name not in operands:
            known = [TIME, *operands]
            raise ProfileError(f"{controller.name} has no operand `{name}`", key="--map", hint=_near(name, known))
        if title.lower() not in small:
            raise ProfileError(
                f"there is no column `{title}` for {name}, there are {', '.join(names)}",
                file=str(source),
                hint=_near(title, names),
            )
        found[name] = small[title.lower()]
    for name in (TIME, *operands):
        own = f"{name}_words" if name in operands and operands[name].kind is Kind.BLOCK else name
        usual = (own.lower(), *ALSO.get(name, ()))
        place = next((small[each] for each in usual if each in small), None)
        if name not in found and place is not None:
            found[name] = place
    if TIME not in columns and EXACT_TIME in small:
        found[EXACT_TIME] = small[EXACT_TIME]
    missing = [name for name in (TIME, "PV") if name not in found]
    if missing:
        raise ProfileError(
            f"no column for {' and '.join(missing)}, there are {', '.join(names)}",
            file=str(source),
            hint=f"name it, such as --map {missing[0]}={names[0]}",
        )
    return found


def _unit(places: dict[str, int], units: list[str], name: str, usual: str) -> str:
    return units[places[name]] or usual if name in places else usual


def _words(row: Operand, text: str, where: str) -> tuple[int, ...]:
    try:
        if row.kind is Kind.BLOCK:
            words = tuple(int(word, 16) for word in text.split())
            if len(words) != row.words or max(words, default=0) > 0xFFFF:
                raise ValueError(f"{len(words)} words")
            return words
        if row.kind is Kind.BOOL:
            return (int(SWITCH[text.lower()]),)
        number = float(text)
        return encode(row.kind, number if row.kind is Kind.REAL else int(number))
    except (ValueError, KeyError, OverflowError, CodecError) as error:
        raise ProfileError(f"`{text}` is no {row.kind.value} for {row.name}", file=where) from error


def _moment(cells: list[str], places: dict[str, int], start_ns: int, where: str) -> int:
    exact = places.get(EXACT_TIME)
    if exact is not None and exact < len(cells) and cells[exact].isdecimal():
        return int(cells[exact])
    place = places[TIME]
    text = cells[place] if place < len(cells) else ""
    try:
        return start_ns + round(float(text) * SECOND)
    except (ValueError, OverflowError):
        pass
    try:
        return utc_ns(datetime.fromisoformat(text))
    except ValueError:
        raise ProfileError(
            f"`{text}` is no time", file=where, hint="seconds, or date and time such as 2026-11-22 03:04:05.250"
        ) from None


def _near(name: str, known: list[str]) -> str:
    near = get_close_matches(name, known, 1, 0.5)
    return f"did you mean `{near[0]}`?" if near else f"known are {', '.join(known)}"
