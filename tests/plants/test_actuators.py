"""A motor valve with backlash and stiction, and a heater with a cooler."""

from __future__ import annotations

import math

import pytest

from ahgateway.plants.heat_cool import HeatCool
from ahgateway.plants.motor_valve import MotorValve


def run(valve: MotorValve, moves: list[tuple[float, float]]) -> list[float]:
    state, found = valve.rest(), []
    for direction, seconds in moves:
        state, position = valve.step(state, direction, seconds)
        found.append(position)
    return found


def test_a_motor_valve_moves_at_constant_speed_and_stops_at_its_ends() -> None:
    valve = MotorValve(stroke_s=50.0, initial=40.0)
    assert [50.0, 50.0, 44.0, 100.0, 0.0] == run(valve, [(1, 5.0), (0, 9.0), (-1, 3.0), (1, 60.0), (-1, 60.0)])


def test_backlash_is_lost_where_the_direction_changes() -> None:
    valve = MotorValve(stroke_s=100.0, backlash=2.0, initial=50.0)
    assert [59.0, 59.0, 58.0] == run(valve, [(1, 10.0), (-1, 2.0), (-1, 1.0)])


def test_a_sticking_stem_jumps_when_it_breaks_loose() -> None:
    valve = MotorValve(stroke_s=100.0, stiction=3.0, initial=50.0)
    assert [50.0, 50.0, 54.0] == run(valve, [(1, 2.0), (1, 1.0), (1, 1.0)])


def test_travel_is_the_same_in_one_step_or_in_many() -> None:
    valve = MotorValve(stroke_s=100.0, backlash=2.0, initial=50.0)
    assert math.isclose(run(valve, [(1, 8.0)])[-1], run(valve, [(1, 0.5)] * 16)[-1])


@pytest.mark.parametrize(
    "wrong", [{"stroke_s": 0.0}, {"stroke_s": 9.0, "backlash": -1.0}, {"stroke_s": 9.0, "initial": 101.0}]
)
def test_a_valve_that_cannot_be_is_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError):
        MotorValve(**wrong)


def test_heating_and_cooling_act_with_their_own_gains() -> None:
    plant = HeatCool(gain=2.0, cool_gain=0.5, tau_s=1.0, bias=20.0, initial=20.0)
    assert math.isclose(plant.step(plant.rest(), 10.0, 100.0)[1], 40.0)
    assert math.isclose(plant.step(plant.rest(), -10.0, 100.0)[1], 15.0)


def test_pulses_act_as_their_mean() -> None:
    plant = HeatCool(gain=1.0, cool_gain=0.0, tau_s=50.0, initial=25.0)
    state, pv = plant.rest(), 0.0
    for _ in range(400):
        state, _ = plant.step(state, 100.0, 0.25)
        state, pv = plant.step(state, 0.0, 0.75)
    assert abs(pv - 25.0) < 0.5


def test_a_cooler_that_heats_is_refused() -> None:
    with pytest.raises(ValueError):
        HeatCool(1.0, -1.0, 1.0)
