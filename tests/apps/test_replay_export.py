"""Exports read back by other libraries equal the recording bit for bit; an exported CSV makes the recording again."""

from __future__ import annotations

import csv
import json
import sqlite3
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from lockstep.bench_world import World
from mcap.reader import make_reader
from recording.conftest import Run

from ahgateway.apps.export import export
from ahgateway.apps.import_trend import Trend, import_csv
from ahgateway.apps.replay import Replay
from ahgateway.codec.words import real_words, words_real
from ahgateway.core.real import REAL, from_bits
from ahgateway.errors import ProfileError, StateError
from ahgateway.recording.reader import Recording, Row

REALS = ("SV", "PV", "Kc_Kp", "Ti_Ki", "Td_Kd", "Tf", "ERR_DBW", "MV_MAX", "MV_MIN", "MOUT", "BIAS", "MV")
ODD = (0x80000000, 0x00000001, 0x7F7FFFFF, 0x7F800000, 0xFF800000, 0x3DCCCCCD)
"""-0, the smallest subnormal, the largest number, both infinities, 0.1."""


@pytest.fixture
def run(tmp_path: Path) -> Run:
    return Run(tmp_path / "run.ahrec", World(is_restless=True))


@pytest.fixture
async def rows(run: Run) -> list[Row]:
    """Pictures of a loop with junk in its memory, and behind them one row for each odd REAL in SV."""
    await run.polls(70)
    run.tape.recorder.flush()
    picture = run.world.follower.picture
    assert picture is not None
    for number, pattern in enumerate(ODD, 1):
        odd = {**picture.words, "SV": real_words(from_bits(pattern))}
        times = (picture.sent_ns + number, picture.last_ns + number, picture.utc_ns + number)
        run.tape.recorder.row(Row("L1", picture.tick + number, *times, 0, None, odd))
    run.close()
    with Recording(run.path) as recording:
        return list(recording.rows())


def written(run: Run, to: str) -> Path:
    with Recording(run.path) as recording:
        (path,) = export(recording, to, run.path.with_suffix(f".{to}"))
    return path


def bits(row: Row, name: str) -> int:
    low, high = row.words[name][:2]
    return high << 16 | low


def test_csv_reads_back_to_the_bits_and_names_units_and_time(run: Run, rows: list[Row]) -> None:
    with written(run, "csv").open(encoding="utf-8-sig", newline="") as handle:
        titles, *lines = list(csv.reader(handle))
    assert ["time", "utc_ns", "tick", "running", "PID_RUN", "SV", "PV"] == titles[:7]
    assert "CYCLE [ms]" in titles
    assert "MV_MAX [%]" in titles
    named = [{title.partition(" [")[0]: cell for title, cell in zip(titles, line, strict=True)} for line in lines]
    assert [row.utc_ns for row in rows] == [int(line["utc_ns"]) for line in named]
    assert "2026-01-01 00:00:00.027400" == named[0]["time"]
    for name in REALS:
        patterns = [int(np.float32(line[name]).view(np.uint32)) for line in named]
        assert [bits(row, name) for row in rows] == patterns
    assert [row.words["I_MV"] for row in rows] == [tuple(int(w, 16) for w in x["I_MV_words"].split()) for x in named]
    assert {"", "MATCH", "UNOBSERVABLE"} == {line["verdict"] for line in named}


def test_parquet_reads_back_to_the_bits_with_types_and_units(run: Run, rows: list[Row]) -> None:
    table = pq.read_table(written(run, "parquet"))
    assert "timestamp[ns, tz=UTC]" == str(table.schema.field("time").type)
    assert b"%" == table.schema.field("MV").metadata[b"unit"]
    assert b"DPIDE" == table.schema.metadata[b"instruction"]
    assert [row.utc_ns for row in rows] == table["time"].cast("int64").to_pylist()
    for name in REALS:
        assert [bits(row, name) for row in rows] == table[name].to_numpy().view(np.uint32).tolist()
    assert [row.words["I_MV"] for row in rows] == [tuple(words) for words in table["I_MV_words"].to_pylist()]
    assert [row.running for row in rows] == table["running"].to_pylist()
    assert [bool(row.words["PID_RUN"][0]) for row in rows] == table["PID_RUN"].to_pylist()


def test_mcap_reads_back_to_the_bits_with_a_schema(run: Run, rows: list[Row]) -> None:
    found: list[tuple[int, dict[str, Any]]] = []
    with written(run, "mcap").open("rb") as handle:
        for schema, channel, message in make_reader(handle).iter_messages():
            assert schema is not None
            assert ("/L1", "json", "jsonschema") == (channel.topic, channel.message_encoding, schema.encoding)
            found.append((message.log_time, json.loads(message.data)))
    assert [row.utc_ns for row in rows] == [utc_ns for utc_ns, _ in found]
    for name in REALS:
        patterns = [int(np.float32(float(value[name])).view(np.uint32)) for _, value in found]
        assert [bits(row, name) for row in rows] == patterns
    assert [row.words["CYCLE"][0] for row in rows] == [value["CYCLE"] for _, value in found]


def test_an_exported_csv_imports_to_the_same_words(run: Run, rows: list[Row], tmp_path: Path) -> None:
    again = tmp_path / "again.ahrec"
    assert len(rows) == import_csv(written(run, "csv"), again, Trend())
    with Recording(again) as recording:
        found = list(recording.rows())
        assert [] == recording.check().texts
        assert ("import", "run.csv") == (recording.meta["origin"], recording.meta["source"])
        assert [row.words for row in rows] == [row.words for row in found]
        assert [row.utc_ns for row in rows] == [row.utc_ns for row in found]
        with pytest.raises(StateError, match="lacks the words that the instruction remembers"):
            Replay(recording)


def test_a_file_that_is_there_is_not_overwritten(run: Run, rows: list[Row]) -> None:
    written(run, "csv")
    with pytest.raises(StateError, match="exists already"):
        written(run, "csv")


def test_an_unknown_loop_is_said(run: Run, rows: list[Row]) -> None:
    with Recording(run.path) as recording, pytest.raises(StateError, match="has no loop `L9`, it has L1"):
        export(recording, "csv", run.path.with_suffix(".csv"), ("L9",))


@pytest.mark.parametrize(
    "text",
    [
        "Date,TT101,SP,Out\n0,20.5,50,1\n0.5,20.25,50,2\n",
        "Date;TT101;SP;Out\n0;20,5;50;1\n0,5;20,25;50;2\n",
        "Date\tTT101 [°C]\tSP\tOut\n0\t20.5\t50\t1\n0.5\t20.25\t50\t2\n",
    ],
)
def test_a_strange_trend_is_taken_by_its_map(tmp_path: Path, text: str) -> None:
    (tmp_path / "t.csv").write_text(text, encoding="utf-8")
    trend = Trend("DPID", "TIC-1", {"time": "Date", "PV": "TT101", "MV": "Out"}, {"Kp": "2.5", "PID_MAN": "on"}, 10**18)
    assert 2 == import_csv(tmp_path / "t.csv", tmp_path / "t.ahrec", trend)
    with Recording(tmp_path / "t.ahrec") as recording:
        first, second = recording.rows({"TIC-1"})
    values = [float(words_real(*second.words[name])) for name in ("PV", "SV", "MV", "Kp")]
    assert [20.25, 50.0, 2.0, 2.5] == values
    assert ((1,), 10**18, 10**18 + 500_000_000) == (first.words["PID_MAN"], first.utc_ns, second.utc_ns)
    assert REAL(20.5) == words_real(*first.words["PV"])


@pytest.mark.parametrize(
    ("text", "changes", "said"),
    [
        ("a,b\n1,2\n", {}, "no column for time and PV, there are a, b"),
        ("time,PV\n1,x\n", {}, "t.csv:2: `x` is no REAL for PV"),
        ("time,PV\n1,1\n1,2\n", {}, "t.csv:3: 1 is not later than the row before"),
        ("time,PV\nnoon,1\n", {}, "t.csv:2: `noon` is no time"),
        ("time,PV\n1\n", {}, "has 1 cells, PV should be cell 2"),
        ("time,PV\n", {}, "has 1 lines"),
        ("time,PV\n1,1\n", {"columns": {"PW": "PV"}}, "DPIDE has no operand `PW`"),
        ("time,PV\n1,1\n", {"columns": {"MV": "Out"}}, "there is no column `Out` for MV"),
        ("time,PV\n1,1\n", {"constants": {"Tfx": "1"}}, "DPIDE has no operand `Tfx`"),
        ("time,PV\n1,1\n", {"constants": {"CYCLE": "fast"}}, "`fast` is no DINT for CYCLE"),
        ("time,PV\n1,1\n", {"instruction": "PID"}, "`PID` cannot be imported for, DPID and DPIDE can"),
    ],
)
def test_what_is_wrong_with_a_trend_is_said_and_no_file_is_left(
    tmp_path: Path, text: str, changes: dict[str, Any], said: str
) -> None:
    (tmp_path / "t.csv").write_text(text)
    with pytest.raises(ProfileError) as wrong:
        import_csv(tmp_path / "t.csv", tmp_path / "t.ahrec", Trend(**changes))
    assert said in str(wrong.value)
    assert ["t.csv"] == [path.name for path in tmp_path.iterdir()]


def test_any_sqlite_program_reads_events_and_notes(run: Run) -> None:
    run.tape.recorder.note(1, "hello")
    run.close()
    base = sqlite3.connect(run.path)
    assert [("hello",)] == base.execute("SELECT text FROM notes").fetchall()
    base.close()
