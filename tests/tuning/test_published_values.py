"""Ours held to what papers, books and other programs have published of rules and loops; where, stands in the list."""

from __future__ import annotations

from pathlib import Path

import pytest
from tuning_published import CASES

from ahgateway.tuning.rules import RULES

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "tune-published.md"


@pytest.mark.parametrize("case", CASES)
def test_what_was_published_of_rules_and_loops_comes_out_within_its_bar(case):
    found = list(CASES[case]())
    assert found
    for each in found:
        assert each.published == pytest.approx(each.ours, abs=each.within), (
            f"{each.rule}, {each.process}: {each.quantity}"
        )


def test_every_rule_has_a_published_figure_of_its_own():
    assert [] == [rule.name for rule in RULES if not any(rule.name in name for name in CASES)]
