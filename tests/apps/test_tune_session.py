"""From a cold start to proven gains on the fake PLC in virtual time; repeats and their spread; the command."""

from __future__ import annotations

import json

import pytest
from lockstep.gate.gate_world import WRITES, GateWorld
from tuning_data import doublet
from typer.testing import CliRunner

from ahgateway.apps.tune import tune
from ahgateway.apps.tune_experiment import Kind, Wanted
from ahgateway.apps.tune_page import page
from ahgateway.apps.tune_session import Gains, Session
from ahgateway.apps.tune_sitting import Envelope
from ahgateway.apps.tune_spread import as_json, as_text, middle, spread
from ahgateway.cli.main import app
from ahgateway.codec.access import Read, Table
from ahgateway.codec.station import PlantSpec, WriteLimit
from ahgateway.core.real import REAL, bits
from ahgateway.errors import ProfileError, StateError
from ahgateway.tuning.models import Kind as Process
from ahgateway.tuning.models import Model
from ahgateway.tuning.rules import RULES

INITIAL = {
    "SV": 80.0, "CYCLE": 200, "Kc_Kp": 1.0, "Ti_Ki": 0.15, "Td_Kd": 0.0, "MV_MAX": 100.0, "MV_MIN": 0.0,
}  # fmt: skip
LISTED = WRITES | {"Kc_Kp": WriteLimit(0.1, 10.0, 3.0, 0.0), "Ti_Ki": WriteLimit(0.0, 2.0, 1.0, 0.0)}
NOW = {"CYCLE": 500, "PID_EQ": True, "Kc_Kp": 1.0, "Ti_Ki": 25.0, "Td_Kd": 0.0}


def judged(record, name, known):
    return tune(record, name, known, kind=Process.FOPDT, rules=RULES[:1])


def bench(folder, writes=LISTED):
    world = GateWorld(
        folder, INITIAL, plant=PlantSpec("fopdt", 1.5, 6.0, 1.0, 20.0, 0.02, 80.0), scan_ms=20, writes=writes
    )
    world.clock.advance_ns(120_000_000_000)
    world.plc.answer(Read(1, Table.HOLDING, 100, 1))
    bounds = Envelope((60.0, 100.0), (5.0, 95.0), time_s=600.0)
    said = []
    session = Session(
        world.station, world.loop, world.link, world.clock, world.folder, bounds, who="test", told=said.append
    )
    return world, session, said


async def test_cold_to_verified(tmp_path):
    world, session, said = bench(tmp_path)
    live = await session.excited(Wanted(Kind.DOUBLET, 2.5), judged, 2, Gains("recommended", 4.0, 25.0))
    assert live.proof.is_kept
    assert live.proof.fit_percent > 90.0
    assert bits(REAL(live.result.chosen.settings["Kc_Kp"])) == world.holds("Kc_Kp")[0]
    assert any("Kc_Kp D" in line and "->" in line for line in said)
    apart = spread(live.repeats)
    assert (2, 0) == (apart.count, apart.refused)
    html = page(live.result, live.proof, apart)
    assert "<h2>Verification</h2>" in html
    assert "<h2>Repeats</h2>" in html
    restored = await session.gate.recover()
    assert ("Kc_Kp", "Ti_Ki") == restored.operands


def test_repeats_are_told_by_mean_deviation_and_their_middle():
    results = [
        tune(
            doublet(Model(Process.FOPDT, gain, 4.0, 20.0), noise=0.01, count=300),
            "DPIDE",
            NOW,
            kind=Process.FOPDT,
            rules=RULES[:1],
        )
        for gain in (1.6, 1.4, 1.5)
    ]
    assert 2 == middle(results)
    found = spread(results)
    gain = found.rows[0]
    assert ("gain", (("FOPDT", 3),)) == (gain.name, found.kinds)
    assert 1.5 == pytest.approx(gain.mean, rel=0.01)
    assert 0.1 == pytest.approx(gain.deviation, rel=0.05)
    # SIMC: Kc is inverse to K, so that gains of 1/1.4 and 1/1.6 are 0.0446·(τ/2θ') from the middle one.
    kc = next(row for row in found.rows if row.name == "SIMC PI Kc_Kp")
    assert 1.6 / 1.4 == pytest.approx(max(kc.values) / min(kc.values), rel=0.02)
    assert "3 experiments, 0 refused: FOPDT 3 times" in as_text(found)
    assert ("SIMC PI Kc_Kp" in as_text(found, ["SIMC PI"]), "SIMC PI Kc_Kp" in as_text(found)) == (True, False)
    assert [1.6, 1.4, 1.5] == pytest.approx(json.loads(json.dumps(as_json(found)))["rows"][0]["values"], rel=0.01)


def test_repeats_that_were_all_refused_have_no_rows():
    refused = tune(doublet(Model(Process.FOPDT, 1.5, 4.0, 20.0), noise=6.0), "DPIDE", NOW, rules=RULES[:1])
    found = spread([refused, refused])
    assert (2, (), 0) == (found.refused, found.rows, middle([refused, refused]))
    assert "no model" in as_text(found)


def csv(folder):
    record = doublet(Model(Process.FOPDT, 1.5, 4.0, 20.0), count=300)
    rows = zip(record.t_s, record.sv, record.pv, record.mv, strict=True)
    path = folder / "a.csv"
    path.write_text(
        "\n".join(["time,SV,PV,MV", *(",".join(f"{value:.6f}" for value in row) for row in rows)]), encoding="utf-8"
    )
    return str(path)


def test_the_command_shows_what_it_would_write_and_sends_nothing_unarmed(tmp_path):
    given = [text for name in ("CYCLE=200", "PID_DE=TRUE", "PID_DIR=TRUE") for text in ("--set", name)]
    done = CliRunner().invoke(
        app,
        ["tune", csv(tmp_path), *given, "--apply", "SIMC PI", "--onto", "demo", "--loop", "TIC-101", "--model", "FOPDT",
         "--output", "json"],
    )  # fmt: skip
    assert 0 == done.exit_code, done.exception
    facts = json.loads(done.stdout)
    assert facts["preview"][0].startswith("Kc_Kp D")
    assert None is facts["verification"]


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["--apply", "SIMC PI"], "need --apply RULE and --onto PROFILE"),
        (["--repeat", "2"], "only an experiment can be repeated"),
        (["--experiment", "step", "--onto", "demo"], "--experiment works on"),
        (["--rollback"], "needs --arm LOOP"),
    ],
)
def test_options_that_do_not_go_together_are_named(tmp_path, arguments, text):
    done = CliRunner().invoke(app, ["tune", csv(tmp_path), *arguments])
    assert isinstance(done.exception, ProfileError)
    assert text in str(done.exception)


def test_rollback_of_a_loop_that_nobody_wrote_says_so(tmp_path):
    done = CliRunner().invoke(app, ["tune", "demo", "--rollback", "--arm", "TIC-101", "--directory", str(tmp_path)])
    assert (0, "TIC-101: there is nothing to put back\n") == (done.exit_code, done.stdout)


async def test_a_refused_result_writes_no_gains(tmp_path):
    world, session, _ = bench(tmp_path)
    noisy = tune(doublet(Model(Process.FOPDT, 1.5, 4.0, 20.0), noise=6.0), "DPIDE", NOW, rules=RULES[:1])
    before = world.holds("Kc_Kp", "Ti_Ki")
    live = await session.excited(Wanted(Kind.STEP, 2.5, 5.0), lambda *given: noisy, 1, Gains("SIMC PI"))
    assert (None, before) == (live.proof, world.holds("Kc_Kp", "Ti_Ki"))


async def test_gains_that_the_profile_forbids_do_not_lose_what_the_experiment_found(tmp_path):
    world, session, _ = bench(tmp_path, LISTED | {"Kc_Kp": WriteLimit(0.1, 10.0, 0.5, 0.0)})
    live = await session.excited(Wanted(Kind.STEP, 2.5, 15.0), judged, 1, Gains("SIMC PI", 4.0, 25.0))
    assert "allowed is 0.5 at once" in live.error.message
    assert not live.result.is_refused
    assert [bits(REAL(1.0))] == world.holds("Kc_Kp")


async def test_a_second_experiment_waits_for_rest_and_gives_up_in_time(tmp_path):
    world, session, _ = bench(tmp_path)
    world.plc.write("L1", "SV", 95.0)
    world.clock.advance_ns(1_500_000_000)
    with pytest.raises(StateError, match="PV is not at rest"):
        await session.excited(Wanted(Kind.STEP, 2.5), judged)
