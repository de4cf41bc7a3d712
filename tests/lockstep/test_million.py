"""A million executions without a fault, in many dialects, with operators who meddle: nobody is convicted.

A twelfth is judged one by one as records of a ring, the rest is walked in bulk as blocks of a recording. What is
polled, over memory and a socket, has its own soak in `test_lockstep_agrees`.
"""

from __future__ import annotations

import pytest
from dialects import random_dialect
from lockstep.million import recorded, walked

from ahgateway.core.dialect import DEFAULT, Dialect

DIALECTS = 25
RECORDED = 1_600
WALKS = 10
WALKED = 46_000

assert 2 * (DIALECTS * RECORDED + WALKS * WALKED) >= 1_000_000


def chosen(seed: int, *, without: tuple[str, ...] = ()) -> Dialect:
    """The default first, then more and more axes at random."""
    return random_dialect(seed, share=seed % 5 / 5, without=("ts_source", *without)) if seed else DEFAULT


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(DIALECTS))
@pytest.mark.parametrize("law", ["DPID", "DPIDE"])
def test_recorded_executions_convict_nobody(law: str, seed: int) -> None:
    counts = recorded(law, chosen(seed), RECORDED, seed)

    assert counts.diverged == 0
    assert counts.compared + counts.unobservable > 0.85 * RECORDED
    assert counts.proven >= 0.9 * (counts.compared + counts.unobservable)


@pytest.mark.parametrize("seed", [165, 174, 183, 190])
def test_an_open_filter_at_a_limit_or_in_a_transfer_convicts_nobody(seed: int) -> None:
    dialect = random_dialect(seed, share=(seed % 4 + 1) / 4, without=("ts_source",))
    counts = recorded("DPIDE", dialect, 1500, seed)

    assert counts.diverged == 0
    assert counts.proven > 1000


@pytest.mark.slow
@pytest.mark.parametrize("law", ["DPID", "DPIDE"])
def test_executions_walked_in_bulk_are_all_reproduced(law: str) -> None:
    total = 0
    for seed in range(WALKS):
        # In manual with its history held nothing shows which PV was read, and with PID_RUN off no word shows that
        # PID_MAN was taken note of; the walk, which sees words alone, does not claim what follows from either.
        executions, differing = walked(law, chosen(seed, without=("manual_history", "run_off_manual")), WALKED, seed)
        assert differing == 0, seed
        total += executions
    assert total > 0.9 * WALKS * WALKED
