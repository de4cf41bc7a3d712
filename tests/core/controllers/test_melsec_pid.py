"""MELSEC PID, sentence by sentence; every expected number is worked out by hand in binary fractions."""

from __future__ import annotations

from typing import Any

import pytest
from core.controllers.melsec_runner import run
from hypothesis import given, settings
from hypothesis import strategies as st

from ahgateway.core import flags as flag
from ahgateway.core.controllers import dpide, melsec_pid
from ahgateway.core.controllers.melsec_dialect import (
    DEFAULT,
    ActionChange,
    AlarmInput,
    DestinationWritten,
    FirstExecution,
    MelsecDialect,
    NumberFormat,
    Variation,
)
from ahgateway.core.dialect import DEFAULT as DELTA
from ahgateway.core.real import REAL, bits, same_bits

PI = {"TS": 1000, "ACT": 1, "KP": 100, "TI": 10}
P_ONLY = {"TS": 1000, "ACT": 1, "KP": 100, "TI": 0}


def pvs(*values: float) -> list[dict[str, Any]]:
    return [{"PV": value} for value in values]


def outs(ran: list[Any]) -> list[float]:
    return [float(terms.out) for terms in ran]


def test_direct_action_takes_pv_minus_sv() -> None:
    ran = run(PI | {"ACT": 0, "SV": 10}, pvs(14, 16))
    assert [4.0, 6.0] == [float(terms.ev) for terms in ran]
    assert [4.0, 12.0] == outs(ran)


@pytest.mark.parametrize(("act", "expected"), [(0, [0.0, 0.0, 3.0, 7.0]), (1, [0.0, 0.0, -3.0, -7.0])])
def test_kd_zero_gives_the_exact_second_difference(act: int, expected: list[float]) -> None:
    """TD/TS = 2; PV 0 0 1 3 has second differences 1, 1; P adds 1 and 2."""
    params = {"TS": 500, "ACT": act, "KP": 100, "TI": 0, "KD": 0, "TD": 100}
    assert expected == outs(run(params, pvs(0, 0, 1, 3)))


def test_pv_filter_starts_unfiltered_and_halves_the_way() -> None:
    assert [8.0, 4.0, 2.0] == [float(t.pvf) for t in run(P_ONLY | {"ALPHA": 50}, pvs(8, 0, 0))]


def test_setpoint_step_kicks_p_but_not_d() -> None:
    ran = run(P_ONLY | {"TD": 100, "PV": 0}, [{"SV": 0}, {"SV": 10}])
    assert [0.0, 10.0] == outs(ran)
    assert 0.0 == float(ran[1].d)


def test_kp_zero_is_no_error_and_moves_nothing() -> None:
    ran = run(PI | {"KP": 0, "SV": 10, "MV": 5}, pvs(0, 3))
    assert [5.0, 5.0] == outs(ran)
    assert [0, 0] == [terms.error for terms in ran]


@pytest.mark.parametrize(
    ("bad", "code"),
    [
        ({"TS": 0}, 0x11A0),
        ({"TS": -5}, 0x11A0),
        ({"ALPHA": -1}, 0x11A1),
        ({"ALPHA": 100}, 0x11A1),
        ({"KP": -1}, 0x11A2),
        ({"TI": -1}, 0x11A3),
        ({"KD": -1}, 0x11A4),
        ({"KD": 201}, 0x11A4),
        ({"TD": -1}, 0x11A5),
        ({"TD": -1, "KP": -1}, 0x11A2),
    ],
)
def test_bad_parameter_stops_the_operation_and_names_the_first_offence(bad: dict[str, int], code: int) -> None:
    first, second, third = run(PI | {"SV": 10}, [{"PV": 9}, {"PV": 0} | bad, PI | {"ALPHA": 0, "KD": 0, "TD": 0}])
    assert (1.0, 0) == (float(first.out), first.error)
    assert (1.0, code) == (float(second.out), second.error)
    assert second.flags & flag.BAD_PARAM
    # EV was 1 before the error and is 10 now: the bad execution left no trace in the history.
    assert (20.0, 0) == (float(third.out), third.error)


@pytest.mark.parametrize("good", [{"ALPHA": 99}, {"KD": 200}, {"KP": 0}, {"TI": 0}, {"TD": 0}])
def test_edges_of_the_legal_ranges_are_no_errors(good: dict[str, int]) -> None:
    assert [0] == [terms.error for terms in run(PI | good, pvs(0))]


@pytest.mark.parametrize(
    ("ts", "scan", "code", "dmv"), [(125, 250, 0x11A6, 2.0), (250, 250, 0x11A6, 2.0), (500, 250, 0, 4.0)]
)
def test_ts_not_above_the_scan_time_goes_on_with_the_scan_time(ts: int, scan: int, code: int, dmv: float) -> None:
    (terms,) = run(PI | {"TS": ts, "SCAN": scan, "SV": 8}, pvs(0))
    assert (dmv, code) == (float(terms.dmv), terms.error)


def test_input_variation_alarm_needs_strictly_more_and_a_second_execution() -> None:
    ran = run(P_ONLY | {"ACT": 3, "S20": 5, "S21": 3}, pvs(100, 105, 111, 108, 104))
    assert [0, 0, 1, 0, 2] == [terms.alarm for terms in ran]


def test_output_variation_alarm_needs_strictly_more() -> None:
    ran = run(P_ONLY | {"ACT": 5, "S22": 5, "S23": 3}, pvs(0, 3, 7, 2, -4))
    assert [0, 0, 8, 0, 4] == [terms.alarm for terms in ran]


def test_output_alarm_and_limits_together_switch_both_off() -> None:
    ran = run(P_ONLY | {"ACT": 37, "S22": 5, "S23": 0}, pvs(0, -20))
    assert (20.0, 0) == (float(ran[1].out), ran[1].alarm)


def test_negative_alarm_value_gives_no_alarm_and_a_warning() -> None:
    ran = run(P_ONLY | {"ACT": 3, "S20": -1, "S21": 3}, pvs(0, 50, 10))
    assert [0, 0, 2] == [terms.alarm for terms in ran]
    assert all(terms.warnings == melsec_pid.WARN_ALARM_VALUE for terms in ran)
    assert 6749 == melsec_pid.FX_CODES[melsec_pid.WARN_ALARM_VALUE]


def test_error_beyond_16_bits_counts_as_the_largest_and_so_does_mv() -> None:
    ran = run(PI | {"SV": 32767}, pvs(-32768, -32768))
    assert [32767.0, 32767.0] == [float(terms.ev) for terms in ran]
    assert [32767.0, 32767.0] == outs(ran)
    assert [melsec_pid.WARN_EV, melsec_pid.WARN_EV | melsec_pid.WARN_RESULT] == [terms.warnings for terms in ran]


def test_integral_increment_beyond_16_bits_is_held() -> None:
    (terms,) = run({"TS": 32767, "ACT": 1, "KP": 100, "TI": 1, "SV": 1000}, pvs(0))
    assert (32767.0, melsec_pid.WARN_INTEGRAL) == (float(terms.i), terms.warnings)


def test_derivative_beyond_16_bits_is_held() -> None:
    terms = run({"TS": 1, "ACT": 1, "KP": 1, "TI": 0, "TD": 32767}, pvs(0, 1))[1]
    assert (-32768.0, melsec_pid.WARN_DERIVATIVE) == (float(terms.d), terms.warnings)


def test_pv_change_beyond_16_bits_is_held_in_the_derivative() -> None:
    """TS 1 s, TD 0.01 s: the change 65535 counts as 32767, D = −0.01·32767."""
    terms = run(P_ONLY | {"TD": 1, "KP": 1}, pvs(-32768, 32767))[1]
    assert terms.warnings & melsec_pid.WARN_PV_CHANGE
    assert bits(REAL(0.01) * REAL(-32767)) == bits(terms.d)


def test_limits_clamp_the_sum_itself() -> None:
    """The limit is the anti-windup: MV leaves it at the first negative increment."""
    ran = run(P_ONLY | {"ACT": 33, "S22": 10, "S23": -10}, pvs(0, -25, -24, 10))
    assert [0.0, 10.0, 9.0, -10.0] == outs(ran)
    assert [0, flag.FREEZE_HI, 0, flag.FREEZE_LO] == [terms.flags for terms in ran]


def test_contact_off_holds_mv_and_on_starts_from_the_destination() -> None:
    ran = run(PI | {"SV": 10}, [{"PV": 8}, {"EN": False, "PV": 0}, {"EN": True, "PV": 6, "MV": 50}])
    assert [2.0, 2.0, 54.0] == outs(ran)
    assert ran[1].flags & flag.STOPPED


def test_value_written_into_the_destination_is_ignored_while_running_or_taken() -> None:
    steps = [{"PV": 8}, {"PV": 8, "MV": 50}]
    assert [2.0, 4.0] == outs(run(PI | {"SV": 10}, steps))
    taken = MelsecDialect(destination_written=DestinationWritten.TAKEN)
    assert [2.0, 52.0] == outs(run(PI | {"SV": 10}, steps, taken))


def test_integer_output_rounds_half_to_even_and_the_real_sum_loses_nothing() -> None:
    params = PI | {"KP": 25, "SV": 1}
    assert [0.25, 0.5, 0.75, 1.0] == outs(run(params, pvs(0, 0, 0, 0)))
    shown = run(params, pvs(0, 0, 0, 0), MelsecDialect(number_format=NumberFormat.INTEGER_IO))
    assert [0.0, 0.0, 1.0, 1.0] == outs(shown)
    assert [0.25, 0.5, 0.75, 1.0] == [float(terms.mv) for terms in shown]
    assert [0.0, 0.0, 0.0, 0.0] == outs(
        run(params, pvs(0, 0, 0, 0), MelsecDialect(number_format=NumberFormat.INTEGER_SUM))
    )


def test_alarm_watches_the_filtered_pv_or_the_raw_one() -> None:
    params = P_ONLY | {"ACT": 3, "ALPHA": 50, "S20": 6, "S21": 6}
    assert [0, 0] == [terms.alarm for terms in run(params, pvs(0, 8))]
    assert [0, 1] == [terms.alarm for terms in run(params, pvs(0, 8), MelsecDialect(alarm_input=AlarmInput.RAW))]


def test_variation_may_count_the_other_way_round() -> None:
    params = P_ONLY | {"ACT": 3, "S20": 6, "S21": 6}
    swapped = MelsecDialect(variation=Variation.OLD_MINUS_NEW)
    assert [0, 1] == [terms.alarm for terms in run(params, pvs(0, 8))]
    assert [0, 2] == [terms.alarm for terms in run(params, pvs(0, 8), swapped)]


def test_change_of_direction_kicks_literally_or_negates_the_history() -> None:
    steps = [{"PV": 4, "ACT": 1}, {"PV": 4, "ACT": 0}]
    assert [0.0, -12.0] == outs(run(P_ONLY | {"SV": 10}, steps))
    assert [0.0, 0.0] == outs(run(P_ONLY | {"SV": 10}, steps, MelsecDialect(action_change=ActionChange.NEGATED)))


def test_first_execution_from_a_cleared_work_area_kicks_p_and_d() -> None:
    """EV 6 − 0, DD = 2·0 − 4 − 0, TD/TS = 1, α 50: PVf = 4 + (0 − 4)/2 = 2, so EV = 8 and DD = −2."""
    cleared = MelsecDialect(first_execution=FirstExecution.CLEARED)
    (terms,) = run(P_ONLY | {"SV": 10, "TD": 100, "MV": 1}, pvs(4), cleared)
    assert (6.0, -4.0, 3.0) == (float(terms.p), float(terms.d), float(terms.out))
    (terms,) = run(P_ONLY | {"SV": 10, "TD": 100, "ALPHA": 50, "MV": 1}, pvs(4), cleared)
    assert (8.0, -2.0, 7.0) == (float(terms.p), float(terms.d), float(terms.out))


def test_auto_tuning_is_not_followed() -> None:
    ran = run(PI | {"SV": 10}, [{"PV": 8}, {"PV": 0, "ACT": 17}])
    assert [2.0, 2.0] == outs(ran)
    assert flag.AUTOTUNE == ran[1].flags


@pytest.mark.parametrize("bad", [{"PV": float("nan")}, {"SV": float("inf")}])
def test_bad_input_holds_everything_and_the_next_good_one_goes_on(bad: dict[str, float]) -> None:
    ran = run(PI | {"SV": 10}, [{"PV": 8}, bad, {"PV": 8, "SV": 10}])
    assert [2.0, 2.0, 4.0] == outs(ran)
    assert flag.BAD_INPUT == ran[1].flags


def test_scan_time_sets_the_nominal_sampling_time_when_it_is_longer() -> None:
    assert 0.5 == float(melsec_pid.nominal_ts(melsec_pid.Operands(ts=500)))
    assert 0.75 == float(melsec_pid.nominal_ts(melsec_pid.Operands(ts=500, scan=750)))


@given(st.lists(st.integers(-100, 100), min_size=1, max_size=8), st.booleans())
@settings(max_examples=40, deadline=None)
def test_velocity_and_position_form_agree_with_dpide(values: list[int], reverse: bool) -> None:
    """Spec 7.3: DE=T, no band, α=0; the sum starts at P(E1) + I0. Kc 2, Ti 4 s, Td 0.5 s, Tf 0.25 s, Ts 0.25 s."""
    sv, i0 = REAL(5), REAL(3)
    ran_state = dpide.State(i=i0)
    position = []
    for value in values:
        operands = dpide.Operands(
            sv=sv, pv=REAL(value), cycle=250, kc_kp=REAL(2), ti_ki=REAL(4), td_kd=REAL(0.5), tf=REAL(0.25),
            pid_eq=True, pid_de=True, pid_dir=reverse, mv_max=REAL(30000), mv_min=REAL(-30000),
        )  # fmt: skip
        ran_state, terms = dpide.step(operands, ran_state, DELTA, dpide.nominal_ts(operands))
        position.append(terms.mv)
    e1 = sv - REAL(values[0]) if reverse else REAL(values[0]) - sv
    params = {"TS": 250, "ACT": int(reverse), "KP": 200, "TI": 40, "KD": 50, "TD": 50, "SV": 5, "MV": 2 * float(e1) + 3}
    velocity = [terms.out for terms in run(params, pvs(*values))]
    assert all(same_bits(left, right) for left, right in zip(position, velocity, strict=True))


@given(st.lists(st.integers(-32768, 32767), min_size=1, max_size=10), st.integers(-32768, 32767))
@settings(max_examples=40, deadline=None)
def test_mv_never_leaves_its_limits(values: list[int], sv: int) -> None:
    ran = run(PI | {"ACT": 33, "SV": sv, "S22": 100, "S23": -50, "TD": 50}, pvs(*values))
    assert all(-50.0 <= out <= 100.0 for out in outs(ran))


@given(st.lists(st.integers(-1000, 1000), min_size=2, max_size=8), st.integers(0, 1))
@settings(max_examples=40, deadline=None)
def test_recalled_bounds_hold_the_next_mv(values: list[int], act: int) -> None:
    params = PI | {"ACT": act, "SV": 7, "TD": 30, "KD": 40}
    ran = run(params, pvs(*values))
    at = melsec_pid.Operands(act=act, sv=REAL(7), pv=REAL(values[-2]), ts=1000, kp=100, ti=10, td=30, kd=40)
    ((low, high),) = melsec_pid.recall(at, melsec_pid.State(mv=ran[-2].mv))
    now = at._replace(pv=REAL(values[-1]), mv=ran[-2].out)
    lowest, highest = (melsec_pid.step(now, end, DEFAULT, REAL(1))[1].mv for end in (low, high))
    assert lowest <= ran[-1].mv <= highest


def test_nothing_is_recalled_while_the_pv_filter_runs() -> None:
    assert () == melsec_pid.recall(melsec_pid.Operands(alpha=10), melsec_pid.State())
