"""Ctrl-C around every write of every experiment, of the proof of gains and of a rollback leaves nothing changed.

Around: before and behind its request, and at the next pause; the writes that put back count too.
`tests/bench/bench_moments.py` does the same at every exchange and every pause.
"""

from __future__ import annotations

import pytest
from tune_moments import GAINS, ROLLBACK, Bench, around_writes, stopped, tuned


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["step", "doublet", "sv", "relay", "autotune", GAINS, ROLLBACK])
async def test_an_end_around_any_write_leaves_nothing_changed(tmp_path, kind):
    bench = Bench(kind, tmp_path, tuned())
    assert [] == await stopped(bench, around_writes)
