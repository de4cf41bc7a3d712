"""Commissioning of the three other blocks, in virtual time, from the shipped examples to the sheet."""

from __future__ import annotations

import json
import math

import pytest
import typer
from typer.testing import CliRunner

from ahgateway.cli.commission import commission

app = typer.Typer()
app.command()(commission)


def run(name: str, loop: str, *arguments: str):
    found = CliRunner().invoke(
        app, [name, "--arm", loop, "--auto", "--executions", "15", "--coverage", "0", "--output", "json", *arguments],
        catch_exceptions=False,
    )  # fmt: skip
    return found, json.loads(found.stdout)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "loop", "left_out"),
    [
        ("melsec_pid", "PIC-501", "MELSEC_PID has no manual value by which its output could be moved in steps"),
        ("pid_reg_ce", "FIC-301", "PID_REG_CE has no manual value by which its output could be moved in steps"),
    ],
)
def test_a_block_without_a_manual_value_goes_to_the_sheet_without_step_5(
    tmp_path, monkeypatch, name: str, loop: str, left_out: str
) -> None:
    monkeypatch.chdir(tmp_path)
    _, facts = run(name, loop)
    outcomes = {each["name"]: each for step in facts["steps"].values() for each in step["checks"]}
    assert [] == [each["name"] for each in outcomes.values() if each["outcome"] == "fail"]
    assert {left_out} == {each["text"] for each in facts["steps"]["5"]["checks"]}
    assert "E = SV - PV: MV rises while PV is below SV" == outcomes["direction"]["text"]
    rows = {row["operand"]: row for row in facts["operands"]}
    assert rows["KP"]["as_found"] == rows["KP"]["as_left"] is not None
    assert not any(row["changed"] for row in rows.values())
    assert all(map(math.isfinite, facts["facts"]["trace"]["PV"]))
    assert (tmp_path / f"commission-{loop}.html").stat().st_size > 20_000


@pytest.mark.slow
def test_pid_temp_is_proven_by_steps_of_its_manual_value(tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    found, facts = run("pid_temp", "TIC-401", "--answer", "12", "--step", "4")
    wiring = {each["name"]: each for each in facts["steps"]["5"]["checks"]}
    assert 0 == found.exit_code, found.stderr
    assert {"clamp-ignored"} == {name for name, each in wiring.items() if each["outcome"] != "pass"}
    assert "PV rises when MV rises, the loop works by E = SV - PV" in wiring["wrong-direction"]["text"]
    assert wiring["pv-does-not-answer"]["text"].startswith("ManualValue +4: PV +")
    assert [] == [row["operand"] for row in facts["operands"] if row["changed"]]
