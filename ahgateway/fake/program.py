"""A PID instruction as an item of the PLC program: when it is due, what it reads, what it leaves.

This file alone decides the schedule of executions (spec §1.1): time is gathered scan by scan, an execution is due
when it reaches the sampling time, the excess is carried over, and whatever would make the next one due at once is
dropped. While EN is off nothing is executed and no time is gathered (ASSUMED, spec A.8/12). The dialect's axes of the
schedule change this where they say so, and hand in the measured interval, on the clock's grid, instead of CYCLE. In an
interval task every call is an execution.
"""

from __future__ import annotations

import random
from collections import deque
from typing import Any, NamedTuple

from ahgateway.codec.station import Loop
from ahgateway.core.controllers import dpide
from ahgateway.core.controllers.delta import limit
from ahgateway.core.controllers.delta_terms import ticks_per_second
from ahgateway.core.dialect import (
    DEFAULT,
    Clamped,
    CrossScan,
    CycleChange,
    Dialect,
    EnOffTime,
    EnOnHistory,
    FirstCall,
    Limits,
    ManualRefresh,
    MoutScan,
    RunOffScan,
    RunOn,
    Schedule,
    StopHistory,
)
from ahgateway.core.operands import Kind
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
        # The schedule's axes are those of Delta's dialect; other laws are scheduled as by default.
        self._dialect: Dialect = DEFAULT if loop.controller.law_ts is None else loop.dialect
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
        self._ts_ns = self._next_ts_ns = 0
        self._scan_er: REAL | None = None
        self._generation = -1
        self._pv_before: REAL | None = None
        self._was_enabled = True
        self._was_run = True

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
        dialect = self._dialect
        if not self.wiring.enabled():
            self._was_enabled = False
            if dialect.en_off_time == EnOffTime.RUNS:
                self._gathered_ns += elapsed_ns
            return False
        if not self._was_enabled:
            self._was_enabled = True
            if dialect.en_on_history == EnOnHistory.FORGOTTEN:
                self.forget()
        if self._is_restless:
            self.wiring.junk(self._rng)
        if not self._is_due(elapsed_ns) and not self._stops_now():
            self._between()
            return False
        if self.skip > 0:
            self.skip -= 1
            return False
        self._execute(now_ns, pv_before)
        return True

    def idle_ns(self) -> int:
        """How long scans do nothing but gather time, as long as nobody writes; 0 where the next one may do more."""
        dialect = self._dialect
        acts_between = (
            dialect.manual_refresh == ManualRefresh.EACH_SCAN
            or dialect.cross_scan == CrossScan.EACH_SCAN
            or dialect.mout_scan == MoutScan.EACH_SCAN
            or dialect.run_off_scan == RunOffScan.EVERY_SCAN
            or self._is_restless
            or (self._fault is not None and self._fault.is_pv_late)
        )
        is_at_rest = self._generation == self._memory.generation and self.wiring.enabled() and not self._is_first
        return self._ts_ns - self._gathered_ns if is_at_rest and not acts_between else 0

    def idle(self, elapsed_ns: int) -> None:
        """Gather the time of scans that did nothing else."""
        self._gathered_ns += elapsed_ns

    def _between(self) -> None:
        """What some dialects do at a scan at which no execution is due."""
        dialect = self._dialect
        if dialect.manual_refresh == ManualRefresh.EACH_SCAN:
            self._refresh_manual()
        if dialect.cross_scan == CrossScan.EACH_SCAN and hasattr(self._state, "cross"):
            inputs = self.wiring.inputs()
            er = dpide.raw_error(inputs, inputs.pv, dialect)
            last = er if self._scan_er is None else self._scan_er
            if inputs.pid_run and er == er:
                self._state = self._state._replace(cross=dpide.crossed(inputs, er, last, self._state.cross, dialect))
                self._scan_er = er
        if dialect.mout_scan == MoutScan.EACH_SCAN and self.executed:
            inputs = self.wiring.inputs()
            if inputs.mout_auto and inputs.pid_run and not inputs.pid_man and inputs.mout != self._state.mv:
                self.wiring.put("MOUT", float(self._state.mv))

    def stopped(self) -> None:
        """The PLC went to STOP and back to RUN."""
        if self._dialect.stop_history == StopHistory.FORGOTTEN:
            self.forget()

    def forget(self) -> None:
        """The next execution starts anew, whatever came before."""
        if hasattr(self._state, "valid"):
            self._state = self._state._replace(valid=False)

    def _is_due(self, elapsed_ns: int) -> bool:
        dialect = self._dialect
        if self._generation != self._memory.generation:
            self._generation = self._memory.generation
            inputs = self.wiring.inputs()
            self._next_ts_ns = round(float(self.loop.controller.nominal_ts(inputs)) * 1e9 / TIME_GRID_NS) * TIME_GRID_NS
            if self._is_first or dialect.cycle_change != CycleChange.NEXT:
                self._ts_ns = self._next_ts_ns
            self._note_run(inputs)
        if self.loop.interval_ms is not None:
            return True
        if self._is_first:
            self._is_first = False
            if dialect.first_call == FirstCall.AFTER_CYCLE:
                self._gathered_ns = 0
                return False
            return True
        self._gathered_ns += elapsed_ns
        if self._gathered_ns < self._ts_ns:
            return False
        self._gathered_ns -= self._ts_ns
        self._ts_ns = self._next_ts_ns
        if self._gathered_ns >= self._ts_ns or dialect.schedule == Schedule.DRIFTING:
            self._gathered_ns = 0
        return True

    def _note_run(self, inputs: Any) -> None:
        """When PID_RUN rises, the dialect may begin a new schedule."""
        is_run = bool(getattr(inputs, "pid_run", True))
        if is_run and not self._was_run and self._dialect.run_on != RunOn.GOES_ON:
            is_now = self._dialect.run_on == RunOn.AT_ONCE
            self._gathered_ns = self._ts_ns if is_now else 0
        self._was_run = is_run

    def _stops_now(self) -> bool:
        """PID_RUN = FALSE acts at every scan in some dialects; once is enough, since it leaves what it finds."""
        if self._dialect.run_off_scan != RunOffScan.EVERY_SCAN or self._was_run:
            return False
        return bool(self._state.mv != 0) or bool(self.wiring.get("MV") != 0)

    def _refresh_manual(self) -> None:
        """MV follows MOUT at each scan in manual, limited as at an execution."""
        inputs = self.wiring.inputs()
        if not (inputs.pid_run and inputs.pid_man and inputs.pid_mode != 1) or inputs.mout != inputs.mout:
            return
        low, high = inputs.mv_min, inputs.mv_max
        if high < low and self._dialect.limits != Limits.AS_WRITTEN:
            low, high = high, low
        mv = limit(low, inputs.mout, high)
        if self._state.man1 and mv != self._state.mv:
            self._state = self._state._replace(mv=mv)
            self.wiring.put("MV", float(mv))

    def _ts(self, inputs: Any, now_ns: int) -> REAL:
        """The interval as the law takes it; measured as the difference of two readings of the clock."""
        per_second = ticks_per_second(self._dialect)
        ticks = 0
        if per_second:
            ticks = round(float(self.loop.controller.nominal_ts(inputs)) * per_second)
            if self._last_ns is not None:
                tick_ns = 1_000_000_000 // per_second
                ticks = max(1, now_ns // tick_ns - self._last_ns // tick_ns)
        return self.loop.controller.ts(inputs, self.loop.dialect, ticks)

    def _execute(self, now_ns: int, pv_before: REAL | None) -> None:
        inputs = self.wiring.inputs()
        ts = self._ts(inputs, now_ns)
        seen_inputs = inputs if pv_before is None else inputs._replace(pv=pv_before)
        before = self.wiring.recalled(self._state)
        state, terms = self._step(seen_inputs, before, self.loop.dialect, ts)
        if inputs.pid_run and inputs.pid_mode == 1:
            state, terms = self._tune(inputs, state, terms, ts)
        else:
            self.tuning = None
        self.wiring.leave(state, terms)
        self._write_back(inputs)
        self._state = state
        self._scan_er = getattr(state, "er1", None)
        since_ns = 0 if self._last_ns is None else now_ns - self._last_ns
        self._last_ns = now_ns
        self.executed += 1
        self.log.append(Execution(now_ns, seen_inputs, before, state, terms, ts, since_ns))

    def _write_back(self, inputs: Any) -> None:
        """Put corrected operands into their registers where the dialect does."""
        if self._dialect.limits == Limits.WRITTEN_BACK and inputs.mv_max < inputs.mv_min:
            self.wiring.put_all({"MV_MAX": float(inputs.mv_min), "MV_MIN": float(inputs.mv_max)})
        if self._dialect.clamped != Clamped.WRITTEN_BACK:
            return
        for row in self.loop.controller.operands:
            if row.kind not in (Kind.REAL, Kind.DINT) or row.minimum is None:
                continue
            value = getattr(inputs, row.attr)
            held = max(value, row.minimum) if row.maximum is None else min(max(value, row.minimum), row.maximum)
            if held != value and row.name != "PID_MODE":
                self.wiring.put_all({row.name: held})

    def _tune(self, inputs: Any, state: Any, terms: Any, ts: REAL) -> tuple[Any, Any]:
        """Go on with the relay experiment; the law itself holds while PID_MODE is 1."""
        error = float(inputs.sv - inputs.pv if inputs.pid_dir else inputs.pv - inputs.sv)
        if error != error:
            return state, terms
        if self.tuning is None:
            self.tuning = autotune.begin(error)
        else:
            hysteresis = max(abs(float(inputs.err_dbw)), self.hysteresis)
            self.tuning = autotune.swing(self.tuning, error, float(inputs.pv), hysteresis, float(ts))
        low, high = sorted((inputs.mv_min, inputs.mv_max))
        if self.tuning.is_done:
            found = autotune.gains(self.tuning, float(high) - float(low))
            names = frozenset(row.name for row in self.loop.controller.operands)
            is_dependent = bool(getattr(inputs, "pid_eq", False))
            self.wiring.put_all({**autotune.as_operands(found, names, is_dependent), "PID_MODE": 0})
        mv = high if self.tuning.is_high else low
        return state._replace(mv=mv), terms._replace(mv=mv)
