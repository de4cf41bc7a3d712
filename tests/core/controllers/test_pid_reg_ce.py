"""PID_REG_CE, sentence by sentence. KP 2, T_PERIOD 10 s, calls of 0.5 s: error 10 is Y 20 %, T1 2 s, pause 2.5 s."""

from __future__ import annotations

from typing import Any

import pytest
from core.controllers.pulse_runner import run, segments
from hypothesis import given, settings
from hypothesis import strategies as st

from ahgateway.core import flags as flag
from ahgateway.core.controllers import pid_reg_ce
from ahgateway.core.controllers.pid_reg_ce_dialect import (
    AXES,
    BacklashPause,
    ErrorSign,
    FirstBacklash,
    IdleY,
    IntegralSpan,
    NoMinimumPulse,
    PauseFrom,
    PulseDialect,
    SeriesEnd,
    ShortPulse,
    Stopped,
    ZonePulse,
)
from ahgateway.core.real import REAL

BASE = {"D_ZONE": 1.0, "KP": 2.0, "PT_MIN_IMP": 0.5, "T_PERIOD": 10.0, "dt": 0.5, "SET_POINT": 60.0, "ACTUAL": 50.0}
NAN = float("nan")


def calls(*runs: tuple[int, dict[str, Any]]) -> list[dict[str, Any]]:
    """Repeat each dict of inputs so many times."""
    return [given for count, given in runs for _ in range(count)]


@pytest.mark.parametrize(("duration", "expected"), [(0.0, 1), (0.1, 1), (0.7, 1), (0.75, 2), (1.0, 2), (1e30, 2**30)])
def test_durations_are_rounded_half_up_to_at_least_one_call(duration: float, expected: int) -> None:
    assert expected == pid_reg_ce.ticks(REAL(duration), REAL(0.5))


def test_reverse_action_closes_on_a_positive_error_and_leaves_error_alone() -> None:
    (terms,) = run(BASE | {"ACTION": True}, [{}])
    assert (10.0, -20.0, True) == (float(terms.error), float(terms.y), terms.close_out)


def test_error_may_follow_action() -> None:
    (terms,) = run(BASE | {"ACTION": True}, [{}], PulseDialect(error_sign=ErrorSign.BY_ACTION))
    assert -10.0 == float(terms.error)


def test_error_of_zero_moves_nothing_without_a_zone() -> None:
    ran = run(BASE | {"D_ZONE": -1.0, "ACTUAL": 60.0}, [{}, {"ACTUAL": 59.75}])
    assert [False, True] == [terms.open_out for terms in ran]


@pytest.mark.parametrize("kp", [0.0, -2.0])
def test_no_gain_never_pulses(kp: float) -> None:
    ran = run(BASE | {"KP": kp}, calls((5, {})))
    assert [["-", 5]] == segments(ran)
    assert (flag.BAD_PARAM if kp < 0 else 0) == ran[0].flags


def test_change_of_sign_drops_the_series_at_once_and_adds_the_backlash() -> None:
    """2 s and 1 s of backlash are 6 calls; the pause is made from 2 s: 5 calls."""
    ran = run(BASE | {"PT_LUFT": 1.0}, calls((2, {}), (12, {"ACTUAL": 70.0})))
    assert [["OPEN", 2], ["CLOSE", 6], ["-", 5], ["CLOSE", 1]] == segments(ran)


def test_backlash_may_enter_the_pause() -> None:
    """0.5/3·10 s = 1.67 s: 3 calls."""
    dialect = PulseDialect(backlash_pause=BacklashPause.WITH_LUFT)
    ran = run(BASE | {"PT_LUFT": 1.0}, calls((2, {}), (10, {"ACTUAL": 70.0})), dialect)
    assert [["OPEN", 2], ["CLOSE", 6], ["-", 3], ["CLOSE", 1]] == segments(ran)


def test_very_first_pulse_has_no_backlash_unless_the_dialect_says_so() -> None:
    assert [["OPEN", 4], ["-", 2]] == segments(run(BASE | {"PT_LUFT": 1.0}, calls((6, {}))))
    dialect = PulseDialect(first_backlash=FirstBacklash.YES)
    assert [["OPEN", 6]] == segments(run(BASE | {"PT_LUFT": 1.0}, calls((6, {})), dialect))


def test_same_direction_after_the_zone_has_no_backlash_and_begins_with_a_first_pulse() -> None:
    ran = run(BASE | {"PT_LUFT": 1.0}, calls((5, {}), (1, {"ACTUAL": 60.0}), (5, {"ACTUAL": 50.0})))
    assert [["OPEN", 4], ["-", 2], ["OPEN", 4], ["-", 1]] == segments(ran)


def test_motion_in_manual_counts_for_the_backlash() -> None:
    manual = {"REG_AVT": False, "IN_OPEN_R": True}
    ran = run(BASE | {"PT_LUFT": 1.0}, calls((1, manual), (7, {"REG_AVT": True, "ACTUAL": 70.0})))
    assert [["OPEN", 1], ["CLOSE", 6], ["-", 1]] == segments(ran)


def test_manual_ends_the_series_and_shows_no_demand() -> None:
    ran = run(BASE, calls((2, {}), (1, {"REG_AVT": False}), (5, {"REG_AVT": True})))
    assert [["OPEN", 2], ["-", 1], ["OPEN", 4], ["-", 1]] == segments(ran)
    assert (0.0, True) == (float(ran[2].y), ran[2].ostanov)


def test_limit_switch_stops_a_pulse_and_a_new_series_waits_for_it() -> None:
    ran = run(BASE, calls((2, {}), (3, {"CONC_OPEN": False}), (5, {"CONC_OPEN": True})))
    assert [["OPEN", 2], ["-", 3], ["OPEN", 4], ["-", 1]] == segments(ran)
    assert [True, True, True] == [terms.ostanov for terms in ran[2:5]]
    assert [20.0, 20.0, 20.0] == [float(terms.y) for terms in ran[2:5]]


def test_limit_switch_of_the_other_direction_does_not_matter() -> None:
    assert [["CLOSE", 2]] == segments(run(BASE | {"ACTUAL": 70.0, "CONC_OPEN": False}, calls((2, {}))))


def test_limit_switch_gates_manual_in_both_directions() -> None:
    manual = BASE | {"REG_AVT": False}
    assert [["-", 1]] == segments(run(manual | {"IN_OPEN_R": True, "CONC_OPEN": False}, [{}]))
    assert [["CLOSE", 1]] == segments(run(manual | {"IN_CLOSE_R": True, "CONC_OPEN": False}, [{}]))


def test_derivative_needs_two_calls_and_acts_on_the_jump() -> None:
    """Error 2 inside the zone, then 6: D = 1·(6 − 2)/0.5 = 8, Y = 2·14; then 0."""
    ran = run(BASE | {"D_ZONE": 5.0, "TV": 1.0}, [{"ACTUAL": 58.0}, {"ACTUAL": 54.0}, {}])
    assert [0.0, 28.0, 12.0] == [float(terms.y) for terms in ran]
    assert 20.0 == float(run(BASE | {"TV": 1.0}, [{}])[0].y)


def test_integral_raises_y_but_not_the_first_pulse_already_begun() -> None:
    ran = run(BASE | {"TN": 10.0}, calls((6, {})))
    assert [21.0, 22.0, 23.0] == [float(terms.y) for terms in ran[:3]]
    assert [["OPEN", 4], ["-", 2]] == segments(ran)


@pytest.mark.parametrize(("end", "expected"), [(SeriesEnd.CLEARED, 21.0), (SeriesEnd.KEPT, 26.0)])
def test_integral_after_a_series_is_cleared_or_kept(end: SeriesEnd, expected: float) -> None:
    """Five calls of 0.5 leave I = 2.5; the zone ends the series in its pause."""
    steps = calls((5, {}), (1, {"ACTUAL": 60.0}), (1, {"ACTUAL": 50.0}))
    assert expected == float(run(BASE | {"TN": 10.0}, steps, PulseDialect(series_end=end))[-1].y)


def test_integral_may_end_tn_after_the_series_began() -> None:
    ran = run(BASE | {"TN": 1.0}, calls((4, {})), PulseDialect(integral_span=IntegralSpan.FIRST_TN))
    assert [5.0, 10.0, 10.0, 10.0] == [float(terms.i) for terms in ran]


@pytest.mark.parametrize(("y_ogr", "expected"), [(15.0, 15.0), (150.0, 100.0), (-5.0, 0.0)])
def test_y_is_limited_and_its_limit_lies_within_0_and_100(y_ogr: float, expected: float) -> None:
    assert expected == float(run(BASE | {"KP": 50.0, "Y_OGR": y_ogr}, [{}])[0].y)


@pytest.mark.parametrize("fault", [{"T_PERIOD": 0.0}, {"PT_MIN_IMP": 0.0}, {"T_PERIOD": NAN}, {"PT_MIN_IMP": -1.0}])
def test_impossible_times_switch_both_outputs_off(fault: dict[str, float]) -> None:
    ran = run(BASE, [{}, fault, {"REG_AVT": False, "IN_OPEN_R": True}])
    assert [["OPEN", 1], ["-", 2]] == segments(ran)
    assert ran[1].flags & flag.BAD_PARAM
    assert ran[1].ostanov


def test_no_minimum_pulse_may_be_one_call() -> None:
    dialect = PulseDialect(no_minimum_pulse=NoMinimumPulse.ONE_CALL)
    ran = run(BASE | {"PT_MIN_IMP": 0.0}, calls((10, {})), dialect)
    assert [["OPEN", 4], ["-", 5], ["OPEN", 1]] == segments(ran)


@pytest.mark.parametrize("bad", [{"ACTUAL": NAN}, {"SET_POINT": float("inf")}])
def test_bad_signal_stops_the_motor_at_once(bad: dict[str, float]) -> None:
    ran = run(BASE, [{}, bad, {"ACTUAL": 50.0, "SET_POINT": 60.0}, {}])
    assert [["OPEN", 1], ["-", 1], ["OPEN", 2]] == segments(ran)
    assert (flag.BAD_INPUT, True) == (ran[1].flags, ran[1].ostanov)


def test_bad_gain_counts_as_zero() -> None:
    (terms,) = run(BASE | {"TN": NAN, "TV": float("inf")}, [{}])
    assert (20.0, flag.BAD_PARAM) == (float(terms.y), terms.flags)


@pytest.mark.parametrize(("pause_from", "pause"), [(PauseFrom.LATCHED, 5), (PauseFrom.TRACKING, 3)])
def test_pause_follows_the_first_pulse_or_the_present_demand(pause_from: PauseFrom, pause: int) -> None:
    """The error doubles after the first pulse: 0.5/4·10 s = 1.25 s, 3 calls rounded half up."""
    ran = run(BASE, calls((4, {}), (7, {"ACTUAL": 40.0})), PulseDialect(pause_from=pause_from))
    assert [["OPEN", 4], ["-", pause]] == segments(ran)[:2]


def test_series_begins_anew_when_the_demand_outgrows_it() -> None:
    ran = run(BASE, calls((5, {}), (9, {"ACTUAL": 40.0})), PulseDialect(rearm_ratio=REAL(1.5)))
    assert [["OPEN", 4], ["-", 1], ["OPEN", 8], ["-", 1]] == segments(ran)
    ran = run(BASE, calls((5, {}), (9, {"ACTUAL": 40.0})), PulseDialect(rearm_ratio=REAL(2)))
    assert [["OPEN", 4], ["-", 5]] == segments(ran)[:2]


def test_pause_may_be_made_from_the_stretched_pulse() -> None:
    """T1 = 0.2 s, stretched to 0.5 s: 0.5/0.5·10 s is 20 calls."""
    ran = run(BASE | {"ACTUAL": 59.0}, calls((22, {})), PulseDialect(short_pulse=ShortPulse.PAUSE_FROM_STRETCHED))
    assert [["OPEN", 1], ["-", 20], ["OPEN", 1]] == segments(ran)


def test_zone_may_cut_a_pulse() -> None:
    steps = calls((2, {}), (3, {"ACTUAL": 60.0}))
    assert [["OPEN", 4], ["-", 1]] == segments(run(BASE, steps))
    assert [["OPEN", 2], ["-", 3]] == segments(run(BASE, steps, PulseDialect(zone_pulse=ZonePulse.CUT)))


def test_reversal_may_wait() -> None:
    steps = calls((2, {}), (7, {"ACTUAL": 70.0}))
    ran = run(BASE, steps, PulseDialect(reverse_pause=REAL(1)))
    assert [["OPEN", 2], ["-", 2], ["CLOSE", 4], ["-", 1]] == segments(ran)


def test_ostanov_may_mean_no_output() -> None:
    steps = calls((5, {}), (1, {"REG_AVT": False, "IN_OPEN_R": True}))
    assert [False] * 5 + [True] == [terms.ostanov for terms in run(BASE, steps)]
    dialect = PulseDialect(stopped=Stopped.NO_OUTPUT)
    assert [False] * 4 + [True, False] == [terms.ostanov for terms in run(BASE, steps, dialect)]


@pytest.mark.parametrize("without", [{"ACTUAL": 60.0}, {"REG_AVT": False}])
def test_y_without_demand_is_zero_or_held(without: dict[str, Any]) -> None:
    steps = calls((5, {}), (1, without))
    assert 0.0 == float(run(BASE, steps)[-1].y)
    assert 20.0 == float(run(BASE, steps, PulseDialect(idle_y=IdleY.HELD))[-1].y)


def test_nothing_is_recalled() -> None:
    assert () == pid_reg_ce.recall(pid_reg_ce.Operands(), pid_reg_ce.State())


DIALECTS = st.fixed_dictionaries({name: st.sampled_from(list(axis)) for name, axis in AXES.items()})
CALLS = st.lists(
    st.fixed_dictionaries(
        {},
        optional={
            "ACTUAL": st.sampled_from([40.0, 55.0, 59.5, 60.0, 61.0, 75.0, NAN]),
            "REG_AVT": st.booleans(),
            "IN_OPEN_R": st.booleans(),
            "IN_CLOSE_R": st.booleans(),
            "CONC_OPEN": st.booleans(),
            "CONC_CLOSE": st.booleans(),
            "ACTION": st.booleans(),
        },
    ),
    min_size=1,
    max_size=30,
)


@given(CALLS, DIALECTS)
@settings(max_examples=60, deadline=None)
def test_never_both_directions_and_never_into_a_limit_switch(steps: list[dict[str, Any]], axes: dict[str, Any]) -> None:
    open_free = close_free = True
    ran = run(BASE | {"TN": 5.0, "TV": 0.5, "PT_LUFT": 1.0}, steps, PulseDialect(**axes))
    for inputs, terms in zip(steps, ran, strict=True):
        open_free = inputs.get("CONC_OPEN", open_free)
        close_free = inputs.get("CONC_CLOSE", close_free)
        assert not (terms.open_out and terms.close_out)
        assert open_free or not terms.open_out
        assert close_free or not terms.close_out


@given(st.integers(4, 100), st.integers(1, 4))
@settings(max_examples=30, deadline=None)
def test_motor_runs_as_long_as_demanded_on_average(error_quarters: int, minimum_calls: int) -> None:
    """First pulse T1; then the share T1/(T1 + T_PERIOD), but for half a call in each pause and one pulse."""
    dt, period = 0.125, 8.0
    params = {
        "KP": 4.0,
        "T_PERIOD": period,
        "PT_MIN_IMP": minimum_calls * dt,
        "dt": dt,
        "SET_POINT": error_quarters / 4,
    }
    count = 600
    driven = sum(terms.open_out for terms in run(params, calls((count, {})))) * dt
    t1 = period / 100 * error_quarters
    first = max(round(t1 / dt), minimum_calls) * dt
    minimum = minimum_calls * dt
    pause = minimum / t1 * period
    slow, fast = (minimum / (minimum + max(pause + half, dt)) for half in (dt / 2, -dt / 2))
    rest = count * dt - first
    assert first + slow * rest - minimum - dt <= driven <= first + fast * rest + minimum + dt
