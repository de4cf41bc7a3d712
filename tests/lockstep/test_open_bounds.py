"""Random dialects in which a bound need not enclose the truth, or older history counts: no execution is convicted."""

from __future__ import annotations

import pytest
from bench.bench_dialects import soak
from dialects import random_dialect


@pytest.mark.parametrize(
    ("name", "seed", "polls"),
    [("DPIDE", 139, 30), ("DPID", 151, 230), ("DPIDE", 154, 300), ("DPID", 7, 290)],
    ids=["forward-filter", "history-older-than-the-picture", "back-calculated-at-a-limit", "manual-without-pv"],
)
async def test_what_cannot_be_known_convicts_nobody(name: str, seed: int, polls: int) -> None:
    world = await soak(name, seed, polls, random_dialect(seed, share=(seed % 4 + 1) / 4))

    assert world.follower.counts.diverged == 0
    assert world.follower.counts.proven > 0
