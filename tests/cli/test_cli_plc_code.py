"""`ahgateway plc-code`: the text on stdout or in a file, and what is said when a table is missing."""

from __future__ import annotations

import json

import pytest
import typer
from typer.testing import CliRunner

from ahgateway.cli.plc_code import plc_code
from ahgateway.errors import ProfileError

app = typer.Typer()
app.command()(plc_code)


def run(*arguments: str):
    return CliRunner().invoke(app, list(arguments), catch_exceptions=False)


def test_the_snippet_comes_to_stdout_in_a_file_and_as_json(tmp_path) -> None:
    text = run("heartbeat", "demo").stdout
    assert text.startswith("(*\n  Lease of loop TIC-101 of station Demo")
    assert text.endswith("END_IF;\n")
    assert 0 == run("heartbeat", "demo", "--file", str(tmp_path / "lease.st")).exit_code
    assert text == (tmp_path / "lease.st").read_text("utf-8")
    facts = json.loads(run("heartbeat", "demo", "--output", "json").stdout)
    assert {"kind": "heartbeat", "station": "Demo", "loops": {"TIC-101": text}} == facts


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--loop", "LIC-201"], "loops.LIC-201.lease: is missing"),
        (["--loop", "nobody"], "no loop `nobody`, it has TIC-101, LIC-201"),
        (["--file", "."], "cannot be written"),
    ],
)
def test_what_cannot_be_made_is_named(arguments: list[str], said: str) -> None:
    with pytest.raises(ProfileError) as caught:
        run("heartbeat", "demo", *arguments)
    assert said in str(caught.value)
