"""`--record` on commands that write or watch for a while: what was seen and written is in the file."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from ahgateway.cli.main import app
from ahgateway.errors import AhGatewayError, ProfileError, StateError
from ahgateway.recording.reader import Recording

RUNNER = CliRunner()


def typed(*words: object) -> tuple[int, str, str]:
    """Run a command; an error of ours is raised as it is."""
    done = RUNNER.invoke(app, [str(word) for word in words])
    if isinstance(done.exception, AhGatewayError):
        raise done.exception
    return done.exit_code, done.stdout, done.stderr


def test_write_keeps_the_write_the_picture_after_it_and_the_anchor(tmp_path: Path) -> None:
    path = tmp_path / "write.ahrec"
    words = ["write", "demo", "SV=82.5", "--arm", "TIC-101", "--directory", tmp_path, "--output", "json"]
    _, said, talk = typed(*words, "--record", path, "--record-frames")
    facts = json.loads(said)
    with Recording(path) as recording:
        assert ["TIC-101"] == recording.names
        assert [("SV", "verified")] == [(operand, each["outcome"]) for _, _, operand, each in recording.writes()]
        assert facts["anchor"] == list(recording.events("journal"))[-1].found["record"]["hash"]
        assert (0, 0x42A5) == list(recording.rows())[-1].words["SV"]
        assert "[station]" in recording.meta["profile"]
        assert 4 < sum(1 for _ in recording.frames())
    assert f"pictures in {path}" in talk
    assert "writes to the PLC: 1" in typed("info", path)[1]
    assert f"last hash {facts['anchor']}" in typed("info", path)[1]


def test_a_name_that_is_taken_is_refused_before_anything_is_written(tmp_path: Path) -> None:
    path = tmp_path / "write.ahrec"
    path.write_text("precious")
    with pytest.raises(StateError, match="never overwritten"):
        typed("write", "demo", "SV=82.5", "--arm", "TIC-101", "--directory", tmp_path / "gate", "--record", path)
    assert [path] == list(tmp_path.rglob("*.*"))


def test_an_identification_can_be_repeated_from_its_recording(tmp_path: Path) -> None:
    path = tmp_path / "learn.ahrec"
    typed("identify", "demo", "--duration", "1", "--record", path, "--output", "json")
    again = typed("identify", path, "--output", "json")[1]
    assert ["TIC-101", "LIC-201"] == [json.loads(line)["loop"] for line in again.splitlines()]


def test_tune_keeps_what_it_does_at_the_loop(tmp_path: Path) -> None:
    path = tmp_path / "tune.ahrec"
    words = ["tune", "demo", "--rollback", "--arm", "TIC-101", "--directory", tmp_path / "gate"]
    assert "there is nothing to put back" in typed(*words, "--record", path)[1]
    with Recording(path) as recording:
        assert (["TIC-101"], True) == (recording.names, recording.is_closed)


@pytest.mark.parametrize("command", ["tune", "identify"])
def test_what_is_no_live_run_is_not_recorded(tmp_path: Path, command: str) -> None:
    path = tmp_path / "learn.ahrec"
    path.write_bytes(b"SQLite format 3\x00")
    with pytest.raises(ProfileError, match="--record"):
        typed(command, path, "--record", tmp_path / "b.ahrec")


@pytest.mark.slow
def test_a_commissioning_keeps_its_pictures_steps_and_writes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "site.ahrec"
    words = ["commission", "demo", "--loop", "LIC-201", "--arm", "LIC-201", "--executions", "20", "--coverage", "0.2"]
    typed(*words, "--auto", "--directory", tmp_path / "gate", "--record", path)
    with Recording(path) as recording:
        rows = list(recording.rows())
        kinds = [event.found["record"]["kind"] for event in recording.events("journal")]
        operands = {operand for _, _, operand, _ in recording.writes()}
    assert list(range(len(rows))) == [row.tick for row in rows]
    assert ("armed", "ended") == (kinds[0], kinds[-1])
    assert {"PID_MAN", "MOUT"} <= operands
