"""`ahgateway write` and `ahgateway journal`: silent without --arm, one door, a journal that can be checked."""

from __future__ import annotations

import json

import pytest
import typer
from typer.testing import CliRunner

from ahgateway.cli import journal
from ahgateway.cli.write import write
from ahgateway.errors import ProfileError, StateError

app = typer.Typer()
app.command()(write)


def run(*arguments: str):
    return CliRunner().invoke(app, list(arguments), catch_exceptions=False)


def test_without_arm_it_says_what_it_would_send() -> None:
    done = run("demo", "SV=82.5", "--loop", "TIC-101")
    assert "TIC-101 SV D100: 80.0 -> 82.5  [0000 42A0 -> 0000 42A5]\n" == done.stdout
    assert "1 request, not sent; --arm TIC-101 sends them\n" == done.stderr


def test_armed_it_writes_and_the_journal_holds_the_anchor(tmp_path) -> None:
    done = run("demo", "SV=82.5", "--arm", "TIC-101", "--by", "Ada", "--directory", str(tmp_path), "--output", "json")
    facts = json.loads(done.stdout)
    assert [{"table": "holding register", "address": 100, "words": [0, 0x42A5]}] == [
        {key: request[key] for key in ("table", "address", "words")} for request in facts["requests"]
    ]
    checked = CliRunner().invoke(journal.app, ["verify", facts["journal"], "--anchor", facts["anchor"]])
    assert (0, True) == (checked.exit_code, "whole, 4 records" in checked.stdout)
    strange = CliRunner().invoke(journal.app, ["verify", facts["journal"], "--anchor", "f" * 64])
    assert (1, True) == (strange.exit_code, "is not in it" in strange.stdout)
    shown = CliRunner().invoke(journal.app, ["show", facts["journal"]]).stdout.splitlines()
    texts = ["armed", "write SV D100 80.0 -> 82.5", "verified", "ended kept"]
    assert [] == [text for text, line in zip(texts, shown, strict=True) if f" {text}" not in line]


def test_a_changed_journal_is_convicted(tmp_path) -> None:
    path = json.loads(
        run("demo", "SV=82.5", "--arm", "TIC-101", "--directory", str(tmp_path), "--output", "json").stdout
    )["journal"]
    with open(path, encoding="utf-8") as file:
        text = file.read()
    with open(path, "w", encoding="utf-8") as file:
        file.write(text.replace('"new_value":"82.5"', '"new_value":"80.5"'))
    checked = CliRunner().invoke(journal.app, ["verify", path, "--output", "json"])
    facts = json.loads(checked.stdout)
    assert (1, 1) == (checked.exit_code, facts["records"])
    assert facts["fault"].startswith("line 2: its content gives the hash")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["demo"], "say one thing: NAME=VALUE…, --restore or --accept"),
        (["demo", "SV=1", "--restore", "--arm", "TIC-101"], "say one thing"),
        (["demo", "--restore"], "need --arm LOOP"),
        (["demo", "SV=1"], "which loop? the station has TIC-101, LIC-201"),
        (["demo", "SV=1", "--arm", "TIC-1"], "has no loop `TIC-1`"),
        (["demo", "SV=1", "--arm", "TIC-101", "--loop", "LIC-201"], "name two loops"),
        (["demo", "SV", "--loop", "TIC-101"], "`SV` is no NAME=VALUE"),
        (["demo", "SV=1", "SV=2", "--loop", "TIC-101"], "SV stands there twice"),
    ],
)
def test_what_was_typed_wrongly_is_named(arguments: list[str], said: str) -> None:
    with pytest.raises(ProfileError) as caught:
        run(*arguments)
    assert said in str(caught.value)


@pytest.mark.parametrize(
    ("value", "said"),
    [
        ("SV=x", "SV is a REAL and takes a number, `x` is none"),
        ("CYCLE=1.5", "CYCLE is a DINT and takes a whole number"),
        ("PID_MAN=maybe", "PID_MAN is a BOOL, `maybe` is none of 1, true, on, 0, false, off"),
        ("SV=151", "SV = 151.0 is outside 20…150"),
        ("PV=50", "PV is not on the list of what may be written"),
    ],
)
def test_a_value_that_does_not_fit_is_refused(value: str, said: str) -> None:
    with pytest.raises(StateError) as caught:
        run("demo", value, "--loop", "TIC-101")
    assert said in str(caught.value)


def test_restore_without_anything_to_put_back_says_so(tmp_path) -> None:
    done = run("demo", "--restore", "--arm", "TIC-101", "--directory", str(tmp_path))
    assert "TIC-101: there is nothing to put back\n" == done.stdout
    done = run("demo", "--accept", "--arm", "TIC-101", "--directory", str(tmp_path))
    assert "TIC-101: nothing was left open\n" == done.stdout
