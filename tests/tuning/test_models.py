"""Models against closed forms, the plants, and each other."""

from __future__ import annotations

from math import e, pi

import numpy as np
import pytest
from tuning_data import doublet

from ahgateway.plants.second_order import SecondOrder
from ahgateway.plants.sopdt import Sopdt
from ahgateway.tuning.fit import driven
from ahgateway.tuning.models import Kind, Model

MODELS = [
    Model(Kind.FOPDT, 1.5, 4.3, 20.0),
    Model(Kind.FOPDT, -2.0, 0.0, 3.0),
    Model(Kind.SOPDT, 1.5, 2.1, 6.0, 0.5),
    Model(Kind.SOPDT, 1.5, 0.25, 6.0, 1.0),
    Model(Kind.SOPDT, 1.5, 2.0, 6.0, 2.5),
    Model(Kind.IPDT, 0.02, 3.2),
]


@pytest.mark.parametrize("model", MODELS)
def test_pulse_transfer_function_equals_the_plant_at_every_sample(model):
    record = doublet(model, noise=0.0)
    assert driven(model, record.mv - 40.0, 0.5) + 50.0 == pytest.approx(record.pv, abs=1e-9)


@pytest.mark.parametrize("model", MODELS)
def test_sampled_response_approaches_the_continuous_one_times_the_hold(model):
    omega = np.array([0.01, 0.05, 0.2])
    ts = 0.001
    hold = np.exp(-0.5j * omega * ts)
    assert model.pulse(ts).response(omega) == pytest.approx(model.response(omega) * hold, rel=1e-4)


def test_step_responses_in_closed_form():
    assert Model(Kind.FOPDT, 2.0, 0.0, 10.0).step_response(10.0) == pytest.approx(2.0 * (1 - 1 / e), abs=1e-12)
    assert Model(Kind.SOPDT, 1.0, 0.0, 2.0, 1.0).step_response(2.0) == pytest.approx(1 - 2 / e, abs=1e-12)
    assert Model(Kind.IPDT, 0.5).step_response(4.0) == 2.0
    # ζ = 0.5: first overshoot e^(−πζ/√(1−ζ²)) = e^(−1.8138) at t = π·τ/√(1−ζ²).
    peak = Model(Kind.SOPDT, 1.0, 0.0, 1.0, 0.5).step_response(pi / 0.75**0.5)
    assert peak == pytest.approx(1.0 + e**-1.813799364, abs=1e-9)


def test_second_order_plant_with_two_real_lags_is_the_two_lag_plant():
    """Lags 5 s and 1.5 s: τ = √7.5, ζ = 6.5/(2√7.5)."""
    left, right = SecondOrder(2.0, 7.5**0.5, 3.25 / 7.5**0.5, 1.3), Sopdt(2.0, 5.0, 1.5, 1.3)
    a, b = left.rest(), right.rest()
    for index in range(200):
        a, y = left.step(a, float(index % 17), 0.25)
        b, z = right.step(b, float(index % 17), 0.25)
        assert y == pytest.approx(z, abs=1e-9)


def test_half_rule_gives_half_of_the_second_lag_to_each():
    """Skogestad 2003: τ1 = 6 + 2/2, θ = 1 + 2/2 for lags 6 and 2."""
    found = Model(Kind.SOPDT, 3.0, 1.0, 12.0**0.5, 4.0 / 12.0**0.5).half_rule()
    assert (3.0, pytest.approx(7.0), pytest.approx(2.0)) == (found.gain, found.tau_s, found.dead_time_s)


def test_a_plant_that_cannot_be_second_order_is_refused():
    with pytest.raises(ValueError, match="zeta"):
        SecondOrder(1.0, 1.0, 0.0)
