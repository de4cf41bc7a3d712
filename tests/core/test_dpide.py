"""DPIDE sentence by sentence (spec controllers B.1–B.5); every number worked out by hand, Ts = 1 s unless said."""

from __future__ import annotations

import math

import pytest
from sequences import operands, play

from ahgateway.core.controllers import DPIDE, dpide
from ahgateway.core.dialect import DEFAULT, Dialect, Freeze, RunOff
from ahgateway.core.real import REAL, bits, from_bits

WIDE = {"mv_max": 100.0, "mv_min": -100.0}
PI = WIDE | {"sv": 10.0, "pv": 6.0, "kc_kp": 2.0, "ti_ki": 0.5, "td_kd": 0.0}
"""Independent: E = 4, so P = 8 and the integral grows by 2 a second."""
D_ONLY = WIDE | {"kc_kp": 0.0, "ti_ki": 0.0, "td_kd": 1.0}
BAND = WIDE | {"sv": 0.0, "kc_kp": 1.0, "ti_ki": 0.0, "td_kd": 0.0, "err_dbw": 2.0}


@pytest.mark.parametrize(
    ("pid_de", "pid_dir", "by_pv", "by_sv"),
    [(False, True, -2, 3), (False, False, 2, -3), (True, True, -2, 0), (True, False, 2, 0)],
    ids=["E reverse", "E forward", "PV reverse", "PV forward"],
)
def test_d_of_e_or_of_pv_in_both_directions(pid_de: bool, pid_dir: bool, by_pv: int, by_sv: int) -> None:
    play(
        DPIDE,
        D_ONLY | {"pid_de": pid_de, "pid_dir": pid_dir},
        [({}, {"d": 0}), ({"pv": 2.0}, {"d": by_pv, "mv": by_pv}), ({"sv": 3.0}, {"d": by_sv, "mv": by_sv})],
    )


def test_dependent_form_scales_i_and_d_by_kc() -> None:
    play(
        DPIDE,
        WIDE | {"sv": 4.0, "cycle": 500, "kc_kp": 2.0, "ti_ki": 4.0, "td_kd": 0.5, "pid_eq": True},
        [
            ({}, {"p": 8, "i": 1, "d": 0, "mv": 9}),  # increment 8 · 0.5 / 4
            ({"pv": 1.0}, {"p": 6, "i": 1.75, "d": -2, "mv": 5.75}),  # D = 2 · 0.5 · (3 - 4) / 0.5
            ({"pid_de": True, "pv": 2.0}, {"p": 4, "i": 2.25, "d": -2, "mv": 4.25}),
        ],
    )


def test_independent_form_does_not_scale_i_and_d_by_kp() -> None:
    play(
        DPIDE,
        WIDE | {"sv": 4.0, "cycle": 500, "kc_kp": 2.0, "ti_ki": 0.25, "td_kd": 0.5},
        [({}, {"p": 8, "i": 0.5, "mv": 8.5}), ({"pv": 1.0}, {"p": 6, "i": 0.875, "d": -1, "mv": 5.875})],
    )


def test_tf_smooths_d_by_backward_euler() -> None:
    play(
        DPIDE,
        D_ONLY | {"tf": 1.0},
        [
            ({}, {"d": 0}),
            ({"sv": 4.0}, {"d": 2, "mv": 2}),  # (1 · 0 + 1 · 4) / (1 + 1)
            ({}, {"d": 1, "mv": 1}),
            ({}, {"d": 0.5}),
            ({"tf": 3.0, "sv": 8.0}, {"d": 1.375}),  # (3 · 0.5 + 4) / 4
            ({"tf": -1.0}, {"d": 0}),  # negative counts as 0: no smoothing
        ],
    )


def test_td_switched_off_empties_the_filter() -> None:
    play(
        DPIDE,
        D_ONLY | {"tf": 1.0},
        [({}, {}), ({"sv": 4.0}, {"d": 2}), ({"td_kd": 0.0}, {"d": 0, "mv": 0}), ({"td_kd": 1.0}, {"d": 0})],
    )


def test_the_filter_runs_on_in_manual() -> None:
    play(
        DPIDE,
        D_ONLY | {"tf": 1.0, "ti_ki": 1.0, "mout": 40.0},
        [
            ({}, {}),
            ({"pid_man": True, "sv": 4.0}, {"mv": 40, "d": 2}),
            ({}, {"mv": 40, "d": 1}),
            ({"pid_man": False}, {"mv": 40, "d": 0.5, "i": 39.5, "flags": ("BUMPLESS",)}),
        ],
    )


def test_pid_run_off_clears_filter_and_cross_and_keeps_i() -> None:
    play(
        DPIDE,
        BAND | {"td_kd": 1.0, "tf": 1.0, "ti_ki": 1.0, "mv_min": 10.0},
        [
            ({"pv": -3.0}, {"mv": 10, "i": 0, "cross": False}),
            ({"pv": 1.0}, {"cross": True, "d": -1.5}),  # E falls from 3 to 0
            ({"pid_run": False}, {"mv": 0, "d": 0, "cross": False, "flags": ("STOPPED",)}),
            ({"pid_run": True}, {"e": -1, "d": 0, "cross": False}),
        ],
    )
    play(
        DPIDE,
        PI,
        [({}, {"i": 2}), ({"pid_run": False}, {"mv": 0, "i": 2}), ({"pid_run": True}, {"i": 4, "mv": 12})],
    )
    play(DPIDE, PI, [({}, {"i": 2}), ({"pid_run": False}, {"mv": 0, "i": 0})], dialect=Dialect(run_off=RunOff.CLEAR))


def test_bias_joins_before_the_limits_and_not_in_manual() -> None:
    play(
        DPIDE,
        PI | {"bias": 50.0, "mv_max": 61.0, "mout": 7.0},
        [
            ({}, {"raw": 60, "mv": 60, "i": 2, "bias": 50}),
            ({}, {"raw": 62, "mv": 61, "i": 2, "flags": ("FREEZE_HI",)}),
            ({"pid_man": True}, {"mv": 7, "i": 2}),
            ({"pid_man": False}, {"mv": 7, "i": -51, "flags": ("BUMPLESS",)}),  # 7 - 8 - 0 - 50
            ({"bias": 60.0}, {"mv": 19, "i": -49}),
        ],
    )


def test_the_sum_is_p_plus_i_plus_d_plus_bias_from_the_left() -> None:
    # (16777216 + 1) rounds back to 16777216; every other grouping gives 16777218.
    play(
        DPIDE,
        {"kc_kp": 16777216.0, "ti_ki": 1.0, "td_kd": 0.0, "sv": 1.0, "bias": 1.0, "mv_max": 3e7},
        [({}, {"p": 16777216, "i": 1, "mv": 16777216})],
    )


def test_transfer_takes_p_then_d_then_bias_from_mv() -> None:
    # 1 - 16777216 is exact, + 16777216 gives 1; with BIAS taken first the 1 is lost.
    play(
        DPIDE,
        WIDE | {"kc_kp": 4194304.0, "ti_ki": 1.0, "td_kd": 0.0, "sv": 4.0, "mout": 1.0, "bias": -16777216.0},
        [({"pid_man": True}, {"mv": 1}), ({"pid_man": False}, {"mv": 1, "i": 1, "flags": ("BUMPLESS",)})],
    )


@pytest.mark.parametrize("kc", [0.0, -2.0])
def test_dependent_form_without_kc_leaves_bias_alone(kc: float) -> None:
    play(
        DPIDE,
        PI | {"ti_ki": 4.0, "td_kd": 1.0, "pid_eq": True, "bias": 5.0, "mout": 30.0},
        [
            ({}, {"i": 2, "mv": 15}),
            ({"kc_kp": kc, "pv": 5.0}, {"p": 0, "i": 0, "d": 0, "mv": 5, "flags": ()}),
            ({"pid_man": True}, {"mv": 30}),
            ({"pid_man": False}, {"mv": 5, "i": 0, "flags": ()}),  # no integral, no bumpless transfer
            ({"bias": 200.0}, {"mv": 100, "flags": ("FREEZE_HI",)}),
        ],
    )


def test_independent_form_without_kp_keeps_i_and_d() -> None:
    play(
        DPIDE,
        PI | {"kc_kp": 0.0, "td_kd": 1.0},
        [({}, {"mv": 2, "i": 2}), ({"pv": 7.0}, {"p": 0, "i": 3.5, "d": -1, "mv": 2.5})],
    )


@pytest.mark.parametrize("pid_eq", [False, True])
def test_ti_ki_of_0_switches_the_integral_off_in_both_forms(pid_eq: bool) -> None:
    start = PI | {"pid_eq": pid_eq, "ti_ki": 4.0 if pid_eq else 0.5}
    play(DPIDE, start, [({}, {"i": 2}), ({"ti_ki": 0.0}, {"i": 0, "mv": 8}), ({"ti_ki": -1.0}, {"i": 0, "mv": 8})])


@pytest.mark.parametrize("width", [2.0, -2.0])
def test_dead_band_excludes_its_edges(width: float) -> None:
    below = float(from_bits(0x3FFFFFFF))  # the REAL below 2
    play(
        DPIDE,
        BAND | {"err_dbw": width},
        [
            ({"pv": -3.0}, {"e": 3, "cross": False}),
            ({"pv": 2.0}, {"e": -2, "cross": False}),  # on the edge is outside, though the sign has changed
            ({"pv": -below}, {"e": 0, "cross": True}),  # from outside on one side to inside on the other
            ({"pv": below}, {"e": 0, "cross": True}),
            ({"pv": 2.0}, {"e": -2, "cross": False}),
        ],
    )


def test_the_true_error_counts_until_pv_has_passed_sv() -> None:
    play(
        DPIDE,
        BAND,
        [
            ({"pv": -3.0}, {"e": 3, "cross": False}),
            ({"pv": -1.0}, {"e": 1, "mv": 1, "cross": False}),
            ({"pv": 0.5}, {"e": 0, "mv": 0, "cross": True}),
            ({"pv": -1.5}, {"e": 0, "cross": True}),
            ({"pv": -2.5}, {"e": 2.5, "cross": False}),
            ({"pv": -1.5}, {"e": 1.5, "cross": False}),
        ],
    )


def test_touching_sv_counts_as_crossing() -> None:
    play(
        DPIDE,
        BAND,
        [
            ({"pv": -1.0}, {"e": 1, "cross": False}),
            ({"pv": 0.0}, {"e": 0, "cross": True}),
            ({"pv": -1.0}, {"e": 0, "cross": True}),
        ],
    )
    play(DPIDE, BAND, [({"pv": 0.0}, {"cross": True})])


def test_zero_is_a_sign_of_its_own_as_the_last_error_too() -> None:
    play(
        DPIDE,
        BAND | {"err_dbw": 0.0},
        [({"pv": 0.0}, {"cross": False}), ({"pv": -1.0, "err_dbw": 2.0}, {"e": 0, "cross": True})],
    )


def test_a_setpoint_step_that_flips_the_sign_inside_the_band_counts_as_crossing() -> None:
    play(DPIDE, BAND, [({"pv": -1.0}, {"e": 1}), ({"sv": -1.5}, {"e": 0, "cross": True})])


def test_the_first_execution_inside_the_band_has_crossed_nothing() -> None:
    play(DPIDE, BAND, [({"pv": 1.0}, {"e": -1, "cross": False}), ({"pv": 0.5}, {"e": -0.5, "cross": False})])


def test_crossed_pv_stands_still_for_d_and_is_tracked_all_the_same() -> None:
    play(
        DPIDE,
        BAND | {"kc_kp": 0.0, "td_kd": 1.0, "pid_de": True},
        [
            ({"pv": -3.0}, {"d": 0}),
            ({"pv": -1.0}, {"d": -2, "cross": False}),
            ({"pv": 1.0}, {"d": 0, "cross": True, "pv1": 1}),
            ({"pv": 1.5}, {"d": 0, "cross": True, "pv1": 1.5}),
            ({"pv": 2.5}, {"d": -1, "cross": False, "pv1": 2.5}),
        ],
    )


def test_d_of_e_sees_the_substituted_error() -> None:
    play(
        DPIDE,
        BAND | {"kc_kp": 0.0, "td_kd": 1.0},
        [
            ({"pv": -3.0}, {"d": 0}),
            ({"pv": 1.0}, {"d": -3, "cross": True}),
            ({"pv": 1.5}, {"d": 0}),
            ({"pv": 2.5}, {"d": -2.5, "cross": False}),
        ],
    )


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("name", ["sv", "pv", "bias", "mout"])
def test_bad_input_changes_nothing(name: str, bad: float) -> None:
    start = PI | {"td_kd": 1.0, "tf": 1.0, "mout": 10.0}
    before = play(DPIDE, start, [({}, {"mv": 10}), ({"pv": 7.0}, {"mv": 9})])
    start = start | {"pv": 7.0, "pid_man": name == "mout"}
    after = play(DPIDE, start, [({name: bad}, {"mv": 9, "flags": ("BAD_INPUT",)})], state=before)
    assert after == before


@pytest.mark.parametrize("name", ["kc_kp", "ti_ki", "td_kd", "tf"])
def test_a_gain_that_is_no_number_counts_as_0(name: str) -> None:
    start = PI | {"td_kd": 1.0, "tf": 1.0}
    rows = {
        "kc_kp": {"p": 0, "i": 3.5, "d": -0.5, "mv": 3},
        "ti_ki": {"p": 6, "i": 0, "d": -0.5, "mv": 5.5},
        "td_kd": {"p": 6, "i": 3.5, "d": 0, "mv": 9.5},
        "tf": {"p": 6, "i": 3.5, "d": -1, "mv": 8.5},
    }
    play(DPIDE, start, [({}, {"mv": 10}), ({name: math.nan, "pv": 7.0}, rows[name] | {"flags": ("BAD_PARAM",)})])


def test_auto_tuning_changes_nothing_and_other_modes_count_as_0() -> None:
    before = play(DPIDE, PI, [({}, {"mv": 10, "i": 2})])
    start = PI | {"pid_mode": 1, "pid_man": True, "pv": 0.0}
    after = play(DPIDE, start, [({}, {"mv": 10, "i": 2, "flags": ("AUTOTUNE",)})], state=before)
    assert after == before
    play(
        DPIDE,
        PI | {"pid_mode": 2, "mout": 40.0},
        [({"pid_man": True}, {"mv": 40}), ({"pid_man": False}, {"mv": 40, "i": 32, "flags": ("BUMPLESS",)})],
    )


@pytest.mark.parametrize(
    ("dialect", "integral", "flags"),
    [(DEFAULT, 0.0, ("LOCKUP",)), (Dialect(freeze=Freeze.OUTWARD), 2.0, ())],
    ids=["always", "outward"],
)
def test_integral_beyond_a_limit_by_dialect(dialect: Dialect, integral: float, flags: tuple[str, ...]) -> None:
    high, low = dpide.State(i=REAL(200), valid=True), dpide.State(i=REAL(-200), valid=True)
    inward = [({}, {"mv": 100, "raw": 190, "i": 200 - integral, "flags": ("FREEZE_HI", *flags)})]
    play(DPIDE, PI | {"pv": 14.0}, inward, dialect=dialect, state=high)
    play(DPIDE, PI, [({}, {"mv": 100, "i": 200, "flags": ("FREEZE_HI",)})], dialect=dialect, state=high)
    inward = [({}, {"mv": -100, "raw": -190, "i": -200 + integral, "flags": ("FREEZE_LO", *flags)})]
    play(DPIDE, PI, inward, dialect=dialect, state=low)
    outward = [({}, {"mv": -100, "i": -200, "flags": ("FREEZE_LO",)})]
    play(DPIDE, PI | {"pv": 14.0}, outward, dialect=dialect, state=low)


@pytest.mark.usefixtures("overflow_is_legal")
def test_an_overflow_does_not_stay_in_the_filter() -> None:
    huge = 2.0**127
    play(
        DPIDE,
        D_ONLY | {"td_kd": huge},
        [
            ({}, {"d": 0}),
            ({"sv": 4.0}, {"d": math.inf, "mv": 100, "flags": ("FREEZE_HI",)}),
            ({"td_kd": 1.0, "sv": 6.0}, {"d": 2, "mv": 2, "flags": ()}),
        ],
    )


@pytest.mark.parametrize(
    ("cycle", "pattern"),
    [
        (-1, 0x3A83126F),  # 0.001
        (0, 0x3A83126F),
        (1, 0x3A83126F),
        (70, 0x3D8F5C29),  # 0.07
        (1000, 0x3F800000),
        (40000, 0x42200000),  # 40
        (40001, 0x42200000),
    ],
)
def test_cycle_is_held_within_1_to_40000_and_divided_by_1000(cycle: int, pattern: int) -> None:
    assert pattern == bits(dpide.nominal_ts(operands(DPIDE, cycle=cycle)))


def test_mout_follows_mv_and_limits_are_exchanged_as_in_dpid() -> None:
    play(
        DPIDE,
        PI | {"mout_auto": True, "mv_max": 0.0, "mv_min": 9.0},
        [
            ({}, {"mv": 9, "mout": 9, "i": 0, "flags": ("FREEZE_HI", "LIMITS_SWAPPED")}),
            ({"pid_man": True, "mout": -4.0}, {"mv": 0, "mout": -4}),
        ],
    )
