"""Time that stands still while the machine is busy, and passes when nothing comes."""

from __future__ import annotations

import asyncio
import time

import pytest
from conformance.patience import GLANCE_S, PatientClock, PatientLoop

LOOP = PatientLoop


def stand_still(seconds: float) -> None:
    """Keep the event loop from looking for so long, as a busy machine does."""
    until_s = time.perf_counter() + seconds
    while time.perf_counter() < until_s:
        pass


async def test_waiting_takes_what_was_waited_for_and_work_takes_nothing() -> None:
    clock = PatientClock()
    began_ns = clock.now_ns()
    stand_still(0.03)
    assert began_ns == clock.now_ns()
    await asyncio.sleep(0.02)
    assert clock.now_ns() - began_ns == pytest.approx(20e6, abs=1e6 * GLANCE_S)


async def test_a_deadline_does_not_pass_in_a_stall_and_does_when_nothing_comes() -> None:
    answer: asyncio.Future[str] = asyncio.get_running_loop().create_future()

    def late() -> None:
        stand_still(0.03)
        answer.set_result("there")

    asyncio.get_running_loop().call_soon(late)
    async with asyncio.timeout(0.01):
        assert "there" == await answer
    with pytest.raises(TimeoutError):
        async with asyncio.timeout(0.01):
            await asyncio.get_running_loop().create_future()
