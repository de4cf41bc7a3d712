"""The file: what was committed is there, sealed, readable while it grows, and never overwritten."""

from __future__ import annotations

import sqlite3
from pathlib import Path

import pytest
from lockstep.bench_world import World
from recording.conftest import Run

from ahgateway.clock import SECOND, VirtualClock
from ahgateway.codec.station import Station
from ahgateway.errors import StateError
from ahgateway.recording.packing import Entry
from ahgateway.recording.reader import Recording, Row
from ahgateway.recording.recorder import Recorder, Rolling
from ahgateway.recording.runfile import Batch, RunFile


@pytest.fixture(scope="module")
def station() -> Station:
    return World().station


def row(tick: int, word: int = 0) -> Row:
    """A row of a DPIDE block of 48 words and 6 flags in which only SV's low word is not 0."""
    widths = {operand.name: max(1, operand.words) for operand in World().loop.controller.operands}
    words = {name: (0,) * width for name, width in widths.items()} | {"SV": (word, 0)}
    return Row("L1", tick, tick * SECOND, tick * SECOND + 1, tick * SECOND + 2, 0, True, words)


def recorder(path: Path, station: Station, **options: object) -> tuple[Recorder, VirtualClock]:
    clock = VirtualClock()
    return Recorder(path, station, clock, {"ahgateway": "0"}, **options), clock  # type: ignore[arg-type]


def ticks(path: Path) -> list[int]:
    with Recording(path) as recording:
        return [each.tick for each in recording.rows()]


def test_a_clean_close_leaves_one_file_that_says_what_it_is(tmp_path: Path, station: Station) -> None:
    tape, _ = recorder(tmp_path / "a.ahrec", station)
    tape.row(row(0, 7))
    tape.close()
    assert ["a.ahrec"] == [path.name for path in tmp_path.iterdir()]
    with Recording(tmp_path / "a.ahrec") as recording:
        assert (1, True, "1", "0") == (
            recording.schema_version,
            recording.is_closed,
            recording.meta["part"],
            recording.meta["dropped"],
        )
        assert [(7, 0)] == [each.words["SV"] for each in recording.rows()]
        assert (1, 2, 2) == recording.totals()


def test_the_station_comes_back_equal_without_its_profile(run: Run) -> None:
    run.close()
    with Recording(run.path) as recording:
        found = recording.station
    assert run.world.station.devices == found.devices
    assert run.world.station.loops == found.loops
    assert ("test", "memory:", 1, run.world.station.running) == (found.name, found.target, found.unit, found.running)


def test_where_each_operand_stood_is_readable_by_anybody(run: Run) -> None:
    run.close()
    base = sqlite3.connect(run.path)
    query = 'SELECT device, "table", address, words, kind FROM operands WHERE name IN (?, ?) ORDER BY position'
    found = base.execute(query, ("SV", "PID_RUN")).fetchall()
    base.close()
    assert [("M1", "coil", 1, 1, "BOOL"), ("D100", "holding register", 100, 2, "REAL")] == found


def test_another_process_reads_while_the_file_grows(tmp_path: Path, station: Station) -> None:
    tape, _ = recorder(tmp_path / "a.ahrec", station)
    tape.row(row(0))
    tape.flush()
    with Recording(tmp_path / "a.ahrec") as reader:
        assert [0] == [each.tick for each in reader.rows()]
        tape.row(row(1))
        tape.flush()
        assert ([0, 1], False) == ([each.tick for each in reader.rows()], reader.is_closed)
        tape.close()
        assert reader.is_closed
        assert [0, 1] == [each.tick for each in reader.rows()]


def test_a_reader_in_the_middle_of_the_file_does_not_disturb_its_close(tmp_path: Path, station: Station) -> None:
    tape, _ = recorder(tmp_path / "a.ahrec", station)
    for tick in range(3):
        tape.row(row(tick))
        tape.flush()
    with Recording(tmp_path / "a.ahrec") as reader:
        rows = reader.rows()
        assert 0 == next(rows).tick
        tape.close()
        assert [] == tape.news()
        assert [1, 2] == [each.tick for each in rows]
    assert [0, 1, 2] == ticks(tmp_path / "a.ahrec")


def test_a_file_is_never_overwritten(tmp_path: Path, station: Station) -> None:
    (tmp_path / "a.ahrec").write_text("precious")
    with pytest.raises(StateError, match="never overwritten"):
        recorder(tmp_path / "a.ahrec", station)
    assert "precious" == (tmp_path / "a.ahrec").read_text()


def test_a_directory_that_is_not_there_is_said(tmp_path: Path, station: Station) -> None:
    with pytest.raises(StateError, match="cannot be made: unable to open"):
        recorder(tmp_path / "no" / "a.ahrec", station)


@pytest.mark.parametrize(
    ("statement", "said"),
    [
        ("SELECT 1", ""),
        ("UPDATE events SET json = '{}' WHERE tick = 1", "second 2 does not match its seal"),
        ("UPDATE verdicts SET json = '{}'", "second 1 does not match its seal"),
        ("UPDATE notes SET text = ''", "second 4 does not match its seal"),
        ("UPDATE meta SET value = 'x' WHERE key = 'ahgateway'", "the heading does not match its seal"),
        ("UPDATE operands SET device = 'D2' WHERE name = 'SV'", "the heading does not match its seal"),
        ("DELETE FROM seconds WHERE id = 4", "the file was closed with"),
    ],
)
def test_every_second_has_a_seal_and_any_change_breaks_it(
    tmp_path: Path, station: Station, statement: str, said: str
) -> None:
    path = tmp_path / "a.ahrec"
    tape, _ = recorder(path, station)
    for tick in range(3):
        tape.row(row(tick))
        tape.verdict("L1", tick, '{"verdict": "MATCH"}')
        tape.event(tick, "L1", tick, "finding", {"text": "käse"})
        tape.flush()
    tape.note(9, "a note")
    tape.close()
    base = sqlite3.connect(path, isolation_level=None)
    base.execute(statement)
    base.close()
    with Recording(path) as recording:
        texts = recording.check().texts
    assert bool(said) == bool(texts)
    assert said in [*texts, ""][0]


def test_a_failed_commit_keeps_nothing_of_itself_and_all_before_it(tmp_path: Path, station: Station) -> None:
    file = RunFile(tmp_path / "a.ahrec", station, {})
    file.commit(Batch(entries=[Entry(0, 0, 1, 2, 3, 4, 1, bytes(2 * 54))]), 0, 0)
    file.limit_pages(1)
    with pytest.raises(sqlite3.OperationalError, match="full"):
        file.commit(Batch(notes=[(0, "x" * 100_000)]), 0, 0)
    file.limit_pages(1 << 20)
    file.commit(Batch(entries=[Entry(0, 1, 1, 2, 3, 4, 1, bytes(2 * 54))]), 0, 0)
    file.close({})
    assert [0, 1] == ticks(tmp_path / "a.ahrec")
    with Recording(tmp_path / "a.ahrec") as recording:
        assert ([], []) == (recording.check().texts, recording.notes())


def test_a_full_disk_is_said_survived_counted_and_noted_in_the_file(tmp_path: Path, station: Station) -> None:
    path = tmp_path / "a.ahrec"
    tape, _ = recorder(path, station)
    tape.row(row(0))
    tape.flush()
    tape._file.limit_pages(1)
    for tick in (1, 2):
        tape.row(row(tick))
        tape.note(0, "x" * 100_000)
        tape.flush()
    (said,) = tape.news()
    assert "database or disk is full" in said
    assert "the run goes on" in said
    assert 4 == tape.figures.dropped
    tape._file.limit_pages(1 << 20)
    tape.row(row(3))
    tape.flush()
    assert [f"{path}: recording again"] == tape.news()
    tape.close()
    assert [0, 3] == ticks(path)
    with Recording(path) as recording:
        (event,) = recording.events("recorder")
        assert {"dropped": 4, "why": "database or disk is full"} == event.found
        assert [] == recording.check().texts


def test_a_queue_that_is_full_drops_and_says_so_and_never_waits(tmp_path: Path, station: Station) -> None:
    tape, _ = recorder(tmp_path / "a.ahrec", station, queue_max=3)
    for tick in range(5):
        tape.row(row(tick))
    assert (2, ["the disk is too slow, 3 things wait: dropping"]) == (
        tape.figures.dropped,
        [line.partition(": ")[2] for line in tape.news()],
    )
    tape.close()
    assert [0, 1, 2] == ticks(tmp_path / "a.ahrec")
    with Recording(tmp_path / "a.ahrec") as recording:
        assert {"dropped": 2, "why": "the disk is too slow"} == next(recording.events("recorder")).found


def test_parts_are_rolled_by_time_and_the_oldest_go(tmp_path: Path, station: Station) -> None:
    tape, clock = recorder(tmp_path / "a.ahrec", station, rolling=Rolling(duration_ns=10 * SECOND, keep=2))
    for tick in range(35):
        tape.row(row(tick))
        tape.flush()
        clock.advance_ns(SECOND)
    tape.close()
    assert ["a-0003.ahrec", "a-0004.ahrec"] == sorted(path.name for path in tmp_path.iterdir())
    assert list(range(21, 31)) == ticks(tmp_path / "a-0003.ahrec")
    assert [31, 32, 33, 34] == ticks(tmp_path / "a-0004.ahrec")
    with Recording(tmp_path / "a-0004.ahrec") as recording:
        assert ("4", [], station.loops) == (recording.meta["part"], recording.check().texts, recording.station.loops)


def test_parts_are_rolled_by_size(tmp_path: Path, station: Station) -> None:
    tape, _ = recorder(tmp_path / "a.ahrec", station, rolling=Rolling(size_max=120_000))
    for _ in range(2):
        tape.note(0, "".join(chr(33 + place % 90) for place in range(100_000)))
        tape.flush()
    tape.close()
    assert ["a-0001.ahrec", "a-0002.ahrec", "a-0003.ahrec"] == sorted(path.name for path in tmp_path.iterdir())


def test_the_thread_keeps_everything_that_was_reported_before_the_close(tmp_path: Path, station: Station) -> None:
    tape, _ = recorder(tmp_path / "a.ahrec", station)
    tape.start()
    for tick in range(500):
        tape.row(row(tick))
    tape.close()
    assert list(range(500)) == ticks(tmp_path / "a.ahrec")


@pytest.mark.parametrize("text", ["", "no database at all, but long enough to have a header of a hundred bytes" * 3])
def test_what_is_no_recording_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "a.ahrec").write_text(text)
    with pytest.raises(StateError, match="no recording"):
        Recording(tmp_path / "a.ahrec")


def test_a_recording_of_a_newer_version_is_refused_with_both_versions(tmp_path: Path, station: Station) -> None:
    recorder(tmp_path / "a.ahrec", station)[0].close()
    base = sqlite3.connect(tmp_path / "a.ahrec")
    base.execute("PRAGMA user_version=2")
    base.close()
    with pytest.raises(StateError, match="has schema version 2, this program reads up to 1"):
        Recording(tmp_path / "a.ahrec")


def test_a_name_without_a_file_is_said(tmp_path: Path) -> None:
    with pytest.raises(StateError, match="there is no such recording"):
        Recording(tmp_path / "a.ahrec")


def test_writes_notes_and_frames_come_back(tmp_path: Path, station: Station) -> None:
    tape, _ = recorder(tmp_path / "a.ahrec", station)
    tape.write(5, "L1", "SV", {"old": [0, 0], "new": [0, 16968], "journal": "ab"})
    tape.note(6, "valve was sticking")
    tape.frame(">", b"\x01\x03", 7, 8)
    tape.frame("<", b"\x01\x83\x02", 9, 10)
    tape.close()
    with Recording(tmp_path / "a.ahrec") as recording:
        assert [(5, "L1", "SV", {"old": [0, 0], "new": [0, 16968], "journal": "ab"})] == list(recording.writes())
        assert [(6, "valve was sticking")] == recording.notes()
        assert [(7, 8, ">", b"\x01\x03"), (9, 10, "<", b"\x01\x83\x02")] == list(recording.frames())
