"""A disk that is really full, by a limit of the system: said, survived, counted, and every commit is there."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from ahgateway.recording.reader import Recording

TESTS = Path(__file__).parents[1]


@pytest.mark.slow
@pytest.mark.parametrize("limit", [200_000, 400_000])
def test_what_was_committed_before_and_behind_a_full_disk_is_there(tmp_path: Path, limit: int) -> None:
    path = tmp_path / "full.ahrec"
    command = [sys.executable, str(Path(__file__).with_name("full_writer.py")), str(path), str(limit)]
    environment = {**os.environ, "PYTHONPATH": str(TESTS)}
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
    said = json.loads(done.stdout)
    kept = said["kept"]
    assert 0 < len(kept) < 61
    assert 60 == kept[-1]
    lost = 61 - len(kept)
    # A row and a note each.
    assert 2 * lost == said["dropped"]
    assert "the run goes on" in said["news"][0]
    assert [f"{path}: recording again"] == said["news"][-1:]
    with Recording(path) as recording:
        assert kept == [row.tick for row in recording.rows()]
        assert ([], True) == (recording.check().texts, recording.is_closed)
        assert 2 * lost == sum(event.found["dropped"] for event in recording.events("recorder"))
