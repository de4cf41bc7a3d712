"""Curves as dots and characters, worked out on squared paper."""

from __future__ import annotations

import numpy as np

from ahgateway.tui.plot import cells, dots, marks, value_range

NAN = float("nan")


def drawn(t_s, y, *, width=2, height=1, values=(0.0, 4.0), plain=False):
    times = (0.0, 4.0)
    return cells(dots(np.asarray(t_s, float), np.asarray(y, float), times, values, width, height), plain=plain)


def test_a_level_curve_fills_one_row_of_dots():
    # Four columns of dots, rows from the top at 4…3, 3…2, 2…1, 1…0: 0.5 lies in the lowest, dots 7 and 8.
    assert ["⣀⣀"] == drawn([0, 4], [0.5, 0.5])
    assert ["⠉⠉"] == drawn([0, 4], [3.5, 3.5])


def test_a_ramp_climbs_a_row_a_column_and_touches_where_it_leaves():
    # Column 0 covers 0…1: rows 4 and 3 from the top, and so on up to 4, which belongs to the top row.
    assert ["⣠⠞"] == drawn([0, 4], [0.0, 4.0])


def test_a_gap_is_not_bridged():
    assert ["⣀ "] == drawn([0, 1.9, 2.1, 4], [0.5, 0.5, NAN, NAN])
    assert ["⣀⢀"] == drawn([0, 1, 2, 3, 4], [0.5, 0.5, NAN, 0.5, 0.5])


def test_before_the_first_and_after_the_last_sample_nothing_is_drawn():
    assert [" ⡀"] == drawn([2.1, 2.9], [0.5, 0.5])


def test_a_spike_between_two_columns_is_not_lost():
    # Column 1 holds a sample at 4, though its edges are at 0.5.
    assert ["⣀⣀"] != drawn([0, 1.4, 1.5, 1.6, 4], [0.5, 0.5, 4.0, 0.5, 0.5])
    assert ["⣸⣀"] == drawn([0, 1.4, 1.5, 1.6, 4], [0.5, 0.5, 4.0, 0.5, 0.5])


def test_plain_signs_need_no_braille():
    assert ["**"] == drawn([0, 4], [0.5, 0.5], plain=True)


def test_marks_differ_by_shape():
    t_s, y = np.array([0.0, 1.9]), np.array([2.5, 2.5])
    assert ["╌ "] == marks(t_s, y, (0.0, 4.0), (0.0, 4.0), 2, 1, "╌")


def test_what_lies_outside_the_range_stands_at_its_edge():
    assert ["⠉⠉"] == drawn([0, 4], [9.0, 9.0])
    assert ["⣀⣀"] == drawn([0, 4], [-9.0, -9.0])


def test_a_range_is_never_empty_and_leaves_a_margin():
    assert (0.0, 1.0) == value_range(np.array([NAN]))
    assert (-0.5, 10.5) == value_range(np.array([0.0, 10.0, NAN]))
    assert (99.5, 100.5) == value_range(np.array([100.0, 100.0]))
