"""One execution from a D that is open: whatever the law leaves is explained, and what it remembers then is enclosed.

Drawn at random: dialect, mode, gains, where the sum lies beside the limits, how wide D is open. The PLC is the law.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from dialects import random_dialect
from lockstep.dialect_traces import loop_of

from ahgateway.core.controllers import CONTROLLERS
from ahgateway.core.controllers.dpide import Operands, State
from ahgateway.core.real import REAL, order, quiet
from ahgateway.lockstep.picture import predicted
from ahgateway.lockstep.shadow import Bound, explain, hides_pv, is_missed_anyway, is_roughly_bounded, judged_names
from ahgateway.lockstep.unseen import advanced

LAW = CONTROLLERS["DPIDE"]
DRAWS = 350


def drawn(chance: np.random.Generator) -> tuple[Operands, State]:
    """What an execution reads, and a state before it but for D."""

    def either(often: Any, seldom: Any, share: float) -> Any:
        return seldom if chance.random() < share else often

    pv = REAL(chance.uniform(20, 70))
    operands = LAW.inputs(
        sv=REAL(pv + either(chance.uniform(-5, 5), 0, 0.5)),
        pv=REAL(pv + either(chance.uniform(-1, 1), 0, 0.5)),
        cycle=100,
        kc_kp=REAL(either(chance.uniform(0.3, 3), 0, 0.05)),
        ti_ki=REAL(either(chance.uniform(0.1, 2), 0, 0.05)),
        td_kd=REAL(chance.uniform(0.02, 1)),
        tf=REAL(either(chance.uniform(0.02, 1), 0, 0.1)),
        bias=REAL(either(3.3, 0, 0.5)),
        err_dbw=REAL(either(0, 2, 0.2)),
        mv_max=REAL(100),
        mv_min=REAL(-100),
        mout=REAL(chance.uniform(-20, 60)),
        pid_man=bool(chance.random() < 0.15),
        pid_eq=bool(chance.random() < 0.3),
        pid_de=bool(chance.random() < 0.4),
        pid_dir=bool(chance.random() < 0.8),
    )
    e1 = REAL(operands.sv - pv if operands.pid_dir else pv - operands.sv)
    state = State(
        i=REAL(chance.uniform(-20, 40)),
        pv1=pv,
        mv=REAL(either(chance.uniform(-20, 60), 100, 0.2)),
        e1=e1,
        er1=e1,
        cross=bool(chance.random() < 0.2),
        man1=bool(chance.random() < 0.3),
        valid=True,
        form1=operands.pid_dir + 2 * operands.pid_eq + 4 * operands.pid_de,
        sv1=operands.sv,
    )
    return operands, state


def beside_a_limit(operands: Operands, state: State, raw: REAL, chance: np.random.Generator) -> tuple[Operands, State]:
    """The same with a limit at the sum, or near it."""
    edge = REAL(raw + REAL(chance.choice([0, 1e-6, 0.5, 3]) * chance.choice([-1, 1])))
    if chance.random() < 0.5:
        operands = operands._replace(mv_max=edge, mv_min=REAL(edge - 100))
    else:
        operands = operands._replace(mv_min=edge, mv_max=REAL(edge + 100))
    return operands, state._replace(mv=REAL(chance.choice([operands.mv_max, operands.mv_min, state.mv])))


@pytest.mark.parametrize("seed", range(4))
def test_what_the_law_leaves_is_explained_and_enclosed(seed: int) -> None:
    chance = np.random.default_rng(seed)
    open_ones = 0
    for number in range(DRAWS):
        dialect = random_dialect(seed * DRAWS + number, share=number % 5 / 4, without=("ts_source", "pv_word"))
        loop = replace(loop_of("DPIDE"), dialect=dialect)
        operands, state = drawn(chance)
        true = REAL(chance.normal() * 10.0 ** chance.uniform(-6, 1.5))
        wide = abs(float(true)) * 10.0 ** chance.uniform(-6, 1)
        low, high = (REAL(float(true) + sign * wide * chance.random()) for sign in (-1, 1))
        if number % 10 == 0:
            low, high = REAL(-1e30), REAL(1e30)
        ts = LAW.ts(operands, dialect)
        with quiet(all="ignore"):
            after, terms = LAW.step(operands, state._replace(d=true), dialect, ts)
            if number % 5 < 2 and np.isfinite(terms.raw):
                operands, state = beside_a_limit(operands, state, terms.raw, chance)
                after, terms = LAW.step(operands, state._replace(d=true), dialect, ts)
        if hides_pv(loop, operands):
            continue
        seen = predicted(LAW, after, terms)
        bound = Bound(state._replace(d=low), state._replace(d=high))
        found = explain(loop, (bound,), [operands], seen, judged_names(loop))
        where = seed, number, dialect, operands, state, low, high, true
        if found.fits:
            assert any(is_within(after.d, fit.after) for fit in found.fits), where
            open_ones += low != high
        else:
            assert found.nearest is not None
            assert is_roughly_bounded(loop, found.nearest, seen), where
            assert not is_missed_anyway(loop, found.nearest, seen), where
        reached = advanced(loop, (bound,), operands)
        assert not reached or any(is_within(after.d, each) and each.low.i == after.i for each in reached), where
    assert open_ones > 0.8 * DRAWS


def is_within(d: REAL, bound: Bound) -> bool:
    return order(bound.low.d) <= order(d) <= order(bound.high.d) or d in (bound.low.d, bound.high.d)
