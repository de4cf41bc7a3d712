"""The law of PID_Temp, its zones, sets and outputs; every number worked out by hand in binary fractions."""

from __future__ import annotations

from typing import Any

import pytest
from core.controllers.temp_runner import run
from hypothesis import given, settings
from hypothesis import strategies as st

from ahgateway.core import flags as flag
from ahgateway.core.controllers import dpide
from ahgateway.core.controllers.pid_temp_dialect import (
    DeadZone,
    DisturbancePlace,
    PerRounding,
    PidTempDialect,
    SamplingTime,
    Switching,
    ZoneReturn,
)
from ahgateway.core.dialect import DEFAULT as DELTA
from ahgateway.core.real import REAL, same_bits

PI = {"Heat_Gain": 2, "Heat_Ti": 4, "Setpoint": 50, "Input": 45}
P = {"Heat_Gain": 1, "Heat_Ti": 0, "Heat_PidLowerLimit": -100, "Setpoint": 50, "Input": 50}
COOLING = {"ActivateCooling": True, "Cool_Gain": 4, "Cool_Ti": 8}
FACTOR = {"ActivateCooling": True, "AdvancedCooling": False, "CoolFactor": 2}
AUTO = {"set_mode": 3}


def inputs(*values: float) -> list[dict[str, Any]]:
    first, *rest = values
    return [AUTO | {"Input": first}, *({"Input": value} for value in rest)]


def ys(ran: list[Any]) -> list[float]:
    return [float(terms.pidoutputsum) for terms in ran]


def integrals(ran: list[Any]) -> list[float]:
    return [float(terms.i) for terms in ran]


@pytest.mark.parametrize(
    ("shape", "expected"), [(DeadZone.SHIFTED, [3.0, 0.0, 0.0, -3.0]), (DeadZone.JUMP, [5.0, 0.0, 0.0, -5.0])]
)
def test_dead_zone_is_continuous_or_jumps(shape: DeadZone, expected: list[float]) -> None:
    ran = run(P | {"Heat_DeadZone": 2}, inputs(45, 48, 52, 55), PidTempDialect(dead_zone=shape))
    assert expected == ys(ran)


def test_process_value_moves_inside_the_dead_zone_change_nothing_but_the_setpoint_does() -> None:
    """b = 0.5: P = 0 − 0.5·w."""
    params = P | {"Heat_DeadZone": 10, "Heat_PWeighting": 0.5}
    assert [-25.0, -25.0, -26.0] == ys(run(params, [AUTO, {"Input": 57}, {"Setpoint": 52}]))


def test_dead_zone_has_two_widths_with_two_sets() -> None:
    params = P | COOLING | {"Cool_Ti": 0, "Cool_Gain": 1, "Heat_DeadZone": 2, "Cool_DeadZone": 4}
    assert [3.0, -1.0, -1.0] == ys(run(params, inputs(45, 55, 55)))


def test_unfiltered_derivative_acts_for_one_cycle() -> None:
    params = P | {"Heat_Td": 1, "Heat_TdFiltRatio": 0, "Heat_Gain": 2}
    ran = run(params, inputs(50, 50, 48, 48))
    assert [0.0, 0.0, 4.0, 0.0] == [float(terms.d) for terms in ran]
    assert [0.0, 0.0, 8.0, 4.0] == ys(ran)


def test_setpoint_step_reaches_the_derivative_by_its_weight() -> None:
    """Td 1, no filter, Gain 1: the step of 8 gives D 8·c."""
    for weight, expected in ((1, 8.0), (0.5, 4.0), (0, 0.0)):
        params = P | {"Heat_Td": 1, "Heat_TdFiltRatio": 0, "Heat_DWeighting": weight}
        assert expected == float(run(params, [AUTO, {"Setpoint": 58}])[1].d)


def test_turning_td_off_empties_the_filter() -> None:
    params = P | {"Heat_Td": 1, "Heat_TdFiltRatio": 1}
    ran = run(params, [AUTO, {"Input": 48}, {"Heat_Td": 0}, {"Heat_Td": 1}])
    assert [0.0, 1.0, 0.0, 0.0] == [float(terms.d) for terms in ran]


def test_control_zone_gives_full_or_least_output_and_holds_the_integral() -> None:
    """Its edges belong to the inside."""
    ran = run(PI | {"Heat_ControlZone": 5}, inputs(45, 44, 56, 45))
    assert [12.5, 100.0, 0.0, 15.0] == ys(ran)
    assert [2.5, 2.5, 2.5, 5.0] == integrals(ran)


def test_return_into_the_control_zone_may_be_bumpless() -> None:
    ran = run(PI | {"Heat_ControlZone": 5}, inputs(45, 44, 45, 45), PidTempDialect(zone_return=ZoneReturn.PRESET))
    assert [12.5, 100.0, 100.0, 100.0] == ys(ran)
    assert [2.5, 2.5, 90.0, 90.0] == integrals(ran)


def test_control_zone_has_two_widths_with_two_sets() -> None:
    ran = run(PI | COOLING | {"Heat_ControlZone": 5, "Cool_ControlZone": 8}, inputs(44, 57, 59))
    assert (100.0, -100.0) == (ys(ran)[0], ys(ran)[2])
    assert 2 * (50 - 57) - 3.5 == ys(ran)[1]


def test_only_the_worsening_direction_stops_the_integral() -> None:
    ran = run(PI | {"Disturbance": 200}, inputs(45, 55))
    assert [100.0, 100.0] == ys(ran)
    assert [0.0, -2.5] == integrals(ran)
    assert [flag.FREEZE_HI, 0] == [terms.flags for terms in ran]
    ran = run(PI | {"Disturbance": -200}, inputs(55, 45))
    assert [0.0, 2.5] == integrals(ran)
    assert flag.FREEZE_LO == ran[0].flags


def test_turning_ti_off_deletes_the_integral_and_the_output_jumps() -> None:
    ran = run(PI, [AUTO, {"Heat_Ti": 0}, {"Heat_Ti": 4}])
    assert [12.5, 10.0, 12.5] == ys(ran)


@pytest.mark.parametrize(
    ("place", "expected"), [(DisturbancePlace.BEFORE_FACTOR, -12.0), (DisturbancePlace.AFTER_FACTOR, -16.0)]
)
def test_disturbance_joins_before_or_after_the_cooling_factor(place: DisturbancePlace, expected: float) -> None:
    """P −10, disturbance 4."""
    params = PI | FACTOR | {"Heat_Ti": 0, "Disturbance": 4, "Input": 55}
    assert [expected] == ys(run(params, [AUTO], PidTempDialect(disturbance_place=place)))


@pytest.mark.parametrize("place", list(DisturbancePlace))
def test_transfer_is_bumpless_wherever_the_disturbance_joins(place: DisturbancePlace) -> None:
    params = PI | FACTOR | {"Disturbance": 4, "Input": 50, "ManualValue": -20}
    assert [-20.0, -20.0, -20.0] == ys(
        run(params, [{"set_mode": 4}, AUTO, {}], PidTempDialect(disturbance_place=place))
    )


def test_parameter_sets_switch_on_output_and_error_and_the_output_does_not_jump() -> None:
    ran = run(PI | COOLING, inputs(45, 55, 55, 55, 45, 45))
    assert [12.5, -10.0, -10.0, -12.5, 30.0, 30.0] == ys(ran)
    assert [2.5, 0.0, 10.0, 7.5, 10.0, 20.0] == integrals(ran)
    assert [False, False, True, True, True, False] == [terms.cooling for terms in ran]


def test_switch_empties_the_derivative() -> None:
    params = PI | COOLING | {"Heat_Td": 1, "Heat_TdFiltRatio": 1, "Cool_Td": 1, "Cool_TdFiltRatio": 1}
    ran = run(params, inputs(45, 58, 58))
    assert [0.0, -13.0, 0.0] == [float(terms.d) for terms in ran]
    assert [12.5, -30.5, -30.5] == ys(ran)


@pytest.mark.parametrize(("axis", "cooling"), [(Switching.AT_ZERO, True), (Switching.BEYOND_ZERO, False)])
def test_output_of_zero_switches_or_does_not(axis: Switching, cooling: bool) -> None:
    params = P | COOLING | {"Cool_Ti": 0}
    assert cooling == run(params, inputs(50, 55), PidTempDialect(switching=axis))[1].cooling


def test_without_cooling_the_second_set_is_never_used() -> None:
    ran = run(PI | {"Cool_Gain": 4}, inputs(55, 55))
    assert [False, False] == [terms.cooling for terms in ran]
    assert [0.0, 0.0] == ys(ran)


def test_law_runs_every_cycle_and_the_outputs_stay_in_between() -> None:
    ran = run(PI | {"CycleTime_Value": 0.25}, [AUTO, {}, {}, {}, {"Input": 40}])
    assert [True, False, False, False, True] == [terms.executed for terms in ran]
    assert [12.5, 12.5, 12.5, 12.5, 27.5] == ys(ran)


def test_mode_change_executes_the_law_at_once() -> None:
    ran = run(PI | {"CycleTime_Value": 0.25, "ManualValue": 30}, [AUTO, {}, {"set_mode": 4}, AUTO, {}])
    assert [True, False, False, True, False] == [terms.executed for terms in ran]


def test_cooling_set_has_its_own_cycle() -> None:
    """Heating every call, cooling every second; the switch itself is an execution of the cooling set."""
    ran = run(PI | COOLING | {"Cool_Cycle": 2}, inputs(55, 55, 55, 55))
    assert [True, False, True, False] == [terms.executed for terms in ran]


@pytest.mark.parametrize(("axis", "expected"), [(SamplingTime.CONFIGURED, 12.5), (SamplingTime.COUNTED, 12.8125)])
def test_cycle_that_is_no_multiple_counts_as_configured_or_as_called(axis: SamplingTime, expected: float) -> None:
    """1 s of 0.375 s calls: 3 calls, 1.125 s; increment 2.5·1.125."""
    ran = run(PI | {"CycleTime_Value": 0.375}, [AUTO, {}, {}, {}], PidTempDialect(sampling_time=axis))
    assert expected == ys(ran)[0]
    assert [True, False, False, True] == [terms.executed for terms in ran]


def test_parameters_that_are_no_numbers_count_as_off() -> None:
    (terms,) = run(PI | {"Heat_Ti": float("nan")}, [AUTO])
    assert (10.0, flag.BAD_PARAM) == (float(terms.pidoutputsum), terms.flags)


def test_heating_line_starts_at_its_lower_limit_without_cooling_and_at_zero_with_it() -> None:
    manual = {"set_mode": 4, "ManualValue": 0}
    assert 50.0 == float(run({"Heat_PidLowerLimit": -100}, [manual])[0].outputheat)
    assert 0.0 == float(run({"Heat_PidLowerLimit": -100, "ActivateCooling": True}, [manual])[0].outputheat)


def test_line_without_length_gives_its_lower_end() -> None:
    params = {"Heat_PidUpperLimit": 0, "Heat_LowerScaling": 3, "ActivateCooling": True, "Cool_PidLowerLimit": 0}
    (terms,) = run(params | {"Cool_LowerScaling": 4}, [{"set_mode": 4}])
    assert (3.0, 4.0) == (float(terms.outputheat), float(terms.outputcool))


@pytest.mark.parametrize(("axis", "expected"), [(PerRounding.HALF_EVEN, 2), (PerRounding.HALF_AWAY, 3)])
def test_peripheral_output_rounds_a_half(axis: PerRounding, expected: int) -> None:
    params = {"Heat_Select": 2, "Heat_PerUpperScaling": 100}
    (terms,) = run(params, [{"set_mode": 4, "ManualValue": 2.5}], PidTempDialect(per_rounding=axis))
    assert expected == terms.outputheat_per


def test_same_loop_as_the_conversion_vector() -> None:
    """Vector F3: Gain 2, Ti 4, Td 0.5, TdFiltRatio 0.5, b 1, c 0, Cycle 0.5 s; unlimited."""
    params = {
        "Heat_Gain": 2, "Heat_Ti": 4, "Heat_Td": 0.5, "Heat_TdFiltRatio": 0.5, "Heat_DWeighting": 0, "Heat_Cycle": 0.5,
        "Setpoint": 10, "Heat_PidLowerLimit": -100,
    }  # fmt: skip
    expected = [
        11.25, 8.916666984558105, 3.6388890743255615, 0.8379631042480469, 0.300154447555542, 2.4750514030456543,
    ]  # fmt: skip
    for want, got in zip(expected, ys(run(params, inputs(5, 6, 8, 9.5, 10.25, 10))), strict=True):
        assert abs(want - got) <= 1e-6


@given(st.lists(st.integers(-100, 100), min_size=1, max_size=8), st.booleans())
@settings(max_examples=40, deadline=None)
def test_position_forms_agree_with_dpide(values: list[int], on_pv: bool) -> None:
    """Spec 7.3: b = 1, c ∈ {0, 1}, no zones, no cooling. Gain 2, Ti 4 s, Td 0.5 s, Tf 0.25 s, Ts 0.25 s: all binary."""
    state, delta = dpide.State(), []
    for value in values:
        operands = dpide.Operands(
            sv=REAL(5), pv=REAL(value), cycle=250, kc_kp=REAL(2), ti_ki=REAL(4), td_kd=REAL(0.5), tf=REAL(0.25),
            pid_eq=True, pid_de=on_pv, mv_max=REAL(30000), mv_min=REAL(-30000),
        )  # fmt: skip
        state, terms = dpide.step(operands, state, DELTA, dpide.nominal_ts(operands))
        delta.append(terms.mv)
    params = {
        "Heat_Gain": 2, "Heat_Ti": 4, "Heat_Td": 0.5, "Heat_TdFiltRatio": 0.5, "Heat_DWeighting": 0 if on_pv else 1,
        "Heat_Cycle": 0.25, "Setpoint": 5, "Heat_PidUpperLimit": 30000, "Heat_PidLowerLimit": -30000,
        "InputUpperLimit": 1000, "InputLowerLimit": -1000,
    }  # fmt: skip
    siemens = [terms.pidoutputsum for terms in run(params, inputs(*values))]
    assert all(same_bits(left, right) for left, right in zip(delta, siemens, strict=True))


@given(st.lists(st.floats(-200, 200, width=32), min_size=1, max_size=8), st.booleans(), st.booleans())
@settings(max_examples=40, deadline=None)
def test_outputs_stay_within_their_scalings(values: list[float], cooling: bool, advanced: bool) -> None:
    params = PI | {"Heat_Td": 1, "ActivateCooling": cooling, "AdvancedCooling": advanced, "CoolFactor": 3, "Cool_Td": 2}
    scaling = {"Heat_UpperScaling": 10, "Heat_LowerScaling": 2, "Cool_UpperScaling": 1, "Cool_LowerScaling": 5}
    for terms in run(params | scaling, inputs(*values)):
        assert (-100.0 if cooling else 0.0) <= terms.pidoutputsum <= 100.0
        assert 2.0 <= terms.outputheat <= 10.0
        assert (1.0 if cooling else 0.0) <= terms.outputcool <= (5.0 if cooling else 0.0)
