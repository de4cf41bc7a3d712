"""`ahgateway identify` as typed, on what a monitor recorded; what --save writes into a copied profile."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import tomlkit
from lockstep.bench_world import World
from recording.conftest import Run
from typer.testing import CliRunner

from ahgateway.cli.main import app
from ahgateway.core.dialect import DEFAULT, Integrator, SumOrder, TsSource
from ahgateway.errors import ProfileError
from ahgateway.schema.profile import load

RUNNER = CliRunner()
DIALECT = DEFAULT._replace(integrator=Integrator.TRAPEZOID, sum_order=SumOrder.PD_I)
GAINS = {"Kp": 1.3, "Ki": 0.37, "Kd": 0.11}

PROFILE = """\
# typed by hand, to stay
[station]
name = "Line 3"
target = "fake://demo"          # nothing is sent there
unit = 1
device_map = "ah500"

[loops.L1]                      # the loop of the recording
instruction = "DPID"
layout = "manual"
"""


@pytest.fixture
async def recording(tmp_path: Path) -> Path:
    run = Run(tmp_path / "run.ahrec", World("DPID", GAINS, loop_changes={"dialect": DIALECT}))
    await run.polls(160)
    run.close()
    return run.path


@pytest.fixture
def profile(tmp_path: Path) -> Path:
    path = tmp_path / "line3.toml"
    path.write_text(PROFILE, encoding="utf-8")
    return path


def test_a_recording_gives_the_dialect_in_which_it_was_made(recording: Path) -> None:
    done = RUNNER.invoke(app, ["identify", str(recording), "--output", "json"])

    found = json.loads(done.stdout)
    assert 0 == done.exit_code
    assert {"integrator": "trapezoid", "sum_order": "pd_i"}.items() <= found["decided"].items()
    assert False is found["cut"]


def test_save_writes_dialect_and_evidence_and_leaves_every_line_of_the_profile(recording: Path, profile: Path) -> None:
    done = RUNNER.invoke(app, ["identify", str(recording), "--save", str(profile), "--firmware", "1.08"])

    text = profile.read_text(encoding="utf-8")
    assert 0 == done.exit_code
    assert text.startswith(PROFILE.rstrip())
    saved = tomlkit.parse(text).unwrap()["loops"]["L1"]
    assert {"integrator": "trapezoid", "sum_order": "pd_i"}.items() <= saved["dialect"].items()
    assert {"by": "ahgateway identify", "firmware": "1.08"}.items() <= saved["evidence"].items()
    assert saved["evidence"]["executions"] >= 20
    dialect = load(str(profile)).station().loops[0].dialect
    assert Integrator.TRAPEZOID is dialect.integrator
    assert SumOrder.PD_I is dialect.sum_order


def test_saving_again_replaces_what_was_saved(recording: Path, profile: Path) -> None:
    for firmware in ("1.08", "1.09"):
        RUNNER.invoke(app, ["identify", str(recording), "--save", str(profile), "--firmware", firmware])

    text = profile.read_text(encoding="utf-8")
    assert 1 == text.count("[loops.L1.dialect]")
    assert 1 == text.count("firmware =")
    assert 'firmware = "1.09"' in text


def test_a_profile_without_the_loop_is_not_touched(recording: Path, tmp_path: Path) -> None:
    path = tmp_path / "other.toml"
    path.write_text(PROFILE.replace("loops.L1", "loops.TIC-9"), encoding="utf-8")
    done = RUNNER.invoke(app, ["identify", str(recording), "--save", str(path)])

    assert isinstance(done.exception, ProfileError)
    assert "no loop `L1`, it has TIC-9" in str(done.exception)
    assert path.read_text(encoding="utf-8") == PROFILE.replace("loops.L1", "loops.TIC-9")


async def test_scans_longer_than_the_profile_allows_are_thought_of_before_no_dialect_fits(tmp_path: Path) -> None:
    measured = DEFAULT._replace(ts_source=TsSource.MS)
    run = Run(tmp_path / "late.ahrec", World("DPID", GAINS, scan_ms=17, loop_changes={"dialect": measured}))
    await run.polls(160)
    run.close()
    found = RUNNER.invoke(app, ["identify", str(tmp_path / "late.ahrec")])

    assert 1 == found.exit_code, found.output
    assert "scan_ms_max = 10 ms; if scans can be longer, raise it" in found.output
