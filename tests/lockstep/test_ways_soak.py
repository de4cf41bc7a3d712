"""Ten thousand executions without a fault in each way, with operators who meddle: nobody is convicted.

Polling has its own soaks; here are the others, half of them with each instruction.
"""

from __future__ import annotations

import pytest
from lockstep.soak import GAINS, soak
from lockstep.ways_world import ground

from ahgateway.codec.ways import Each, Way


@pytest.mark.slow
@pytest.mark.parametrize(
    ("way", "each", "share"),
    [(Way.STEPPED, Each.CALL, 0.98), (Way.RECORDED, Each.CALL, 0.98), (Way.COUNTED, Each.SCAN, 0.2)],
)
@pytest.mark.parametrize("law", ["DPID", "DPIDE"])
async def test_five_thousand_executions_without_a_fault(law: str, way: Way, each: Each, share: float) -> None:
    world = ground(way, law, GAINS[law], each=each, seed=21)
    counts = await soak(world, 5_000, seed=21)

    assert world.follower.first_diverged is None
    assert counts.proven >= share * counts.total
