"""A closing Windows console: the work is stopped and Windows kept waiting; Ctrl-C stays Python's."""

from __future__ import annotations

import asyncio
import threading

import pytest

from ahgateway.cli.interrupt import GRACE_S, closing_handler, stop_event

CTRL_C, CTRL_BREAK, CLOSE, LOGOFF, SHUTDOWN = 0, 1, 2, 5, 6


@pytest.mark.parametrize("kind", [CLOSE, LOGOFF, SHUTDOWN])
async def test_what_ends_the_console_stops_the_work_and_waits_for_it(kind: int) -> None:
    """As Windows does it: from a thread of its own, which ends only when the work has been put back."""
    loop, done, waited = asyncio.get_running_loop(), threading.Event(), []
    with stop_event() as stop:

        def wait(seconds: float) -> None:
            waited.append(seconds)
            done.wait(seconds)

        handle = closing_handler(lambda: loop.call_soon_threadsafe(stop.set), wait)
        console = loop.run_in_executor(None, handle, kind)
        await stop.wait()
        assert not console.done()
        done.set()
        assert await console
    assert [GRACE_S] == waited


@pytest.mark.parametrize("kind", [CTRL_C, CTRL_BREAK])
def test_ctrl_c_and_ctrl_break_are_left_to_python(kind: int) -> None:
    called = []
    assert not closing_handler(lambda: called.append("stop"), called.append)(kind)
    assert [] == called
