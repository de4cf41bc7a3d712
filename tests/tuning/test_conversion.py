"""Conversion: golden pairs, round trips, every warning with its size (spec 7)."""

from __future__ import annotations

import json
from itertools import permutations
from math import inf
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ahgateway.core.controllers import dpide
from ahgateway.core.dialect import DEFAULT
from ahgateway.core.real import REAL
from ahgateway.errors import ProfileError
from ahgateway.tuning.blocks import BLOCKS, Family, Use
from ahgateway.tuning.canonical import Band, Scaling
from ahgateway.tuning.conversion import convert
from ahgateway.tuning.runner import siemens

GOLDEN = {
    each["id"]: each
    for each in json.loads((Path(__file__).parent.parent / "golden" / "conversions.json").read_text(encoding="utf-8"))
}
DEPENDENT = {"PID_EQ": True, "PID_DE": True}


def codes(found):
    return [loss.code for loss in found.losses]


def loss(found, code):
    return next(each for each in found.losses if each.code == code)


def mv_of(settings, sv, pvs, bias=0.0, **more):
    """A DPIDE that runs from a cold start."""
    typed = {key.lower(): REAL(value) if isinstance(value, float) else value for key, value in settings.items()}
    operands = dpide.Operands(**typed | {"mv_min": REAL(-100)})
    state, out = dpide.State(), []
    for pv in pvs:
        now = operands._replace(sv=REAL(sv), pv=REAL(pv), bias=REAL(bias), **more)
        state, terms = dpide.step(now, state, DEFAULT, dpide.nominal_ts(operands))
        out.append(float(terms.mv))
    return out


# F1 and F3 leave open what their numbers give away: 14.25 = 2·5 + 0.5·5·Ts + BIAS with Ts = 0.5 s (F3: 11.25 without
# BIAS) is BIAS 3; −1 = 1·(−1)/(Tf + Ts) is Tf 0.5 s in F1, and TdFiltRatio 0.5 · Td 0.5 s = 0.25 s in F3.
INDEPENDENT = {
    "Kc_Kp": 2.0, "Ti_Ki": 0.5, "Td_Kd": 1.0, "Tf": 0.5, "PID_DE": True, "CYCLE": 500, "BIAS": 3.0,
}  # fmt: skip


def test_golden_independent_is_dependent():
    case = GOLDEN["F1"]
    assert case["MV"] == mv_of(INDEPENDENT, case["SV"], case["PV"], 3.0)
    # Kc 2, Ti 2/0.5, Td 1/2.
    rebuilt = convert("DPIDE", INDEPENDENT, "DPIDE", use_to=Use(dependent=True))
    assert (2.0, 4.0, 0.5, 0.5, True) == tuple(
        rebuilt.settings[name] for name in ("Kc_Kp", "Ti_Ki", "Td_Kd", "Tf", "PID_EQ")
    )
    assert rebuilt.is_exact
    assert case["MV"] == mv_of(rebuilt.settings, case["SV"], case["PV"], 3.0)


def test_golden_pid_temp_is_the_same_loop():
    case = GOLDEN["F3"]
    found = convert("DPIDE", INDEPENDENT | {"BIAS": 0.0, "Tf": 0.25, "MV_MIN": -100.0}, "PID_Temp")
    assert (2.0, 4.0, 0.5, 0.5, 1.0, 0.0) == tuple(
        found.settings[f"Heat_{name}"] for name in ("Gain", "Ti", "Td", "TdFiltRatio", "PWeighting", "DWeighting")
    )
    # Rest is at SV = PV, so the first execution sees PV fall from 10 to 5; its history is set to begin at 5.
    block = siemens(found.settings, 5.0, 5.0, 0.0)
    assert case["PidOutputSum"] == pytest.approx([block.execute(10.0, pv) for pv in case["PV"]], rel=1e-6)


def test_golden_melsec_and_back():
    case = GOLDEN["F5"]
    source = {"Kc_Kp": 1.2345, "Ti_Ki": 12.34, "Td_Kd": 1.234, "Tf": 0.3, "CYCLE": 250, **DEPENDENT}
    found = convert("DPIDE", source, "MELSEC_PID")
    assert [case[name] for name in ("KP", "TI", "TD", "KD", "TS")] == [
        found.settings[name] for name in ("KP", "TI", "TD", "KD", "TS")
    ]
    back = convert("MELSEC_PID", found.settings, "DPIDE").settings
    want = case["back"]
    assert [want["Kc"], want["Ti"], want["Td"], want["Tf"]] == pytest.approx(
        [back[name] for name in ("Kc_Kp", "Ti_Ki", "Td_Kd", "Tf")], rel=1e-6
    )
    assert 1.6 == pytest.approx(next(each.size for each in found.losses if each.text.startswith("Tf was")))


def test_a_setpoint_weight_is_a_bias_at_every_scan():
    """Golden F7's law by hand: Gain 2, b 0.25, Ti 4 s, Ts 1 s, SV 10, PV 4: 2·(6 − 7.5) + 0.5·6 = 0."""
    found = convert("PID_Temp", {"Heat_Gain": 2.0, "Heat_Ti": 4.0, "Heat_PWeighting": 0.25}, "DPIDE")
    assert 0.75 == loss(found, "W-WEIGHT").size
    assert [0.0] == mv_of(found.settings | {"MV_MAX": 100.0}, 10.0, [4.0], bias=-2.0 * 0.75 * 10.0)


def test_dpid_becomes_dpide_with_ten_times_the_cycle():
    found = convert("DPID", {"Kp": 2.0, "Ki": 0.05, "Kd": 1.0, "CYCLE": 20}, "DPIDE")
    assert found.is_exact
    assert [] == codes(found)
    settings = found.settings
    assert (2.0, float(REAL(0.05)), 1.0, False, False, 200) == tuple(
        settings[name] for name in ("Kc_Kp", "Ti_Ki", "Td_Kd", "PID_EQ", "PID_DE", "CYCLE")
    )


@pytest.mark.parametrize(
    ("source", "given", "target", "code", "size"),
    [
        ("DPIDE", {"Tf": 0.5, "CYCLE": 200}, "DPID", "W-DFILT", 0.5),
        ("DPIDE", {"CYCLE": 205}, "DPID", "W-TS", 5.0),
        ("DPIDE", {"PID_DE": True}, "DPID", "W-DSRC", 1.0),
        ("DPIDE", {"BIAS": 7.0}, "DPID", "W-BIAS", 7.0),
        ("DPIDE", {"ERR_DBW": 2.0}, "DPID", "W-DBAND", 2.0),
        ("DPID", {"ERR_DBW": 2.0}, "DPIDE", "W-DBAND", 2.0),
        ("DPID", {"PID_MODE": 2}, "DPIDE", "W-MODE", 0.0),
        ("DPID", {"PID_MODE": 1}, "DPIDE", "W-AUTOTUNE", 0.0),
        ("DPIDE", {"PID_DIR": False}, "PID_Temp", "W-SIGN", 1.0),
        ("MELSEC_PID", {"ALPHA": 50, "ACT": 1, "TS": 1000}, "DPIDE", "W-PVFILT", 1.0),
        ("PID_Temp", {"Heat_DWeighting": 0.25, "Heat_Td": 2.0}, "DPIDE", "W-WEIGHT", 0.25),
        ("PID_Temp", {"ActivateCooling": True, "AdvancedCooling": False, "CoolFactor": 3.0}, "DPIDE", "W-SPLIT", 3.0),
        ("DPIDE", {"Kc_Kp": 0.0, "Ti_Ki": 0.5, "Td_Kd": 0.0}, "PID_Temp", "W-RANGE", 0.5),
        ("DPIDE", {"MV_MAX": 50000.0, "Td_Kd": 0.0}, "MELSEC_PID", "W-RANGE", 17233.0),
    ],
)
def test_every_loss_has_its_code_and_size(source, given, target, code, size):
    assert size == pytest.approx(loss(convert(source, given, target), code).size)


def test_an_integral_without_p_keeps_its_independent_form_and_is_no_loss():
    """Kp 0, Ki 0.05 in a DPID is Ti_Ki 0.05 with PID_EQ off; binary32 of 0.05 is no loss."""
    found = convert("DPID", {"Kp": 0.0, "Ki": 0.05, "Kd": 0.25, "CYCLE": 10}, "DPIDE")
    assert (0.0, float(REAL(0.05)), 0.25, False) == tuple(
        found.settings[name] for name in ("Kc_Kp", "Ti_Ki", "Td_Kd", "PID_EQ")
    )
    assert ([], True) == (codes(found), found.is_exact)


def test_a_gain_that_rounds_to_nothing_is_said_to_switch_the_controller_off():
    """100 · 0.004 = 0.4 rounds to KP 0."""
    found = convert("DPIDE", {"Kc_Kp": 0.004, "Ti_Ki": 10.0, "Td_Kd": 0.0, **DEPENDENT}, "MELSEC_PID")
    assert 0 == found.settings["KP"]
    assert "Kc was 0.004, in MELSEC_PID it is 0: the controller is off" in [each.text for each in found.losses]


def test_a_mode_that_the_target_lacks_is_not_exact():
    """Spec 7.3: DPID to DPIDE is exact only when PID_MODE is not 2."""
    assert not convert("DPID", {"PID_MODE": 2}, "DPIDE").is_exact
    assert not convert("DPID", {"PID_MODE": 1}, "DPIDE").is_exact


def test_what_no_real_register_holds_becomes_the_largest():
    found = convert("DPID", {"Kp": 3e38}, "DPIDE", scaling=Scaling(pv_from=(0.0, 100.0)))
    assert 3.4028234663852886e38 == found.settings["Kc_Kp"]
    assert "W-RANGE" in codes(found)


@pytest.mark.parametrize(
    ("source", "given", "text"),
    [
        ("MELSEC_PID", {"TS": 0}, "TS: 0 stops the instruction with error 11A0H"),
        ("MELSEC_PID", {"KD": 201}, "KD: 201 stops the instruction with error 11A4H"),
        ("MELSEC_PID", {"KP": 250.5}, "KP: 250.5 does not fit its register, a whole number of -32768…32767"),
        ("MELSEC_PID", {"TS": 40000}, "TS: 40000 does not fit its register"),
        ("PID_Temp", {"Heat_Cycle": 0.0}, "Heat_Cycle: 0 is no time above 0"),
        ("PID_REG_CE", {"DT": 0.0}, "DT: 0 is no time above 0"),
    ],
)
def test_a_source_that_does_not_run_is_refused(source, given, text):
    with pytest.raises(ProfileError, match=text):
        convert(source, given, "DPIDE")


def test_a_derivative_before_pulses_is_said_to_act_in_one_call():
    """Kc 2, Ti 20 s, stroke 60 s: KP 2 · 60/20 = 6; TV 3 s; DT the shorter of 1 s and 0.6 s / 5: 6 · 3 / 0.12."""
    given_ones = {"Kc_Kp": 2.0, "Ti_Ki": 20.0, "Td_Kd": 3.0, "PID_EQ": True}
    found = convert("DPIDE", given_ones, "PID_REG_CE", use_to=Use(stroke_s=60.0))
    assert "SV that steps by 1 makes Y jump by 150 % in one call" in loss(found, "W-PULSE").text


def test_pulses_are_never_exact_and_say_so():
    found = convert("DPIDE", {"Kc_Kp": 2.0, "Ti_Ki": 20.0, "PID_EQ": True}, "PID_REG_CE", use_to=Use(stroke_s=60.0))
    # T_PERIOD = Ti, KP = Kc·Tm/T_PERIOD = 2·60/20, one hundredth of the stroke as the shortest pulse.
    assert (20.0, 6.0, pytest.approx(0.6)) == tuple(found.settings[name] for name in ("T_PERIOD", "KP", "PT_MIN_IMP"))
    assert "W-PULSE" in codes(found)
    assert not found.is_exact


def test_windup_is_reported_for_every_pair_of_other_laws():
    for source, target in permutations(BLOCKS, 2):
        same = BLOCKS[source].windup == BLOCKS[target].windup
        assert same != ("W-WINDUP" in codes(convert(source, {}, target)))


def test_physical_scaling_moves_gains_limits_and_bands():
    """PV 0…4000 counts to 0…200 °C, MV 0…4000 to 4…20 mA: Kc · (16/4000)/(200/4000) = Kc · 0.08."""
    scaling = Scaling((0.0, 4000.0), (0.0, 4000.0), (0.0, 200.0), (4.0, 20.0))
    given = {"KP": 250, "TI": 300, "ACT": 33, "S22": 4000, "S23": 1000}
    found = convert("MELSEC_PID", given, "DPIDE", scaling=scaling)
    assert float(REAL(0.2)) == found.settings["Kc_Kp"]
    assert (30.0, 20.0, 8.0) == tuple(found.settings[name] for name in ("Ti_Ki", "MV_MAX", "MV_MIN"))


def test_the_as_family_means_the_opposite_by_true():
    assert convert("DPIDE", {"PID_DIR": True}, "DPIDE", use_from=Use(Family.AS)).settings["PID_DIR"] is False
    assert convert("DPIDE", {"PID_DIR": True}, "DPIDE", use_to=Use(Family.AS)).settings["PID_DIR"] is False


def test_pidinit_filters_with_the_inverse_of_kd():
    """KD 8.00 in PIDINIT is KD 12.5 % in the PID instruction; 13 with whole numbers."""
    found = convert("PIDINIT", {"KP": 250, "TI": 300, "TD": 400, "KD": 800, "TS": 50}, "MELSEC_PID")
    assert (250, 300, 400, 13, 500) == tuple(found.settings[name] for name in ("KP", "TI", "TD", "KD", "TS"))
    assert inf == BLOCKS["PIDINIT"].read(BLOCKS["PIDINIT"].settings({"TI": 30001}), Use()).ti_s


def test_a_dead_band_keeps_its_kind():
    read = BLOCKS["DPIDE"].read(BLOCKS["DPIDE"].settings({"ERR_DBW": -3.0}), Use())
    assert (3.0, Band.ZERO_CROSS) == (read.band, read.band_kind)


@given(
    kc=st.integers(1, 32767), ti=st.integers(0, 32767), td=st.integers(0, 3000), kd=st.integers(0, 100),
    ts=st.integers(1, 32767),
)  # fmt: skip
def test_melsec_through_dpide_and_back_is_the_same_block(kc, ti, td, kd, ts):
    given_ones = {"KP": kc, "TI": ti, "TD": td, "KD": kd if td else 0, "TS": ts, "ACT": 33, "S22": 4000, "S23": 0}
    there = convert("MELSEC_PID", given_ones, "DPIDE")
    back = convert("DPIDE", there.settings, "MELSEC_PID")
    assert given_ones == {name: back.settings[name] for name in given_ones}


def test_an_unknown_setting_and_an_unknown_block_are_named():
    with pytest.raises(ProfileError, match=r"Gain: MELSEC_PID has no setting of that name"):
        convert("MELSEC_PID", {"Gain": 1}, "DPIDE")
    with pytest.raises(ProfileError, match="`DPIDX` is no controller we know"):
        convert("DPIDX", {}, "DPIDE")
