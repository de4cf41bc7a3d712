"""Every question that the specification leaves open has an axis with a page, and every axis a question."""

from __future__ import annotations

import re

import pytest

from ahgateway.core.dialect import AXES
from ahgateway.core.dialect_axes import BY_NAME, TABLE

AH500: dict[str, tuple[str, ...]] = {
    "A1": ("ts_unit",),
    "A2": ("integral_store",),
    "A3": ("integrator", "integral_used"),
    "A4": ("freeze",),
    "A5": ("freeze_test", "limit_edge"),
    "A6": ("derivative_of",),
    "A7": ("derivative_product", "first_history"),
    "A8": ("filter", "filter_content"),
    "A9": ("tf_unit",),
    "A10": ("band", "band_edge", "cross_edge"),
    "A11": ("cross_touch", "cross_manual", "cross_jump", "cross_sv", "cross_scan"),
    "A12": ("cross_d",),
    "A13": ("run_off", "run_off_history", "run_off_mout"),
    "A14": ("first_call", "first_history", "run_on"),
    "A15": (
        "transfer",
        "preset_order",
        "preset_d",
        "preset_integrates",
        "preset_limit",
        "manual_integral",
        "preset_mv",
    ),
    "A16": ("transfer_2", "manual_integral"),
    "A17": ("mout_auto", "mout_scan"),
    "A18": ("manual_refresh",),
    "A19": ("ts_source", "schedule", "cycle_change"),
    "A20": ("limits", "clamped"),
    "A21": ("ki_off", "kc_off"),
    "A22": ("sum_order", "bias_joins", "ts_scale"),
    "A23": ("bad_input",),
    "A24": ("form_change", "form_integral"),
    "A26": ("direction",),
    "A27": ("pv_word",),
}
"""Of A25 the spec says that it is opaque: a loop that tunes is not judged. A28 is about pictures, not arithmetic."""

CHOICES: dict[str, tuple[str, ...]] = {
    "§1.1": ("ts_source", "schedule"),
    "A.5": ("transfer_2",),
    "A.8/1": ("integral_store",),
    "A.8/2": ("integrator",),
    "A.8/3": ("limited_output",),
    "A.8/4": ("freeze",),
    "A.8/5": ("manual_integral",),
    "A.8/6": ("run_off",),
    "A.8/7": ("manual_history",),
    "A.8/8": ("en_on_history", "stop_history"),
    "A.8/9": ("run_off_manual",),
    "A.8/10": ("preset_mv",),
    "A.8/11": ("run_off_scan",),
    "A.8/12": ("en_off_time",),
    "A.8/13": ("first_call",),
    "B.3": ("run_off_filter", "preset_integrates"),
    "B.4": ("cross_band", "cross_jump"),
    "B.5/1": ("filter",),
    "B.5/2": ("cross_touch",),
    "B.5/3": ("cross_sv",),
    "B.5/4": ("manual_filter",),
}
"""B.5/5 is A25 again."""

ORDERS = {"product", "ratio", "dependent_sum"}
"""Orders of operations that the laws of A.3 and B.3 leave open (ah500 A22)."""


@pytest.mark.parametrize("table", [AH500, CHOICES], ids=["ah500", "controllers"])
def test_every_open_question_of_the_spec_has_an_axis_with_a_page(table: dict[str, tuple[str, ...]]) -> None:
    named = [axis for axes in table.values() for axis in axes]
    assert [] == [axis for axis in named if axis not in AXES or not BY_NAME[axis].excitation]


def test_every_axis_answers_a_question_of_the_spec() -> None:
    answered = {axis for table in (AH500, CHOICES) for axes in table.values() for axis in axes} | ORDERS
    assert set(AXES) == answered


def test_the_questions_that_an_axis_names_are_those_of_the_table() -> None:
    wrong = {
        axis.name: identifier
        for axis in TABLE
        for identifier in re.findall(r"\bA\d{1,2}\b(?!\.)", axis.question)
        if axis.name not in AH500[identifier]
    }
    assert {} == wrong
