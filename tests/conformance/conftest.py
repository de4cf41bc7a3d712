"""Which event loop a module's tests run on."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping

import pytest


def pytest_asyncio_loop_factories(item: pytest.Item) -> Mapping[str, Callable[[], asyncio.AbstractEventLoop]]:
    """The loop that the module names as `LOOP`, see `patience`; else the ordinary one."""
    return {"loop": getattr(item.module, "LOOP", asyncio.new_event_loop)}
