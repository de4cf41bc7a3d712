"""A PLC written apart from the package is proven by bits, its dialect is learned, and a wrong gain of it convicted."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from conformance.peers import followed, verdicts

pytestmark = pytest.mark.slow

AHGATEWAY = [sys.executable, "-m", "ahgateway.cli.main"]
STAND_IN = Path(__file__).parent / "stand_in.py"
SCAN_MS_MAX = 40
"""A busy machine scans late."""


@contextmanager
def stand_in(folder: Path, *options: str) -> Iterator[Path]:
    """The PLC in a process of its own; gives a profile that names it."""
    process = subprocess.Popen([sys.executable, str(STAND_IN), *options], stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        profile = folder / "plc.toml"
        profile.write_text(
            f'[station]\nname = "S"\ntarget = "modbus+tcp://127.0.0.1:{int(process.stdout.readline())}?unit=1"\n'
            f'[loops.L1]\ninstruction = "DPIDE"\nlayout = "manual"\nscan_ms_max = {SCAN_MS_MAX}\n'
        )
        yield profile
    finally:
        process.terminate()
        process.communicate(timeout=60)


def run(*arguments: str | Path) -> tuple[int, list[dict[str, Any]]]:
    """Type a command with JSON lines out; return its exit code and them."""
    command = [*AHGATEWAY, *map(str, arguments), "--output", "json"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert "internal error" not in done.stderr, done.stderr
    return done.returncode, [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")]


def executions(lines: list[dict[str, Any]]) -> list[dict[str, Any]]:
    return [line for line in lines if line.get("verdict") in ("MATCH", "DIVERGED")]


def test_a_stranger_in_the_default_dialect_is_proven_by_bits(tmp_path: Path) -> None:
    with stand_in(tmp_path, "tf=0.5") as profile:
        *lines, end = followed(profile, enough=lambda told: len(executions(told)) > 15)

    assert 0 == end["code"]
    assert {"MATCH"} == {line["verdict"] for line in executions(lines)}


@pytest.mark.parametrize(
    ("options", "axis", "value"),
    [(["sum=p_id"], "sum_order", "p_id"), (["clock=ms"], "ts_source", "ms")],
    ids=["order", "clock"],
)
def test_a_stranger_s_dialect_is_learned_and_then_proves_it(
    tmp_path: Path, options: list[str], axis: str, value: str
) -> None:
    with stand_in(tmp_path, *options) as profile:
        code, _ = run("identify", profile, "--duration", "5", "--save", profile)
        assert 0 == code
        assert f'{axis} = "{value}"' in profile.read_text()

        *_, end = followed(profile, enough=lambda told: len(executions(told)) > 10)
        assert 0 == end["code"]


def test_a_gain_wrong_by_a_hundredth_in_a_stranger_is_convicted(tmp_path: Path) -> None:
    """Right for two hundred questions, so that the shadow agrees first, however seldom a busy machine asks."""
    with stand_in(tmp_path, "gain=1.01", "good=200") as profile:
        *lines, end = followed(profile, enough=lambda told: "DIVERGED" in verdicts(told))

    wrong = [line for line in lines if line.get("verdict") == "DIVERGED"]
    assert 1 == end["code"]
    assert {"gain"} == {line["cause"] for line in wrong}
    assert any(line.get("verdict") == "MATCH" for line in executions(lines)[: -len(wrong)])
