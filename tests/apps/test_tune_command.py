"""Tuning and migration from files, as data and over the command line."""

from __future__ import annotations

import json

import numpy as np
import pytest
from tuning_data import closed, doublet
from typer.testing import CliRunner

from ahgateway.apps.tune import as_json, as_text, tune
from ahgateway.apps.tune_page import page
from ahgateway.apps.tune_source import read_csv
from ahgateway.cli.main import app
from ahgateway.errors import ProfileError
from ahgateway.tuning.models import Kind, Model
from ahgateway.tuning.rules import RULES

MODEL = Model(Kind.FOPDT, 1.5, 4.0, 20.0)
NOW = {"CYCLE": 500, "PID_EQ": True, "Kc_Kp": 1.0, "Ti_Ki": 25.0, "Td_Kd": 0.0}
TWO = RULES[:2]


def written(path, record, head="time,SV,PV,MV", separator=","):
    rows = zip(record.t_s, record.sv, record.pv, record.mv, strict=True)
    lines = [head, *(separator.join(f"{value:.6f}" for value in row) for row in rows)]
    text = "\n".join(lines)
    path.write_text(text if separator == "," else text.replace(".", ","), encoding="utf-8")
    return path


def test_a_csv_of_a_german_spreadsheet_is_read(tmp_path):
    record = doublet(MODEL)
    file = written(tmp_path / "a.csv", record, "Zeit;Soll;Ist;Stell", ";")
    columns = {"time": "Zeit", "SV": "Soll", "PV": "Ist", "MV": "Stell"}
    found = read_csv(file, columns)
    assert found.pv == pytest.approx(record.pv, abs=1e-6)
    assert found.mv.tolist() == record.mv.tolist()


def test_times_of_day_become_seconds(tmp_path):
    file = tmp_path / "a.csv"
    file.write_text("timestamp,PV,OP\n2026-01-01T10:00:00,1,2\n2026-01-01T10:00:01.5,1,2\n", encoding="utf-8")
    assert [0.0, 1.5] == read_csv(file).t_s.tolist()


def test_a_missing_column_and_a_wrong_cell_are_named_with_their_place(tmp_path):
    file = tmp_path / "a.csv"
    file.write_text("time,PV\n0,1\n", encoding="utf-8")
    with pytest.raises(ProfileError, match=r"no column looks like MV, there are time, PV"):
        read_csv(file)
    file.write_text("time,PV,MV\n0,1,2\n1,x,2\n", encoding="utf-8")
    with pytest.raises(ProfileError, match=r"a\.csv:3: PV: `x` is no number"):
        read_csv(file)


@pytest.mark.parametrize(
    ("content", "text"),
    [
        (b"time,SV,PV,MV\n", "has no samples"),
        (bytes(range(256)) * 4, "is no text file"),
        (b"0.0,80,80,40\n0.2,80,80,40\n", "no column looks like time, there are 0.0, 80, 80, 40"),
        (b"time,PV,MV\n01.03.2026 12:00,1,2\n", "is no number"),
    ],
)
def test_a_file_that_is_no_trace_is_an_error_of_the_file_and_not_ours(tmp_path, content, text):
    file = tmp_path / "a.csv"
    file.write_bytes(content)
    with pytest.raises(ProfileError, match=text):
        read_csv(file)


@pytest.mark.parametrize(
    ("head", "encoding", "factor"),
    [("time [ms];SV [°C];PV [°C];MV [%]", "utf-16", 1000), ("time_ms;sv;pv;mv", "cp1252", 1000),
     ("t (s);sp;pv (bar);op", "utf-8-sig", 1)],
)  # fmt: skip
def test_units_and_encodings_of_trend_programs_are_read(tmp_path, head, encoding, factor):
    file = tmp_path / "a.csv"
    rows = [f"{time * factor};80,5;79,25;40" for time in (0, 1, 2)]
    file.write_text("\r\n".join([head, *rows]), encoding=encoding)
    found = read_csv(file)
    assert ([0.0, 1.0, 2.0], [80.5] * 3, [79.25] * 3) == (found.t_s.tolist(), found.sv.tolist(), found.pv.tolist())


def test_a_robust_rule_that_may_not_be_written_is_named(tmp_path):
    found = tune(doublet(MODEL), "DPIDE", NOW, rules=TWO, writable=frozenset({"SV"}))
    assert "the profile lets nobody write Kc_Kp, Ti_Ki, Td_Kd, Tf; by its numbers it would be SIMC PI" in as_text(found)


def test_closed_loop_data_are_run_again_with_the_new_gains():
    """The present gains on the recorded run give back the recorded MV: the disturbance and the model are the run's."""
    record = closed(MODEL, {"Kc_Kp": 1.0, "Ti_Ki": 25.0, "Td_Kd": 0.0})
    found = tune(record, "DPIDE", NOW, rules=TWO)
    again = found.again["present"]
    assert np.max(np.abs(again.mv - record.mv)) < 0.1
    assert found.chosen is not None


def test_every_fact_stands_in_text_json_and_page():
    found = tune(doublet(MODEL), "DPIDE", NOW, rules=TWO)
    facts = json.loads(json.dumps(as_json(found)))
    assert ("tuning", False, "FOPDT", "SIMC PI") == (
        facts["kind"], facts["refused"], facts["model"]["kind"], facts["recommended"],
    )  # fmt: skip
    assert facts["proposals"][0]["settings"]["Kc_Kp"] == pytest.approx(1.57, rel=0.02)
    assert "recommended: SIMC PI" in as_text(found)
    html = page(found)
    assert 3 == html.count("<svg")
    assert "MV side by side" in html
    assert "the new gains differ by" in as_text(found)
    assert facts["compared"]["rms"] > 0.0
    assert "SIMC PI *" in html
    assert "http-equiv" not in html
    assert "<script" not in html


def test_refused_data_make_no_proposal_and_say_why():
    found = tune(doublet(MODEL, noise=6.0), "DPIDE", NOW, rules=TWO)
    assert found.is_refused
    assert "no proposal is made" in as_text(found)
    assert as_json(found)["proposals"] == []
    assert "refused: noisy" in page(found)


def test_a_direction_that_runs_away_is_said():
    found = tune(doublet(MODEL), "DPIDE", NOW | {"PID_DIR": False}, rules=TWO)
    assert "wrong-direction" in [each.name for each in found.findings]


def test_the_command_ends_with_0_or_3(tmp_path):
    good, bad = written(tmp_path / "a.csv", doublet(MODEL)), written(tmp_path / "b.csv", doublet(MODEL, noise=6.0))
    run = CliRunner()
    done = run.invoke(app, ["tune", str(good), "--set", "CYCLE=500", "--output", "json"])
    assert (0, False) == (done.exit_code, json.loads(done.stdout)["refused"])
    assert 3 == run.invoke(app, ["tune", str(bad)]).exit_code


def test_migrate_proves_what_it_converts(tmp_path):
    run = CliRunner()
    report, piece = tmp_path / "m.html", tmp_path / "m.toml"
    done = run.invoke(
        app,
        ["migrate", "Kp=2", "Ki=0.05", "CYCLE=100", "--from", "DPID", "--to", "DPIDE", "--output", "json",
         "--report", str(report), "--fragment", str(piece)],
    )  # fmt: skip
    facts = json.loads(done.stdout)
    assert (0, "identical", []) == (done.exit_code, facts["verdict"], facts["losses"])
    assert 2 == report.read_text(encoding="utf-8").count("<svg")
    assert 'instruction = "DPIDE"' in piece.read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("arguments", "code", "verdict"),
    [
        (["Kc_Kp=2", "Ti_Ki=20", "Td_Kd=2", "Tf=0.5", "PID_EQ=TRUE", "PID_DE=TRUE", "--from", "DPIDE", "--to",
          "PID_Temp"], 0, "identical"),
        (["KP=250", "TI=300", "ACT=33", "S22=4000", "--from", "MELSEC_PID", "--to", "DPIDE", "--pv-from", "0", "4000",
          "--mv-from", "0", "4000", "--pv-to", "0", "200", "--mv-to", "0", "100"], 0, "equivalent"),
        (["Heat_Gain=3", "Heat_Ti=30", "Heat_PWeighting=0.2", "--from", "PID_Temp", "--to", "DPIDE"], 1, "different"),
        (["KP=250", "--from", "PIDINIT", "--to", "DPIDE"], 3, "unproven"),
    ],
)  # fmt: skip
def test_migrate_ends_with_its_verdict(arguments, code, verdict):
    done = CliRunner().invoke(app, ["migrate", *arguments, "--output", "json"])
    assert (code, verdict) == (done.exit_code, json.loads(done.stdout)["verdict"])


def test_what_may_not_be_written_is_not_recommended():
    """D of PV is PID_DE; where that stands fixed, D acts on E, and where Td does, a PI rule is recommended."""
    record = doublet(MODEL)
    pid = tuple(rule for rule in RULES if rule.name in ("SIMC PI", "AMIGO PID"))
    free = tune(record, "DPIDE", NOW, rules=pid)
    assert ("AMIGO PID", True) == (free.chosen.name, free.chosen.settings["PID_DE"])
    fixed = tune(record, "DPIDE", NOW, rules=pid, writable=frozenset({"Kc_Kp", "Ti_Ki", "Td_Kd", "Tf"}))
    assert all("PID_DE" not in each.settings for each in fixed.found)
    least = tune(record, "DPIDE", NOW, rules=pid, writable=frozenset({"Kc_Kp", "Ti_Ki"}))
    assert "SIMC PI" == least.chosen.name
