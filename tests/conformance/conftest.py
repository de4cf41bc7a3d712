"""What tests on the wall clock need: their own event loop where they say so, and patience with a busy machine."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping

import pytest

PATIENCE_S = 400


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Only a test that hangs is ended: a command that takes a second alone may take a minute on a busy machine."""
    for item in items:
        if item.path.parent.name == "conformance" and item.get_closest_marker("timeout") is None:
            item.add_marker(pytest.mark.timeout(PATIENCE_S))


def pytest_asyncio_loop_factories(item: pytest.Item) -> Mapping[str, Callable[[], asyncio.AbstractEventLoop]]:
    """The loop that the module names as `LOOP`, see `patience`; else the ordinary one."""
    return {"loop": getattr(item.module, "LOOP", asyncio.new_event_loop)}
