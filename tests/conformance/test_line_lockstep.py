"""The demo's loops followed over RTU and ASCII lines whose characters take their time, in virtual time."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from conformance.peers import CLIENT, SERVER

from ahgateway.apps.monitor import Monitor
from ahgateway.apps.read import read_devices, wanted
from ahgateway.apps.record import Tape
from ahgateway.apps.report import as_json
from ahgateway.clock import MILLISECOND, SECOND, VirtualClock
from ahgateway.codec.access import Request
from ahgateway.fake.plc import FakePlc
from ahgateway.recording.reader import Recording
from ahgateway.schema.profile import load
from ahgateway.transports.base import LinkFigures, Reply
from ahgateway.transports.engine import Engine, Limits
from ahgateway.transports.line import Line
from ahgateway.transports.responder import Responder


class Slot:
    """Where one outcome goes."""

    def __init__(self) -> None:
        self.reply: Reply | None = None
        self.error: Exception | None = None

    def done(self) -> bool:
        return self.reply is not None or self.error is not None

    def set_result(self, reply: Reply, /) -> None:
        self.reply = reply

    def set_exception(self, error: Exception, /) -> None:
        self.error = error


class VirtualLine:
    """A `Link` over a serial line in virtual time: the real engine, each character as long as on the wire.

    The answer to request number `lost` never comes.
    """

    def __init__(self, plc: FakePlc, clock: VirtualClock, wire: str, line: Line) -> None:
        self.target = f"{wire} {line}"
        self.figures = LinkFigures()
        self.clock = clock
        self.byte_ns, self.gap_ns = line.byte_ns, line.gap_ns if wire == "rtu" else 0
        limits = Limits(SECOND, pause_ns=self.gap_ns or line.byte_ns, quiet_ns=20 * MILLISECOND, byte_ns=line.byte_ns)
        self.engine = Engine(CLIENT[wire](), limits, clock, self.figures, self.target)
        self.engine.connected(0)
        self.unit = Responder(plc, SERVER[wire]())
        self.lost, self.asked = 0, 0

    async def exchange(self, request: Request) -> Reply:
        slot = Slot()
        self.engine.submit(request, slot, self.clock.now_ns())
        while not slot.done():
            frame = self.engine.outgoing(self.clock.now_ns())
            if frame is None:
                wake_ns = self.engine.wake_ns()
                assert wake_ns is not None
                self.clock.advance_ns(max(0, wake_ns - self.clock.now_ns()))
                self.engine.tick(self.clock.now_ns())
                continue
            self.clock.advance_ns(len(frame) * self.byte_ns + self.gap_ns)
            answer = self.unit.feed(frame)
            self.asked += 1
            if self.asked == self.lost:
                continue
            self.clock.advance_ns(len(answer) * self.byte_ns)
            self.engine.received(answer, self.clock.now_ns())
        if slot.error is not None:
            raise slot.error
        assert slot.reply is not None
        return slot.reply

    async def close(self) -> None:
        """Nothing is held."""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("wire", "line", "cycle_ms"),
    [
        ("rtu", Line("x", 115200, "E", 8, 1), 200),
        ("ascii", Line("x", 115200, "E", 7, 1), 400),
        ("rtu", Line("x", 19200, "E", 8, 1), 1000),
        ("ascii", Line("x", 9600, "E", 7, 1), 4000),
    ],
)
async def test_the_demo_is_followed_over_a_serial_line(
    clock: VirtualClock, wire: str, line: Line, cycle_ms: int
) -> None:
    loaded = load("demo")
    setup = loaded.fake_setup()
    cycles = {"TIC-101": cycle_ms, "LIC-201": cycle_ms // 10}  # DPIDE counts ms, DPID 10 ms
    setup = {name: replace(each, initial={**each.initial, "CYCLE": cycles[name]}) for name, each in setup.items()}
    plc = FakePlc(loaded.station(), setup, clock=clock)
    plc.warm_up(30 * SECOND)
    link = VirtualLine(plc, clock, wire, line)
    monitor = Monitor(loaded.station(), link, clock)
    before = {name: plc.executed(name) for name in setup}

    async for _ in monitor.reports(duration_ns=40 * cycle_ms * MILLISECOND):
        pass

    for name, counts in monitor.summaries().items():
        executed = plc.executed(name) - before[name]
        assert executed >= 38
        assert 0 == counts.diverged
        # All but the first few, until the derivative's filter is known, and one at either end.
        assert counts.proven >= executed - 7, (name, counts)
    assert 0 == link.figures.timeouts


@pytest.mark.slow
@pytest.mark.parametrize("wire", ["rtu", "ascii"])
async def test_each_sample_says_since_when_its_line_is_aligned(clock: VirtualClock, wire: str, tmp_path: Path) -> None:
    """In JSON lines, in the recording and when read: one reply is lost, and what comes later says so."""
    loaded = load("demo")
    plc = FakePlc(loaded.station(), loaded.fake_setup(), clock=clock)
    plc.warm_up(10 * SECOND)
    link = VirtualLine(plc, clock, wire, Line("x", 115200, "N", 8, 1))
    link.lost = 60
    monitor = Monitor(loaded.station(), link, clock)
    told = []
    with Tape(tmp_path / "run.ahrec", loaded.station(), clock) as tape:
        async for report in monitor.reports(duration_ns=6 * SECOND):
            tape.take(report)
            told.append(as_json(report))
    (read, *_) = await read_devices(loaded.station(), link, clock, wanted(loaded.station(), ["D100"], None, 1))

    lines = [each for each in told if each is not None]
    (down_s,) = [each["t"] for each in lines if each["kind"] == "link" and not each["up"]]
    since = [(each["t"], each["aligned_since"]) for each in lines if each["kind"] == "execution"]
    rows = list(Recording(str(tmp_path / "run.ahrec")).rows())
    kept = [(row.utc_ns, row.utc_ns - row.last_ns + row.aligned_since_ns) for row in rows]
    since += [(t / SECOND, aligned / SECOND) for t, aligned in kept]
    assert {True, False} == {t < down_s for t, _ in since}
    assert all(aligned <= t and (t < down_s) == (aligned < down_s) for t, aligned in since)
    assert kept[-1][1] == read.aligned_utc_ns
