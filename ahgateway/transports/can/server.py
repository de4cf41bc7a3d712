"""Put a node on a bus: answers what comes, beats its heart, until closed."""

from __future__ import annotations

import asyncio

from ahgateway.clock import Clock
from ahgateway.codec.can_frame import CanFrame
from ahgateway.errors import LinkError
from ahgateway.transports.can.bus import CanBus
from ahgateway.transports.can.node import CanNode
from ahgateway.transports.can.reader import Trouble

WAITING_MAX = 1024


class NodeServer:
    """A running node; made by `serve_node`.

    Attributes:
        unsent: Answers that the interface did not take.
    """

    def __init__(self, node: CanNode, bus: CanBus, clock: Clock) -> None:
        self.unsent = 0
        self._node = node
        self._bus = bus
        self._clock = clock
        self._frames: asyncio.Queue[CanFrame] = asyncio.Queue(maxsize=WAITING_MAX)
        self._end = bus.subscribe(self._take, self._trouble)
        self._tasks = [asyncio.ensure_future(self._answer()), asyncio.ensure_future(self._beat())]

    async def close(self) -> None:
        """Take the node off the bus and release the interface."""
        self._end()
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        await self._bus.close()

    async def boot(self) -> None:
        """Say that the node is there."""
        await self._send(self._node.boot(self._clock.now_ns()))

    def _take(self, frame: CanFrame) -> None:
        if self._frames.full():
            self._bus.figures.overflows += 1
            return
        self._frames.put_nowait(frame)

    def _trouble(self, trouble: Trouble) -> None:
        if trouble.name == "lost":
            while not self._frames.empty():
                self._frames.get_nowait()

    async def _answer(self) -> None:
        while True:
            frame = await self._frames.get()
            await self._send(self._node.feed(frame, self._clock.now_ns()))

    async def _beat(self) -> None:
        while True:
            await self._clock.sleep_ns(self._node.wait_ns(self._clock.now_ns()))
            await self._send(self._node.tick(self._clock.now_ns()))

    async def _send(self, frames: list[CanFrame]) -> None:
        for frame in frames:
            try:
                await self._bus.send(frame)
            except LinkError:
                self.unsent += 1


async def serve_node(node: CanNode, bus: CanBus, clock: Clock) -> NodeServer:
    """Open the bus, send the boot-up message and serve until `close`.

    Raises:
        LinkError: The interface cannot be opened.
    """
    try:
        await bus.open()
    except LinkError:
        await bus.close()
        raise
    server = NodeServer(node, bus, clock)
    await server.boot()
    return server
