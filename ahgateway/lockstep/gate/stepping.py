"""Letting the instruction execute once: the gate's class of writes for a bench whose contact EN is a coil of ours.

The coil is set, the PLC lets the instruction through, counts, and clears the coil again. So nothing is read back but
the count; the coil is one more operand of the loop that is streamed, as the process value of a bench is: the first time
stands in the journal, and what is left of it is put back like everything else.
"""

from __future__ import annotations

from dataclasses import replace

from ahgateway.clock import MILLISECOND, SECOND, Clock
from ahgateway.codec.access import Span, Write
from ahgateway.codec.record_layout import RANGE
from ahgateway.codec.station import Loop, Station, WriteLimit
from ahgateway.core.operands import Access, Kind, Operand, Source
from ahgateway.errors import StateError, TransportError
from ahgateway.lockstep.gate.wire import Wire

TRIGGER = "TRIGGER"
LOOKS_PER_CYCLE = 8
LOOK_MIN_NS = 5 * MILLISECOND
PATIENCE_NS = 2 * SECOND
PATIENCE_CYCLES = 3

_ROW = Operand(
    TRIGGER, Kind.BOOL, "", None, None, None, Access.IN, Source.ASSUMED, "coil that lets one execution through", 0
)


def with_trigger(loop: Loop) -> Loop:
    """Return the loop with its trigger as an operand that may be written; as it is without one."""
    if loop.trigger is None or TRIGGER in loop.bindings:
        return loop
    return replace(
        loop,
        controller=replace(loop.controller, operands=(*loop.controller.operands, _ROW)),
        bindings={**loop.bindings, TRIGGER: loop.trigger.coil},
        writes={**loop.writes, TRIGGER: WriteLimit(interval_s=0.0)},
    )


def check_can_step(loop: Loop, station: Station) -> None:
    """Make sure that the loop's executions can be let through one by one.

    Raises:
        StateError: The station is no bench, or the loop has no trigger.
    """
    if loop.trigger is None:
        raise StateError(
            f"loop {loop.name}: nothing lets its executions through one by one",
            hint=f"[loops.{loop.name}.trigger] in the profile, and `ahgateway plc-code trigger` for the program",
        )
    if not station.bench:
        raise StateError(
            f'loop {loop.name}: executions are triggered only on a station of kind = "bench", '
            f"and {station.name} is a plant"
        )


class Stepping:
    """One loop's trigger.

    Raises:
        StateError: The station is no bench, or the loop has no trigger.
    """

    def __init__(self, loop: Loop, station: Station, wire: Wire, clock: Clock) -> None:
        check_can_step(loop, station)
        assert loop.trigger is not None
        self.coil = loop.trigger.coil
        self._loop, self._wire, self._clock = loop, wire, clock
        place = station.devices.address(self.coil, bits=True)
        count = station.devices.address(loop.trigger.counter)
        self._set = Write(station.unit, place.table, place.address, (1,))
        self._count = Span(count.table, count.address, 1)

    async def once(self, cycle_ns: int) -> int:
        """Set the coil and wait until the PLC has counted; return by how much.

        Args:
            cycle_ns: The loop's CYCLE, or the interval of its task.

        Raises:
            StateError: Nothing was counted in time.
            TransportError: The link failed when the count was read.
            PlcRefusedError: The PLC refused it.
        """
        before = (await self._wire.read(self._count))[0]
        lost: TransportError | None = None
        try:
            await self._wire.send(self._set)
        except TransportError as error:
            # Nobody knows whether it arrived; it is not sent again, the count decides.
            lost = error
        patience_ns = max(PATIENCE_NS, PATIENCE_CYCLES * cycle_ns)
        ends_ns = self._clock.now_ns() + patience_ns
        while self._clock.now_ns() < ends_ns:
            await self._clock.sleep_ns(max(LOOK_MIN_NS, cycle_ns // LOOKS_PER_CYCLE))
            counted = ((await self._wire.read(self._count))[0] - before) % RANGE
            if counted:
                return counted
        raise StateError(
            f"loop {self._loop.name}: `{self.coil}` was set and nothing was counted within "
            f"{patience_ns / SECOND:g} s{f'; {lost.message}' if lost else ''}",
            hint="is the trigger snippet in the program, EN gated by the coil, the PLC in RUN?",
        )
