"""`ahgateway check` as a person and a CI job meet it: lines, exit codes, files."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from ahgateway.cli.main import app
from ahgateway.errors import ProfileError, StateError
from ahgateway.schema.scenario import library

RUNNER = CliRunner()

SHORT = """
title = "A loop at rest"
instruction = "DPID"
duration = 2.0
plant = { kind = "fopdt", gain = 1.2, tau_s = 1.0, bias = 10.0, noise = 0.02, initial = 49.0 }
initial = { SV = 50.0, CYCLE = 10, Kp = 1.1, Ki = 0.9 }
"""


def folder(tmp_path: Path, expect: str = "") -> str:
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "rest.toml").write_text(SHORT + expect)
    return str(tmp_path / "mine")


def test_a_folder_that_passes_exits_0_and_writes_what_was_asked_for(tmp_path: Path) -> None:
    files = [tmp_path / name for name in ("c.xml", "c.html", "c.json")]
    asked = [folder(tmp_path), "--junit", files[0], "--html", files[1], "--fingerprint", files[2]]
    result = RUNNER.invoke(app, ["check", *map(str, asked)])

    assert (0, True) == (result.exit_code, all(each.exists() for each in files))
    assert "mine/rest                    pass" in result.stdout
    again = RUNNER.invoke(app, ["check", asked[0], "--against", str(files[2])])
    assert (0, True) == (again.exit_code, "the same words as in" in again.stdout)


def test_a_failure_exits_1_and_says_where(tmp_path: Path) -> None:
    result = RUNNER.invoke(app, ["check", folder(tmp_path, '\n[[expect.response]]\nalways = "PV > 60"\n')])

    assert 1 == result.exit_code
    assert "violated response.0.always: `PV > 60` does not hold at 0.00 s" in result.stdout


def test_json_is_one_object_a_line(tmp_path: Path) -> None:
    result = RUNNER.invoke(app, ["check", folder(tmp_path), "--output", "json"])

    told = [json.loads(line) for line in result.stdout.splitlines()]
    assert ["bench", "scenario", "run"] == [each["kind"] for each in told]
    assert ("pass", 0) == (told[1]["verdict"], told[2]["exit"])


def test_an_empty_shard_is_no_pass(tmp_path: Path) -> None:
    result = RUNNER.invoke(app, ["check", folder(tmp_path), "--shard", "2/2"])

    assert (3, "") == (result.exit_code, result.stdout)


def test_a_filter_that_matches_nothing_is_refused(tmp_path: Path) -> None:
    result = RUNNER.invoke(app, ["check", folder(tmp_path), "-k", "not rest and not test"])

    assert isinstance(result.exception, StateError)
    assert "no scenario matches" in result.exception.message


def test_a_real_target_is_not_driven_without_being_armed(tmp_path: Path) -> None:
    result = RUNNER.invoke(app, ["check", folder(tmp_path), "--target", "modbus+tcp://192.0.2.1:502"])

    assert isinstance(result.exception, ProfileError)
    assert "nothing was sent" in result.exception.message


def test_a_plc_that_is_no_bench_is_never_driven(tmp_path: Path) -> None:
    plant = tmp_path / "plant.toml"
    plant.write_text((library() / "bench.toml").read_text("utf-8").replace('kind = "bench"', ""), "utf-8")
    asked = ["check", folder(tmp_path), "--profile", str(plant), "--target", "modbus+tcp://192.0.2.1:502", "--arm"]
    result = RUNNER.invoke(app, asked)

    assert isinstance(result.exception, ProfileError)
    assert "Check bench is no bench" in result.exception.message


def test_a_plc_that_is_no_match_for_the_profile_is_not_the_products_fault(tmp_path: Path) -> None:
    """The shipped bench keeps its DPID at D300; a copy of it at D500 is another PLC."""
    other = tmp_path / "other.toml"
    other.write_text((library() / "bench.toml").read_text("utf-8").replace("D300", "D500"), "utf-8")
    result = RUNNER.invoke(app, ["check", folder(tmp_path), "--target", f"fake://{other}"])

    assert (3, True) == (result.exit_code, "wrong profile" in result.stdout)


def test_two_kept_fingerprints_are_compared_without_running_anything(tmp_path: Path) -> None:
    mine = folder(tmp_path)
    old, new, other = (str(tmp_path / name) for name in ("old.json", "new.json", "other.json"))
    for file, seed in ((old, "1"), (new, "1")):
        assert 0 == RUNNER.invoke(app, ["check", mine, "--fingerprint", file, "--seed", seed]).exit_code
    dialect = tmp_path / "trapezoid.toml"
    shipped = (library() / "bench.toml").read_text("utf-8")
    dialect.write_text(
        shipped.replace('flags = "M21"', 'flags = "M21"\ndialect = { integrator = "trapezoid" }'), "utf-8"
    )
    assert 0 == RUNNER.invoke(app, ["check", mine, "--fingerprint", other, "--profile", str(dialect)]).exit_code

    same = RUNNER.invoke(app, ["check", "--compare", old, new])
    assert (0, "1 scenarios in both, 0 differ\n") == (same.exit_code, same.stdout)
    differing = RUNNER.invoke(app, ["check", "--compare", old, other, "--output", "json"])
    assert (1, ["mine/rest"]) == (
        differing.exit_code, [each["scenario"] for each in json.loads(differing.stdout)["differences"]]
    )  # fmt: skip


def test_scenarios_and_compare_are_not_asked_for_together(tmp_path: Path) -> None:
    for arguments in ([], ["dpid", "--compare", "a.json", "b.json"]):
        result = RUNNER.invoke(app, ["check", *arguments])
        assert isinstance(result.exception, ProfileError)


def test_each_scenario_is_recorded_and_replay_comes_to_the_same_verdicts(tmp_path: Path) -> None:
    kept = tmp_path / "kept"
    done = RUNNER.invoke(app, ["check", folder(tmp_path), "--repeat", "2", "--record", str(kept)])

    assert (0, ["mine-rest-2.ahrec", "mine-rest.ahrec"]) == (
        done.exit_code,
        sorted(each.name for each in kept.iterdir()),
    )
    replayed = RUNNER.invoke(app, ["replay", str(kept / "mine-rest.ahrec"), "--diverged"])
    assert (0, True) == (replayed.exit_code, "the same verdicts as then: " in replayed.stdout)
    again = RUNNER.invoke(app, ["check", str(tmp_path / "mine"), "--record", str(kept)])
    assert (3, True) == (again.exit_code, "never overwritten" in again.stdout)


@pytest.mark.parametrize("option", ["--junit", "--html", "--fingerprint", "--history"])
def test_a_place_where_nothing_can_be_written_is_refused_before_anything_runs(tmp_path: Path, option: str) -> None:
    for place, said in ((tmp_path / "nowhere" / "file", "its folder does not exist"), (tmp_path, "is a folder")):
        result = RUNNER.invoke(app, ["check", str(library() / "dpid"), option, str(place)])

        assert isinstance(result.exception, ProfileError)
        assert ("", True) == (result.stdout, said in result.exception.message and option in result.exception.message)
