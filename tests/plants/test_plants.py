"""Plants against values worked out by hand and against scipy's continuous-time solution."""

from __future__ import annotations

from math import e, inf, nan

import numpy as np
import pytest
from scipy import integrate, signal

from ahgateway.plants.base import DelayLine, delayed
from ahgateway.plants.fopdt import Fopdt
from ahgateway.plants.integrating import Integrating
from ahgateway.plants.second_order import SecondOrder
from ahgateway.plants.sopdt import Sopdt
from ahgateway.plants.tank import Tank


def run(plant, inputs, dt_s):
    state, outputs = plant.rest(), []
    for u in inputs:
        state, y = plant.step(state, u, dt_s)
        outputs.append(y)
    return outputs


def test_fopdt_reaches_63_percent_after_one_time_constant():
    assert run(Fopdt(gain=2.0, tau_s=10.0), [50.0], 10.0) == [pytest.approx(100.0 * (1 - 1 / e), abs=1e-12)]


def test_fopdt_is_the_same_in_one_step_and_in_many():
    once = run(Fopdt(gain=2.0, tau_s=10.0, dead_time_s=1.3), [50.0], 7.0)[-1]
    often = run(Fopdt(gain=2.0, tau_s=10.0, dead_time_s=1.3), [50.0] * 700, 0.01)[-1]
    assert often == pytest.approx(once, rel=1e-12)


def test_fopdt_settles_at_bias_without_input():
    assert run(Fopdt(gain=2.0, tau_s=1.0, bias=20.0, initial=80.0), [0.0], 60.0) == [pytest.approx(20.0)]


def test_dead_time_between_two_steps_acts_from_its_own_moment():
    # θ = 1.5 steps: nothing in the first step, half of the second.
    plant = Fopdt(gain=1.0, tau_s=1.0, dead_time_s=1.5)
    assert run(plant, [1.0, 1.0], 1.0) == [0.0, pytest.approx(1 - e**-0.5, abs=1e-15)]


def test_delay_line_gives_every_change_in_order_with_its_duration():
    line, pieces = delayed(DelayLine(), 4.0, 1.0, 2.0)
    assert pieces == ((1.0, 0.0),)
    line, pieces = delayed(line, 7.0, 0.5, 2.0)
    assert pieces == ((0.5, 0.0),)
    line, pieces = delayed(line, 7.0, 2.0, 2.0)
    assert pieces == ((0.5, 0.0), (1.0, 4.0), (0.5, 7.0))
    assert line == DelayLine(3.5, 7.0, 7.0, ())


def test_delay_line_holds_changes_not_samples():
    line = DelayLine()
    for _ in range(1000):
        line, _ = delayed(line, 5.0, 0.005, 60.0)
    assert len(line.pending) == 1


def test_integrating_runs_at_gain_times_input_plus_bias():
    plant = Integrating(gain=0.5, bias=-1.0, initial=10.0)
    assert run(plant, [4.0, 4.0, 0.0], 2.0) == [12.0, 14.0, 12.0]


def test_integrating_stays_within_its_bounds_and_leaves_them_at_once():
    plant = Integrating(gain=1.0, initial=9.0, minimum=0.0, maximum=10.0)
    assert run(plant, [2.0, 2.0, -1.0, -20.0], 1.0) == [10.0, 10.0, 9.0, 0.0]


def test_integrating_waits_for_its_dead_time():
    assert run(Integrating(gain=1.0, dead_time_s=2.5), [2.0] * 4, 1.0) == [0.0, 0.0, 1.0, 3.0]


def test_sopdt_with_equal_lags_follows_the_textbook_step_response():
    # y = 1 − (1 + t/τ)·e^(−t/τ)
    assert run(Sopdt(gain=1.0, tau1_s=2.0, tau2_s=2.0), [1.0, 1.0], 1.0) == [
        pytest.approx(1 - 1.5 * e**-0.5, abs=1e-14),
        pytest.approx(1 - 2.0 * e**-1.0, abs=1e-14),
    ]


@pytest.mark.parametrize(
    ("plant", "a", "b"),
    [
        (Fopdt(gain=3.0, tau_s=4.0), [[-0.25]], [[0.75]]),
        (Integrating(gain=0.25), [[0.0]], [[0.25]]),
        (Sopdt(gain=2.0, tau1_s=5.0, tau2_s=1.5), [[-2 / 3, 2 / 3], [0.0, -0.2]], [[0.0], [0.4]]),
        (SecondOrder(gain=2.0, tau_s=2.0, zeta=0.3), [[0.0, 1.0], [-0.25, -0.3]], [[0.0], [0.5]]),
        (SecondOrder(gain=2.0, tau_s=2.0, zeta=1.0), [[0.0, 1.0], [-0.25, -1.0]], [[0.0], [0.5]]),
        (SecondOrder(gain=2.0, tau_s=2.0, zeta=1.7), [[0.0, 1.0], [-0.25, -1.7]], [[0.0], [0.5]]),
    ],
)
def test_plants_agree_with_scipy_under_a_held_input(plant, a, b):
    """scipy discretises dx/dt = a·x + b·u by a matrix exponential; PV is the first element of x."""
    dt_s, size = 0.25, len(b)
    inputs = np.random.default_rng(7).normal(size=200).tolist()
    ad, bd, *_ = signal.cont2discrete((np.array(a), np.array(b), np.eye(1, size), np.zeros((1, 1))), dt_s, "zoh")
    x, reference = np.zeros((size, 1)), []
    for u in inputs:
        x = ad @ x + bd * u
        reference.append(float(x[0, 0]))
    assert run(plant, inputs, dt_s) == pytest.approx(reference, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("plant", [Fopdt(1.0, 1.0), Integrating(1.0), Sopdt(1.0, 1.0, 2.0)])
def test_no_time_changes_nothing_and_the_state_is_kept_by_the_caller(plant):
    rest = plant.rest()
    after, y = plant.step(rest, 5.0, 0.0)
    assert y == plant.output(rest) == plant.output(after)
    assert plant.step(rest, 5.0, 1.0) == plant.step(rest, 5.0, 1.0)


@pytest.mark.parametrize(("u", "dt_s"), [(nan, 1.0), (1.0, -1.0)])
def test_a_step_backwards_or_on_no_number_is_a_bug(u, dt_s):
    with pytest.raises(ValueError, match="steps forward"):
        Fopdt(1.0, 1.0).step(Fopdt(1.0, 1.0).rest(), u, dt_s)


@pytest.mark.parametrize(
    "make",
    [
        lambda: Fopdt(1.0, 0.0),
        lambda: Fopdt(1.0, nan),
        lambda: Fopdt(1.0, 1.0, -0.1),
        lambda: Sopdt(1.0, 1.0, 0.0),
        lambda: Integrating(1.0, initial=5.0, maximum=4.0),
        lambda: Integrating(1.0, dead_time_s=-inf),
        lambda: Tank(1.0, outflow=-0.1),
        lambda: Tank(1.0, outflow=0.1, initial=5.0, full=4.0),
    ],
)
def test_a_plant_that_cannot_be_is_refused(make):
    with pytest.raises(ValueError):
        make()


def test_a_tank_agrees_with_scipys_integrator_filling_emptying_and_near_its_balance():
    """dh/dt = 0.02·u − 0.4·√h; its balance at u = 60 lies at h = 9."""
    tank, inputs = Tank(gain=0.02, outflow=0.4, initial=4.0), [60.0] * 8 + [0.0] * 3 + [120.0] * 6 + [59.0] * 3
    h, reference = 4.0, []
    for u in inputs:
        found = integrate.solve_ivp(
            lambda _, y, u=u: 0.02 * u - 0.4 * np.sqrt(np.maximum(y, 0.0)), (0.0, 5.0), [h],
            method="DOP853", rtol=1e-12, atol=1e-14,
        )  # fmt: skip
        h = float(found.y[0, -1])
        reference.append(h)
    assert run(tank, inputs, 5.0) == pytest.approx(reference, rel=1e-9)


def test_a_tank_is_the_same_in_one_step_and_in_many():
    once = run(Tank(gain=0.02, outflow=0.4, dead_time_s=1.3, initial=4.0), [80.0], 7.0)[-1]
    often = run(Tank(gain=0.02, outflow=0.4, dead_time_s=1.3, initial=4.0), [80.0] * 700, 0.01)[-1]
    assert often == pytest.approx(once, rel=1e-11)


def test_a_tank_runs_dry_in_the_time_that_torricelli_gives_and_stays_so():
    # √h falls evenly by c/2 per second: from 4 to 0 in 2·2/0.4 = 10 s, to 1 in 5 s.
    assert run(Tank(gain=1.0, outflow=0.4, initial=4.0), [0.0, 0.0, 0.0], 5.0) == [pytest.approx(1.0), 0.0, 0.0]
    assert run(Tank(gain=1.0, outflow=0.4, bias=-1.0, initial=4.0), [0.0], 60.0) == [0.0]
    assert run(Tank(gain=1.0, outflow=0.4, bias=-1.0), [0.0], 1.0) == [0.0]


def test_a_tank_overflows_at_full_and_fills_from_empty_towards_its_balance():
    assert run(Tank(gain=1.0, outflow=0.4, full=6.0), [5.0], 60.0) == [6.0]
    assert run(Tank(gain=0.02, outflow=0.4), [60.0], 1e4) == [pytest.approx(9.0, rel=1e-12)]
