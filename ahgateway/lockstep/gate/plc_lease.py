"""The gateway's side of the lease that the PLC keeps: claim, beat, slots, give back. The block is `codec.lease`.

This file alone decides when the PLC is believed to stand guard. Nothing is armed before the snippet was seen alive, in
the layout that the profile gives, and has granted the lease to our owner word. Whoever holds the gate armed comes by
often enough (`beat`); a beat that would come too late is found out by the PLC, which puts the loop back by itself.
"""

from __future__ import annotations

import random
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from ahgateway.clock import MILLISECOND, SECOND, Clock
from ahgateway.codec import lease, lease_text
from ahgateway.codec.access import Span, Write
from ahgateway.codec.block import Raw
from ahgateway.codec.station import Loop, Station
from ahgateway.errors import StateError
from ahgateway.lockstep.gate.change import Step
from ahgateway.lockstep.gate.session import Session
from ahgateway.lockstep.gate.wire import Wire

BEATS_PER_TIMEOUT = 4
CALLS_TO_WAIT = 3
"""So many calls of the snippet are waited for where one would do."""
SNIPPET_HINT = "`ahgateway plc-code heartbeat` writes the snippet; without [loops.TAG.lease] the gate asks for none"


@dataclass(frozen=True, slots=True)
class Head:
    """The head of the block, as it stood at one moment."""

    words: tuple[int, ...]

    @property
    def owner(self) -> int:
        """Owner word that has the lease, 0 for nobody."""
        return self.words[lease.OWNER]

    def put_back(self, owner: int) -> bool:
        """Tell whether the PLC itself put back what this owner wrote."""
        return self.words[lease.EXPIRED] == owner and self.words[lease.RESULT] == lease.PUT_BACK


class PlcLease:
    """The lease of one loop, as one gateway holds it.

    Args:
        station: The PLC.
        loop: The loop, with a lease.
        wire: The gate's wire.
        clock: Says when a beat is due.

    Attributes:
        owner: Our owner word while we hold the lease, else 0.
        period_ns: Beats are due this often.
    """

    def __init__(self, station: Station, loop: Loop, wire: Wire, clock: Clock) -> None:
        self.owner = 0
        self._station, self._loop, self._wire, self._clock = station, loop, wire, clock
        self._block = lease.layout(loop)
        self._slots = {slot.operand: slot for slot in self._block.slots}
        self._number = lease_text.number(loop, self._block)
        place = station.devices.address(self._block.device(0))
        self._table, self._first = place.table, place.address
        self._beat, self._beaten_ns = 1, 0
        self._timeout_ns = self._block.spec.timeout_ms * MILLISECOND
        self._call_ns = CALLS_TO_WAIT * self._block.spec.task_ms * MILLISECOND
        self.period_ns = self._timeout_ns // BEATS_PER_TIMEOUT

    async def take(self, *, owner: int = 0, is_return: bool = False) -> None:
        """Claim the lease and wait until the PLC has granted it.

        Args:
            owner: Owner word that an earlier run of ours had, so that its lease is taken up again; 0 for none.
            is_return: Something is to be put back, which no missing snippet may hinder.

        Raises:
            StateError: The snippet does not run, has another layout, or another gateway holds the lease.
            TransportError: The link failed.
            PlcRefusedError: The PLC refused it.
        """
        head, fault = await self._alive()
        if fault and is_return:
            return
        if fault:
            raise StateError(fault, hint=SNIPPET_HINT)
        if owner and head.owner == owner:
            self.owner = owner
            await self._send_beat(head.words[lease.LAST] % lease.COUNT_MAX + 1)
            return
        if head.owner:
            await self._wait_until_free(head)
        self.owner = random.SystemRandom().randint(1, lease.COUNT_MAX)
        self._beat, self._beaten_ns = 1, self._clock.now_ns()
        await self._write(lease.CLAIM, (self.owner, self.owner, 1))
        await self._clock.sleep_ns(self._call_ns)
        head = await self.head()
        if head.owner != self.owner:
            self.owner = 0
            raise self._taken(head)

    async def _alive(self) -> tuple[Head, str]:
        """Return the head, and why the snippet cannot be trusted, empty when it can."""
        first = await self.head()
        await self._clock.sleep_ns(self._call_ns)
        head = await self.head()
        where = f"loop {self._loop.name}: the lease at {self._block.device(0)}"
        if head.words[lease.ALIVE] == first.words[lease.ALIVE]:
            return head, f"{where} stands still: the PLC does not run its snippet, and would not put the loop back"
        if head.words[lease.LAYOUT] != self._number:
            return head, (
                f"{where} has layout {head.words[lease.LAYOUT]}, the profile gives {self._number}: the snippet in the "
                "PLC was made from another profile"
            )
        return head, ""

    async def _wait_until_free(self, head: Head) -> None:
        """Another owner word stands there: one that beats is another gateway, one that does not runs out."""
        ends_ns = self._clock.now_ns() + self._timeout_ns + self._call_ns
        while self._clock.now_ns() < ends_ns:
            await self._clock.sleep_ns(self._call_ns)
            now = await self.head()
            if not now.owner:
                return
            if now.owner != head.owner or now.words[lease.LAST] != head.words[lease.LAST]:
                break
        raise self._taken(head)

    def _taken(self, head: Head) -> StateError:
        return StateError(
            f"loop {self._loop.name} is armed by another gateway: owner word {head.owner} stands in the lease at "
            f"{self._block.device(lease.OWNER)} of the PLC, and beats",
            hint="end that one first; only one may write",
        )

    async def guard(self, found: Raw) -> None:
        """Let the PLC watch the operands of the mode, as they were found."""
        watched = {slot.operand: (found[slot.operand],) * 3 for slot in self._block.slots if not slot.is_restored}
        await self._fill(watched)

    async def intend(self, session: Session, step: Step) -> None:
        """Say what was found in these operands, and what can stand there before and behind the write that follows."""
        await self._fill({item.operand: (session.as_found[item.operand], item.old, item.new) for item in step.items})

    async def prove(self, session: Session, step: Step) -> None:
        """Say that a fresh read has shown the write: what stood there before is nobody's any more."""
        await self._fill({item.operand: (session.as_found[item.operand], item.new, item.new) for item in step.items})

    async def _fill(self, wanted: Mapping[str, tuple[tuple[int, ...], ...]]) -> None:
        for operand, (found, before, after) in wanted.items():
            slot = self._slots.get(operand)
            if slot is not None and self.owner:
                await self._write(slot.at, slot.words(found, before, after))

    async def beat(self) -> None:
        """Beat when it is due.

        Raises:
            StateError: The lease is not ours any more: the PLC has put the loop back, or somebody else took it.
            TransportError: The link failed.
            PlcRefusedError: The PLC refused it.
        """
        if not self.owner or self._clock.now_ns() - self._beaten_ns < self.period_ns:
            return
        head = await self.head()
        if head.owner == self.owner:
            await self._send_beat(self._beat % lease.COUNT_MAX + 1)
            return
        owner, self.owner = self.owner, 0
        raise self._lost(head, owner) if head.words[lease.EXPIRED] == owner else self._taken(head)

    def _lost(self, head: Head, owner: int) -> StateError:
        late_s = (self._clock.now_ns() - self._beaten_ns) / SECOND
        does = "has put the loop back by itself" if head.put_back(owner) else "found the loop taken over"
        return StateError(
            f"loop {self._loop.name}: no beat for {late_s:.3g} s, the lease ends after "
            f"{self._timeout_ns / SECOND:g} s: the PLC {does}",
            hint="is this laptop or the line too slow for timeout_ms of the lease?",
        )

    async def release(self) -> None:
        """Give the lease back, so that the PLC puts nothing back any more.

        Raises:
            StateError: The lease had run out already, or the PLC did not take it back.
            TransportError: The link failed.
            PlcRefusedError: The PLC refused it.
        """
        owner, self.owner = self.owner, 0
        if not owner:
            return
        await self._write(lease.BEAT_OWNER, (owner, 0))
        await self._clock.sleep_ns(self._call_ns)
        head = await self.head()
        if owner in (head.owner, head.words[lease.EXPIRED]):
            raise self._lost(head, owner)

    async def head(self) -> Head:
        """Read the head of the block."""
        span = Span(self._table, self._first, lease.HEAD_WORDS)
        return Head(await self._wire.read(span))

    async def _send_beat(self, beat: int) -> None:
        self._beat, self._beaten_ns = beat, self._clock.now_ns()
        await self._write(lease.BEAT_OWNER, (self.owner, beat))

    async def _write(self, at: int, words: Iterable[int]) -> None:
        await self._wire.send(Write(self._station.unit, self._table, self._first + at, tuple(words)))
