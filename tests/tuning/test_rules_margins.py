"""Rules and margins against the values that the papers give; predictions against what can be worked out by hand."""

from __future__ import annotations

import json
from math import inf, pi
from pathlib import Path

import numpy as np
import pytest

from ahgateway.tuning.canonical import Canonical, standard
from ahgateway.tuning.margins import margins
from ahgateway.tuning.models import Kind, Model
from ahgateway.tuning.predict import judge_load, judge_setpoint, simulate
from ahgateway.tuning.propose import GAIN_NAMES, LoopForm, proposals, recommended
from ahgateway.tuning.rules import RULES, apply, ultimate
from ahgateway.tuning.runner import delta

BY_NAME = {rule.name: rule for rule in RULES}
FAST_S = 1e-4
"""Sampling so fast that the loop is as good as the continuous one of the papers."""


def gains(name, model, ts_s=1e-9, dial=0.5):
    found = apply(BY_NAME[name], model, ts_s, dial)
    return found.kc, found.ti_s, found.td_s


@pytest.mark.parametrize(
    ("name", "kc", "ti", "td"),
    [
        # K 2, θ 1, τ 4: a = 0.5, r = 0.25.
        ("SIMC PI", 1.0, 4.0, 0.0),
        ("lambda PI", 4 / 26, 4.0, 0.0),
        ("AMIGO PI", 0.075 + (0.35 - 4 / 25) * 2.0, 0.35 + 13 * 16 / (16 + 48 + 7), 0.0),
        ("AMIGO PID", 1.0, (0.4 + 3.2) / 1.4, 2.0 / 4.3),
        ("CHR load PI", 1.2, 4.0, 0.0),
        ("CHR load PID", 1.9, 2.4, 0.42),
        ("CHR setpoint PI", 0.7, 4.8, 0.0),
        ("CHR setpoint PID", 1.2, 4.0, 0.5),
        ("Cohen-Coon PI", 2.0 * (0.9 + 1 / 48), 30.75 / 14, 0.0),
        ("Cohen-Coon PID", 2.0 * (4 / 3 + 1 / 16), 33.5 / 15, 4 / 11.5),
        ("Ziegler-Nichols PI", 1.8, 10 / 3, 0.0),
        ("Ziegler-Nichols PID", 2.4, 2.0, 0.5),
    ],
)
def test_formulas_worked_out_by_hand(name, kc, ti, td):
    assert (kc, ti, td) == pytest.approx(gains(name, Model(Kind.FOPDT, 2.0, 1.0, 4.0)), rel=1e-6)


def test_simc_pid_in_standard_form():
    """Lags 6 and 2, θ 1, K 1: series Kc 3, τI 6, τD 2; standard Kc 3·(1 + 2/6) = 4, Ti 8, Td 1.5."""
    model = Model(Kind.SOPDT, 1.0, 1.0, 12.0**0.5, 4.0 / 12.0**0.5)
    assert (4.0, 8.0, 1.5) == pytest.approx(gains("SIMC PID", model), rel=1e-6)


def test_ultimate_point_of_an_integrating_process():
    """K·e^(−θs)/s turns by −180° at ω = π/2θ, where its gain is 2Kθ/π."""
    ku, pu = ultimate(Model(Kind.IPDT, 0.5, 2.0), 2.0)
    assert (pi / 2, 8.0) == (pytest.approx(ku, rel=1e-4), pytest.approx(pu, rel=1e-4))
    assert ((pi / 2) / 3.2, 17.6) == pytest.approx(gains("Tyreus-Luyben PI", Model(Kind.IPDT, 0.5, 2.0))[:2], rel=1e-4)


def test_half_a_sample_counts_as_dead_time():
    assert gains("SIMC PI", Model(Kind.IPDT, 1.0, 1.0), 2.0) == pytest.approx((0.25, 16.0, 0.0))


def test_the_dial_scales_by_two_at_each_end():
    model = Model(Kind.FOPDT, 2.0, 1.0, 4.0)
    assert gains("CHR load PI", model, dial=1.0)[0] == pytest.approx(2.4)
    assert gains("SIMC PI", model, dial=0.0)[0] == pytest.approx(4.0 / (2.0 * 3.0))
    with pytest.raises(ValueError, match="dial"):
        apply(BY_NAME["SIMC PI"], model, 0.1, 1.5)


def test_a_loop_beyond_its_gain_margin_is_unstable_and_on_this_side_not():
    """P control of an integrator with θ = 1: ultimate gain π/2."""
    model = Model(Kind.IPDT, 1.0, 1.0)
    inside, outside = (margins(model, standard(k, ts_s=FAST_S)) for k in (1.56, 1.58))
    assert inside.is_stable
    assert inside.gain_margin == pytest.approx((pi / 2) / 1.56, rel=1e-3)
    assert not outside.is_stable
    assert inf == outside.ms


def test_an_integral_of_error_after_a_load_is_ti_over_kc():
    """IE = Ti/Kc for a unit load, and IAE is the same where PV does not swing; Kc 1, Ti 20, load 2: 40."""
    model = Model(Kind.FOPDT, 1.0, 1.0, 20.0)
    settings = {"CYCLE": 100, "PID_EQ": True, "Kc_Kp": 1.0, "Ti_Ki": 20.0, "Td_Kd": 0.0}
    response = simulate(delta("DPIDE", settings, 50.0, 50.0, 40.0), model, (50.0, 40.0), 50.0, 2.0, 300.0)
    assert 40.0 == pytest.approx(judge_load(response, (50.0, 40.0)).iae, rel=0.005)


def test_a_controller_at_rest_stays_there():
    settings = {"CYCLE": 100, "PID_EQ": True, "Kc_Kp": 1.0, "Ti_Ki": 20.0, "Td_Kd": 3.0, "BIAS": 5.0}
    model = Model(Kind.SOPDT, 1.0, 1.0, 5.0, 0.5)
    response = simulate(delta("DPIDE", settings, 50.0, 50.0, 40.0), model, (50.0, 40.0), 50.0, 0.0, 20.0)
    assert {50.0} == set(np.round(response.pv, 9))
    assert {40.0} == set(response.mv)


def test_overshoot_of_an_underdamped_loop():
    """P control with K·Kp/s around 1/(s + 1)… by hand: Ki alone, Ki 1, on 1/(s + 1): ζ = 0.5, overshoot 16.3 %."""
    settings = {"CYCLE": 10, "Kc_Kp": 0.0, "Ti_Ki": 1.0, "Td_Kd": 0.0}
    model = Model(Kind.FOPDT, 1.0, 0.0, 1.0)
    response = simulate(delta("DPIDE", settings, 50.0, 50.0, 50.0), model, (50.0, 50.0), 51.0, 0.0, 20.0)
    assert 16.3 == pytest.approx(judge_setpoint(response, (50.0, 50.0)).overshoot_percent, abs=0.5)


@pytest.mark.parametrize(
    ("block", "now"),
    [
        ("DPID", {"CYCLE": 5}),
        ("DPIDE", {"CYCLE": 50, "PID_EQ": True}),
        ("DPIDE", {"CYCLE": 50, "PID_EQ": False}),
    ],
)
def test_proposals_hold_what_registers_can_hold_and_the_right_direction(block, now):
    """CYCLE in units of 10 and of 1 ms; gains in REALs, in either form, are the rule's to 1 part in 5 million."""
    model = Model(Kind.FOPDT, -1.5, 4.0, 20.0)
    names = ("SIMC PI", "AMIGO PID", "Tyreus-Luyben PI")
    loop = LoopForm(block, now, (50.0, 40.0), 5.0, 5.0)
    found = proposals(model, loop, rules=tuple(BY_NAME[name] for name in names))
    for each in found:
        kc, ti, td = gains(each.name, model, 0.05)
        form = (kc, ti, td) if now.get("PID_EQ") else (kc, kc / ti, kc * td)
        held = tuple(each.settings[name] for name in GAIN_NAMES if name in each.settings)[:3]
        assert form == pytest.approx(held, rel=2e-7)
        assert all(value == float(np.float32(value)) for value in held)
        assert (0.05, -1, False) == (each.canonical.ts_s, each.canonical.sign, each.settings["PID_DIR"])
        assert each.margins.is_stable
    best = recommended(found)
    assert best.margins.ms <= 1.7
    assert best.load.iae == min(each.load.iae for each in found if each.margins.ms <= 1.7)


def some(model, cycle, *names):
    loop = LoopForm("DPIDE", {"CYCLE": cycle}, (50.0, 40.0), 1.0, 1.0)
    return proposals(model, loop, rules=tuple(BY_NAME[name] for name in names))


def test_a_short_cycle_is_predicted_to_the_end_of_what_the_loop_does():
    """5 ms beside a lag of 300 s: 4000 executions are 20 s, less than the dead time."""
    model, names = Model(Kind.FOPDT, 1.0, 30.0, 300.0), ("SIMC PI", "AMIGO PID")
    quick, slow = some(model, 5, *names), some(model, 1000, *names)
    for one, other in zip(quick, slow, strict=True):
        assert (one.setpoint.iae, one.load.iae) == pytest.approx((other.setpoint.iae, other.load.iae), rel=0.04)
        assert one.load.settling_s == pytest.approx(other.load.settling_s, rel=0.04)
        assert 0.005 == pytest.approx(one.canonical.ts_s)
        assert one.pace_s <= 0.05 * 30.0
    assert "AMIGO PID" == recommended(quick).name


def test_an_iae_that_was_cut_off_counts_the_rest_of_the_integral():
    """Ti 100 s, Kc 1/9, K 1: a load of 1 has ∫(SV − PV) = −900 PV·s, of SV 900; 4000 executions see a part of it."""
    (found,) = some(Model(Kind.FOPDT, 1.0, 0.1, 300.0), 5, "lambda PI")
    whole = (300.0 * 3.0 + 0.1025) / 1.0
    assert not np.isfinite(found.load.settling_s)
    assert (whole, whole) == pytest.approx((found.load.iae, found.setpoint.iae), rel=1e-3)


def test_margins_are_those_that_another_program_finds():
    """python-control 0.10.2: zero-order hold, whole dead time, the law in z, 200 000 frequencies up to π/Ts."""
    cases = json.loads((Path(__file__).parent.parent / "golden" / "margins.json").read_text(encoding="utf-8"))
    for each in cases:
        model = Model(Kind(each["kind"]), each["K"], each["theta"], each["tau"], each["zeta"])
        law = Canonical(each["kp"], each["ki"], each["kd"], each["tf"], ts_s=each["ts"])
        found = margins(model, law)
        assert (each["ms"], each["gm"], each["pm"]) == pytest.approx(
            (found.ms, found.gain_margin, found.phase_margin_deg), rel=1e-3
        ), each["name"]
        assert found.is_stable
