"""Time lines in characters: the worst verdict of a column, pulses, levels, gaps; worked out by hand."""

from __future__ import annotations

import numpy as np

from ahgateway.apps.lanes import Lane
from ahgateway.apps.marks import Mark
from ahgateway.apps.trail import Trace
from ahgateway.tui.trend import per_column, strip_lines

NAN = float("nan")
TIMES = (0.0, 4.0)


def trace(t_s, mark, *lanes) -> Trace:
    level = np.zeros(len(t_s))
    return Trace(
        np.asarray(t_s, float), level, level, level, level, level, level, level, np.asarray(mark, float),
        np.asarray(lanes, float).reshape(len(lanes), len(t_s)),
    )  # fmt: skip


def text(line) -> str:
    return "".join(part for part, _ in line)


def strips(found: Trace, *lanes: Lane, is_plain=True) -> list[str]:
    return [text(line) for line in strip_lines(found, TIMES, lanes, 4, is_plain=is_plain)]


def test_a_column_shows_its_worst_verdict():
    found = trace([0.1, 1.1, 1.2, 2.1, 2.2, 3.1], [1, 1, 2, 4, 6, 5])
    assert ["      verdict|-=!x"] == strips(found)


def test_every_verdict_has_a_sign_of_its_own():
    signs = {strips(trace([0.5], [mark]))[0][-4:][0] for mark in Mark}
    assert len(Mark) == len(signs)


def test_a_switch_holds_until_it_changes_and_a_mixed_column_says_so():
    lane = Lane("OPEN", "OPEN_OUT")
    found = trace([0.1, 2.1, 2.6, 3.1], [0, 0, 0, 0], [1, 1, 0, 0])
    assert "         OPEN|##+." == strips(found, lane)[1]
    assert "         OPEN│██▒·" == strips(found, lane, is_plain=False)[1]


def test_a_level_rises_with_its_value_and_shows_the_newest():
    lane = Lane("heat", "OutputHeat", "%", is_switch=False)
    found = trace([0.5, 1.5, 2.5, 3.5], [0] * 4, [0, 10, 20, 30])
    assert "      heat 30|0369" == strips(found, lane)[1]


def test_a_gap_and_what_lies_behind_the_last_sample_are_empty():
    lane = Lane("OPEN", "OPEN_OUT")
    assert "         OPEN|# #" == strips(trace([0.5, 1.5, 2.5], [0] * 3, [1, NAN, 1]), lane)[1].rstrip()
    lowest, highest = per_column(np.zeros(0), np.zeros(0), TIMES, 4)
    assert np.isnan(lowest).all()
    assert np.isnan(highest).all()
