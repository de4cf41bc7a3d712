"""A live run recorded and followed again as a target, in real time as a user would."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from ahgateway.cli.main import app

RUNNER = CliRunner()


def typed(*words: object) -> str:
    return RUNNER.invoke(app, [str(word) for word in words]).stdout


@pytest.mark.slow
def test_monitor_follows_a_recording_as_a_target(patient_machine: None, tmp_path: Path) -> None:
    first = tmp_path / "first.ahrec"
    done = RUNNER.invoke(app, ["monitor", "demo", "--duration", "0.4", "--record", str(first), "--record-frames"])
    assert "recorded" in done.stderr
    info = json.loads(typed("info", first, "--output", "json"))
    assert 0 < info["rows"]
    assert "[station]" in typed("info", first, "--profile")
    again = RUNNER.invoke(app, ["monitor", "demo", "--target", f"replay://{first}", "--output", "json"])
    ends = [json.loads(line) for line in again.stdout.splitlines()]
    assert ["TIC-101", "LIC-201"] == [each["loop"] for each in ends if each["kind"] == "summary"]
