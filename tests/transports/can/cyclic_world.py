"""A fake PLC that sends PDOs behind SYNC, a bus that loses and repeats frames, and a follower, on one virtual clock."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import replace

from ahgateway.clock import MILLISECOND, VirtualClock
from ahgateway.codec.can_frame import CanFrame
from ahgateway.codec.station import FakeLoop, Pacing
from ahgateway.fake.can import CanPlc
from ahgateway.fake.plc import FakePlc
from ahgateway.lockstep.follow import Event, Follower
from ahgateway.lockstep.picture import Picture, Sampler
from ahgateway.schema.profile import load
from ahgateway.transports.can.cyclic import CyclicLink
from ahgateway.transports.can.link import SdoLink

PERIOD_NS = 20 * MILLISECOND
SETTLED_NS = 11 * MILLISECOND
"""Behind a SYNC the window of 10 ms is over."""


class Wire:
    """As much of a `CanBus` as links need; what is sent goes to `hears`, and nobody answers."""

    is_listen_only = False

    def __init__(self) -> None:
        self.target = "canopen://wire"
        self.sent: list[CanFrame] = []
        self.hears: Callable[[CanFrame], None] = lambda frame: None
        self._sinks: list[Callable[[CanFrame], None]] = []

    def subscribe(self, on_frame: Callable[[CanFrame], None], on_trouble: object = None) -> Callable[[], None]:
        self._sinks.append(on_frame)
        return lambda: self._sinks.remove(on_frame)

    async def open(self) -> None:
        return None

    async def send(self, frame: CanFrame) -> None:
        self.sent.append(frame)
        self.hears(frame)

    async def close(self) -> None:
        return None

    def deliver(self, frame: CanFrame) -> None:
        for sink in tuple(self._sinks):
            sink(frame)


class CyclicWorld:
    """The shipped CAN example followed by PDOs; `lost` and `repeated` are chances of each frame.

    Without its plant the PLC's PV stays where it is written.
    """

    def __init__(
        self,
        *,
        lost: float = 0.0,
        repeated: float = 0.0,
        seed: int = 1,
        cycle_ms: int = 80,
        has_plant: bool = True,
        clock: VirtualClock | None = None,
    ) -> None:
        loaded = load("can")
        station = self.station = replace(loaded.station(), target="canopen://wire?node=3&pdo=1")
        assert station.can is not None
        setup = loaded.fake_setup()["TIC-101"]
        initial = {**setup.initial, "CYCLE": cycle_ms}
        self.clock = clock or VirtualClock()
        plant = setup.plant if has_plant else None
        self.plc = FakePlc(station, {"TIC-101": FakeLoop(initial, plant)}, clock=self.clock, seed=seed)
        self.wire = Wire()
        sdo = SdoLink(self.wire, 3, station.can, self.clock)  # type: ignore[arg-type]
        pacing = Pacing(reply_timeout_ms=1)
        self.link = CyclicLink(sdo, self.wire, station.can, self.clock, pacing)  # type: ignore[arg-type]
        self.follower = Follower(station.loops[0])
        self.events: list[Event] = []
        self._content = CanPlc(self.plc, station.can)
        self.wire.hears = self._content.on_pdo
        self._sampler = Sampler(station.loops[0], station, self.link, self.clock)
        self._rng = random.Random(seed)
        self._lost, self._repeated = lost, repeated

    def cross(self) -> None:
        """Let one SYNC and its PDOs cross the wire, to the end of their window."""
        frames = [CanFrame(0x80, b""), *self._content.on_sync(self.clock.now_ns())]
        for frame in frames:
            self.clock.advance_ns(200_000)
            if self._rng.random() < self._lost:
                continue
            stamped = replace(frame, now_ns=self.clock.now_ns())
            self.wire.deliver(stamped)
            if self._rng.random() < self._repeated:
                self.wire.deliver(stamped)
        self.clock.advance_ns(SETTLED_NS)

    async def sync(self, behind_ns: int = 0) -> Picture:
        """Let one SYNC and its PDOs cross the wire, and take a picture `behind_ns` after their window is over."""
        self.clock.advance_ns(-self.clock.now_ns() % PERIOD_NS)
        self.cross()
        self.clock.advance_ns(behind_ns)
        picture = await self._sampler.picture()
        assert picture is not None
        self.events += self.follower.see(picture)
        return picture
