"""The history of many nights: since when, how often, how far."""

from __future__ import annotations

import sqlite3
from pathlib import Path

import pytest

from ahgateway.apps.check.history import kept, sentence
from ahgateway.apps.check.result import Outcome, Result, State, Verdict
from ahgateway.errors import ProfileError

DAY = 86_400_000_000_000
NOON = 1_795_262_400_000_000_000
"""2026-11-21T12:00:00Z."""


def night(path: Path, number: int, verdict: Verdict, figure: float = 10.0, target: str = "fake://bench") -> str:
    out = (Outcome("response.0.iae", State.MET, "", figure),)
    result = Result("dpid/step", "Steps", "DPID", verdict, "why", outcomes=out)
    return sentence(kept(path, [result], target, 1, "0.1", NOON + number * DAY)[0])


def test_a_check_that_fails_says_since_when(tmp_path: Path) -> None:
    file = tmp_path / "nights.db"

    assert "" == night(file, 0, Verdict.PASS)
    assert "fails since 2026-11-22 12:00 UTC" == night(file, 1, Verdict.FAIL)
    assert "fails since 2026-11-22 12:00 UTC" == night(file, 2, Verdict.FAIL)
    assert "changed its verdict 2 times in 4 runs" == night(file, 3, Verdict.PASS)


def test_a_figure_that_drifts_is_named(tmp_path: Path) -> None:
    file = tmp_path / "nights.db"

    assert ["", "", "response.0.iae went from 10 to 11 in 3 runs"] == [
        night(file, number, Verdict.PASS, figure) for number, figure in enumerate((10.0, 10.4, 11.0))
    ]


def test_another_target_has_a_past_of_its_own(tmp_path: Path) -> None:
    night(tmp_path / "nights.db", 0, Verdict.FAIL, target="fake://a")

    assert "" == night(tmp_path / "nights.db", 1, Verdict.PASS, target="fake://b")


def test_a_database_of_another_program_is_left_alone(tmp_path: Path) -> None:
    file = tmp_path / "other.db"
    base = sqlite3.connect(file)
    base.execute("create table theirs (x)")
    base.commit()
    base.close()

    with pytest.raises(ProfileError, match="another program's database"):
        night(file, 0, Verdict.PASS)
