"""Ticks of a clock are cut down to what an execution's words allow: no tick that leaves the very words may be lost."""

from __future__ import annotations

import numpy as np
import pytest

from ahgateway.core import ticks
from ahgateway.core.compiling import asked_row
from ahgateway.core.controllers import CONTROLLERS
from ahgateway.core.controllers.dpide import Operands, State
from ahgateway.core.dialect import DEFAULT, Dialect, Filter, FilterContent, TsSource
from ahgateway.core.real import REAL, quiet, same_bits
from ahgateway.core.sieve import maker_for

AROUND = 1500
"""Ticks of 1 µs on either side of 0.1 s."""

LAW = CONTROLLERS["DPIDE"]
CUT = maker_for(LAW, compiled=False).function(ticks.cut)


def resting(chance: np.random.Generator) -> tuple[Operands, State]:
    """A loop whose E is 0, so that I_MV says nothing of Ts, while D still moves, or almost."""
    pv1, moved = chance.uniform(20, 70), chance.choice([0.0, 1e-3, 0.4])
    operands = LAW.inputs(
        sv=REAL(pv1 + moved),
        pv=REAL(pv1 + moved),
        cycle=100,
        kc_kp=REAL(1.3),
        ti_ki=REAL(0.4),
        td_kd=REAL(chance.uniform(0.02, 2.0)),
        tf=REAL(chance.uniform(0.05, 1.0)),
        pid_de=True,
        mv_max=REAL(1000),
        mv_min=REAL(-1000),
    )
    content = REAL(-pv1 - chance.choice([0.0, 1e-3, 0.4]))
    state = State(i=REAL(40), pv1=REAL(pv1), mv=REAL(40), d=content, valid=True, form1=3, sv1=operands.sv)
    return operands, state


@pytest.mark.parametrize("content", list(FilterContent))
@pytest.mark.parametrize("filter_", [each for each in Filter if each != Filter.IGNORED])
def test_no_tick_is_lost_that_leaves_the_words(filter_: Filter, content: FilterContent) -> None:
    dialect = DEFAULT._replace(filter=filter_, filter_content=content, ts_source=TsSource.MICROSECOND)
    chance = np.random.default_rng(int(filter_) * 10 + int(content))
    alike = 0
    for _ in range(6):
        operands, state = resting(chance)
        operands = operands._replace(tf=max(operands.tf, REAL(0.2)))
        state = state if content == FilterContent.INPUT else state._replace(d=REAL(chance.choice([0.0, -1e-4, 0.7])))
        first, last = 100_000 - AROUND, 100_000 + AROUND
        left = {tick: words(operands, state, dialect, tick) for tick in range(first, last + 1)}
        seen = left[int(chance.integers(first, last + 1))]
        fitting = [tick for tick, found in left.items() if all(map(same_bits, found, seen))]
        asked = asked_row({name: int(value) for name, value in dialect._asdict().items()})
        with quiet(all="ignore"):
            low, high = CUT(operands, asked, state, state, seen, (True,) * 4, first, last)

        assert low <= fitting[0]
        assert fitting[-1] <= high
        alike += len(fitting) > 1
    assert alike, "several ticks leave the same words somewhere"


def words(operands: Operands, state: State, dialect: Dialect, tick: int) -> tuple[REAL, ...]:
    with quiet(all="ignore"):
        after, terms = LAW.step(operands, state, dialect, LAW.law_ts(operands, dialect, tick))
    return after.pv1, after.i, after.mv, terms.mout
