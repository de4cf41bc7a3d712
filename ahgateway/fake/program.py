"""A PID instruction as an item of the PLC program: when it is due, what it reads, what it leaves.

This file alone decides the schedule of executions (spec §1.1): time is gathered scan by scan, an execution is due
when it reaches the sampling time, the excess is carried over, and whatever would make the next one due at once is
dropped. While EN is off nothing is executed and no time is gathered (ASSUMED, spec A.8/12).
"""

from __future__ import annotations

import random
from collections import deque
from typing import Any, NamedTuple

from ahgateway.codec.station import Loop
from ahgateway.core.dialect import FirstCall
from ahgateway.core.real import REAL
from ahgateway.fake import autotune
from ahgateway.fake.faults import Fault, Step
from ahgateway.fake.memory import Memory
from ahgateway.fake.wiring import Wiring

TIME_GRID_NS = 100_000
"""Sampling times are whole multiples of 0.1 ms, the finest unit in which Delta counts scan time (ASSUMED)."""


class Execution(NamedTuple):
    """One execution as it happened inside the PLC.

    Attributes:
        time_ns: Time of the PLC.
        inputs: What the instruction read.
        before: State before it, as memory and the hidden part held it.
        state: State after it.
        terms: Every term.
        ts: Sampling time in s that it computed with.
        since_ns: Time since the execution before, 0 for the first.
    """

    time_ns: int
    inputs: Any
    before: Any
    state: Any
    terms: Any
    ts: REAL
    since_ns: int


class PidItem:
    """One DPID, DPIDE or another instruction with the same shape.

    Attributes:
        loop: The loop.
        wiring: Its operands.
        executed: How often it has been executed since power-up.
        skip: Executions that will be due and not happen.
        log: The last executions, oldest first.
        tuning: The relay experiment under way, None outside PID_MODE = 1; a model, not the vendor's.
        hysteresis: How far PV must pass SV, in PV's unit, before the experiment turns MV; ERR_DBW counts if larger.
    """

    def __init__(self, loop: Loop, memory: Memory, rng: random.Random, *, log_max: int, is_restless: bool) -> None:
        self.loop = loop
        self.wiring = Wiring(loop, memory)
        self.log: deque[Execution] = deque(maxlen=log_max)
        self.tuning: autotune.Relay | None = None
        self.hysteresis = 0.0
        self._memory = memory
        self._rng = rng
        self._is_restless = is_restless
        self._fault: Fault | None = None
        self._step: Step = loop.controller.step
        self.power_up()

    def power_up(self) -> None:
        """Forget everything that stands in no register: the hidden state, the gathered time, the counters."""
        self.executed = 0
        self.skip = 0
        self.tuning = None
        self._state = self.loop.controller.state()
        self._is_first = True
        self._gathered_ns = 0
        self._last_ns: int | None = None
        self._ts = REAL(0)
        self._ts_ns = 0
        self._generation = -1
        self._pv_before: REAL | None = None

    def fail(self, fault: Fault | None) -> None:
        """Compute wrongly from the next execution on, or rightly again with None."""
        self._fault = fault
        self._step = fault.wrong(self.loop.controller.step) if fault else self.loop.controller.step

    def scan(self, now_ns: int, elapsed_ns: int) -> bool:
        """Evaluate the instruction once; tell whether it was executed.

        Args:
            now_ns: Time of the PLC, for the log.
            elapsed_ns: Time since the scan before.
        """
        pv_before, self._pv_before = self._pv_before, None
        if self._fault is not None and self._fault.is_pv_late:
            self._pv_before = self.wiring.get("PV")
        if not self.wiring.enabled():
            return False
        if self._is_restless:
            self.wiring.junk(self._rng)
        if not self._is_due(elapsed_ns):
            return False
        if self.skip > 0:
            self.skip -= 1
            return False
        self._execute(now_ns, pv_before)
        return True

    def _is_due(self, elapsed_ns: int) -> bool:
        if self._generation != self._memory.generation:
            self._generation = self._memory.generation
            self._ts = self.loop.controller.nominal_ts(self.wiring.inputs())
            self._ts_ns = round(float(self._ts) * 1e9 / TIME_GRID_NS) * TIME_GRID_NS
        if self._is_first:
            self._is_first = False
            return self.loop.dialect.first_call == FirstCall.AT_ONCE
        self._gathered_ns += elapsed_ns
        if self._gathered_ns < self._ts_ns:
            return False
        self._gathered_ns -= self._ts_ns
        if self._gathered_ns >= self._ts_ns:
            self._gathered_ns = 0
        return True

    def _execute(self, now_ns: int, pv_before: REAL | None) -> None:
        inputs = self.wiring.inputs()
        seen_inputs = inputs if pv_before is None else inputs._replace(pv=pv_before)
        before = self.wiring.recalled(self._state)
        state, terms = self._step(seen_inputs, before, self.loop.dialect, self._ts)
        if inputs.pid_run and inputs.pid_mode == 1:
            state, terms = self._tune(inputs, state, terms)
        else:
            self.tuning = None
        self.wiring.leave(state, terms)
        self._state = state
        since_ns = 0 if self._last_ns is None else now_ns - self._last_ns
        self._last_ns = now_ns
        self.executed += 1
        self.log.append(Execution(now_ns, seen_inputs, before, state, terms, self._ts, since_ns))

    def _tune(self, inputs: Any, state: Any, terms: Any) -> tuple[Any, Any]:
        """Go on with the relay experiment; the law itself holds while PID_MODE is 1."""
        error = float(inputs.sv - inputs.pv if inputs.pid_dir else inputs.pv - inputs.sv)
        if error != error:
            return state, terms
        if self.tuning is None:
            self.tuning = autotune.begin(error)
        else:
            hysteresis = max(abs(float(inputs.err_dbw)), self.hysteresis)
            self.tuning = autotune.swing(self.tuning, error, float(inputs.pv), hysteresis, float(self._ts))
        low, high = sorted((inputs.mv_min, inputs.mv_max))
        if self.tuning.is_done:
            found = autotune.gains(self.tuning, float(high) - float(low))
            names = frozenset(row.name for row in self.loop.controller.operands)
            is_dependent = bool(getattr(inputs, "pid_eq", False))
            self.wiring.put_all({**autotune.as_operands(found, names, is_dependent), "PID_MODE": 0})
        mv = high if self.tuning.is_high else low
        return state._replace(mv=mv), terms._replace(mv=mv)
