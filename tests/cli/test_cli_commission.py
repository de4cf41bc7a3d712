"""`ahgateway commission` on the fake: the whole list in virtual time, a sheet, progress that is kept, exit codes."""

from __future__ import annotations

import json

import pytest
import typer
from typer.testing import CliRunner

from ahgateway.cli.commission import commission
from ahgateway.errors import ProfileError

app = typer.Typer()
app.command()(commission)


def run(*arguments: str):
    return CliRunner().invoke(app, list(arguments), catch_exceptions=False)


@pytest.mark.slow
def test_the_demo_is_rehearsed_to_the_sheet_and_the_next_call_goes_on(tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    heading = ("--by", "A. Lovelace", "--instrument", "Fluke\n754", "--remarks", "cold start \udcff")
    asked = ("demo", "--loop", "LIC-201", "--executions", "20", "--coverage", "0.2", "--auto", "--output", "json")
    done = run(*asked, *heading)
    facts = json.loads(done.stdout)
    assert (0, "PASS", True) == (done.exit_code, facts["verdict"], facts["rehearsal"])
    assert ["1", "2", "3", "4", "5"] == list(facts["steps"])
    assert {"skipped"} == {check["outcome"] for check in facts["steps"]["5"]["checks"]}
    assert "REHEARSAL on a fake PLC" in (tmp_path / "commission-LIC-201.html").read_text("utf-8")
    again = run("demo", "--loop", "LIC-201", "--auto")
    assert "steps 1, 2, 3, 4 are done already; --fresh does them again" in again.stderr
    text = (tmp_path / "commission-LIC-201.html").read_text("utf-8")
    assert ["A. Lovelace", "Fluke 754", "cold start ?"] == [
        said
        for said in ("A. Lovelace", "Fluke 754", "cold start ?")
        if f"<td>{said}</td>" in text or f">{said}<" in text
    ]
    assert "dialect: the default" in text


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["demo", "--arm", "TIC-101", "--loop", "LIC-201"], "name two loops"),
        (["demo"], "which loop?"),
        (["demo", "--loop", "TIC-101", "--rollback"], "needs --arm LOOP"),
    ],
)
def test_what_was_typed_wrongly_is_named(arguments: list[str], said: str) -> None:
    with pytest.raises(ProfileError) as caught:
        run(*arguments)
    assert said in str(caught.value)
