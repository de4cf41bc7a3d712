"""Modes, errors and warnings of PID_Temp. Gain 2, Ti 4 s, Cycle 1 s, setpoint 50, input 45: P 10, increment 2.5."""

from __future__ import annotations

from typing import Any

import pytest
from core.controllers.temp_runner import run

from ahgateway.core import flags as flag
from ahgateway.core.controllers import pid_temp
from ahgateway.core.controllers.pid_temp_dialect import (
    InvalidGain,
    PidTempDialect,
    PwmInactive,
    Resume,
    WarningEdge,
    WarningLatch,
    ZoneAtTransfer,
)
from ahgateway.core.real import REAL

PI = {"Heat_Gain": 2, "Heat_Ti": 4, "Setpoint": 50, "Input": 45}
AUTO = {"set_mode": 3}
NAN = float("nan")


def ys(ran: list[Any]) -> list[float]:
    return [float(terms.pidoutputsum) for terms in ran]


def states(ran: list[Any]) -> list[int]:
    return [terms.state for terms in ran]


def test_block_starts_inactive_with_all_outputs_zero() -> None:
    (terms,) = run(PI | {"Heat_LowerScaling": 7, "Heat_Select": 2, "Heat_PerLowerScaling": 9}, [{}])
    assert (0, 0.0, 0.0, 0) == (terms.state, float(terms.pidoutputsum), float(terms.outputheat), terms.outputheat_per)


def test_manual_to_automatic_is_bumpless() -> None:
    ran = run(PI | {"ManualValue": 30}, [{"set_mode": 4}, AUTO, {}])
    assert [30.0, 30.0, 32.5] == ys(ran)
    assert [20.0, 22.5] == [float(terms.i) for terms in ran[1:]]
    assert flag.BUMPLESS == ran[1].flags


def test_manual_to_automatic_divides_by_the_cooling_factor() -> None:
    params = PI | {"Input": 55, "ActivateCooling": True, "AdvancedCooling": False, "CoolFactor": 2, "ManualValue": -20}
    ran = run(params, [{"set_mode": 4}, AUTO, {}])
    assert [-20.0, -20.0, -25.0] == ys(ran)
    assert 0.0 == float(ran[1].i)


def test_manual_to_automatic_jumps_without_an_integral() -> None:
    assert [30.0, 10.0] == ys(run(PI | {"Heat_Ti": 0, "ManualValue": 30}, [{"set_mode": 4}, AUTO]))


@pytest.mark.parametrize(("axis", "integral"), [(ZoneAtTransfer.DROPPED, 0.0), (ZoneAtTransfer.KEPT, 20.0)])
def test_control_zone_wins_over_the_bumpless_preset(axis: ZoneAtTransfer, integral: float) -> None:
    params = PI | {"ManualValue": 30, "Heat_ControlZone": 3}
    ran = run(params, [{"set_mode": 4}, AUTO], PidTempDialect(zone_at_transfer=axis))
    assert ([30.0, 100.0], integral) == (ys(ran), float(ran[1].i))


@pytest.mark.parametrize(
    ("mode", "expected", "integral"),
    [(0, 0.0, -10.0), (1, 12.5, 2.5), (2, 19.5, 9.5), (3, 40.0, 30.0), (4, 12.5, 2.5), (9, 12.5, 2.5)],
)
def test_start_from_inactive_by_integral_reset_mode(mode: int, expected: float, integral: float) -> None:
    params = PI | {"IntegralResetMode": mode, "OverwriteInitialOutputValue": 40}
    (terms,) = run(params, [AUTO | {"set_I": 7}])
    assert (expected, integral) == (float(terms.pidoutputsum), float(terms.i))


def test_start_as_a_setpoint_change_jumps_by_the_weighted_error() -> None:
    """b = 0.5: I0 = 2·0.5·45 = 45, P = 2·(5 − 25) = −40, so 5 = Kp·b·(w − x), and 2.5 of integral."""
    (terms,) = run(PI | {"Heat_PWeighting": 0.5}, [AUTO])
    assert (7.5, 47.5) == (float(terms.pidoutputsum), float(terms.i))


def test_start_presets_the_integral_before_the_control_zone_is_looked_at() -> None:
    (terms,) = run(PI | {"IntegralResetMode": 0, "Heat_ControlZone": 3}, [AUTO])
    assert (100.0, -10.0) == (float(terms.pidoutputsum), float(terms.i))


def test_start_from_inactive_goes_on_with_the_integral_of_before() -> None:
    ran = run(PI | {"IntegralResetMode": 2}, [AUTO, {"set_mode": 0}, AUTO])
    assert [12.5, 0.0, 15.0] == ys(ran)


@pytest.mark.parametrize(
    ("bad", "bits"),
    [
        ({"Input": NAN}, 0x200),
        ({"Input": float("inf")}, 0x200),
        ({"Setpoint": NAN}, 0x1000),
        ({"InputPerOn": True, "Input_PER": 32767}, 0x2),
        ({"InputPerOn": True, "Input_PER": -32768}, 0x2),
        ({"InputPerOn": True, "InputScaling_UpperPointIn": 0}, 0x2),
    ],
)
def test_invalid_input_or_setpoint_puts_out_the_substitute_until_it_is_gone(bad: dict[str, Any], bits: int) -> None:
    good = {"Input": 45, "Setpoint": 50, "InputPerOn": False}
    ran = run(PI | {"SubstituteOutput": 20}, [AUTO, bad, good, {}])
    assert [3, 5, 3, 3] == states(ran)
    assert [12.5, 20.0, 20.0, 22.5] == ys(ran)
    assert [0, bits, 0, 0] == [terms.pending for terms in ran]
    assert [0, bits, bits, bits] == [terms.errorbits for terms in ran]
    assert [False, True, False, False] == [terms.error for terms in ran]


def test_integral_may_be_kept_over_the_substitute_output() -> None:
    steps = [AUTO, {"Input": NAN}, {"Input": 45}]
    ran = run(PI | {"SubstituteOutput": 20}, steps, PidTempDialect(resume=Resume.INTEGRAL_KEPT))
    assert [12.5, 20.0, 15.0] == ys(ran)


def test_last_valid_output_stays_without_set_substitute_output() -> None:
    ran = run(PI | {"SubstituteOutput": 20, "SetSubstituteOutput": False}, [AUTO, {"Input": NAN}])
    assert [12.5, 12.5] == ys(ran)


@pytest.mark.parametrize(
    ("value", "expected", "bits", "warning"), [(150, 100.0, 0x200, 0x1000), (NAN, 5.0, 0x20200, 0)]
)
def test_substitute_output_is_limited_or_replaced(value: float, expected: float, bits: int, warning: int) -> None:
    terms = run(PI | {"SubstituteOutput": value, "Heat_PidLowerLimit": 5}, [AUTO, {"Input": NAN}])[1]
    assert (expected, bits, warning) == (float(terms.pidoutputsum), terms.pending, terms.warning)


def test_invalid_disturbance_counts_as_zero_and_automatic_stays() -> None:
    ran = run(PI, [AUTO | {"Disturbance": 8}, {"Disturbance": NAN}])
    assert [20.5, 15.0] == ys(ran)
    assert (3, 0x40000) == (ran[1].state, ran[1].pending)


@pytest.mark.parametrize(("substitute", "expected", "bits"), [(20, 20.0, 0x10000), (NAN, 0.0, 0x30000)])
def test_invalid_manual_value_is_substituted_and_manual_stays(substitute: float, expected: float, bits: int) -> None:
    params = PI | {"SubstituteOutput": substitute, "SetSubstituteOutput": False}
    ran = run(params, [{"set_mode": 4, "ManualValue": 30}, {"ManualValue": NAN}, {"ManualValue": 31}])
    assert [30.0, expected, 31.0] == ys(ran)
    assert (4, bits) == (ran[1].state, ran[1].pending)


def test_sum_that_is_no_number_is_an_output_error_until_it_can_be_computed() -> None:
    ran = run(PI | {"SubstituteOutput": 20}, [AUTO, {"Heat_Gain": 3e38}, {}, {"Heat_Gain": 2}])
    assert [3, 5, 5, 3] == states(ran)
    assert [12.5, 20.0, 20.0, 20.0] == ys(ran)
    assert [0, 0x400, 0x400, 0] == [terms.pending for terms in ran]


@pytest.mark.parametrize("bad", [{"Input": NAN}, {"Input": 121}, {"Disturbance": NAN}, {"Heat_Gain": 3e38}])
def test_any_error_makes_the_block_inactive_without_recover_mode(bad: dict[str, Any]) -> None:
    good = {"Input": 45, "Disturbance": 0, "Heat_Gain": 2}
    ran = run(PI | {"ActivateRecoverMode": False}, [AUTO, bad, good, AUTO])
    assert [3, 0, 0, 3] == states(ran)
    assert [12.5, 0.0, 0.0, 12.5] == ys(ran)


def test_manual_too_becomes_inactive_without_recover_mode() -> None:
    ran = run(PI | {"ActivateRecoverMode": False}, [{"set_mode": 4, "ManualValue": 30}, {"ManualValue": NAN}])
    assert [4, 0] == states(ran)


def test_error_acknowledgement_is_an_edge_and_pending_errors_come_back() -> None:
    steps = [{"Input": 121}, {"Input": 45}, {"ErrorAck": True}, {"Input": 121}, {"Input": 45}, {"ErrorAck": False}]
    assert [1, 1, 0, 1, 1, 1] == [terms.errorbits for terms in run(PI, steps)]
    still = run(PI | {"Input": 121}, [{}, {"ErrorAck": True}])
    assert [1, 1] == [terms.errorbits for terms in still]


def test_reset_stops_clears_and_takes_mode_when_it_falls() -> None:
    steps = [AUTO | {"Input": 121}, {"Input": 45, "Reset": True, "Mode": 3}, {}, {"Reset": False}]
    ran = run(PI, steps)
    assert [3, 0, 0, 3] == states(ran)
    assert [1, 0, 0, 0] == [terms.errorbits for terms in ran]


def test_reset_beats_manual_enable_which_acts_when_reset_falls() -> None:
    ran = run(PI | {"ManualValue": 30}, [{"Reset": True, "ManualEnable": True}, {"Reset": False}])
    assert [0, 4] == states(ran)


def test_manual_enable_acts_on_both_edges() -> None:
    steps = [AUTO, {"Mode": 3, "ManualEnable": True}, {}, {"ManualEnable": False}]
    assert [3, 4, 4, 3] == states(run(PI | {"ManualValue": 30}, steps))


@pytest.mark.parametrize("held", ["ManualEnable", "Reset"])
def test_mode_cannot_be_activated_while_an_input_holds_it(held: str) -> None:
    ran = run(PI, [{held: True}, AUTO])
    assert ran[0].state == ran[1].state
    assert [0, 0x10] == [terms.warning for terms in ran]


def test_mode_is_taken_on_the_edge_only() -> None:
    ran = run(PI, [{"ModeActivate": True, "Mode": 3}, {"Mode": 0}, {"ModeActivate": False}, {"ModeActivate": True}])
    assert [3, 3, 3, 0] == states(ran)


@pytest.mark.parametrize("mode", [-1, 5])
def test_invalid_mode_changes_nothing_and_warns(mode: int) -> None:
    ran = run(PI, [AUTO, {"set_mode": mode}])
    assert [3, 3] == states(ran)
    assert 0x80 == ran[1].warning


def test_automatic_asked_for_during_an_error_waits_in_state_5() -> None:
    ran = run(PI | {"SubstituteOutput": 20}, [AUTO | {"Input": NAN}, AUTO, {"Input": 45}])
    assert [5, 5, 3] == states(ran)
    assert [20.0, 20.0, 20.0] == ys(ran)


@pytest.mark.parametrize("mode", [1, 2])
def test_tuning_holds_everything(mode: int) -> None:
    ran = run(PI, [AUTO, {"set_mode": mode, "Input": 30}, {}])
    assert [3, mode, mode] == states(ran)
    assert [12.5, 12.5, 12.5] == ys(ran)
    assert flag.AUTOTUNE == ran[1].flags


def test_setpoint_is_limited_in_every_mode_and_warns() -> None:
    ran = run(PI | {"SetpointUpperLimit": 48, "SetpointLowerLimit": 10}, [{}, AUTO, {"Setpoint": 48}, {"Setpoint": 5}])
    assert [48.0, 48.0, 48.0, 10.0] == [float(terms.setpoint) for terms in ran]
    assert [0x4, 0x4, 0, 0x4] == [terms.warning for terms in ran]
    assert [True, True, True, False] == [terms.setpointlimit_h for terms in ran]
    assert [False, False, False, True] == [terms.setpointlimit_l for terms in ran]


def test_warning_limit_outside_the_process_limits_is_replaced_by_them() -> None:
    params = PI | {"InputUpperWarning": 200, "InputLowerWarning": -5}
    ran = run(params, [{"Input": 120}, {"Input": 121}, {"Input": 0}, {"Input": -1}])
    assert [False, True, False, False] == [terms.inputwarning_h for terms in ran]
    assert [False, False, False, True] == [terms.inputwarning_l for terms in ran]


@pytest.mark.parametrize(("edge", "warning"), [(WarningEdge.EXCEEDED, 0), (WarningEdge.REACHED, 0x40)])
def test_warning_limit_just_reached(edge: WarningEdge, warning: int) -> None:
    params = PI | {"InputUpperWarning": 90, "InputLowerWarning": 10}
    ran = run(params, [{"Input": 90}, {"Input": 10}], PidTempDialect(warning_edge=edge))
    assert [warning, warning] == [terms.warning for terms in ran]


def test_warning_goes_with_its_cause_or_waits_for_an_acknowledgement() -> None:
    steps = [AUTO | {"Heat_Gain": 0}, {"Heat_Gain": 2}, {"ErrorAck": True}, {"Input": 121}, {"Input": 45}]
    assert [0x40000, 0, 0, 0x40, 0] == [terms.warning for terms in run(PI, steps)]
    latched = run(PI, steps, PidTempDialect(warning_latch=WarningLatch.UNTIL_ACKNOWLEDGED))
    assert [0x40000, 0x40000, 0, 0x40, 0] == [terms.warning for terms in latched]


@pytest.mark.parametrize("gain", [0, -1, NAN])
def test_invalid_gain_gives_zero_and_stops_the_integral(gain: float) -> None:
    ran = run(PI, [AUTO, {"Heat_Gain": gain}, {}, {"Heat_Gain": 2}])
    assert [3, 3, 3, 3] == states(ran)
    assert [12.5, 0.0, 0.0, 15.0] == ys(ran)
    assert [0, 0x40000, 0x40000, 0] == [terms.warning for terms in ran]
    cleared = run(PI, [AUTO, {"Heat_Gain": gain}], PidTempDialect(invalid_gain=InvalidGain.CLEARED))
    assert 0.0 == float(cleared[1].i)


def test_cooling_factor_and_cooling_gain_matter_only_where_they_are_used() -> None:
    factor = PI | {"CoolFactor": 0, "Cool_Gain": 0}
    assert 0 == run(factor, [AUTO])[0].warning
    assert (
        0x40000 == run(factor | {"ActivateCooling": True, "AdvancedCooling": False, "Cool_Gain": 1}, [AUTO])[0].warning
    )
    assert 0x40000 == run(factor | {"ActivateCooling": True, "CoolFactor": 1}, [AUTO])[0].warning


def test_unknown_selection_leaves_the_real_output_and_warns() -> None:
    (terms,) = run(PI | {"Heat_Select": 3}, [AUTO])
    assert (0x4000, 12.5, 0, False) == (
        terms.warning,
        float(terms.outputheat),
        terms.outputheat_per,
        terms.outputheat_pwm,
    )


def test_manual_value_is_limited_with_a_warning() -> None:
    ran = run(PI, [{"set_mode": 4, "ManualValue": 100}, {"ManualValue": 101}, {"ManualValue": -1}])
    assert [100.0, 100.0, 0.0] == ys(ran)
    assert [0, 0x100, 0x100] == [terms.warning for terms in ran]


@pytest.mark.parametrize(("per", "expected"), [(0, -20.0), (16384, 60.0), (-8192, -60.0)])
def test_input_per_is_scaled_on_the_line_through_two_points(per: int, expected: float) -> None:
    """0 → −20 and 16384 → 60: 80 units over 16384."""
    params = {
        "InputPerOn": True,
        "InputScaling_UpperPointIn": 16384,
        "InputScaling_UpperPointOut": 60,
        "InputScaling_LowerPointOut": -20,
    }
    assert expected == float(run(params, [{"Input_PER": per}])[0].scaledinput)


def test_bad_cycle_time_acts_as_the_default() -> None:
    assert REAL(0.1) == pid_temp.nominal_ts(pid_temp.Operands(cycletime_value=REAL(0)))
    assert REAL(0.5) == pid_temp.nominal_ts(pid_temp.Operands(cycletime_value=REAL(0.5)))


@pytest.mark.parametrize(("axis", "expected"), [(PwmInactive.CLEARED, "1100"), (PwmInactive.KEPT, "1001")])
def test_inactive_clears_the_phase_of_the_pulses_or_keeps_it(axis: PwmInactive, expected: str) -> None:
    """50 % of 4 calls; inactive after the first call."""
    params = PI | {"Heat_Cycle": 1, "CycleTime_Value": 0.25, "ManualValue": 50}
    steps = [{"set_mode": 4}, {"set_mode": 0}, {}, {"set_mode": 4}, {}, {}, {}]
    ran = run(params, steps, PidTempDialect(pwm_inactive=axis))
    assert "100" == "".join("1" if terms.outputheat_pwm else "0" for terms in ran[:3])
    assert expected == "".join("1" if terms.outputheat_pwm else "0" for terms in ran[3:])


def test_nothing_is_recalled() -> None:
    assert () == pid_temp.recall(pid_temp.Operands(), pid_temp.State())
