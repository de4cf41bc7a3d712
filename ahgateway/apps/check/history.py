"""The results of many nights in one SQLite file: when a check first failed, how often it flickers, how figures drift.

One row per run and per scenario in it. Only what a scenario claimed is kept, no words and no traces. A run is written
in one transaction behind its end, so that a killed one leaves nothing behind.
"""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path

from ahgateway.apps.check.result import Result
from ahgateway.clock import SECOND
from ahgateway.errors import ProfileError

APPLICATION_ID = 0x41484348
"""`AHCH` in the file's header."""

BUSY_S = 10.0
NIGHTS_MAX = 20
"""How many runs back flakiness and drift look."""

SCHEMA = """
create table if not exists run (id integer primary key, utc_ns integer not null, target text not null,
    seed integer not null, version text not null);
create table if not exists result (run integer not null references run(id), name text not null, verdict text not null,
    reason text not null, figures text not null, primary key (run, name)) without rowid;
create index if not exists result_by_name on result (name, run);
"""


@dataclass(frozen=True, slots=True)
class Past:
    """What is known of one scenario on one target, the run at hand included.

    Attributes:
        name: The scenario.
        runs: How many of the last runs had it.
        failed_since: UTC of the first failure of those that it ends with; None when it did not fail last.
        flips: How often its verdict changed from one of these runs to the next.
        drifts: Figure to its oldest and its newest value, of those that differ.
        nights: UTC of these runs, oldest first.
        verdicts: Their verdicts.
        series: Figure to its value in each of these runs; None where a run did not measure it.
    """

    name: str
    runs: int
    failed_since: str | None
    flips: int
    drifts: dict[str, tuple[float, float]]
    nights: tuple[str, ...] = ()
    verdicts: tuple[str, ...] = ()
    series: Mapping[str, tuple[float | None, ...]] = field(default_factory=dict)

    @property
    def moved(self) -> list[str]:
        """Figures that moved by more than `DRIFT` from the oldest of these runs to the newest."""
        return [
            name for name, (old, new) in self.drifts.items() if abs(new - old) > DRIFT * max(abs(old), abs(new))
        ]  # fmt: skip


def kept(path: Path, results: Sequence[Result], target: str, seed: int, version: str, utc_ns: int) -> list[Past]:
    """Add a run to the file, which is made when it is not there; return what is known of each of its scenarios.

    Raises:
        ProfileError: The file is no history, or cannot be written.
    """
    try:
        with closing(sqlite3.connect(path, timeout=BUSY_S)) as base, base:
            _check(base, path)
            base.executescript(f"pragma application_id = {APPLICATION_ID};{SCHEMA}")
            row = (utc_ns, target, seed, version)
            run = base.execute("insert into run (utc_ns, target, seed, version) values (?, ?, ?, ?)", row).lastrowid
            base.executemany(
                "insert into result values (?, ?, ?, ?, ?)",
                [(run, each.name, each.verdict.value, each.reason, json.dumps(each.figures)) for each in results],
            )
            return [_past(base, each.name, target) for each in results]
    except sqlite3.Error as error:
        raise ProfileError(f"cannot be kept: {error}", file=str(path)) from error


def _check(base: sqlite3.Connection, path: Path) -> None:
    found = base.execute("pragma application_id").fetchone()[0]
    is_empty = not base.execute("select count(*) from sqlite_master").fetchone()[0]
    if found != APPLICATION_ID and not is_empty:
        raise ProfileError("is another program's database", file=str(path), hint="name a new file")


def _past(base: sqlite3.Connection, name: str, target: str) -> Past:
    """Read the last runs of a scenario, newest first."""
    rows = base.execute(
        "select utc_ns, verdict, figures from result join run on run.id = result.run "
        "where name = ? and target = ? order by run.id desc limit ?",
        (name, target, NIGHTS_MAX),
    ).fetchall()
    verdicts = [verdict for _, verdict, _ in rows]
    failing = next((at for at, verdict in enumerate(verdicts) if verdict != "fail"), len(rows))
    since = None if not failing else _day(rows[failing - 1][0])
    newest, oldest = json.loads(rows[0][2]), json.loads(rows[-1][2])
    return Past(
        name,
        len(rows),
        since,
        sum(one != other for one, other in pairwise(verdicts)),
        {key: (oldest[key], newest[key]) for key in newest if key in oldest and oldest[key] != newest[key]},
        tuple(_day(utc_ns) for utc_ns, _, _ in reversed(rows)),
        tuple(reversed(verdicts)),
        {key: tuple(json.loads(figures).get(key) for _, _, figures in reversed(rows)) for key in newest},
    )


def _day(utc_ns: int) -> str:
    return datetime.fromtimestamp(utc_ns // SECOND, UTC).strftime("%Y-%m-%d %H:%M UTC")


def sentence(past: Past) -> str:
    """Say what a person should know of a scenario's past; empty when it is as always."""
    parts = []
    if past.failed_since is not None:
        parts.append(f"fails since {past.failed_since}")
    if past.flips > 1:
        parts.append(f"changed its verdict {past.flips} times in {past.runs} runs")
    for name in past.moved:
        oldest, newest = past.drifts[name]
        parts.append(f"{name} went from {oldest:.4g} to {newest:.4g} in {past.runs} runs")
    return ", ".join(parts)


DRIFT = 0.05
"""Share by which a figure must have moved to be named."""
