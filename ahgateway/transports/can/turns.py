"""Who speaks next to one SDO server: one transfer at a time, commands before polls, nobody waits for ever."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager


class Turns:
    """A lock with two queues; each is first come, first served.

    Args:
        wait_max_s: How long one may wait for its turn.
    """

    def __init__(self, wait_max_s: float) -> None:
        self._wait_max_s = wait_max_s
        self._is_taken = False
        self._commands: deque[asyncio.Future[None]] = deque()
        self._polls: deque[asyncio.Future[None]] = deque()

    @asynccontextmanager
    async def turn(self, *, is_command: bool) -> AsyncIterator[None]:
        """Hold the turn for the body.

        Raises:
            TimeoutError: It did not come in time.
        """
        if self._is_taken:
            await self._wait(self._commands if is_command else self._polls)
        self._is_taken = True
        try:
            yield
        finally:
            self._pass_on()

    async def _wait(self, queue: deque[asyncio.Future[None]]) -> None:
        mine = asyncio.get_running_loop().create_future()
        queue.append(mine)
        try:
            async with asyncio.timeout(self._wait_max_s):
                await mine
        except BaseException:
            if mine in queue:
                queue.remove(mine)
            else:
                self._pass_on()  # the turn came, and nobody is there any more to take it
            raise

    def _pass_on(self) -> None:
        """Give the turn to the next; it stays taken meanwhile, so that nobody slips in between."""
        for queue in (self._commands, self._polls):
            if queue:
                queue.popleft().set_result(None)
                return
        self._is_taken = False
