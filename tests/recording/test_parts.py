"""A rolled run read as one: the same rows and verdicts as one file, and only of the same run."""

from __future__ import annotations

import json
import shutil
import sqlite3
from pathlib import Path
from typing import Any

import pytest
from lockstep.bench_world import World
from recording.conftest import Run
from typer.testing import CliRunner

from ahgateway.apps.record import Tape
from ahgateway.apps.replay import Comparison, Replay
from ahgateway.cli.main import app
from ahgateway.recording.parts import opened, part_path
from ahgateway.recording.recorder import Rolling

DPID = {"SV": 50.0, "CYCLE": 10, "Kp": 1.0, "Ki": 0.2}
RUNNER = CliRunner()


@pytest.fixture
async def rolled(tmp_path: Path) -> Path:
    """A run of 120 pictures in three parts, whose gain is wrong from the 80th on."""
    run = Run(tmp_path / "whole.ahrec", World("DPID", DPID))
    whole = run.tape
    run.tape = Tape(tmp_path / "run.ahrec", run.world.station, run.world.clock, rolling=Rolling(duration_ns=1))
    take = run.tape.take
    run.tape.take = lambda report: (take(report), whole.take(report))  # type: ignore[assignment,func-returns-value]
    await run.polls(40)
    run.tape.recorder.flush()
    await run.polls(40)
    run.world.plc.fail("L1", "gain-1-percent")
    run.tape.recorder.flush()
    await run.polls(40)
    run.close()
    whole.recorder.close()
    return tmp_path


def verdicts(path: Path, **how: Any) -> list[Any]:
    with opened(path, **how) as recording:
        return list(recording.verdicts())


def test_parts_read_as_one_hold_what_one_file_holds(rolled: Path) -> None:
    first = rolled / "run-0001.ahrec"
    with opened(first) as parts, opened(rolled / "whole.ahrec") as whole:
        assert list(whole.rows()) == list(parts.rows())
        assert whole.totals() == parts.totals()
        assert (True, []) == (parts.is_closed, parts.check().texts)
        assert [each.tick for each in whole.events("execution")] == [each.tick for each in parts.events("execution")]
    assert verdicts(rolled / "whole.ahrec") == verdicts(first)


def test_a_replay_of_all_parts_comes_to_the_verdicts_of_then(rolled: Path) -> None:
    with opened(rolled / "run-0001.ahrec") as recording:
        again = Replay(recording)
        then = Comparison(again)
        for report in again.reports():
            then.take(report)
    assert then.result().is_whole
    assert 0 < again.followers["L1"].counts.diverged


def test_a_part_alone_or_a_later_one_holds_less(rolled: Path) -> None:
    whole = verdicts(rolled / "whole.ahrec")
    alone = verdicts(rolled / "run-0001.ahrec", is_alone=True)
    late = verdicts(rolled / "run-0002.ahrec")
    assert whole == [*alone, *late]
    assert 0 < len(alone) < len(whole)


def test_a_part_of_another_run_a_gap_or_another_name_ends_it(rolled: Path, tmp_path: Path) -> None:
    alone = len(verdicts(rolled / "run-0001.ahrec", is_alone=True))
    shutil.copy(rolled / "run-0001.ahrec", rolled / "other-0001.ahrec")
    assert alone == len(verdicts(rolled / "other-0001.ahrec"))
    shutil.copy(rolled / "run-0003.ahrec", rolled / "other-0002.ahrec")
    assert alone == len(verdicts(rolled / "other-0001.ahrec"))
    base = sqlite3.connect(rolled / "run-0002.ahrec", isolation_level=None)
    base.execute("UPDATE meta SET value = 'another' WHERE key = 'run'")
    base.close()
    assert alone == len(verdicts(rolled / "run-0001.ahrec"))


def test_parts_are_named_by_four_digits_before_the_suffix() -> None:
    assert [Path("a-0001.ahrec"), Path("b/a.b-12345.x")] == [
        part_path(Path("a.ahrec"), 1),
        part_path(Path("b/a.b.x"), 12345),
    ]


def test_replay_as_typed_goes_on_into_the_next_parts_unless_told(rolled: Path) -> None:
    done = RUNNER.invoke(app, ["replay", str(rolled / "run-0001.ahrec"), "--summary"])
    assert (1, True) == (done.exit_code, "parts 1 to " in done.stderr)
    assert "the same verdicts as then" in done.stdout
    alone = RUNNER.invoke(app, ["replay", str(rolled / "run-0001.ahrec"), "--summary", "--one-part"])
    assert (0, "") == (alone.exit_code, alone.stderr)
    late = RUNNER.invoke(app, ["replay", str(rolled / "run-0002.ahrec"), "--summary"])
    assert "begins with part 2" in late.stderr


def test_replay_names_another_reference_than_then(rolled: Path) -> None:
    path = rolled / "whole.ahrec"
    words = ["replay", str(path), "--summary"]
    assert "another reference" not in RUNNER.invoke(app, words).stdout
    base = sqlite3.connect(path, isolation_level=None)
    base.execute("UPDATE meta SET value = '0123456789abcdef' WHERE key = 'core'")
    base.close()
    said = RUNNER.invoke(app, words).stdout
    assert "another reference than then: ahgateway 0.1.0 (core 0123456789abcdef, judge " in said
    objects = [json.loads(line) for line in RUNNER.invoke(app, [*words, "--output", "json"]).stdout.splitlines()]
    (found,) = [each for each in objects if each["kind"] == "judges"]
    assert (False, "0123456789abcdef") == (found["same"], found["then"]["core"])
    assert found["then"]["judge"] == found["now"]["judge"] != ""
