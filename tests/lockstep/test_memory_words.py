"""What the double words of I_MV follow: learned from pictures of a PLC whose other words hold junk."""

from __future__ import annotations

from typing import Any

import pytest
from lockstep.bench_world import World

from ahgateway.apps.identify import learn
from ahgateway.core.dialect import DEFAULT, PvWord, SumOrder
from ahgateway.lockstep.picture import Picture
from ahgateway.lockstep.words import followed


async def pictures(world: World, polls: int) -> list[Picture]:
    found = []
    for _ in range(polls):
        await world.poll()
        if world.follower.picture is not None:
            found.append(world.follower.picture)
    return found


def world_with(place: PvWord, profile: PvWord = PvWord.MANUAL) -> tuple[World, Any]:
    """A PLC that keeps PV there, and the loop as a profile has it."""
    dialect = DEFAULT._replace(pv_word=place, sum_order=SumOrder.PD_I)
    world = World("DPID", {"Kp": 1.3, "Ki": 0.37, "Kd": 0.11}, loop_changes={"dialect": dialect})
    return world, DEFAULT._replace(pv_word=profile)


@pytest.mark.parametrize("place", [PvWord.MANUAL, PvWord.DWORD_3])
async def test_the_word_that_holds_pv_is_found_and_the_search_goes_on_from_it(place: PvWord) -> None:
    world, _ = world_with(place)
    found = await pictures(world, 160)

    (result,) = learn(world.station, {"L1": found})
    assert (int(place) or 1, "PV") in [(each.dword, each.quantity) for each in result.words]
    assert {"sum_order": "pd_i", "pv_word": place.name.lower()}.items() <= result.decided().items()
    assert result.found.is_named


async def test_a_standing_word_is_no_evidence() -> None:
    world, _ = world_with(PvWord.MANUAL)
    (first, *_) = await pictures(world, 3)
    assert () == followed(world.loop, [first] * 40)
