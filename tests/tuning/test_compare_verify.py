"""Gains compared on one run, and predicted against measured: numbers worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest
from tuning_data import closed

from ahgateway.tuning.blocks import BLOCKS
from ahgateway.tuning.compare import compare
from ahgateway.tuning.models import Kind, Model
from ahgateway.tuning.record import Record
from ahgateway.tuning.runner import delta
from ahgateway.tuning.verify import Predictor, fit_late, fit_percent, tube

MODEL = Model(Kind.FOPDT, 1.5, 4.0, 20.0)
GAINS = {"CYCLE": 500, "PID_EQ": True, "Kc_Kp": 1.0, "Ti_Ki": 25.0, "Td_Kd": 0.0}
ALONE = {"Ti_Ki": 0.0, "BIAS": 40.0}


def settings(**changes):
    return BLOCKS["DPIDE"].settings(GAINS | changes)


def test_a_proportional_law_that_is_twice_as_strong_answers_an_error_of_two_with_two_more():
    """P alone: MV = 40 + Kc·E with E = 2 in half of the executions, so that rms is √2 for Kc 1 → 2."""
    t = np.arange(20) * 0.5
    pv = np.where(np.arange(20) < 10, 50.0, 48.0)
    record = Record(t, np.full(20, 50.0), pv, np.full(20, 40.0))
    found = compare(record, "DPIDE", settings(**ALONE), settings(**ALONE, Kc_Kp=2.0))
    assert [40.0] * 10 + [42.0] * 10 == found.old.tolist()
    assert [40.0] * 10 + [44.0] * 10 == found.new.tolist()
    assert 2.0**0.5 == pytest.approx(found.difference)
    assert (2.0, (2.0, 4.0)) == (found.largest, found.travel)


def test_the_gains_that_ran_give_back_the_recorded_mv():
    record = closed(MODEL, {"Kc_Kp": 1.0, "Ti_Ki": 25.0, "Td_Kd": 0.0})
    found = compare(record, "DPIDE", settings(), settings(Kc_Kp=1.5))
    assert found.recorded == pytest.approx(found.old, abs=1e-4)
    assert found.difference > 0.1


def test_without_sv_nothing_is_compared():
    t = np.arange(20) * 0.5
    record = Record(t, np.full(20, np.nan), t, t)
    assert compare(record, "DPIDE", settings(), settings()) is None


def test_a_predictor_advanced_in_pieces_stands_where_the_loop_stood():
    record = closed(MODEL, {"Kc_Kp": 1.0, "Ti_Ki": 25.0, "Td_Kd": 0.0}, noise=0.0)
    beside = Predictor(delta("DPIDE", settings(), 50.0, 50.0, 40.0), MODEL, (50.0, 40.0))
    # SV of a row belongs to the execution at that row, which runs on the way to the next.
    rows = [beside.until(t + 0.5, sv)[0] for t, sv in zip(record.t_s, record.sv, strict=True)]
    assert record.pv[1:].tolist() == rows[:-1]
    between = Predictor(delta("DPIDE", settings(), 50.0, 50.0, 40.0), MODEL, (50.0, 40.0))
    between.until(6.0, 55.0)
    low, high = between.until(6.5, 55.0)[0], between.until(7.0, 55.0)[0]
    assert (low + high) / 2.0 == pytest.approx(between_half(6.75))


def between_half(t_s):
    fresh = Predictor(delta("DPIDE", settings(), 50.0, 50.0, 40.0), MODEL, (50.0, 40.0))
    return fresh.until(t_s, 55.0)[0]


def test_the_fit_is_100_for_equal_0_for_the_mean_and_worse_below():
    y = np.array([0.0, 0.0, 2.0, 2.0])
    assert 100.0 == fit_percent(y, y)
    assert 0.0 == fit_percent(y, np.ones(4))
    assert 50.0 == fit_percent(y, np.array([0.5, 0.5, 1.5, 1.5]))
    assert -100.0 == fit_percent(y, 2.0 - y)


def test_a_course_that_comes_up_to_three_samples_late_fits_and_one_that_comes_early_does_not():
    y = np.array([0.0, 0.0, 0.0, 0.0, 1.0, 2.0, 3.0, 3.0, 3.0, 3.0])
    assert 100.0 == fit_late(y, np.roll(y, -3))
    assert fit_late(y, np.roll(y, -5)) < 60.0
    assert fit_late(y, np.concatenate([[0.0, 0.0], y[:-2]])) < 60.0


def test_the_tube_is_half_the_step_or_what_noise_and_resolution_ask_for():
    assert (2.0, 4.0, 8.0) == (tube(-4.0, 0.1, 0.1), tube(4.0, 0.5, 0.1), tube(4.0, 0.5, 2.0))
