"""Moves of MV that samples only bound: the middle is taken, and large moves are put where PV says that they came."""

from __future__ import annotations

import numpy as np
import pytest
from tuning_data import answered

from ahgateway.tuning.findings import Weight
from ahgateway.tuning.fit import fit
from ahgateway.tuning.identify import identify
from ahgateway.tuning.models import Kind, Model
from ahgateway.tuning.record import Record, even, polled
from ahgateway.tuning.timing import timed
from ahgateway.tuning.valve import backlash

FIRST = Model(Kind.FOPDT, 1.5, 2.0, 8.0)


def test_a_move_stands_in_the_middle_of_what_is_known_of_it():
    """Samples every second; 3 → 7 is seen at 2 s; the request left at 1.5 s, MV was read first at 1.9 s."""
    t = np.arange(4.0)
    record = Record(t, t * 0.0, t, np.array([3.0, 3.0, 7.0, 7.0]))
    plain = polled(record)
    assert ([3.0, 5.0, 7.0, 7.0], 0.5) == (plain.acted.tolist(), plain.timing_s)
    known = polled(record, np.array([0.0, 1.0, 1.9, 3.0]), np.array([1.5]))
    # The move at 1.7 s: 0.7 s of 3 and 0.3 s of 7.
    assert [3.0, 4.2, 7.0, 7.0] == pytest.approx(known.acted.tolist())
    assert 0.2 == pytest.approx(known.timing_s)


def test_a_move_between_two_points_of_a_new_grid_keeps_its_time():
    """0, 1, 2, 2.6, 3.6 s become 0…3: MV 1 → 2 at 2.6 s is 0.6 s of 1 and 0.4 s of 2 from 2 s on."""
    t = np.array([0.0, 1.0, 2.0, 2.6, 3.6])
    record = even(Record(t, t * 0.0, t, np.array([1.0, 1.0, 1.0, 2.0, 2.0])))
    assert [1.0, 1.0, 1.4, 2.0] == pytest.approx(record.input.tolist())
    assert [1.0, 1.0, 1.0, 2.0] == record.mv.tolist()


def test_moves_that_were_seen_late_or_at_once_are_told_apart_by_what_pv_does():
    """Two of three moves are shown a sample late; of each only that interval is known."""
    true = np.full(500, 40.0)
    true[75:225] += 5.0
    true[225:375] -= 5.0
    seen = true.copy()
    seen[75], seen[375] = 40.0, 35.0
    made = answered(FIRST, true, noise=0.02)
    record = polled(Record(made.t_s, made.sv, made.pv, seen))
    found = timed(record, Kind.FOPDT)
    # Half a sample late, early, late; a common shift of all three would be the dead time's, their distance is not.
    steps = {75: 5.0, 224: -10.0, 375: 5.0}
    before, after = ([float((true - each.acted)[at]) / step for at, step in steps.items()] for each in (record, found))
    assert [0.5, -0.5, 0.5] == before
    assert max(after) - min(after) < 0.15
    plain, better = fit(record, Kind.FOPDT, noise=False), fit(found, Kind.FOPDT, noise=False)
    assert better.spread < 0.5 * plain.spread
    assert 0.02 == pytest.approx(better.spread, rel=0.5)


def test_a_trace_whose_times_are_known_stays_as_it_is():
    made = answered(FIRST, np.repeat([40.0, 45.0, 40.0], 100))
    assert made is timed(made, Kind.FOPDT)


@pytest.mark.parametrize(("play", "names"), [(0.0, []), (2.5, ["backlash"])])
def test_a_slow_line_makes_no_worn_valve_of_a_good_one_and_still_finds_a_worn_one(play, names):
    """MV is stepped at times between samples of 0.6 s, beside a lag of 1 s: the times are warned of."""
    levels, fine_s = (42, 44, 46, 44, 42, 40, 38, 40, 43, 39, 40), 0.02
    mv = np.full(5600, 40.0)
    for index, level in enumerate(levels):
        mv[400 + 400 * index + 7 * index**2 :] = level
    made = answered(Model(Kind.FOPDT, 1.5, 0.2, 1.0), mv, position=backlash(mv, play), noise=0.02, ts_s=fine_s)
    found = identify(polled(Record(*(each[::30] for each in (made.t_s, made.sv, made.pv, made.mv)))), Kind.FOPDT)
    assert names == [each.name for each in found.findings if each.weight is Weight.REFUSED]
    assert play or "coarse-times" in [each.name for each in found.findings]
