"""Loop health on data whose figures are known without any code."""

from __future__ import annotations

import dataclasses
import math
from concurrent.futures import Executor, Future

import numpy as np
import pytest

from ahgateway.apps.health import Window, health, label, oscillation_of, stiction_of
from ahgateway.apps.health_process import Learner, PlantResidual, Process, learned, part, plant_residual, statement
from ahgateway.core.verdict import Counts
from ahgateway.plants.base import DelayLine
from ahgateway.plants.fopdt import Fopdt
from ahgateway.tuning.models import Kind, Model
from ahgateway.tuning.valve import stiction

PROVEN = Counts(informative=100)


def window(pv, mv=None, sv=0.0, t_s=None, auto=True, low=0.0, high=100.0) -> Window:
    """Samples a second apart unless said otherwise."""
    pv = np.asarray(pv, float)
    full = np.ones(pv.size)
    return Window(
        t_s=np.arange(float(pv.size)) if t_s is None else np.asarray(t_s, float),
        sv=sv * full,
        pv=pv,
        mv=50.0 * full if mv is None else np.asarray(mv, float),
        auto=np.broadcast_to(np.asarray(auto, bool), pv.shape),
        mv_min=low * full,
        mv_max=high * full,
    )


def swing(amplitude, period_s, count=600, phase=0.0):
    return amplitude * np.sin(2.0 * np.pi * np.arange(count) / period_s + phase)


def test_nothing_is_said_of_19_samples_and_something_of_20():
    assert health(window(np.zeros(19))) is None
    assert health(window(np.zeros(20))) is not None


def test_shares_of_time_hold_each_sample_until_the_next():
    # 20 samples: 10 of them 1 s apart, then 10 that are 3 s apart; 10 s + 27 s.
    t_s = [*range(11), *range(13, 38, 3)]
    auto = [True] * 10 + [False] * 10
    mv = [0.0] * 5 + [50.0] * 5 + [100.0] * 10
    found = health(window(np.zeros(20), mv, t_s=t_s, auto=auto))
    assert 20 == found.samples
    assert 37.0 == found.duration_s
    assert 10.0 / 37.0 == pytest.approx(found.auto_share)
    assert 5.0 / 37.0 == pytest.approx(found.low_share)
    assert 27.0 / 37.0 == pytest.approx(found.high_share)


def test_iae_counts_the_time_in_automatic_only():
    # |E| is 2 all the time; 10 of 20 s are automatic.
    found = health(window(np.full(21, -2.0), auto=[True] * 10 + [False] * 11))
    assert 20.0 == found.iae
    assert 2.0 == found.error_mean_abs
    assert 0.0 == found.error_std


def test_variability_is_two_sigma_by_the_mean_and_nothing_at_mean_nought():
    # 9, 11, 9, 11 …: mean 10, standard deviation 1.
    assert 20.0 == health(window([9.0, 11.0] * 10)).variability
    assert health(window([-1.0, 1.0] * 10)).variability is None


def test_travel_and_reversals_of_mv_are_counted_by_hand():
    # up 3, stands, up 1, down 2, down 2, up 4, then rests: travel 12, two turns; in 22 s, so 12 * 3600 / 22 an hour.
    mv = [50, 53, 53, 54, 52, 50, 54] + [54] * 16
    found = health(window(np.zeros(23), mv))
    assert 12.0 == found.mv_travel
    assert 12.0 * 3600.0 / 22.0 == pytest.approx(found.mv_travel_per_h)
    assert 2 == found.reversals


@pytest.mark.parametrize("period_s", [8.0, 25.0, 61.0])
def test_a_sine_shows_its_period_amplitude_and_regularity(period_s):
    found = oscillation_of(window(swing(3.0, period_s)))
    assert period_s == pytest.approx(found.period_s, rel=0.01)
    assert 3.0 == pytest.approx(found.amplitude, rel=0.02)
    assert found.regularity > 5.0
    assert found.is_one


def test_noise_hides_neither_period_nor_amplitude():
    noisy = swing(3.0, 25.0) + np.random.default_rng(7).normal(0.0, 1.0, 600)
    found = oscillation_of(window(noisy))
    assert 25.0 == pytest.approx(found.period_s, rel=0.02)
    assert 3.0 == pytest.approx(found.amplitude, rel=0.05)
    # A sine of amplitude 3 has variance 4.5; the noise adds 1.
    assert 4.5 / 5.5 == pytest.approx(found.strength, abs=0.05)


def test_samples_at_uneven_times_show_the_same_period():
    t_s = np.sort(np.random.default_rng(3).uniform(0.0, 600.0, 1200))
    assert 40.0 == pytest.approx(oscillation_of(window(np.sin(2 * np.pi * t_s / 40.0), t_s=t_s)).period_s, rel=0.02)


@pytest.mark.parametrize("seed", range(5))
def test_white_noise_and_a_random_walk_are_no_oscillation(seed):
    noise = np.random.default_rng(seed).normal(0.0, 1.0, 600)
    assert not health(window(noise)).oscillates
    assert not health(window(np.cumsum(noise))).oscillates


def test_a_loop_at_rest_has_no_oscillation():
    assert oscillation_of(window(np.full(100, 5.0))) is None


def test_a_flicker_of_one_resolution_step_is_no_oscillation():
    assert not health(window([5.0, 5.0, 5.1, 5.1] * 50)).oscillates


def test_a_triangle_in_mv_and_a_square_in_pv_are_odd_so_the_valve_sticks():
    quarter = np.arange(600) % 40
    triangle = 50.0 + np.where(quarter < 20, quarter, 40 - quarter)
    square = np.where(quarter < 20, 1.0, -1.0)
    found = stiction_of(window(square, triangle))
    assert "stiction" == found.says
    # The square changes half a sample late: 0.5 of the 10 samples to the extremum, where the curve is steepest.
    assert 1.0 == pytest.approx(found.lag_skew, abs=0.06)
    assert 0.9 / 1.1 == pytest.approx(found.size_skew, abs=0.01)


def test_sines_in_opposite_phase_are_even_so_nothing_sticks():
    found = stiction_of(window(swing(1.0, 40.0), 50.0 - swing(2.0, 40.0)))
    assert "none" == found.says
    assert 0.0 == pytest.approx(found.lag_skew, abs=0.01)
    assert 0.0 == pytest.approx(found.size_skew, abs=0.01)


def test_horchs_measures_of_a_known_phase():
    # cos(ωτ + 60°): zeros at τ = 30° and −150°, so skew 120 / 180; between them the extremum is 1, lag 0 is cos 60°.
    found = stiction_of(window(swing(1.0, 360.0, 7200, phase=np.pi / 3), swing(1.0, 360.0, 7200)))
    assert 120 / 180 == pytest.approx(found.lag_skew, abs=0.02)
    assert 0.5 / 1.5 == pytest.approx(found.size_skew, abs=0.02)


def test_noise_and_resolution_of_pv_come_back():
    rng = np.random.default_rng(1)
    found = health(window(swing(5.0, 100.0) + rng.normal(0.0, 0.2, 600)))
    assert 0.2 == pytest.approx(found.noise, rel=0.15)
    assert 0.0 == found.resolution
    assert 0.25 == health(window(np.round(swing(5.0, 100.0) / 0.25) * 0.25)).resolution


def worked_loop(play: float, *, gain: float = 1.2, since: int = 0, count: int = 1200) -> Window:
    """A first-order process at rest for a while, then moved by MV; from a sample on it is another one, or sticks."""
    rng = np.random.default_rng(5)
    mv = 50.0 + np.repeat(np.cumsum(rng.normal(0.0, 1.5, count // 20)), 20)
    valve = np.where(np.arange(count) < since, mv, 50.0 + gain / 1.2 * (stiction(mv, play) - 50.0))
    plant = Fopdt(gain=1.2, tau_s=12.0, dead_time_s=2.0, bias=7.0, initial=67.0)
    state = plant.rest()._replace(line=DelayLine(0.0, 50.0, 50.0))
    pv = [plant.output(state)]
    # A sample shows the MV that came since the sample before it.
    for position in valve[1:].tolist():
        state, value = plant.step(state, position, 1.0)
        pv.append(value)
    sv = 60.0 + np.repeat([0.0, 1.0], count // 2)
    return window(np.asarray(pv) + rng.normal(0.0, 0.05, count), mv, sv=sv)


KNOWN = Process(Model(Kind.FOPDT, 1.2, 1.5, 12.0), 0.05, 0.02, -1.0)
"""MV is taken to move in the middle between two samples, and here it moved at the first: 0.5 s less dead time."""


class Inline(Executor):
    """Does it at once."""

    def submit(self, work, /, *given):
        done = Future()
        done.set_result(work(*given))
        return done


def test_a_plant_that_answers_as_its_model_leaves_only_noise():
    residual = plant_residual(worked_loop(0.0), KNOWN)
    assert 0.05 == pytest.approx(residual.rms, rel=0.25)
    assert residual.is_nought


def test_only_the_shadow_can_say_valve_or_process_do_not_retune():
    sticking = worked_loop(8.0)
    residual = plant_residual(sticking, KNOWN)
    assert not residual.is_nought
    said = statement(health(sticking), PROVEN, residual)
    assert "valve-or-process" == said.name
    assert "valve or process, do not retune" in said.text
    # Nothing was compared, or only a loop at rest: nobody knows whether the controller is right.
    assert statement(health(sticking), Counts(), residual) is None
    assert statement(health(sticking), Counts(trivial=100), residual) is None


@pytest.mark.parametrize(("play", "gain"), [(8.0, 1.2), (0.0, 0.7)])
def test_a_fault_that_comes_later_is_seen_by_a_model_that_nobody_handed_in(play, gain):
    """The first 400 samples are in order; then the valve sticks, or the process loses nearly half of its gain."""
    whole, learner = worked_loop(play, gain=gain, since=400), Learner(Inline())
    assert None is learner.look(first(whole, 299))
    assert None is learner.look(first(whole, 350))
    assert learner.look(first(whole, 399)).is_nought
    assert 1.2 == pytest.approx(learner.known.model.gain, rel=0.05)
    assert 12.0 == pytest.approx(learner.known.model.tau_s, rel=0.1)
    residual = learner.look(whole)
    assert residual.ratio > 5.0
    said = statement(health(whole), PROVEN, residual)
    assert ("valve-or-process", True) == (said.name, "do not retune" in said.text)


def test_a_process_that_stays_in_order_is_never_blamed():
    whole, learner = worked_loop(0.0), Learner(Inline())
    for count in (350, 400, 600, 900, 1200):
        residual = learner.look(first(whole, count))
        assert residual is None or residual.is_nought
    assert residual is not None


def test_data_that_show_no_process_are_asked_again_at_twice_their_length():
    still = window(50.0 + np.random.default_rng(1).normal(0.0, 0.1, 1200))
    asked = []

    class Counting(Inline):
        def submit(self, work, /, *given):
            asked.append(given[0].t_s.size)
            return super().submit(work, *given)

    learner = Learner(Counting())
    for count in range(300, 1201, 50):
        assert None is learner.look(first(still, count))
    assert [300, 600, 1200] == [round(size, -2) for size in asked]
    assert None is learned(first(still, 10))


def first(whole: Window, count: int) -> Window:
    return dataclasses.replace(whole, **{name: getattr(whole, name)[:count] for name in Window.__dataclass_fields__})


def test_a_part_of_a_window_is_its_samples_from_one_on():
    assert [8.0, 9.0] == part(window(np.arange(10.0)), -2).pv.tolist()


def test_a_controller_that_diverged_is_blamed_first():
    bad = Counts(informative=99, diverged=1)
    assert "controller" == statement(health(worked_loop(2.0)), bad, PlantResidual(1.0, 20.0)).name


def test_a_swing_without_a_model_is_not_called_a_valve():
    swinging = window(swing(3.0, 40.0), 50.0 - swing(2.0, 40.0))
    assert "oscillation" == statement(health(swinging), PROVEN).name
    assert statement(health(window(np.full(100, 5.0))), PROVEN) is None


def test_the_odd_swing_of_a_sticking_valve_is_named_without_a_model():
    quarter = np.arange(600) % 40
    odd = window(np.tanh(swing(4.0, 40.0)), 50.0 + np.where(quarter < 20, quarter, 40 - quarter))
    assert "valve-or-process" == statement(health(odd), PROVEN).name


def test_a_residual_is_judged_by_three_times_the_noise():
    assert PlantResidual(1.0, math.nextafter(3.0, 0.0)).is_nought
    assert not PlantResidual(1.0, 3.0).is_nought


@pytest.mark.parametrize(
    ("words", "samples"),
    [
        ("-", window(np.zeros(5))),
        ("swings 40 s", window(swing(3.0, 40.0), 50.0 - swing(2.0, 40.0))),
        ("at limit 100%", window(np.zeros(30), np.full(30, 100.0))),
        ("auto 0%", window(np.zeros(30), auto=False)),
        ("steady", window(np.zeros(30))),
    ],
)
def test_a_table_names_the_worst_figure(words, samples):
    assert words == label(health(samples))
