"""kill -9 at any moment, and a disk that ends: the file opens, and what was committed is there and right."""

from __future__ import annotations

import os
import random
import subprocess
import sys
from pathlib import Path

import pytest

from ahgateway.recording.reader import Recording

HERE = Path(__file__).parent
KILLS = 20
KILLS_WHOLE = 6
"""Whole processes take a second each; `tests/bench/bench_record.py` kills two hundred."""


def killed(path: Path, seed: int, bytes_max: int) -> int:
    """Let the writer run until it has said so many bytes, kill it, and return the tick that it had committed."""
    environment = {**os.environ, "PYTHONPATH": str(HERE.parent)}
    command = [sys.executable, str(HERE / "kill_writer.py"), str(path), str(seed)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, env=environment) as process:
        assert process.stdout is not None
        said = process.stdout.read(bytes_max)
        process.kill()
        said += process.stdout.read()
    whole, _, _ = said.rpartition(b"\n")
    return int(whole.rpartition(b"\n")[2] or b"0")


def assert_sound(path: Path, committed: int) -> None:
    """Everything that was said to be committed is there, whole, and at most one commit more."""
    with Recording(path) as recording:
        assert [] == recording.check().texts
        assert not recording.is_closed
        ticks = []
        for row in recording.rows():
            ticks.append(row.tick)
            assert {row.tick & 0xFFFF} == {word for words in row.words.values() for word in words}
        assert list(range(len(ticks))) == ticks
        assert len(ticks) in (committed, committed + 40)
        assert ticks == [tick for _, tick, _ in recording.verdicts()]


@pytest.mark.slow
def test_after_a_kill_the_file_opens_and_holds_every_commit(tmp_path: Path) -> None:
    rng = random.Random(4)
    for seed in range(KILLS_WHOLE):
        path = tmp_path / f"{seed}.ahrec"
        committed = killed(path, seed, rng.randrange(1, 200))
        assert_sound(path, committed)


@pytest.mark.slow
def test_after_a_kill_at_any_byte_of_the_log_the_file_opens_and_holds_every_commit_before_it(tmp_path: Path) -> None:
    """What a power cut leaves: the log ends anywhere. Whole commits before that place are there, nothing half."""
    path = tmp_path / "run.ahrec"
    committed = killed(path, 1, 60)
    log = path.with_name(path.name + "-wal")
    whole, file = log.read_bytes(), path.read_bytes()
    rng = random.Random(5)
    most = 0
    for number in range(KILLS):
        cut = tmp_path / f"cut{number}.ahrec"
        cut.write_bytes(file)
        cut.with_name(cut.name + "-wal").write_bytes(whole[: rng.randrange(len(whole) // 2, len(whole))])
        with Recording(cut) as recording:
            assert [] == recording.check().texts
            ticks = [row.tick for row in recording.rows()]
        assert list(range(len(ticks))) == ticks
        assert 0 == len(ticks) % 40
        most = max(most, len(ticks))
    assert 0 < most <= committed + 40
