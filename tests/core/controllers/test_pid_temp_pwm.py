"""The pulses of PID_Temp: minimum times, carry, and how the block times them."""

from __future__ import annotations

from typing import Any

import pytest
from core.controllers.temp_runner import run
from hypothesis import given
from hypothesis import strategies as st

from ahgateway.core import flags as flag
from ahgateway.core.controllers import pid_temp
from ahgateway.core.controllers.begins_temp import VEIL, veil
from ahgateway.core.controllers.pid_temp_dialect import PwmConflict
from ahgateway.core.controllers.pid_temp_output import calls
from ahgateway.core.controllers.pid_temp_pwm import Pulse, Timing, advance, period
from ahgateway.core.real import REAL, ZERO, quiet

ON = PwmConflict.ON_RULE


def train(ran: list[Any], side: str = "outputheat_pwm") -> str:
    return "".join("1" if getattr(terms, side) else "0" for terms in ran)


@pytest.mark.parametrize(
    ("percent", "timing", "carry", "expected"),
    [
        (20.0, Timing(10, 2, 0), 0.0, (2, 0.0)),
        (19.0, Timing(10, 2, 0), 0.0, (0, REAL(1.9))),
        (80.0, Timing(10, 0, 2), 0.0, (8, 0.0)),
        (85.0, Timing(10, 0, 2), 0.0, (10, -1.5)),
        (85.0, Timing(10, 0, 2), -1.5, (7, 0.0)),
        (0.0, Timing(10, 0, 0), 0.0, (0, 0.0)),
        (100.0, Timing(10, 0, 0), 0.0, (10, 0.0)),
        (100.0, Timing(10, 0, 0), 5.0, (10, 5.0)),
        (0.0, Timing(10, 0, 0), -3.0, (0, -3.0)),
        (float("nan"), Timing(10, 0, 0), 1.0, (0, 0.0)),
    ],
)
def test_one_period(percent: float, timing: Timing, carry: float, expected: tuple[int, float]) -> None:
    assert expected == period(REAL(percent), timing, REAL(carry), ON)


def test_carry_never_exceeds_a_period() -> None:
    assert (0, 10.0) == period(REAL(99), Timing(10, 30, 0), REAL(8), ON)


def test_whole_number_just_missed_counts_as_reached() -> None:
    """3 − 2⁻¹⁰ lies within the margin of 0.001, 3 − 2⁻⁹ does not."""
    for missing, expected in ((2.0**-10, 3), (2.0**-9, 2)):
        assert expected == period(REAL(30), Timing(10, 0, 0), REAL(-missing), ON)[0]


def test_minimum_times_longer_than_the_period_follow_the_on_rule_or_the_off_rule() -> None:
    """50 % of 10: less than 6 on, and 5 off is less than 6."""
    timing = Timing(10, 6, 6)
    assert (0, 5.0) == period(REAL(50), timing, ZERO, ON)
    assert (10, -5.0) == period(REAL(50), timing, ZERO, PwmConflict.OFF_RULE)


@given(st.lists(st.integers(0, 400), min_size=1, max_size=20), st.integers(1, 8), st.integers(0, 3), st.integers(0, 3))
def test_carry_loses_nothing_and_minimum_times_hold(
    quarters: list[int], eighths: int, on_min: int, off_min: int
) -> None:
    """Percent in quarters of a period of 25·2ⁿ calls: every want is a binary fraction, every sum exact."""
    calls = 25 * eighths
    carry, wanted, given_calls = ZERO, 0.0, 0
    for quarter in quarters:
        on, carry = period(REAL(quarter / 4), Timing(calls, on_min, off_min), carry, ON)
        wanted += quarter / 4 * calls / 100
        given_calls += on
        assert on == 0 or on >= on_min
        assert on == calls or calls - on >= off_min
    assert wanted == given_calls + float(carry)


@given(st.integers(0, 100), st.integers(1, 12))
def test_pulse_is_one_block_at_the_start_of_its_period(percent: int, calls: int) -> None:
    pulse, levels = Pulse(), []
    for _ in range(calls):
        pulse, level = advance(pulse, REAL(percent), Timing(calls, 0, 0), ON)
        levels.append(level)
    assert sorted(levels, reverse=True) == levels
    assert pulse.on == sum(levels)
    assert 0 == pulse.tick


def test_percentage_and_timing_are_sampled_where_a_period_begins() -> None:
    pulse, first = advance(Pulse(), REAL(50), Timing(4, 0, 0), ON)
    pulse, second = advance(pulse, REAL(0), Timing(2, 0, 0), ON)
    pulse, third = advance(pulse, REAL(100), Timing(2, 0, 0), ON)
    assert (True, True, False, 3) == (first, second, third, pulse.tick)


def manual(params: dict[str, Any], value: float, count: int) -> list[Any]:
    """So many calls of 0.125 s in manual."""
    base = {"CycleTime_Value": 0.125, "Heat_Cycle": 1} | params
    return run(base, [{"set_mode": 4, "ManualValue": value}, *({} for _ in range(count - 1))])


def test_cycle_is_the_period_unless_pwm_periode_is_set() -> None:
    assert "1100000011000000" == train(manual({}, 25, 16))
    assert "1000100010001000" == train(manual({"Heat_PwmPeriode": 0.5}, 25, 16))
    assert "1100000011000000" == train(manual({"Heat_PwmPeriode": 2}, 25, 16))


def test_minimum_times_are_rounded_to_calls() -> None:
    """0.3 s is 2.4 calls: 2; 25 % is 2 calls; 0.32 s is 2.56 calls: 3."""
    assert "11000000" == train(manual({"Heat_MinimumOnTime": 0.3}, 25, 8))
    assert "00000000" == train(manual({"Heat_MinimumOnTime": 0.32}, 25, 8))


def test_cooling_pulses_have_their_own_period_with_two_sets_and_the_heating_one_with_the_factor() -> None:
    params = {"ActivateCooling": True, "Cool_Cycle": 0.5}
    assert "11001100" == train(manual(params, -50, 8), "outputcool_pwm")
    assert "11110000" == train(manual(params | {"AdvancedCooling": False}, -50, 8), "outputcool_pwm")
    assert "00000000" == train(manual(params, -50, 8))


def test_pulse_width_has_its_own_scaling() -> None:
    """50 % of the output is 25…75 %: half way, 50 %; at 0 it is 25 %."""
    params = {"Heat_PwmLowerScaling": 25, "Heat_PwmUpperScaling": 75}
    assert "11110000" == train(manual(params, 50, 8))
    assert "11000000" == train(manual(params, 0, 8))


def test_pulses_only_where_selected() -> None:
    assert "00000000" == train(manual({"Heat_Select": 2}, 50, 8))
    assert "00000000" == train(manual({"Heat_Select": 0}, 50, 8))


def test_impossible_minimum_times_are_flagged() -> None:
    assert manual({"Heat_MinimumOnTime": 0.75, "Heat_MinimumOffTime": 0.5}, 50, 1)[0].flags & flag.BAD_PARAM
    assert not manual({"Heat_MinimumOnTime": 0.5, "Heat_MinimumOffTime": 0.5}, 50, 1)[0].flags & flag.BAD_PARAM


def test_a_carry_that_is_not_known_stays_so_over_a_period_without_a_pulse() -> None:
    """A period of one call at 0 % leaves no carry to a block that had none; what this one owed is hidden."""
    met = pid_temp.State(heat=VEIL, cool=VEIL)
    ran, is_on = advance(VEIL, REAL(0), Timing(1, 0, 0), ON)
    assert not is_on
    assert veil(met, met._replace(heat=ran, cool=Pulse())) == met._replace(cool=Pulse())


def test_a_time_whose_number_of_calls_no_real_holds_counts_as_none_or_for_ever() -> None:
    """-3e38 s in calls of 0.1 s is minus infinity, 3e38 s infinity."""
    with quiet(all="ignore"):
        assert (0, 2**30) == tuple(calls(REAL(time), REAL(0.1), 0) for time in (-3e38, 3e38))
