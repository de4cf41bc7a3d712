"""A loop on the fake PLC that may be written, and a link that can fail at any exchange."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from lockstep.bench_world import DirectLink, World

from ahgateway.codec.access import Request, Write
from ahgateway.codec.station import WriteLimit
from ahgateway.core.real import bits
from ahgateway.lockstep.gate.gate import Gate
from ahgateway.transports.base import Reply

WIDE = WriteLimit(-1000.0, 1000.0, 1000.0, 0.0)
WRITES = {
    "SV": WriteLimit(20.0, 120.0, 5.0, 2.0),
    "Kc_Kp": WriteLimit(0.1, 10.0, 1.0, 0.0),
    "Ti_Ki": WriteLimit(0.0, 1.0, 0.5, 0.0),
    "Td_Kd": WriteLimit(0.0, 10.0, 5.0, 0.0),
    "CYCLE": WriteLimit(10, 1000, 900, 0.0),
    "MV_MAX": WIDE,
    "MV_MIN": WIDE,
    "MOUT": WriteLimit(0.0, 100.0, 5.0, 0.0),
    "PID_MAN": WriteLimit(interval_s=0.0),
}
INITIAL = {"Kc_Kp": 1.5, "Ti_Ki": 0.2, "Td_Kd": 0.5, "MV_MAX": 100.0, "MV_MIN": 0.0}


class Cut(BaseException):
    """The process ends here: nothing that it would still do happens."""


class FailingLink:
    """A link in front of another; `at` is asked before and behind each exchange and may raise."""

    def __init__(self, inner: DirectLink, at: Callable[[str, Request], None]) -> None:
        self.target, self.figures, self.inner, self.at = inner.target, inner.figures, inner, at

    async def exchange(self, request: Request) -> Reply:
        self.at("before", request)
        reply = await self.inner.exchange(request)
        self.at("behind", request)
        return reply

    async def close(self) -> None:
        await self.inner.close()


class GateWorld(World):
    """A `World` with an allow-list and a directory for the gate."""

    def __init__(self, folder: Path, initial: Mapping[str, Any] | None = None, **changes: Any) -> None:
        loop_changes = {"writes": changes.pop("writes", WRITES), **changes.pop("loop_changes", {})}
        super().__init__(
            "DPIDE", {**INITIAL, **(initial or {})}, loop_changes=loop_changes, **{"scan_ms": 10, **changes}
        )
        self.folder = folder
        self.clock.advance_ns(12_000_000_000)
        self.plc.answer(_nothing(self))
        self.plc.writes.clear()

    def gate(self, link: Any = None, who: str = "test") -> Gate:
        return Gate(self.station, self.loop, link or self.link, self.clock, self.folder, who=who)

    def holds(self, *names: str) -> list[Any]:
        """What stands in the PLC; REALs as their bits."""
        values = [self.plc.read("L1", name) for name in names]
        return [value if isinstance(value, bool | int) else bits(value) for value in values]

    def sent(self) -> list[tuple[str, int, tuple[int, ...]]]:
        """Writes that came over the link, oldest first."""
        return [(each.table.name, each.address, each.values) for each in self.plc.writes if each.who == "link"]


def _nothing(world: World) -> Request:
    from ahgateway.codec.access import Read, Table

    return Read(1, Table.HOLDING, 100, 1)


def is_write(request: Request) -> bool:
    return isinstance(request, Write)
