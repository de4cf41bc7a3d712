"""What a run may claim: anything diverged is 1, too little is 3, nothing checked is never a pass."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ahgateway.core.verdict import Counts, Exit, Proof, Verdict, Weight, outcome, reason

SOME = st.integers(min_value=0, max_value=5)


def test_the_words_of_the_json_line() -> None:
    assert [v.value for v in Verdict] == ["MATCH", "DIVERGED", "UNOBSERVABLE", "LINK"]
    assert [p.value for p in Proof] == ["bits", "ulp", "tolerance"]
    assert [w.value for w in Weight] == ["informative", "trivial"]
    assert [(e.name, e.value) for e in Exit] == [
        ("PASS", 0),
        ("DIFFERENT", 1),
        ("USAGE", 2),
        ("INCONCLUSIVE", 3),
        ("FAULT", 4),
    ]


@pytest.mark.parametrize(
    ("counts", "coverage_min", "code"),
    [
        (Counts(), 0.0, 3),
        (Counts(unobservable=7, link=2), 0.0, 3),
        (Counts(trivial=1000), 0.0, 3),
        (Counts(informative=1), 1.0, 0),
        (Counts(informative=1, trivial=9), 1.0, 0),
        (Counts(informative=9, link=1), 0.9, 0),
        (Counts(informative=9, link=1), 0.91, 3),
        (Counts(informative=9, unobservable=1), 0.91, 3),
        (Counts(informative=9, expected=10), 0.9, 0),
        (Counts(informative=9, expected=11), 0.9, 3),
        (Counts(informative=9, ulp=1), 0.95, 3),
        (Counts(ulp=10), 0.1, 3),
        (Counts(ulp=10), 0.0, 0),
        (Counts(tolerance=10), 0.0, 0),
        (Counts(informative=1000, diverged=1), 0.0, 1),
        (Counts(diverged=1), 1.0, 1),
        (Counts(diverged=1, link=10**6), 1.0, 1),
    ],
)
def test_outcome(counts: Counts, coverage_min: float, code: int) -> None:
    assert code == outcome(counts, coverage_min)


@pytest.mark.parametrize(
    ("counts", "sentence"),
    [
        (Counts(informative=4, diverged=1, link=5), "1 of 5 compared executions diverged"),
        (Counts(link=5), "nothing was compared"),
        (Counts(trivial=5), "all 5 matches are trivial: the loop rested, or was limited or manual"),
        (Counts(informative=1, link=1), "1 of 2 executions proven by bits (50.0%), asked for 90.0%"),
        (Counts(informative=9, link=1), "9 of 10 executions proven by bits, none diverged"),
    ],
)
def test_reason_says_what_decided(counts: Counts, sentence: str) -> None:
    assert sentence == reason(counts, 0.9)


def test_one_lost_frame_does_not_spoil_a_night() -> None:
    assert outcome(Counts(informative=86_399, link=1), 0.99) == Exit.PASS


@pytest.mark.parametrize("coverage_min", [-0.01, 1.01, float("nan")])
def test_a_share_outside_0_to_1_is_refused(coverage_min: float) -> None:
    with pytest.raises(ValueError, match="coverage_min"):
        outcome(Counts(), coverage_min)


def test_executions_are_counted_where_they_belong() -> None:
    counts = Counts()
    for _ in range(2):
        counts = counts.plus(Verdict.MATCH, Proof.BITS, Weight.INFORMATIVE)
    counts = counts.plus(Verdict.MATCH, Proof.BITS, Weight.TRIVIAL)
    counts = counts.plus(Verdict.MATCH, Proof.BITS)
    counts = counts.plus(Verdict.MATCH, Proof.ULP, Weight.INFORMATIVE)
    counts = counts.plus(Verdict.MATCH, Proof.TOLERANCE)
    counts = counts.plus(Verdict.DIVERGED).plus(Verdict.UNOBSERVABLE).plus(Verdict.LINK).plus(Verdict.LINK)
    assert counts == Counts(2, 2, 1, 1, 1, 1, 2, 0)
    assert (4, 7, 10) == (counts.proven, counts.compared, counts.total)
    assert counts.coverage == 0.4
    assert Counts(4, 4, 2, 2, 2, 2, 4, 0) == counts + counts


@given(st.builds(Counts, SOME, SOME, SOME, SOME, SOME, SOME, SOME, SOME), st.sampled_from([0.0, 0.5, 1.0]))
def test_a_pass_is_always_earned(counts: Counts, coverage_min: float) -> None:
    code = outcome(counts, coverage_min)
    assert (code == Exit.DIFFERENT) == (counts.diverged > 0)
    if code == Exit.PASS:
        assert counts.informative + counts.ulp + counts.tolerance > 0
        assert counts.coverage >= coverage_min
    assert outcome(Counts(diverged=1) + counts, coverage_min) == Exit.DIFFERENT
