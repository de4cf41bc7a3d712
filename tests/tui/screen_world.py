"""A fed monitor behind a screen, in virtual time: a fake PLC over a link without wires, and a screen read as text."""

from __future__ import annotations

from ahgateway.apps.board import Board
from ahgateway.apps.monitor import Monitor
from ahgateway.clock import SECOND, VirtualClock
from ahgateway.fake.plc import FakePlc
from ahgateway.schema.profile import load
from ahgateway.transports.base import Tap
from ahgateway.transports.memory import MemoryLink
from ahgateway.tui.app import MonitorApp


class ScreenWorld:
    """The loops of a shipped example, the demo's two unless another is named, followed and shown."""

    def __init__(self, profile: str = "demo", *, warm_up_s: int = 0, tap: Tap | None = None) -> None:
        loaded = load(profile)
        self.clock = VirtualClock()
        self.plc = FakePlc(loaded.station(), loaded.fake_setup(), clock=self.clock)
        self.clock.advance_ns(warm_up_s * SECOND)
        self.link = MemoryLink(self.plc, self.clock, tap=tap, target=f"memory:{profile}")
        self.monitor = Monitor(loaded.station(), self.link, self.clock)
        self.board = Board(self.monitor, self.clock)
        self.notes = []

    def app(self, *, encoding: str = "utf-8") -> MonitorApp:
        return MonitorApp(self.board, "Demo", on_note=self.notes.append, encoding=encoding, is_ticking=False)

    async def run(self, seconds: float) -> None:
        """Follow for so long and feed the board."""
        end_ns = self.clock.now_ns() + round(seconds * SECOND)
        async for report in self.monitor.reports():
            self.board.take(report)
            if self.clock.now_ns() >= end_ns:
                break


def text_of(app: MonitorApp) -> list[str]:
    """What stands on the screen, line by line, without colour."""
    strips = app.screen._compositor.render_strips()
    return ["".join(segment.text for segment in strip).rstrip() for strip in strips]
