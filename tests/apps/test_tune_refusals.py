"""Every refusal of `tune` as a person meets it: the command on a CSV file, its exit code, and its one sentence."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tuning_data import answered, closed, doublet
from typer.testing import CliRunner

from ahgateway.apps.tune import tune
from ahgateway.cli.main import app
from ahgateway.tuning.models import Kind, Model
from ahgateway.tuning.record import Record
from ahgateway.tuning.valve import backlash, stiction

MODEL = Model(Kind.FOPDT, 1.5, 4.0, 20.0)
STAIRS = 40.0 + np.repeat([0.0, 2.0, 4.0, 6.0, 4.0, 2.0, 0.0, -2.0, 0.0, 3.0, -1.0, 0.0], 60)


def at_its_limit() -> Record:
    mv = np.full(300, 40.0)
    mv[50:200] = 100.0
    return answered(MODEL, mv)


def with_a_gap() -> Record:
    whole = doublet(MODEL, count=300)
    move = int(np.flatnonzero(np.diff(whole.mv))[1])
    kept = np.r_[: move - 10, move + 10 : 300]
    return Record(*(each[kept] for each in (whole.t_s, whole.sv, whole.pv, whole.mv)))


def with_a_still_pv() -> Record:
    whole = doublet(MODEL, count=300)
    return Record(whole.t_s, whole.sv, np.full(300, 50.0), whole.mv)


@pytest.mark.parametrize(
    ("record", "said", "hint"),
    [
        (lambda: doublet(MODEL, noise=6.0, count=300), "refused: noisy: PV answers MV by ", "use a step "),
        (at_its_limit, "refused: saturated: MV stands at a limit (0 or 100) in 50 %", "use a smaller step"),
        (
            lambda: answered(MODEL, np.full(300, 40.0)),
            "refused: not-excited: MV stands at 40 over the whole record",
            "record a step of MOUT in manual",
        ),
        (
            lambda: closed(MODEL, {"Kc_Kp": 1.0, "Ti_Ki": 25.0, "Td_Kd": 0.0}, sv_step=0.0, count=300),
            "refused: not-excited: SV stands at 50 and MV moves in ",
            "record a step of SV in automatic",
        ),
        (lambda: doublet(MODEL, drift=20.0, count=300), "refused: drifting: PV drifts by ", "wait until PV"),
        (
            lambda: answered(MODEL, doublet(MODEL).mv, position=np.full(600, 40.0)),
            "refused: stuck-valve: PV does not follow MV: MV moves by 10",
            "valve stuck or by-passed",
        ),
        (
            lambda: answered(MODEL, STAIRS, position=stiction(STAIRS, 2.5)),
            "refused: stiction: a valve with stiction of about 2",
            "fix the valve, do not retune",
        ),
        (
            lambda: answered(MODEL, STAIRS, position=backlash(STAIRS, 2.5)),
            "refused: backlash: a valve with backlash of about ",
            "fix the valve, do not retune",
        ),
        (with_a_gap, "refused: gap: 10.5 s are missing from ", "cut the file there"),
        (with_a_still_pv, "refused: frozen-pv: PV stands at 50 while MV moves by 10", "check the sensor"),
    ],
    ids=[
        "noisy", "saturated", "not excited", "feedback alone", "drifting", "stuck valve", "stiction", "backlash", "gap",
        "frozen PV",
    ],
)  # fmt: skip
def test_data_that_are_unfit_end_the_command_with_3_the_number_and_what_to_do(tmp_path: Path, record, said, hint):
    found = record()
    rows = zip(found.t_s, found.sv, found.pv, found.mv, strict=True)
    path = tmp_path / "trend.csv"
    path.write_text("\n".join(["time,SV,PV,MV", *(",".join(f"{value:.6f}" for value in row) for row in rows)]))
    done = CliRunner().invoke(app, ["tune", str(path), "--set", "CYCLE=500", "--model", "FOPDT"])
    assert 3 == done.exit_code, done.stdout
    lines = done.stdout.splitlines()
    at = next(number for number, line in enumerate(lines) if line.startswith(said))
    assert lines[at + 1].startswith(f"  hint: {hint}")
    assert "no proposal is made" == lines[-1]


def test_a_controller_that_is_looked_at_more_often_than_it_executes_is_feedback_all_the_same():
    """Four looks at each execution: MV stands still in three quarters of the samples, and nobody but it moved MV."""
    seen = closed(MODEL, {"Kc_Kp": 1.0, "Ti_Ki": 25.0, "Td_Kd": 0.0}, sv_step=0.0, count=150)
    often = Record(np.arange(600) * 0.125, *(np.repeat(each, 4) for each in (seen.sv, seen.pv, seen.mv)))
    assert ["not-excited"] == [each.name for each in tune(often, "DPIDE", {"CYCLE": 500}).findings]


@pytest.mark.parametrize(("shape", "name"), [("behind a valve that sticks", "stiction"), ("sine", "oscillating")])
def test_a_loop_that_swings_by_itself_is_told_by_what_its_swing_looks_like(shape, name):
    """A stem that jumps makes PV a square and MV, its integral, a triangle (Horch 1999); a sine follows MV at −180°."""
    t = np.arange(1200) * 0.5
    turn = 2.0 * np.pi * t / 40.0
    noise = 0.02 * np.random.default_rng(1).standard_normal(t.size)
    if name == "stiction":
        pv, mv = np.sign(np.sin(turn)), -2.0 / np.pi * np.arcsin(np.cos(turn + 1e-3))
    else:
        pv, mv = np.sin(turn), -np.sin(turn)
    found = tune(Record(t, np.full(t.size, 50.0), 50.0 + 2.0 * pv + noise, 40.0 - mv + 1e-4 * t), "DPIDE", {})
    assert {"not-excited", name} == {each.name for each in found.findings}
    assert "period of 40" in found.findings[-1].text
    assert found.is_refused
