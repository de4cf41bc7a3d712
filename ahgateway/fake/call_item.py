"""A block that the program calls at a fixed interval, as an item of the program: MELSEC PID, PID_REG_CE, PID_Temp.

As `program.PidItem`, with three differences: the process value is copied into the block's register just before a call
where the loop says that it holds still between calls; a counter counts the calls where the loop names one; and a
contact EN among the operands, when it turns off, makes the next execution start afresh and at once (ASSUMED, C.3).
"""

from __future__ import annotations

import random
from collections.abc import Callable
from typing import Any

from ahgateway.codec.block import COUNTER, EN, address
from ahgateway.codec.station import Loop
from ahgateway.codec.ways import COUNTS
from ahgateway.fake.memory import Memory
from ahgateway.fake.program import Execution, PidItem


class CallItem(PidItem):
    """One block of the three.

    Attributes:
        sense: Copies the process value into its register before a call; None where the program does so in each scan.
    """

    sense: Callable[[], None] | None

    def __init__(self, loop: Loop, memory: Memory, rng: random.Random, *, log_max: int, is_restless: bool) -> None:
        self.sense = None
        self._has_contact = any(row.name == EN for row in loop.controller.operands)
        self._counter = None if loop.counter is None else memory.words_at(address(loop, memory.devices, COUNTER), 1)
        super().__init__(loop, memory, rng, log_max=log_max, is_restless=is_restless)

    def scan(self, now_ns: int, elapsed_ns: int) -> bool:
        """Evaluate the block once; tell whether it was executed; see `PidItem.scan`."""
        if not self.wiring.enabled():
            if self._has_contact:
                self._state = self._state._replace(valid=False)
                self._is_first = True
                self._gathered_ns = 0
            return False
        if not self._is_due(elapsed_ns):
            return False
        if self.skip > 0:
            self.skip -= 1
            return False
        if self.sense is not None:
            self.sense()
        self._call(now_ns)
        return True

    def _call(self, now_ns: int) -> None:
        inputs: Any = self.wiring.inputs()
        ts = self.loop.controller.ts(inputs, self.loop.dialect)
        before = self.wiring.recalled(self._state)
        state, terms = self._step(inputs, before, self.loop.dialect, ts)
        self.wiring.leave(state, terms)
        self._state = state
        since_ns = 0 if self._last_ns is None else now_ns - self._last_ns
        self._last_ns = now_ns
        self.executed += 1
        if self._counter is not None:
            self._counter[0] = (int(self._counter[0]) + 1) % COUNTS
        self.log.append(Execution(now_ns, inputs, before, state, terms, ts, since_ns))
