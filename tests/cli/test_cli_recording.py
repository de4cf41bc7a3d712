"""The commands around recordings as typed: what they print, what they end with, what they load."""

from __future__ import annotations

import json
import os
import sqlite3
import subprocess
import sys
from pathlib import Path

import pytest
from lockstep.bench_world import World
from recording.conftest import Run
from typer.testing import CliRunner

from ahgateway.cli.main import app
from ahgateway.errors import AhGatewayError, ProfileError, StateError

DPID = {"SV": 50.0, "CYCLE": 10, "Kp": 1.0, "Ki": 0.2}
RUNNER = CliRunner()


def typed(*words: object) -> tuple[int, str]:
    """Run a command; an error of ours is raised as it is."""
    done = RUNNER.invoke(app, [str(word) for word in words])
    if isinstance(done.exception, AhGatewayError):
        raise done.exception
    return done.exit_code, done.stdout


@pytest.fixture
async def faulty(tmp_path: Path) -> Path:
    run = Run(tmp_path / "run.ahrec", World("DPID", DPID))
    await run.polls(60)
    run.world.plc.fail("L1", "gain-1-percent")
    await run.polls(20)
    run.close()
    return run.path


@pytest.fixture
async def sound(tmp_path: Path) -> Path:
    run = Run(tmp_path / "good.ahrec", World("DPID", DPID))
    await run.polls(60)
    run.close()
    return run.path


def test_replay_ends_as_the_run_did_and_says_that_nothing_changed(faulty: Path, sound: Path) -> None:
    code, said = typed("replay", faulty, "--summary")
    assert 1 == code
    assert "the same verdicts as then" in said
    assert 0 == typed("replay", sound, "--summary")[0]
    assert 3 == typed("replay", sound, "--summary", "--coverage", "1.0")[0]


def test_replay_lists_only_what_was_asked_for(faulty: Path) -> None:
    _, whole = typed("replay", faulty)
    _, diverged = typed("replay", faulty, "--diverged")
    _, none = typed("replay", faulty, "--from", "1000")
    assert "MATCH bits" in whole
    assert "MATCH bits" not in diverged
    assert " DIVERGED: " in diverged
    assert "term   plc" in diverged
    assert "term   plc" not in none


def test_replay_as_json_has_both_sides_of_every_term(faulty: Path) -> None:
    _, said = typed("replay", faulty, "--diverged", "--output", "json")
    objects = [json.loads(line) for line in said.splitlines()]
    assert ["execution", "judges", "summary", "then"] == sorted({each["kind"] for each in objects})
    lines = {line["term"]: line for line in objects[0]["lines"]}
    assert lines["MV"]["plc_bits"] != lines["MV"]["ref_bits"]
    assert None is lines["P"]["plc"]
    assert 0 == objects[-1]["other"]


def test_replay_judges_with_a_tolerance_that_is_typed(faulty: Path) -> None:
    code, said = typed("replay", faulty, "--summary", "--tolerance", "50")
    assert 0 == code
    assert "diverged 0" in said
    assert "than then" not in said


def test_replay_refuses_what_it_does_not_know(faulty: Path) -> None:
    with pytest.raises(ProfileError, match="`freeze` is no axis=value"):
        typed("replay", faulty, "--dialect", "freeze")
    with pytest.raises(StateError, match="no such recording"):
        typed("replay", "nothing.ahrec")


def test_info_says_what_is_in_it_and_check_finds_damage(faulty: Path) -> None:
    code, said = typed("info", faulty, "--check")
    assert (0, True, True) == (code, "80 pictures" in said, "sound: 1 seconds match their seals" in said)
    assert "# by hand\n" == typed("info", faulty, "--profile")[1]
    found = json.loads(typed("info", faulty, "--output", "json")[1])
    assert ("test", 80, True, 0) == (found["station"], found["rows"], found["closed"], found["dropped"])
    base = sqlite3.connect(faulty, isolation_level=None)
    base.execute("UPDATE events SET utc_ns = 0")
    base.close()
    code, said = typed("info", faulty, "--check")
    assert 1 == code
    assert "was changed afterwards" in said


def test_export_says_which_files_it_made_and_import_takes_them_back(faulty: Path, tmp_path: Path) -> None:
    _, said = typed("export", faulty, "--out", tmp_path / "out")
    (path,) = said.split()
    assert "run-L1.csv" == Path(path).name
    code, said = typed("import", path, "--out", tmp_path / "again.ahrec", "--instruction", "DPID")
    assert (0, f"{tmp_path / 'again.ahrec'}: 80 rows\n") == (code, said)


@pytest.mark.slow
def test_a_message_names_the_missing_library() -> None:
    program = """
import sys
sys.modules["pyarrow"] = None
from importlib.machinery import PathFinder
find = PathFinder.find_spec
PathFinder.find_spec = classmethod(lambda cls, name, *rest: None if name == "pyarrow" else find(name, *rest))
from ahgateway.apps.export import _need
from ahgateway.errors import StateError
del sys.modules["pyarrow"]
try:
    _need("pyarrow", "Parquet")
except StateError as error:
    print(error.message, "|", error.hint)
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, env=os.environ)
    assert "Parquet needs the library pyarrow, which is not installed" in done.stdout
    assert "ahgateway[export]" in done.stdout
