"""Identification against known processes, and every refusal demonstrated on a record that deserves it."""

from __future__ import annotations

import numpy as np
import pytest
from tuning_data import answered, closed, doublet

from ahgateway.errors import ProfileError
from ahgateway.tuning.findings import Weight
from ahgateway.tuning.identify import identify
from ahgateway.tuning.models import Kind, Model
from ahgateway.tuning.noise import noise, resolution, whiteness
from ahgateway.tuning.record import Record, checked, even
from ahgateway.tuning.valve import backlash, stiction

FIRST = Model(Kind.FOPDT, 1.5, 4.3, 20.0)


def names(found, weight=Weight.REFUSED):
    return [each.name for each in found.findings if each.weight is weight]


@pytest.mark.parametrize(
    "model",
    [
        FIRST,
        Model(Kind.FOPDT, -0.8, 1.2, 12.0),
        Model(Kind.SOPDT, 1.5, 2.1, 6.0, 0.5),
        Model(Kind.SOPDT, 1.5, 2.1, 6.0, 1.5),
        Model(Kind.IPDT, 0.02, 3.0),
    ],
)
def test_the_right_model_is_chosen_and_its_parameters_found(model):
    found = identify(doublet(model))
    assert [] == names(found)
    fit = found.fit
    assert model.kind is fit.model.kind
    assert fit.model.gain == pytest.approx(model.gain, rel=0.02)
    assert fit.model.dead_time_s == pytest.approx(model.dead_time_s, abs=0.3)
    if model.kind is not Kind.IPDT:
        assert fit.model.tau_s == pytest.approx(model.tau_s, rel=0.03)
    if model.kind is Kind.SOPDT:
        assert fit.model.zeta == pytest.approx(model.zeta, rel=0.06)
    assert fit.spread == pytest.approx(0.05, rel=0.15)
    assert found.noise == pytest.approx(0.05, rel=0.2)


def test_a_process_that_does_not_start_at_rest_is_found_all_the_same():
    record = doublet(FIRST)
    cut = slice(100, None)  # 12 s after the first step: PV is on its way
    found = identify(Record(record.t_s[cut], record.sv[cut], record.pv[cut], record.mv[cut]))
    assert found.fit.model.gain == pytest.approx(1.5, rel=0.02)
    assert found.fit.model.tau_s == pytest.approx(20.0, rel=0.05)


def test_closed_loop_data_with_a_wandering_load_need_and_get_a_noise_model():
    found = identify(closed(FIRST, {"Kc_Kp": 1.0, "Ti_Ki": 25.0, "Td_Kd": 0.0}, slow=0.03))
    assert found.fit.noise_model is not None
    assert [] == names(found)
    assert found.fit.model.gain == pytest.approx(1.5, rel=0.1)
    assert found.fit.model.dead_time_s == pytest.approx(4.3, abs=1.0)


def test_a_quantised_pv_is_recognised_and_used():
    found = identify(doublet(FIRST, quantum=0.25))
    assert found.resolution == pytest.approx(0.25)
    assert ["quantised"] == names(found, Weight.NOTE)
    assert found.fit.model.gain == pytest.approx(1.5, rel=0.03)


def test_samples_at_uneven_times_are_brought_onto_a_grid():
    record = doublet(FIRST)
    kept = np.sort(np.random.default_rng(3).permutation(record.t_s.size)[:450])
    found = identify(Record(record.t_s[kept], record.sv[kept], record.pv[kept], record.mv[kept]))
    assert "uneven" in names(found, Weight.NOTE)
    assert found.fit.model.gain == pytest.approx(1.5, rel=0.03)


def test_noise_above_the_floor_is_refused_with_the_ratio_and_a_step_that_would_do():
    found = identify(doublet(FIRST, noise=5.0))
    assert "noisy" in names(found)
    text = next(each for each in found.findings if each.name == "noisy")
    assert "at least 5 is needed" in text.text
    assert "times as large" in text.hint


def test_mv_that_stands_still_is_refused():
    record = doublet(FIRST)
    found = identify(Record(record.t_s, record.sv, record.pv, np.full(600, 40.0)))
    assert ["not-excited"] == names(found)
    assert found.fit is None


def test_feedback_alone_is_no_excitation():
    found = identify(closed(FIRST, {"Kc_Kp": 1.0, "Ti_Ki": 25.0, "Td_Kd": 0.0}, sv_step=0.0))
    assert ["not-excited"] == names(found)
    assert "feedback alone" in found.findings[0].text


def test_mv_at_its_limit_is_refused_with_the_share():
    mv = np.full(600, 40.0)
    mv[100:400] = 100.0
    record = answered(FIRST, mv)
    found = identify(Record(record.t_s, record.sv, record.pv, record.mv, "test", (0.0, 100.0)))
    assert ["saturated"] == names(found)
    assert "50 % of the samples" in found.findings[0].text


def test_a_pv_at_the_end_of_its_range_is_refused():
    record = doublet(FIRST)
    found = identify(Record(record.t_s, record.sv, np.minimum(record.pv, 53.0), record.mv))
    assert ["saturated"] == names(found)
    assert "its extreme 53" in found.findings[0].text


def test_a_drift_as_large_as_the_answer_is_refused():
    found = identify(doublet(FIRST, drift=20.0))
    assert "drifting" in names(found)


def test_a_pv_that_does_not_follow_is_a_stuck_valve():
    mv = doublet(FIRST).mv
    found = identify(answered(FIRST, mv, position=np.full(600, 40.0)))
    assert ["stuck-valve"] == names(found)


@pytest.mark.parametrize(("shape", "name"), [(backlash, "backlash"), (stiction, "stiction")])
def test_a_worn_valve_is_named_and_gains_are_not_proposed(shape, name):
    steps = np.repeat([0, 2, 4, 6, 4, 2, 0, -2, 0, 3, -1, 0], 60)
    mv = 40.0 + steps.astype(float)
    found = identify(answered(FIRST, mv, position=shape(mv, 2.5)))
    assert set(names(found)) <= {"backlash", "stiction"}
    assert name in names(found)
    assert "fix the valve" in next(each for each in found.findings if each.name == name).hint


def test_play_of_a_valve_that_was_opened_last_is_backlash_and_no_second_gain():
    """Up it follows at once, down it lacks its play; a doublet alone could be two gains, a second one could not."""
    mv = 40.0 + np.repeat([0.0, 8.0, -8.0, 0.0, 6.0, -3.0, 0.0], [60, 90, 90, 90, 90, 90, 90])
    found = identify(answered(FIRST, mv, position=backlash(mv, 4.0, -0.5)))
    assert ["backlash"] == names(found)
    assert "about 4 in MV" in next(each.text for each in found.findings if each.name == "backlash")


def test_a_gap_in_which_mv_moved_is_refused_and_one_without_is_not():
    record = doublet(FIRST)
    move = int(np.flatnonzero(np.diff(record.mv))[1])

    def without(first, last):
        kept = np.r_[:first, last : record.t_s.size]
        return Record(*(values[kept] for values in (record.t_s, record.sv, record.pv, record.mv)))

    found = identify(without(move - 10, move + 10))
    assert ["gap"] == names(found)
    assert "10.5 s are missing from" in next(each.text for each in found.findings if each.name == "gap")
    assert not identify(without(20, 40)).is_refused


def test_a_gain_that_depends_on_the_direction_is_stated():
    mv = doublet(FIRST, count=800).mv
    half = np.where(mv > 40.0, 40.0 + 2.0 * (mv - 40.0), mv)
    mv[500:700] = 35.0
    half[500:700] = 35.0
    found = identify(answered(FIRST, mv, position=half))
    assert "direction-gain" in names(found, Weight.WARNING)


def test_resolution_is_none_for_a_continuous_signal():
    assert 0.0 == resolution(np.random.default_rng(1).normal(size=300))
    assert 0.1 == pytest.approx(resolution(np.array([1.0, 1.1, 1.3, 1.1, 1.0] * 10)))


def test_noise_is_found_beside_steps():
    rng = np.random.default_rng(2)
    pv = np.repeat([0.0, 100.0, -50.0], 500) + 0.3 * rng.standard_normal(1500)
    assert noise(pv) == pytest.approx(0.3, rel=0.1)


def test_whiteness_acquits_white_noise_and_convicts_a_slow_one():
    rng = np.random.default_rng(4)
    white = rng.standard_normal(500)
    assert whiteness(white, 0).is_white
    assert not whiteness(np.convolve(white, [1.0, 0.8, 0.6], "valid"), 0).is_white


def test_backlash_and_stiction_by_hand():
    mv = np.array([0.0, 1.0, 3.0, 3.0, 2.0, 0.0])
    assert [0.0, 0.0, 2.0, 2.0, 2.0, 1.0] == backlash(mv, 2.0).tolist()
    assert [0.0, 0.0, 3.0, 3.0, 3.0, 0.0] == stiction(mv, 2.0).tolist()


def test_even_holds_mv_and_draws_pv_straight():
    t = np.concatenate([np.arange(25.0), [26.0]])
    record = Record(t, t * 0, t * 2, np.where(t < 24.5, 1.0, 9.0))
    found = even(record)
    assert 27 == found.t_s.size
    assert [48.0, 50.0, 52.0] == found.pv[-3:].tolist()
    assert [1.0, 1.0, 9.0] == found.mv[-3:].tolist()


def test_time_that_runs_backwards_and_too_few_samples_are_errors():
    t = np.arange(30.0)
    t[10] = 3.0
    with pytest.raises(ProfileError, match="time does not rise: 9 s is followed by 3 s"):
        checked(Record(t, t, t, t))
    with pytest.raises(ProfileError, match="holds 5 samples"):
        checked(Record(t[:5], t[:5], t[:5], t[:5]))
