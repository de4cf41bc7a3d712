"""Proposals for MELSEC PID and PID_Temp in their own form and arithmetic; what rules cannot know is refused."""

from __future__ import annotations

import numpy as np
import pytest
from tuning_data import answered
from typer.testing import CliRunner

from ahgateway.apps.tune import as_text, compared, tune
from ahgateway.cli.main import app
from ahgateway.errors import ProfileError
from ahgateway.tuning.models import Kind, Model
from ahgateway.tuning.record import Record
from ahgateway.tuning.rules import RULES

SOME = tuple(rule for rule in RULES if rule.name in ("SIMC PI", "AMIGO PID"))
MELSEC = {"TS": 500, "ACT": 0x23, "KP": 100, "TI": 300, "TD": 0, "KD": 0, "ALPHA": 0, "S22": 4000, "S23": 0}


def counts(gain: float = 1.5) -> Record:
    """A doublet of 200 counts of 4000 in MV; PV in whole counts, noise of one count."""
    mv = np.full(600, 2000.0)
    mv[75:225] += 200.0
    mv[225:375] -= 200.0
    made = answered(Model(Kind.FOPDT, gain, 4.0, 20.0), mv, noise=1.0)
    return Record(made.t_s, np.full(600, 2000.0), np.rint(made.pv - 50.0 + 2000.0), mv, "counts")


def test_melsec_gains_are_whole_numbers_of_hundredths_and_tenths():
    """SIMC: θ' = 4.25 s, Kc = 20/(1.5·8.5) = 1.569, Ti = 20 s; ACT keeps its alarm and limit bits."""
    found = tune(counts(), "MELSEC_PID", MELSEC, kind=Kind.FOPDT, rules=SOME)
    simc, amigo = found.found
    assert (157, 200) == (pytest.approx(simc.settings["KP"], abs=3), pytest.approx(simc.settings["TI"], abs=3))
    assert all(isinstance(simc.settings[name], int) for name in ("KP", "TI", "TD", "KD"))
    assert "ACT" not in simc.settings
    # Tf is Td/8: KD is that share in %, rounded.
    assert amigo.settings["KD"] in (12, 13)
    assert amigo.settings["TD"] > 0
    assert simc.margins.ms == pytest.approx(1.6, abs=0.05)
    assert float(simc.setpoint_trace.mv[5]).is_integer()
    assert "KP 15" in as_text(found)
    assert "present" == found.present.name
    assert compared(found, simc).difference > 0.0


def test_a_melsec_loop_that_acts_the_wrong_way_gets_the_right_bit_and_keeps_the_others():
    found = tune(counts(-1.5), "MELSEC_PID", MELSEC, kind=Kind.FOPDT, rules=SOME)
    assert "ACT is 35" in next(each for each in found.findings if each.name == "wrong-direction").text
    assert 0x22 == found.found[0].settings["ACT"]


def test_pid_temp_gets_gain_times_and_ratio():
    record = answered(Model(Kind.FOPDT, 1.5, 4.0, 20.0), np.repeat([40.0, 45.0, 35.0, 40.0], 150))
    found = tune(record, "PID_Temp", {"Heat_Cycle": 0.5, "Heat_Gain": 1.0}, kind=Kind.FOPDT, rules=SOME)
    simc, amigo = found.found
    assert (1.569, 20.0) == pytest.approx((simc.settings["Heat_Gain"], simc.settings["Heat_Ti"]), rel=0.03)
    assert (0.125, 0.0) == (amigo.settings["Heat_TdFiltRatio"], amigo.settings["Heat_DWeighting"])
    assert set(simc.settings) <= {"Heat_Gain", "Heat_Ti", "Heat_Td", "Heat_TdFiltRatio", "Heat_DWeighting"}


def test_what_rules_cannot_know_is_refused_with_a_way_out():
    record = answered(Model(Kind.FOPDT, -1.5, 4.0, 20.0), np.repeat([40.0, 45.0, 35.0, 40.0], 150))
    found = tune(record, "PID_Temp", {"Heat_Cycle": 0.5}, kind=Kind.FOPDT, rules=SOME)
    assert (True, ()) == (found.is_refused, found.found)
    assert "no negative gain" in as_text(found)
    with pytest.raises(ProfileError, match="heats and cools"):
        tune(record, "PID_Temp", {"ActivateCooling": True}, rules=SOME)
    for instruction, settings in (("MELSEC_PID", {"ACT": 0x11}), ("DPIDE", {"PID_MODE": 1})):
        with pytest.raises(ProfileError, match="still seeks its gains itself"):
            tune(record, instruction, settings, rules=SOME)
    with pytest.raises(ProfileError, match="not PID_REG_CE, which moves its actuator by pulses") as caught:
        tune(record, "PID_REG_CE", {}, rules=SOME)
    assert "migrate --to PID_REG_CE" in caught.value.hint


def test_the_command_takes_the_block_s_name(tmp_path):
    record = counts()
    rows = zip(record.t_s, record.sv, record.pv, record.mv, strict=True)
    path = tmp_path / "a.csv"
    path.write_text("time,SV,PV,MV\n" + "\n".join(",".join(f"{x:g}" for x in row) for row in rows), "utf-8")
    given = [text for name, value in MELSEC.items() for text in ("--set", f"{name}={value}")]
    done = CliRunner().invoke(app, ["tune", str(path), "--instruction", "melsec_pid", "--model", "FOPDT", *given])
    assert 0 == done.exit_code, done.exception
    assert "proposals for MELSEC_PID" in done.stdout
