"""Actuators, load and sensor around a plant: in which order, how exactly, by which chance."""

from __future__ import annotations

import random
from itertools import pairwise
from math import exp, nan
from statistics import fmean, pstdev

import pytest

from ahgateway.clock import SECOND
from ahgateway.plants.actuators import Positioner, Pulses
from ahgateway.plants.fopdt import Fopdt
from ahgateway.plants.heat_cool import HeatCool
from ahgateway.plants.integrating import Integrating
from ahgateway.plants.motor_valve import MotorValve
from ahgateway.plants.rig import Load, Rig, Sensor

QUIET = Load()
IDEAL = Sensor()


def rig(plant, sensor: Sensor = IDEAL, load: Load = QUIET, actuator=None, seed: int = 1) -> Rig:
    return Rig(plant, random.Random(seed).gauss, sensor, load, actuator)


def test_pulses_are_on_for_their_share_of_the_period_whatever_the_steps() -> None:
    pulses = Pulses(10.0)
    state, pieces = pulses.step(pulses.rest(), 30.0, 4.0)
    assert ((3.0, 100.0), (1.0, 0.0)) == pieces
    # A new demand waits for the next period.
    state, pieces = pulses.step(state, -50.0, 8.0)
    assert ((6.0, 0.0), (2.0, -100.0)) == pieces
    state, pieces = pulses.step(state, -50.0, 8.0)
    assert ((3.0, -100.0), (5.0, 0.0)) == pieces


@pytest.mark.parametrize(("demand", "value"), [(0.0, 0.0), (100.0, 100.0), (140.0, 100.0), (-100.0, -100.0)])
def test_pulses_without_an_edge_are_a_constant(demand: float, value: float) -> None:
    pulses = Pulses(2.0)
    _, pieces = pulses.step(pulses.rest(), demand, 6.0)
    assert ([value] * 3, 6.0) == ([each for _, each in pieces], sum(lasts for lasts, _ in pieces))


def test_pulses_heat_and_cool_with_the_gain_of_their_side() -> None:
    # Integrating twice nothing: over many fast periods the mean of the pulses counts.
    plant = HeatCool(gain=2.0, cool_gain=0.5, tau_s=50.0, bias=20.0, initial=20.0)
    for demand, settles in ((40.0, 20.0 + 2.0 * 40.0), (-40.0, 20.0 - 0.5 * 40.0)):
        found = rig(plant, actuator=Pulses(0.05))
        found.ask(demand)
        found.advance(1000 * SECOND)
        assert settles == pytest.approx(found.pv, abs=0.2)


def test_a_positioner_runs_at_the_motors_speed_and_stops_at_its_position() -> None:
    actuator = Positioner(MotorValve(stroke_s=50.0, initial=40.0))
    state, moved = actuator.rest(), []
    for u in (46.0, 46.0, 30.0, 30.0, 130.0):
        state, pieces = actuator.step(state, u, 2.5)
        moved.append(pieces[0][1])
    assert pytest.approx([45.0, 46.0, 41.0, 36.0, 41.0]) == moved


def test_backlash_of_a_positioned_valve_is_lost_at_each_reversal() -> None:
    actuator = Positioner(MotorValve(stroke_s=10.0, backlash=4.0, initial=50.0))
    state, moved = actuator.rest(), []
    for u in (60.0, 58.0, 50.0):
        state, pieces = actuator.step(state, u, 10.0)
        moved.append(pieces[0][1])
    assert pytest.approx([58.0, 58.0, 52.0]) == moved


def test_a_set_load_joins_at_the_plants_input() -> None:
    found = rig(Integrating(0.5))
    found.ask(3.0)
    found.load = -1.0
    found.advance(2 * SECOND)
    assert 0.5 * (3.0 - 1.0) * 2.0 == found.pv


def test_an_output_that_is_no_number_leaves_the_actuator_where_it_is() -> None:
    found = rig(Integrating(1.0))
    found.ask(3.0)
    found.ask(nan)
    found.advance(SECOND)
    assert 3.0 == found.pv


def test_a_random_load_has_its_deviation_and_time_constant_whatever_the_step() -> None:
    for dt_s in (0.5, 4.0):
        gauss, load, x, seen = random.Random(3).gauss, Load(2.0, 4.0), 0.0, []
        for _ in range(40_000):
            x = load.step(x, dt_s, gauss)
            seen.append(x)
        assert 2.0 == pytest.approx(pstdev(seen), rel=0.05)
        kept = fmean(a * b for a, b in pairwise(seen)) / 4.0
        assert exp(-dt_s / 4.0) == pytest.approx(kept, abs=0.03)


def test_equal_seeds_give_equal_processes_and_others_do_not() -> None:
    def walked(seed: int) -> list[float]:
        found = rig(Fopdt(1.0, 2.0), Sensor(noise=0.5), Load(1.0), seed=seed)
        readings = []
        for _ in range(20):
            found.advance(SECOND // 10)
            readings.append(found.reading())
        return readings

    assert walked(7) == walked(7) != walked(8)


def test_the_sensor_lags_rounds_and_ends() -> None:
    lagging = rig(Integrating(0.0, initial=8.0), Sensor(filter_s=2.0))
    lagging.load = 0.0
    assert 8.0 == lagging.reading()
    stepped = rig(Integrating(1.0), Sensor(filter_s=2.0))
    stepped.ask(10.0)
    stepped.advance(SECOND)
    assert 10.0 * (1.0 - exp(-0.5)) == pytest.approx(stepped.reading())
    assert 12.5 == rig(Integrating(0.0, initial=12.34), Sensor(resolution=0.5)).reading()
    assert 10.0 == rig(Integrating(0.0, initial=12.34), Sensor(low=0.0, high=10.0)).reading()
    assert 12.34 == rig(Integrating(0.0, initial=12.34)).reading()


@pytest.mark.parametrize(
    "make",
    [
        lambda: Pulses(0.0),
        lambda: Sensor(noise=-1.0),
        lambda: Sensor(low=5.0, high=5.0),
        lambda: Load(1.0, 0.0),
    ],
)
def test_what_cannot_be_built_is_refused(make) -> None:
    with pytest.raises(ValueError):
        make()
