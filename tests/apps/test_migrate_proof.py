"""Migration: a verdict blames nothing that is exact, the recorded run goes through both, fragments are profiles."""

from __future__ import annotations

import numpy as np
import pytest
from tuning_data import closed
from typer.testing import CliRunner

from ahgateway.apps.migrate import Verdict, migrate
from ahgateway.apps.migrate_page import page
from ahgateway.apps.migrate_text import fragment
from ahgateway.cli.main import app
from ahgateway.tuning.canonical import Scaling
from ahgateway.tuning.models import Kind, Model

WIDE = Scaling((0.0, 4000.0), (0.0, 4000.0), (0.0, 4000.0), (0.0, 4000.0))
STATION = '[station]\nname = "x"\ntarget = "fake://x"\nunit = 1\ndevice_map = "ah500"\n\n'
SOURCES = {
    "DPID": {"Kp": 2.0, "Ki": 0.05, "Kd": 1.0, "CYCLE": 20, "MV_MAX": 4000.0},
    "DPIDE": {"Kc_Kp": 2.0, "Ti_Ki": 40.0, "Td_Kd": 2.0, "Tf": 0.5, "PID_EQ": True, "PID_DE": True, "CYCLE": 200,
              "MV_MAX": 4000.0},
    "MELSEC_PID": {"KP": 200, "TI": 400, "TD": 200, "KD": 25, "TS": 200, "ACT": 33, "S22": 4000},
    "PID_Temp": {"Heat_Gain": 2.0, "Heat_Ti": 40.0, "Heat_Td": 2.0, "Heat_Cycle": 0.2, "Heat_PidUpperLimit": 4000.0},
}  # fmt: skip


@pytest.mark.parametrize(
    ("source", "target", "verdict", "because"),
    [
        ("DPID", "DPIDE", Verdict.IDENTICAL, []),
        ("DPIDE", "PID_Temp", Verdict.IDENTICAL, []),
        ("DPIDE", "DPID", Verdict.DIFFERENT, ["W-DSRC", "W-DFILT"]),
        ("MELSEC_PID", "DPIDE", Verdict.EQUIVALENT, []),
        ("PID_Temp", "MELSEC_PID", Verdict.DIFFERENT, ["W-DSRC"]),
    ],
)
def test_what_differs_has_a_warning_and_what_has_none_does_not_differ(source, target, verdict, because):
    found = migrate(source, SOURCES[source], target, scaling=WIDE)
    assert verdict is found.verdict
    assert because == [each.code for each in found.conversion.losses if not each.is_exact]
    assert all(code in found.text for code in because)
    assert "W-WINDUP" not in found.text


def test_ranges_of_a_hundred_whole_numbers_are_named_with_their_share():
    """0…100 in a block of whole numbers: one number is 1 %."""
    scaling = Scaling((0.0, 100.0), (0.0, 100.0), (0.0, 100.0), (0.0, 100.0))
    found = migrate("MELSEC_PID", {"KP": 200, "TI": 400, "TS": 200, "ACT": 1}, "DPIDE", scaling=scaling)
    rounded = [each for each in found.conversion.losses if each.code == "W-QUANT"]
    assert [(1.0, "% of PV"), (1.0, "% of MV")] == [(each.size, each.unit) for each in rounded]
    assert "W-QUANT" in found.text


def test_y_as_an_analog_output_is_said_to_hold_nothing():
    scaling = Scaling((0.0, 100.0), (-100.0, 100.0), (0.0, 100.0), (-100.0, 100.0))
    found = migrate("PID_REG_CE", {"KP": 2.0, "TN": 40.0, "TV": 2.0}, "DPIDE", scaling=scaling)
    assert (Verdict.DIFFERENT, True) == (found.verdict, "W-PULSE" in found.text)


def test_the_recorded_run_goes_through_both():
    """The recorded loop had just these gains, so that DPIDE gives back its MV, and what was migrated does too."""
    now = {"CYCLE": 500, "PID_EQ": True, "Kc_Kp": 1.0, "Ti_Ki": 25.0, "Td_Kd": 0.0}
    record = closed(Model(Kind.FOPDT, 1.5, 4.0, 20.0), {"Kc_Kp": 1.0, "Ti_Ki": 25.0, "Td_Kd": 0.0}, count=300)
    scaling = Scaling((0.0, 100.0), (0.0, 100.0), (0.0, 100.0), (0.0, 100.0))
    process = Model(Kind.FOPDT, 1.5, 4.0, 20.0)
    found = migrate("DPIDE", now, "DPID", scaling=scaling, process=process, record=record)
    again = found.runs[2]
    assert ("the recorded SV and PV", True) == (again.name, again.is_same)
    # From rest at the first PV: what the first error was then stands between the two all the time.
    assert 1e-3 > np.ptp(again.old.mv - record.mv[: again.old.mv.size])
    assert "on the recorded SV and PV by up to 0 %" in found.text or "identical" in found.text
    assert 3 == page(found, "TIC-1").count("<svg")


@pytest.mark.parametrize("target", ["DPID", "DPIDE", "MELSEC_PID", "PID_Temp", "PID_REG_CE"])
def test_every_fragment_is_a_loop_that_a_profile_takes(tmp_path, target):
    source = "DPIDE" if target != "DPIDE" else "DPID"
    file = tmp_path / "p.toml"
    file.write_text(STATION + fragment(migrate(source, SOURCES[source], target, scaling=WIDE), "TIC-1"), "utf-8")
    done = CliRunner().invoke(app, ["profile", "check", str(file)])
    assert (0, True) == (done.exit_code, "1 loop: TIC-1" in done.stdout), done.exception


def test_a_tag_with_a_blank_and_the_process_limits_of_pid_temp_stand_in_the_fragment(tmp_path):
    text = fragment(migrate("DPIDE", SOURCES["DPIDE"], "PID_Temp", scaling=WIDE), "TIC 1")
    assert {'[loops."TIC 1"]', "InputPerOn = false", "InputUpperLimit = 4000", "InputLowerLimit = 0"} <= set(
        text.splitlines()
    )
    (tmp_path / "p.toml").write_text(STATION + text, "utf-8")
    assert 0 == CliRunner().invoke(app, ["profile", "check", str(tmp_path / "p.toml")]).exit_code


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["Kp=1", "--to", "PID_REG_CE", "--stroke", "0"], "--stroke: 0 is no stroke time above 0"),
        (["Kp=1", "--to", "DPIDE", "--mv-from", "0", "inf"], "--mv-from: 0 and inf are no range, lowest first"),
        (["Kp=1", "Kp=2", "--to", "DPIDE"], "Kp is given twice, 1 and 2"),
        (["Kp=1", "--to", "DPIDE", "--family-to", "x"], "--family-to: `x` is no CPU family"),
    ],
)
def test_a_wrong_word_is_refused_with_its_name(words, text):
    done = CliRunner().invoke(app, ["migrate", *words, "--from", "DPID"])
    assert text in str(done.exception)


def test_what_has_no_law_of_ours_is_named_alone():
    found = migrate("DPID", SOURCES["DPID"], "PIDINIT", scaling=WIDE)
    assert "no law of ours for PIDINIT: the settings stand unproven" == found.text
    assert "no law of ours for PIDINIT" in page(found, "TIC-1")
