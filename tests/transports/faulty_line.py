"""A unit behind a line on which everything goes wrong, in virtual time: the whole of a history follows from its seed.

The unit answers in order, each request at most once; that is what the link assumes of it. Even registers hold their
own address, odd ones the millisecond at which the unit read them, modulo 2¹⁶, so that every value tells where and when
it was.
"""

from __future__ import annotations

import heapq
import random
from dataclasses import dataclass

from ahgateway.clock import MILLISECOND, VirtualClock
from ahgateway.codec.access import Read, Request, Table, Write
from ahgateway.errors import AhGatewayError
from ahgateway.transports.ascii import AsciiReplies, AsciiRequests
from ahgateway.transports.base import LinkFigures, Reply
from ahgateway.transports.engine import Engine, Limits
from ahgateway.transports.fault import DETECTABLE, FaultyWire, Piece, Rule, Script
from ahgateway.transports.framing import Framing, Mbap
from ahgateway.transports.responder import Responder
from ahgateway.transports.rtu import RtuReplies, RtuRequests

WIRES: dict[str, tuple[type[Framing], type[Framing]]] = {
    "tcp": (Mbap, Mbap),
    "rtu": (RtuReplies, RtuRequests),
    "ascii": (AsciiReplies, AsciiRequests),
}
TIMEOUT_NS = 50 * MILLISECOND
PAUSE_NS = 2 * MILLISECOND
"""Longer than a second copy of a reply is behind the first: the link assumes that too."""
FAULT_RATE = 0.4
EXCHANGES, FEW_EXCHANGES = (2, 14), (1, 6)
"""Fewest and most exchanges on the bad line; how many is the seed's choice."""
SOUND = Script((), 0)
TURNS_MAX = 500
"""An exchange that needs more is one that never ends."""


@dataclass
class Outcome:
    """What became of one exchange."""

    request: Request
    reply: Reply | None = None
    error: Exception | None = None
    asked_ns: int = 0
    ended_ns: int = 0

    def done(self) -> bool:
        return self.reply is not None or self.error is not None

    def set_result(self, reply: Reply) -> None:
        self.reply = reply

    def set_exception(self, error: Exception) -> None:
        self.error = error

    @property
    def is_true(self) -> bool:
        """No value, or values that stood in the registers asked for, between request and reply."""
        if self.reply is None or not isinstance(self.request, Read):
            return True
        sent_ms, last_ms = self.reply.sent_ns // MILLISECOND, self.reply.last_ns // MILLISECOND
        for address, value in enumerate(self.reply.values, start=self.request.address):
            if address % 2 == 0 and value != address:
                return False
            if address % 2 == 1 and (value - sent_ms) % 0x10000 > last_ms - sent_ms:
                return False
        return True


class History:
    """One seeded run: `faulty` exchanges on a bad line, then sound ones until the first passes."""

    def __init__(self, seed: int, wire: str) -> None:
        client, server = WIRES[wire]
        self.clock = VirtualClock()
        self.random = random.Random(seed)
        self.wire = wire
        limits = Limits(TIMEOUT_NS, pause_ns=PAUSE_NS, quiet_ns=5 * MILLISECOND)
        self.engine = Engine(client(), limits, self.clock, LinkFigures(), wire)
        self.engine.connected(0)
        self.responder = Responder(self, server())
        self.coming: list[tuple[int, int, bytes]] = []
        self.order = 0
        self.free_ns = 0
        self.faulty = FaultyWire(wire, Script((Rule(DETECTABLE[wire], rate=FAULT_RATE),), seed))
        self.reads_at_ns = 0
        self.frames = 0

    def answer(self, request: Request) -> tuple[int, ...]:
        now_ms = self.reads_at_ns // MILLISECOND % 0x10000
        if not isinstance(request, Read):
            return ()
        return tuple(
            now_ms if address % 2 else address for address in range(request.address, request.address + request.count)
        )

    def run(self, exchanges: tuple[int, int] = EXCHANGES) -> list[Outcome]:
        """Return the outcomes of some exchanges on the bad line and of at least one on the good line after it."""
        outcomes = [self.exchange() for _ in range(self.random.randint(*exchanges))]
        self.faulty.script = SOUND
        for _ in range(200):
            outcomes.append(self.exchange())
            if outcomes[-1].reply is not None:
                break
        return outcomes

    def exchange(self) -> Outcome:
        address, count = self.random.randrange(0, 60), self.random.choice((2, 2, 2, 4, 6))
        is_read = self.random.random() < 0.85
        request = Read(1, Table.HOLDING, address, count) if is_read else Write(1, Table.HOLDING, address, (1,) * count)
        outcome = Outcome(request, asked_ns=self.clock.now_ns())
        self.engine.submit(request, outcome, outcome.asked_ns)
        for _ in range(TURNS_MAX):
            self._turn()
            if outcome.done():
                break
        else:
            outcome.error = AssertionError("the exchange never ends")
        if self.wire == "tcp" and self.engine.is_worn:
            self._renew()
        outcome.ended_ns = self.clock.now_ns()
        self.clock.advance_ns(self.random.randrange(0, 10) * MILLISECOND)
        self._deliver()
        return outcome

    def _renew(self) -> None:
        """Make a new connection, as the TCP link does where only that is clean."""
        self.coming.clear()
        self.engine.lost(self.clock.now_ns(), "worn")
        self.engine.connected(self.clock.now_ns())

    def _turn(self) -> None:
        engine, clock, coming = self.engine, self.clock, self.coming
        now_ns = clock.now_ns()
        frame = engine.outgoing(now_ns)
        if frame is not None:
            self._transmit(frame)
            return
        if not engine.is_busy:
            return  # the request has failed without being sent
        next_ns = engine.wake_ns()
        if coming and (next_ns is None or coming[0][0] < next_ns):
            next_ns = coming[0][0]
        assert next_ns is not None, "the engine waits for nothing, and for ever"
        if next_ns > now_ns:
            clock.advance_ns(next_ns - now_ns)
        self._deliver()
        engine.tick(clock.now_ns())

    def _deliver(self) -> None:
        while self.coming and self.coming[0][0] <= self.clock.now_ns():
            self.engine.received(heapq.heappop(self.coming)[2], self.clock.now_ns())

    def _transmit(self, frame: bytes) -> None:
        rng = self.random
        self.frames += 1
        asked, back = self.faulty.request(frame)
        delay_ns = rng.randrange(1, 20) * MILLISECOND
        self.reads_at_ns = max(self.free_ns, self.clock.now_ns()) + delay_ns // 2
        answered_ns = self.reads_at_ns + delay_ns // 2
        if asked:
            back = back + self.faulty.reply(self.responder.feed(asked))
        for piece in back:
            self.frames += 1
            self._send(piece, answered_ns)

    def _send(self, piece: Piece, earliest_ns: int) -> None:
        self.free_ns = max(self.free_ns, earliest_ns) + piece.delay_ns
        self.order += 1
        heapq.heappush(self.coming, (self.free_ns, self.order, piece.data))


def faults_of(seed: int, wire: str, exchanges: tuple[int, int] = EXCHANGES) -> list[str]:
    """Run one history and say what in it broke a law; empty when all is well."""
    history = History(seed, wire)
    return broken_laws(history, history.run(exchanges), seed)


def broken_laws(history: History, outcomes: list[Outcome], seed: int, *, is_end: bool = True) -> list[str]:
    """Say which of the outcomes broke a law."""
    wire = history.wire
    said = []
    for outcome in outcomes:
        if not outcome.is_true:
            said.append(f"{wire} seed {seed}: {outcome.request} got {outcome.reply}")
        if outcome.ended_ns - outcome.asked_ns > 6 * TIMEOUT_NS:
            said.append(f"{wire} seed {seed}: {outcome.request} took {(outcome.ended_ns - outcome.asked_ns) / 1e6} ms")
        if outcome.error is not None and not isinstance(outcome.error, AhGatewayError):
            said.append(f"{wire} seed {seed}: {outcome.error!r}")
    if is_end and outcomes[-1].reply is None:
        said.append(f"{wire} seed {seed}: the line is sound and the link has not come back")
    return said
