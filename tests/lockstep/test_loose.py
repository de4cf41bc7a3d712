"""Filters that rounding keeps from being monotone: their bounds enclose the truth, and what lies beyond is wrong."""

from __future__ import annotations

import random
from dataclasses import replace
from typing import Any

import pytest
from dialects import random_dialect
from lockstep.dialect_traces import loop_of, trace

from ahgateway.core.dialect import DEFAULT, Dialect, Filter, FilterContent
from ahgateway.core.real import REAL, from_order, order, quiet
from ahgateway.core.verdict import Counts
from ahgateway.lockstep.follow import Follower
from ahgateway.lockstep.picture import predicted
from ahgateway.lockstep.shadow import Bound, explain, judged_names

LOOSE: dict[str, dict[str, Any]] = {
    "forward": {"filter": Filter.FORWARD},
    "alpha": {"filter": Filter.ALPHA},
    "of-the-input": {"filter_content": FilterContent.INPUT},
    "of-the-input-forward": {"filter_content": FilterContent.INPUT, "filter": Filter.FORWARD},
}


def followed(dialect: Dialect, seed: int, executions: int, step: Any = None) -> Counts:
    """Every execution seen with what it read, as a recorder shows it."""
    follower = Follower(replace(loop_of("DPIDE"), dialect=dialect))
    for each in trace("DPIDE", dialect, seed, executions, step):
        follower.see(replace(each.after, inputs=each.before.inputs, executions=(1, 1), is_exact=True))
    return follower.counts


def some_inputs(loop: Any, chance: random.Random) -> Any:
    given = {
        "sv": chance.uniform(20, 80),
        "pv": chance.uniform(20, 80),
        "kc_kp": chance.uniform(0.1, 3),
        "ti_ki": chance.uniform(0.1, 2),
        "td_kd": chance.uniform(0.02, 1),
        "tf": chance.uniform(0.02, 1),
        "bias": chance.choice([0.0, chance.uniform(-5, 5)]),
        "mv_max": 1e6,
        "mv_min": -1e6,
    }
    reals = {name: REAL(value) for name, value in given.items()}
    return loop.controller.inputs(**reals, cycle=chance.choice([10, 70, 130]), pid_de=chance.random() < 0.5)


@pytest.mark.parametrize("kind", LOOSE)
@pytest.mark.parametrize("width", [3, 40, 65, 300, 20_000, 1 << 24, None])
def test_whatever_content_there_was_is_among_what_explains_the_words(kind: str, width: int | None) -> None:
    """Width in REALs; None spans all contents that there can be, as behind a start."""
    chance = random.Random(f"loose {kind} {width}")
    for seed in range(10):
        dialect = random_dialect(seed, share=0.4, without=("ts_source", "pv_word", "bad_input"))._replace(**LOOSE[kind])
        loop = replace(loop_of("DPIDE"), dialect=dialect)
        inputs = some_inputs(loop, chance)
        pv1, sv = REAL(chance.uniform(20, 80)), REAL(chance.uniform(20, 80))
        content = REAL(chance.choice([chance.uniform(-60, 60), chance.gauss(0, 1e-3)]))
        state = loop.controller.state(
            i=REAL(chance.uniform(0, 60)),
            pv1=pv1,
            mv=REAL(40),
            e1=sv - pv1,
            er1=sv - pv1,
            d=content,
            valid=True,
            sv1=sv,
        )
        if width is None:
            ends = REAL(-1e30), REAL(1e30)
        else:
            first = order(content) - chance.randrange(width + 1)
            ends = from_order(first), from_order(first + width)
        with quiet(all="ignore"):
            after, terms = loop.controller.step(inputs, state, dialect, loop.controller.ts(inputs, dialect))
        seen = predicted(loop.controller, after, terms)
        bound = Bound(state._replace(d=ends[0]), state._replace(d=ends[1]))
        found = explain(loop, (bound,), [inputs], seen, judged_names(loop))

        assert any(fit.before.low.d <= content <= fit.before.high.d for fit in found.fits), seed
        assert any(fit.after.low.d <= after.d <= fit.after.high.d for fit in found.fits), seed


@pytest.mark.parametrize("kind", LOOSE)
def test_what_no_content_can_have_left_is_explained_by_none(kind: str) -> None:
    """64 ULP of MV aside of every content: an allowance of 1024 would have let it pass."""
    chance = random.Random(f"missed {kind}")
    for _ in range(8):
        loop = replace(loop_of("DPIDE"), dialect=DEFAULT._replace(**LOOSE[kind]))
        inputs = some_inputs(loop, chance)
        pv1 = REAL(chance.uniform(20, 80))
        state = loop.controller.state(
            i=REAL(30), pv1=pv1, mv=REAL(40), e1=inputs.sv - pv1, er1=inputs.sv - pv1, valid=True
        )
        middle = order(REAL(chance.uniform(5, 60)))
        words = []
        with quiet(all="ignore"):
            for away in (-100, 100):
                end = state._replace(d=from_order(middle + away))
                words.append(predicted(loop.controller, *loop.controller.step(inputs, end, loop.dialect, REAL(0.1))))
        beyond = max(order(each["MV"]) for each in words) + 64
        seen = {**words[0], "MV": from_order(beyond), "MOUT": words[0]["MOUT"]}
        bound = Bound(state._replace(d=from_order(middle - 100)), state._replace(d=from_order(middle + 100)))

        assert not explain(loop, (bound,), [inputs], seen, judged_names(loop)).fits


@pytest.mark.parametrize("kind", LOOSE)
def test_a_gain_that_is_wrong_by_a_hundred_thousandth_from_the_start_is_convicted(kind: str) -> None:
    dialect = DEFAULT._replace(**LOOSE[kind])
    law = loop_of("DPIDE", dialect).controller

    def wrong(inputs: Any, *rest: Any) -> Any:
        return law.step(inputs._replace(kc_kp=inputs.kc_kp * REAL(1.00001)), *rest)

    assert followed(dialect, 3, 60, wrong).diverged > 5


@pytest.mark.parametrize("kind", LOOSE)
@pytest.mark.parametrize("seed", [1070, 1103])
def test_executions_without_a_fault_convict_nobody(kind: str, seed: int) -> None:
    dialect = random_dialect(seed, share=(seed % 4) / 4, without=("ts_source", "manual_history"))
    counts = followed(dialect._replace(**LOOSE[kind]), seed, 160)

    assert counts.diverged == 0
    assert counts.proven > 110
