"""DPID sentence by sentence (spec controllers A.1–A.8); every number worked out by hand, Ts = 1 s unless said."""

from __future__ import annotations

import math

import pytest
from sequences import operands, play

from ahgateway.core import flags as flag
from ahgateway.core.controllers import DPID, dpid
from ahgateway.core.dialect import DEFAULT, Dialect, Freeze, RunOff
from ahgateway.core.real import REAL, bits, from_bits

PI = {"sv": 10.0, "pv": 6.0, "kp": 2.0, "ki": 0.5, "mv_max": 100.0, "mv_min": -100.0}
"""E = 4, so P = 8 and the integral grows by 2 a second."""


def test_pid_run_off_sets_mv_to_0_outside_the_limits_and_keeps_i_and_mout() -> None:
    play(
        DPID,
        PI | {"kd": 4.0, "mv_min": 10.0, "mout_auto": True},
        [
            ({}, {"mv": 10, "i": 2, "mout": 10, "flags": ()}),  # on the limit is not beyond it
            ({"pv": 7.0}, {"mv": 10, "i": 2, "d": -4, "raw": 5.5, "flags": ("FREEZE_LO", "LOCKUP")}),
            ({"pid_run": False, "pv": 0.0}, {"mv": 0, "i": 2, "mout": 10, "flags": ("STOPPED",)}),
            ({"pid_run": True}, {"mv": 27, "i": 7, "d": 0, "mout": 27, "flags": ()}),  # no history, no D
        ],
    )


def test_pid_run_off_clears_i_in_the_dialect_that_says_so() -> None:
    play(
        DPID,
        PI,
        [({}, {"mv": 10, "i": 2}), ({"pid_run": False}, {"mv": 0, "i": 0}), ({"pid_run": True}, {"mv": 10, "i": 2})],
        dialect=Dialect(run_off=RunOff.CLEAR),
    )


def test_transfer_after_pid_run_off_starts_from_the_mv_register() -> None:
    play(
        DPID,
        PI | {"pid_man": True, "mout": 40.0},
        [
            ({}, {"mv": 40, "i": 0, "flags": ("MANUAL",)}),
            ({"pid_run": False}, {"mv": 0}),
            ({"pid_run": True, "pid_man": False}, {"mv": 0, "i": -8, "flags": ("BUMPLESS",)}),
            ({}, {"mv": 2, "i": -6, "flags": ()}),
        ],
    )


def test_manual_seen_only_while_stopped_leads_to_no_transfer() -> None:
    play(
        DPID,
        PI | {"mout": 40.0},
        [
            ({}, {"mv": 10, "i": 2}),
            ({"pid_run": False, "pid_man": True}, {"mv": 0, "i": 2}),
            ({"pid_run": True, "pid_man": False}, {"mv": 12, "i": 4, "flags": ()}),
        ],
    )


@pytest.mark.parametrize("mode", [0, 3, -1, 99])
def test_transfer_continues_from_the_manual_value_and_counts_unknown_modes_as_0(mode: int) -> None:
    play(
        DPID,
        PI | {"kd": 1.0, "pid_mode": mode, "pid_man": True, "mout": 40.0},
        [
            ({}, {"mv": 40, "i": 0, "d": 0}),
            # E = 3: P = 6, D = -1 against the E tracked in manual, I = (40 - 6) + 1
            ({"pid_man": False, "pv": 7.0}, {"mv": 40, "i": 35, "d": -1, "flags": ("BUMPLESS",)}),
            ({}, {"mv": 42.5, "i": 36.5, "d": 0, "flags": ()}),
        ],
    )


def test_mode_2_goes_on_with_the_integral_held_in_manual() -> None:
    play(
        DPID,
        PI | {"pid_mode": 2, "mout": 40.0},
        [
            ({}, {"mv": 10, "i": 2}),
            ({"pid_man": True}, {"mv": 40, "i": 2}),
            ({"pv": 7.0}, {"mv": 40, "i": 2}),
            ({"pid_man": False}, {"mv": 9.5, "i": 3.5, "flags": ()}),
        ],
    )


def test_auto_tuning_changes_nothing_and_manual_has_no_effect() -> None:
    before = play(DPID, PI | {"kd": 1.0}, [({}, {"mv": 10, "i": 2})])
    after = play(
        DPID,
        PI | {"pid_mode": 1, "pid_man": True, "mout": 70.0, "pv": 0.0},
        [({}, {"mv": 10, "i": 2, "mout": 70, "flags": ("AUTOTUNE",)})],
        state=before,
    )
    assert after == before


@pytest.mark.parametrize("ki", [0.0, -0.5])
def test_without_ki_the_integral_is_0_and_no_transfer_is_bumpless(ki: float) -> None:
    play(
        DPID,
        PI | {"mout": 40.0},
        [
            ({}, {"mv": 10, "i": 2}),
            ({"ki": ki}, {"mv": 8, "i": 0}),
            ({"pid_man": True}, {"mv": 40, "i": 0}),
            ({"pid_man": False}, {"mv": 8, "i": 0, "flags": ()}),
        ],
    )


def test_ki_set_to_0_in_manual_leaves_the_integral_until_automatic() -> None:
    play(
        DPID,
        PI | {"mout": 40.0},
        [
            ({}, {"i": 2}),
            ({"pid_man": True, "ki": 0.0}, {"mv": 40, "i": 2}),
            ({"pid_man": False}, {"mv": 8, "i": 0}),
        ],
    )


def test_equal_limits_freeze_the_integral_unless_the_sum_hits_them() -> None:
    play(
        DPID,
        PI | {"mv_max": 5.0, "mv_min": 5.0},
        [
            ({}, {"mv": 5, "i": 0, "raw": 10, "flags": ("FREEZE_HI",)}),
            ({"pv": 8.0}, {"mv": 5, "i": 1, "raw": 5, "flags": ()}),
            ({"pv": 9.0}, {"mv": 5, "i": 1, "raw": 3.5, "flags": ("FREEZE_LO", "LOCKUP")}),
        ],
    )


def test_limits_the_wrong_way_round_are_exchanged() -> None:
    play(
        DPID,
        PI | {"mv_max": 0.0, "mv_min": 8.0},
        [
            ({}, {"mv": 8, "i": 0, "flags": ("FREEZE_HI", "LIMITS_SWAPPED")}),
            ({"pv": 11.0}, {"mv": 0, "i": 0, "raw": -2.5, "flags": ("FREEZE_LO", "LIMITS_SWAPPED")}),
            ({"pid_man": True, "mout": 9.0}, {"mv": 8, "flags": ("LIMITS_SWAPPED", "MANUAL")}),
        ],
    )


@pytest.mark.parametrize(("mout", "mv"), [(150.0, 100.0), (-150.0, -100.0), (100.0, 100.0), (-3.5, -3.5)])
def test_manual_value_is_limited_and_not_written_back(mout: float, mv: float) -> None:
    play(DPID, PI | {"pid_man": True, "mout_auto": True}, [({"mout": mout}, {"mv": mv, "mout": mout, "i": 0})])


def test_mout_follows_mv_in_automatic_only_when_told() -> None:
    play(
        DPID,
        PI | {"mout": 40.0},
        [
            ({}, {"mv": 10, "mout": 40}),
            ({"mout_auto": True}, {"mv": 12, "mout": 12}),
            ({"pid_man": True}, {"mv": 12, "mout": 12}),
            ({"pid_man": False}, {"mv": 12, "mout": 12, "flags": ("BUMPLESS",)}),
            ({"mout_auto": False}, {"mv": 14, "mout": 12}),
        ],
    )


@pytest.mark.parametrize("width", [1.0, -1.0])
def test_dead_band_includes_its_edges(width: float) -> None:
    above, below = float(from_bits(0x3F800001)), float(from_bits(0x3F7FFFFF))  # 1 ± one ULP
    play(
        DPID,
        {"kp": 1.0, "err_dbw": width, "mv_min": -100.0},
        [
            ({"pv": -1.0}, {"e": 0, "mv": 0}),
            ({"pv": 1.0}, {"e": 0}),
            ({"pv": -below}, {"e": 0}),
            ({"pv": -above}, {"e": above, "mv": above}),
            ({"pv": above}, {"e": -above, "mv": -above}),
            ({"pid_dir": False}, {"e": above}),
            ({"err_dbw": 0.0, "pv": 0.5}, {"e": 0.5}),
        ],
    )


def test_d_sees_the_error_after_the_dead_band() -> None:
    play(
        DPID,
        {"kp": 0.0, "kd": 1.0, "err_dbw": 1.0, "mv_min": -100.0},
        [({"sv": 2.0}, {"d": 0}), ({"sv": 1.0}, {"d": -2, "mv": -2}), ({"sv": -1.5}, {"d": -1.5}), ({}, {"d": 0})],
    )


def test_d_kicks_at_a_setpoint_step_and_divides_by_ts() -> None:
    play(
        DPID,
        {"kp": 0.0, "kd": 2.0, "cycle": 50, "mv_min": -100.0},
        [({}, {"d": 0}), ({"sv": 4.0}, {"d": 16, "mv": 16}), ({"cycle": 200, "sv": 0.0}, {"d": -4, "mv": -4})],
    )


@pytest.mark.parametrize(
    ("dialect", "integral", "flags"),
    [(DEFAULT, 0.0, ("LOCKUP",)), (Dialect(freeze=Freeze.OUTWARD), 2.0, ())],
    ids=["always", "outward"],
)
def test_integral_beyond_a_limit_by_dialect(dialect: Dialect, integral: float, flags: tuple[str, ...]) -> None:
    high = dpid.State(i=REAL(200), valid=True)
    play(
        DPID,
        PI | {"pv": 14.0},  # E = -4: P = -8, increment -2, back toward the range
        [({}, {"mv": 100, "raw": 190, "i": 200 - integral, "flags": ("FREEZE_HI", *flags)})],
        dialect=dialect,
        state=high,
    )
    play(DPID, PI, [({}, {"mv": 100, "raw": 210, "i": 200, "flags": ("FREEZE_HI",)})], dialect=dialect, state=high)
    low = dpid.State(i=REAL(-200), valid=True)
    play(
        DPID,
        PI,
        [({}, {"mv": -100, "raw": -190, "i": -200 + integral, "flags": ("FREEZE_LO", *flags)})],
        dialect=dialect,
        state=low,
    )
    play(
        DPID,
        PI | {"pv": 14.0},
        [({}, {"mv": -100, "raw": -210, "i": -200, "flags": ("FREEZE_LO",)})],
        dialect=dialect,
        state=low,
    )


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("name", ["sv", "pv", "mout"])
def test_bad_input_changes_nothing_and_the_next_good_sample_continues(name: str, bad: float) -> None:
    start = PI | {"kd": 1.0, "mout": 10.0, "pid_man": name == "mout"}
    before = play(DPID, start, [({}, {"mv": 10})])
    after = play(
        DPID, start | {"pid_man": name == "mout"}, [({name: bad}, {"mv": 10, "flags": ("BAD_INPUT",)})], state=before
    )
    assert after == before
    if name != "mout":
        play(DPID, start | {"pv": 7.0}, [({}, {"mv": 8.5, "i": 3.5, "d": -1, "flags": ()})], state=after)


def test_a_bad_manual_value_matters_in_manual_only() -> None:
    play(DPID, PI, [({"mout": math.nan}, {"mv": 10, "flags": ()})])


@pytest.mark.usefixtures("overflow_is_legal")
def test_an_error_beyond_the_reals_is_a_bad_input_even_inside_a_dead_band() -> None:
    huge = float(from_bits(0x7F7FFFFF))
    play(DPID, PI, [({"sv": huge, "pv": -huge}, {"mv": 0, "i": 0, "flags": ("BAD_INPUT",)})])
    play(DPID, PI | {"err_dbw": math.inf}, [({"sv": huge, "pv": -huge}, {"mv": 0, "flags": ("BAD_INPUT",)})])


@pytest.mark.usefixtures("overflow_is_legal")
def test_a_sum_that_is_no_number_holds_the_step() -> None:
    broken = dpid.State(i=from_bits(0x7FC00000), mv=REAL(5), valid=True)
    play(DPID, PI, [({}, {"mv": 5, "flags": ("BAD_INPUT",)}), ({"ki": 0.0}, {"mv": 8, "i": 0})], state=broken)
    manual = dpid.State(mv=from_bits(0x7FC00000), man1=True, valid=True)
    play(DPID, PI, [({}, {"i": 0, "flags": ("BUMPLESS", "BAD_INPUT")})], state=manual)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_gains_that_are_no_numbers_count_as_0(bad: float) -> None:
    play(DPID, PI, [({"kp": bad}, {"mv": 2, "p": 0, "i": 2, "flags": ("BAD_PARAM",)})])
    play(DPID, PI, [({"ki": bad}, {"mv": 8, "i": 0, "flags": ("BAD_PARAM",)})])
    play(DPID, PI, [({}, {}), ({"kd": bad, "pv": 7.0}, {"mv": 9.5, "d": 0, "flags": ("BAD_PARAM",)})])


def test_negative_gains_switch_their_term_off() -> None:
    play(DPID, PI, [({"kp": -2.0}, {"mv": 2, "p": 0, "i": 2, "flags": ()})])
    play(DPID, PI, [({"kd": -1.0}, {}), ({"pv": 7.0}, {"mv": 9.5, "d": 0, "flags": ()})])


@pytest.mark.usefixtures("overflow_is_legal")
def test_a_d_that_is_off_is_0_even_where_the_difference_overflows() -> None:
    huge = float(from_bits(0x7F7FFFFF))
    play(
        DPID,
        {"kp": 1.0, "kd": 0.0},
        [({"sv": huge}, {"mv": 100}), ({"sv": -huge}, {"d": 0, "mv": 0, "flags": ("FREEZE_LO",)})],
    )


@pytest.mark.parametrize(
    ("cycle", "pattern"),
    [
        (-2147483648, 0x3C23D70A),  # 0.01
        (0, 0x3C23D70A),
        (1, 0x3C23D70A),
        (7, 0x3D8F5C29),  # 0.07
        (50, 0x3F000000),
        (2000, 0x41A00000),  # 20
        (2001, 0x41A00000),
    ],
)
def test_cycle_is_held_within_1_to_2000_and_divided_by_100(cycle: int, pattern: int) -> None:
    assert pattern == bits(dpid.nominal_ts(operands(DPID, cycle=cycle)))


def test_a_new_ki_does_not_bump_through_the_integral() -> None:
    play(DPID, PI, [({}, {"mv": 10, "i": 2}), ({"pv": 10.0, "ki": 8.0}, {"mv": 2, "i": 2})])


def test_forward_action_is_pv_minus_sv() -> None:
    play(DPID, PI | {"pid_dir": False}, [({}, {"e": -4, "p": -8, "i": -2, "mv": -10})])


def test_the_sum_is_p_plus_i_plus_d_from_the_left() -> None:
    # (16777216 + 1) rounds back to 16777216, twice; the other order gives 16777218.
    play(
        DPID,
        {"kp": 16777216.0, "ki": 1.0, "kd": 1.0, "mv_max": 3e7},
        [({}, {"mv": 0}), ({"sv": 1.0}, {"p": 16777216, "i": 1, "d": 1, "mv": 16777216})],
    )


@pytest.mark.usefixtures("overflow_is_legal")
def test_products_are_taken_before_ts() -> None:
    big = 2.0**127  # big · 4 overflows, big · (4 · Ts) would not
    play(DPID, {"kp": 0.0, "ki": big}, [({"sv": 4.0, "ts": 0.0625}, {"mv": 100, "raw": math.inf, "i": 0})])
    play(
        DPID,
        {"kp": 0.0, "kd": big},
        [({"ts": 4.0}, {"mv": 0}), ({"sv": 4.0, "ts": 4.0}, {"mv": 100, "d": math.inf, "raw": math.inf})],
    )


def test_stopped_and_held_executions_leave_their_arguments_alone() -> None:
    inputs, state = operands(DPID, **PI), dpid.State(i=REAL(3), mv=REAL(7))
    after, terms = dpid.step(inputs._replace(pid_run=False), state, DEFAULT, REAL(1))
    assert (REAL(3), REAL(7)) == (state.i, state.mv)
    assert (REAL(3), REAL(0), flag.STOPPED) == (after.i, after.mv, terms.flags)
