"""Which event loop a module's tests run on."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator, Mapping

import pytest
from conformance.patience import PatientClock, PatientPolicy


def pytest_asyncio_loop_factories(item: pytest.Item) -> Mapping[str, Callable[[], asyncio.AbstractEventLoop]]:
    """The loop that the module names as `LOOP`, see `patience`; else the ordinary one."""
    return {"loop": getattr(item.module, "LOOP", asyncio.new_event_loop)}


@pytest.fixture
def patient_machine(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Let a command with its PLC in this process live on patient time."""
    monkeypatch.setattr("ahgateway.clock.WallClock", PatientClock)
    asyncio.set_event_loop_policy(PatientPolicy())
    yield
    asyncio.set_event_loop_policy(None)
