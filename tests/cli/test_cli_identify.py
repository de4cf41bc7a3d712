"""`ahgateway identify` as typed, on what a monitor recorded; what --save writes into a copied profile."""

from __future__ import annotations

import asyncio
import json
from pathlib import Path

import pytest
import tomlkit
from lockstep.bench_world import World
from recording.conftest import Run
from typer.testing import CliRunner

from ahgateway.cli.main import app
from ahgateway.core.dialect import DEFAULT, Freeze, Integrator, SumOrder, TsSource
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


SAVED = """
[loops.L1.dialect]
mout_auto = "always"            # nothing of the recording can tell
integrator = "rectangle"
freeze = "outward"

[loops.L1.evidence]
by = "ahgateway identify"
date = "2026-11-20"
executions = 900
firmware = "1.08"
earlier = { freeze = "2026-11-02" }
"""
"""What an earlier run has saved; of the integrator it says something else than the recording."""


def test_saving_again_keeps_what_the_newer_run_leaves_open(recording: Path, profile: Path) -> None:
    profile.write_text(PROFILE + SAVED, encoding="utf-8")
    done = RUNNER.invoke(app, ["identify", str(recording), "--save", str(profile)])

    saved = tomlkit.parse(profile.read_text(encoding="utf-8")).unwrap()["loops"]["L1"]
    assert 0 == done.exit_code, done.output
    assert {"mout_auto": "always", "freeze": "outward", "sum_order": "pd_i"}.items() <= saved["dialect"].items()
    assert {"mout_auto": "2026-11-20", "freeze": "2026-11-02"} == saved["evidence"]["earlier"]
    assert "1.08" == saved["evidence"]["firmware"]
    assert "L1: kept from before, where this run says nothing else: mout_auto, freeze" in done.stderr
    assert "# nothing of the recording can tell" in profile.read_text(encoding="utf-8")
    assert Freeze.OUTWARD is load(str(profile)).station().loops[0].dialect.freeze


def test_what_the_newer_run_contradicts_is_said_with_both_values_and_the_newer_stands(
    recording: Path, profile: Path
) -> None:
    profile.write_text(PROFILE + SAVED, encoding="utf-8")
    done = RUNNER.invoke(app, ["identify", str(recording), "--save", str(profile)])

    saved = tomlkit.parse(profile.read_text(encoding="utf-8")).unwrap()["loops"]["L1"]
    assert "trapezoid" == saved["dialect"]["integrator"]
    assert "L1: integrator was rectangle (2026-11-20), this run leaves only trapezoid: the newer stands" in done.stderr
    assert "if another firmware runs now, say so with --firmware" in done.stderr


def test_another_firmware_begins_anew(recording: Path, profile: Path) -> None:
    profile.write_text(PROFILE + SAVED, encoding="utf-8")
    done = RUNNER.invoke(app, ["identify", str(recording), "--save", str(profile), "--firmware", "1.09"])

    saved = tomlkit.parse(profile.read_text(encoding="utf-8")).unwrap()["loops"]["L1"]
    assert {"mout_auto", "freeze"}.isdisjoint(saved["dialect"])
    assert "1.09" == saved["evidence"]["firmware"]
    assert "earlier" not in saved["evidence"]
    assert "firmware was 1.08 (2026-11-20) and is 1.09: the dialect begins anew, dropped: mout_auto = always" in (
        done.stderr
    )


def test_what_names_nothing_leaves_what_was_saved(recording: Path, profile: Path, tmp_path: Path) -> None:
    run = Run(tmp_path / "short.ahrec", World("DPID", GAINS, loop_changes={"dialect": DIALECT}))
    asyncio.run(run.polls(3))
    run.close()
    profile.write_text(PROFILE + SAVED, encoding="utf-8")
    done = RUNNER.invoke(app, ["identify", str(run.path), "--save", str(profile)])

    assert 3 == done.exit_code
    assert PROFILE + SAVED == profile.read_text(encoding="utf-8")
    assert "dialect of L1 not written, none is named" in done.stderr


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


async def test_an_integral_that_no_dialect_has_is_said_to_fit_none_with_the_execution(tmp_path: Path) -> None:
    run = Run(tmp_path / "foreign.ahrec", World("DPID", GAINS))
    run.world.plc.fail("L1", "ki-1-percent")
    await run.polls(160)
    run.close()
    found = RUNNER.invoke(app, ["identify", str(run.path)])

    assert 1 == found.exit_code, found.output
    assert "L1 (DPID): no known dialect fits" in found.output
    assert "I_MV: plc" in found.output


async def test_a_loop_that_is_not_seen_plain_is_said_to_be_undecided(tmp_path: Path) -> None:
    run = Run(tmp_path / "manual.ahrec", World("DPID", GAINS | {"PID_MAN": True, "MOUT": 30.0}))
    await run.polls(60)
    run.close()
    text, json_line = (RUNNER.invoke(app, ["identify", str(run.path), *more]) for more in ([], ["--output", "json"]))

    assert 3 == text.exit_code, text.output
    assert "L1 (DPID): too little to decide, of " in text.output
    assert " pictures 0 show a plain execution, nothing is named" in text.output
    assert "hint: watch longer, in automatic, between the limits, ERR_DBW 0" in text.output
    assert {"crowded": True, "decided": {}, "exit": "inconclusive"}.items() <= json.loads(json_line.stdout).items()
