"""Six thousand executions without a fault in each way, with operators who meddle: nobody is convicted.

Polling has its own soaks. Behind an open filter counting claims next to nothing, and must not claim more.
"""

from __future__ import annotations

import pytest
from lockstep.soak import GAINS, soak
from lockstep.ways_world import ground

from ahgateway.codec.ways import Each, Way


@pytest.mark.slow
@pytest.mark.parametrize(
    ("way", "each", "law", "executions", "share"),
    [
        (Way.STEPPED, Each.CALL, "DPID", 3000, 0.98),
        (Way.STEPPED, Each.CALL, "DPIDE", 3000, 0.98),
        (Way.RECORDED, Each.CALL, "DPID", 3000, 0.98),
        (Way.RECORDED, Each.CALL, "DPIDE", 3000, 0.98),
        (Way.COUNTED, Each.SCAN, "DPID", 5000, 0.1),
        (Way.COUNTED, Each.SCAN, "DPIDE", 1000, 0.02),
    ],
)
async def test_executions_without_a_fault_convict_nobody(
    way: Way, each: Each, law: str, executions: int, share: float
) -> None:
    world = ground(way, law, GAINS[law], each=each, seed=21)
    counts = await soak(world, executions, seed=21)

    assert world.follower.first_diverged is None
    assert counts.proven >= share * counts.total
