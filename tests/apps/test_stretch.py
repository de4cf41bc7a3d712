"""What may be left out of a picture of a stretch of time, worked out on squared paper."""

from __future__ import annotations

import numpy as np
import pytest

from ahgateway.apps.marks import Mark
from ahgateway.apps.stretch import Stretch, joined, runs, thinned

NAN = float("nan")
NONE = np.zeros((0, 0))


def stretch(pv, *, mark=None, lanes=None, t_s=None) -> Stretch:
    """PV as given, everything else level; one sample a second unless times are given."""
    values = np.asarray(pv, float)
    level = np.zeros(values.size)
    return Stretch(
        np.arange(values.size, dtype=float) if t_s is None else np.asarray(t_s, float),
        np.array([level, values, level, level]),
        np.asarray(mark, float) if mark is not None else np.ones(values.size),
        np.asarray(lanes, float) if lanes is not None else np.zeros((0, values.size)),
    )


def test_few_samples_come_back_as_they_are():
    whole = stretch([1, 2, 3, 4])
    assert whole is thinned(whole, 0.0, 4.0, 1)


def test_first_last_lowest_and_highest_of_each_slice_stay():
    found = thinned(stretch([5, 1, 5, 5, 9, 5, 5, 5, 5, 5, 2, 7, 5, 5]), 0.0, 14.0, 2)
    # Slices 0…6 and 7…13: ends, the lowest at 1 and 10, the highest at 4 and 11; SV, MV are level: their first.
    assert [0.0, 1.0, 4.0, 6.0, 7.0, 10.0, 11.0, 13.0] == found.t_s.tolist()
    assert [5.0, 1.0, 9.0, 5.0, 5.0, 2.0, 7.0, 5.0] == found.curve("pv").tolist()
    assert not found.is_whole


def test_the_worst_mark_of_a_slice_is_that_of_all_its_samples():
    mark = [Mark.PROVEN] * 20
    mark[3] = Mark.DIVERGED
    mark[12] = Mark.TRIVIAL
    found = thinned(stretch([0.0] * 20, mark=mark), 0.0, 20.0, 2)
    assert [(0.0, 10.0, 6), (10.0, 19.0, 2)] == runs(found)


def test_a_gap_stays_one():
    pv = [1.0] * 20
    pv[7] = NAN
    found = thinned(stretch(pv), 0.0, 20.0, 1)
    assert [0.0, 7.0, 19.0] == found.t_s.tolist()
    assert np.isnan(found.curve("pv")[1])


def test_a_short_pulse_is_not_lost():
    lane = np.zeros((1, 30))
    lane[0, 17] = 1.0
    found = thinned(stretch([0.0] * 30, lanes=lane), 0.0, 30.0, 1)
    assert 17.0 in found.t_s
    assert 1.0 == found.lanes[0].max()


def test_samples_outside_the_time_belong_to_the_slices_at_its_edges():
    found = thinned(stretch([1, 2, 9, 2, 1, 1, 1, 1, 1, 1]), 4.0, 6.0, 1)
    assert [0.0, 2.0, 9.0] == found.t_s.tolist()


@pytest.mark.parametrize(("since_s", "until_s", "slices"), [(0.0, 0.0, 10), (1.0, 0.0, 10), (0.0, 1.0, 0)])
def test_no_time_and_no_slices_are_refused(since_s, until_s, slices):
    with pytest.raises(ValueError, match="slices"):
        thinned(stretch([1, 2]), since_s, until_s, slices)


def test_a_moment_without_a_verdict_belongs_to_the_run_before():
    marks = [Mark.NONE, Mark.PROVEN, Mark.NONE, Mark.PROVEN, Mark.DIVERGED, Mark.NONE]
    assert [(1.0, 4.0, 2), (4.0, 5.0, 6)] == runs(stretch([0.0] * 6, mark=marks))
    assert [] == runs(stretch([0.0], mark=[Mark.NONE]))


def test_stretches_stand_one_behind_the_other():
    both = joined([stretch([1, 2]), stretch([3], t_s=[9.0])], 0)
    assert [0.0, 1.0, 9.0] == both.t_s.tolist()
    assert [1.0, 2.0, 3.0] == both.curve("pv").tolist()
    assert (5, 0) == joined([], 5).lanes.shape


def test_every_point_of_a_thinned_stretch_was_seen():
    rng = np.random.default_rng(4)
    whole = stretch(rng.normal(size=5000))
    found = thinned(whole, 0.0, 5000.0, 50)
    assert found.t_s.size <= 50 * 11
    assert whole.curve("pv")[found.t_s.astype(int)].tolist() == found.curve("pv").tolist()
    for first in range(0, 5000, 100):
        inside = (found.t_s >= first) & (found.t_s < first + 100)
        assert whole.curve("pv")[first : first + 100].max() == found.curve("pv")[inside].max()
        assert whole.curve("pv")[first : first + 100].min() == found.curve("pv")[inside].min()
