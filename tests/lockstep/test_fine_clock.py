"""A Ts measured by a clock of 1 µs: more intervals fit than can be tried, and what is not known is not claimed."""

from __future__ import annotations

import pytest
from dialects import random_dialect
from lockstep.dialect_traces import loop_of
from lockstep.million import recorded

from ahgateway.core.controllers import CONTROLLERS
from ahgateway.core.dialect import DEFAULT, Dialect, Freeze, TsSource
from ahgateway.core.real import REAL
from ahgateway.fake.faults import fault
from ahgateway.lockstep.interval import INTERVALS_MAX, SAMPLES, intervals

EXECUTIONS = 120


def fine(seed: int) -> Dialect:
    dialect = random_dialect(seed, share=seed % 5 / 4, without=("ts_source",))
    frozen = Freeze.BACK_CALCULATED if seed % 2 else dialect.freeze
    return dialect._replace(ts_source=TsSource.MICROSECOND, freeze=frozen)


@pytest.mark.parametrize("seed", [0, 1, 3, 4])
@pytest.mark.parametrize("law", ["DPID", "DPIDE"])
def test_a_clock_of_a_microsecond_convicts_nobody(law: str, seed: int) -> None:
    counts = recorded(law, fine(seed), EXECUTIONS, seed)

    assert counts.diverged == 0
    # On a DPIDE the content of D's filter goes with the interval, and the next MV with both.
    assert law == "DPIDE" or counts.proven > 0.4 * EXECUTIONS
    assert counts.compared + counts.unobservable > 0.9 * EXECUTIONS


def test_a_wrong_gain_is_convicted_by_a_clock_of_a_microsecond_too() -> None:
    law = CONTROLLERS["DPID"]
    counts = recorded("DPID", fine(6), EXECUTIONS, 6, fault("gain-1-percent", law).wrong(law.step))

    assert counts.diverged > 0.5 * EXECUTIONS


def test_what_cannot_be_tried_is_said_not_to_be_whole() -> None:
    loop = loop_of("DPID", DEFAULT._replace(ts_source=TsSource.MICROSECOND))
    law = loop.controller
    inputs = law.inputs(sv=REAL(50), pv=REAL(49), ki=REAL(0.5), cycle=10)
    state = law.state()

    blind = intervals(loop, inputs)
    assert not blind.is_whole
    assert len(blind.values) <= SAMPLES + 3

    # K·E·Ts of 0.05 in REALs 2^-28 apart: some ticks of 1 µs have an integral of their own, and none has twice it.
    with_i = law.step(inputs, state, loop.dialect, law.ts(inputs, loop.dialect, 100_123))[0].i
    told = intervals(loop, inputs, (state, state), with_i)
    assert told.is_whole
    assert len(told.values) <= INTERVALS_MAX
    assert law.ts(inputs, loop.dialect, 100_123) in told.values
    assert intervals(loop, inputs, (state, state), REAL(2) * with_i).is_whole
