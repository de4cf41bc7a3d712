"""A PLC without iron: memory, scan, program, processes, and the ways in which a real one misbehaves.

One scan is inputs (the plant moves on, PV is written), interval tasks that are due, program (every instruction in the
profile's order), outputs (MV goes to the actuator). Communication happens between scans, at the scan's end. Time is the
PLC's own and moves only in `scan`, `advance` or, when a clock was handed in, up to its time before each answer.

Source:
    MANUAL order of the scan.
    ASSUMED SM400 on and SM402 on in the first scan (spec ah500 §3.6, remembered); outputs go to 0 in STOP and PV
    stands still, since it is the program that scales it.
"""

from __future__ import annotations

import random
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any, NamedTuple

from ahgateway.clock import MILLISECOND, Clock
from ahgateway.codec.access import Read, Request, Table
from ahgateway.codec.block import address
from ahgateway.codec.devices import Device
from ahgateway.codec.lease_text import heartbeat
from ahgateway.codec.station import FakeLoop, Loop, Station
from ahgateway.core.real import quiet
from ahgateway.errors import CodecError, PlcRefusedError, StateError
from ahgateway.fake.call_item import CallItem
from ahgateway.fake.faults import fault as fault_named
from ahgateway.fake.memory import BUSY, BitCell, Limits, Memory
from ahgateway.fake.process import Process
from ahgateway.fake.program import Execution, PidItem
from ahgateway.fake.rigs import DEFAULT_PLANT
from ahgateway.fake.structured_text import Snippet
from ahgateway.fake.task import Task, is_plain

ALWAYS_ON, ALWAYS_OFF, FIRST_ON, FIRST_OFF, IS_RUNNING = 400, 401, 402, 403, 215
"""Numbers of the SM flags (ASSUMED, spec ah500 §3.6)."""


class Written(NamedTuple):
    """One write into the memory from outside the program: `who` is `link` for a request."""

    time_ns: int
    who: str
    table: Table
    address: int
    values: tuple[int, ...]


@dataclass(slots=True)
class Refusal:
    """Answer every request that touches these addresses with a Modbus exception; `count` times, None for ever."""

    table: Table
    first: int
    last: int
    code: int
    count: int | None = None


def _item_type(loop: Loop) -> type[PidItem]:
    """Delta's instructions keep their own schedule, the other blocks are called."""
    return PidItem if loop.controller.begin is None else CallItem


class FakePlc:
    """One station in memory, ready to be handed to a link or a server as its device.

    Args:
        station: Device map, station number and loops.
        setups: Loop name to what it starts with; a loop without one, or with an empty one, starts with its
            operands' defaults and a first-order plant.
        seed: Of the noise and of the junk in the system's words.
        scan_ns: Time of one scan.
        clock: When given, the PLC catches up with it before each answer.
        words_max: Most words in one request; more is answered with exception 3.
        is_restless: The system's words of I_MV change with every scan instead of standing still.
        log_max: Executions kept per loop, and writes kept.

    Attributes:
        memory: The memory image.
        now_ns: Time since power-up, of the last scan.
        scans: Scans since power-up.
        items: The program: loop name to instruction.
        snippets: Snippets in interval tasks: the lease of each loop that has one.
        processes: Loop name to its process, for the loops that have one.
        writes: Writes from outside, oldest first.
        refusals: Exceptions to answer with.
        busy: Requests still to be answered with exception 6.
        is_running: RUN or STOP.
    """

    def __init__(
        self,
        station: Station,
        setups: Mapping[str, FakeLoop] | None = None,
        *,
        seed: int = 0,
        scan_ns: int = 5 * MILLISECOND,
        clock: Clock | None = None,
        words_max: int = 125,
        is_restless: bool = False,
        log_max: int = 10_000,
    ) -> None:
        self.station = station
        self.scan_ns = scan_ns
        self.memory = Memory(station.devices, Limits.of_words(words_max))
        self.now_ns = 0
        self.scans = 0
        self.writes: deque[Written] = deque(maxlen=log_max)
        self.refusals: list[Refusal] = []
        self.busy = 0
        self.is_running = True
        self._is_first_scan = True
        self._owed_ns = 0
        self._slow: deque[int] = deque()
        self._script: list[tuple[int, int, Callable[[FakePlc], None]]] = []
        self._rng = random.Random(seed)
        self._clock = clock
        self._origin_ns = clock.now_ns() if clock else 0
        self._flags = self._system_flags()
        self.items = {
            loop.name: _item_type(loop)(loop, self.memory, self._rng, log_max=log_max, is_restless=is_restless)
            for loop in station.loops
        }
        first = self._flags.get(FIRST_ON)
        self._tasks = [Task(item, self.memory, first) for item in self.items.values()]
        self._program = [task.item.scan if is_plain(task.item.loop) else task.run for task in self._tasks]
        self.snippets = [
            Snippet(heartbeat(station, loop), self.memory, loop.lease.task_ms * MILLISECOND)
            for loop in station.loops
            if loop.lease is not None
        ]
        self.processes: dict[str, Process] = {}
        self._sensed: list[Process] = []
        setups = setups or {}
        for name in setups:
            self._item(name)
        for item in self.items.values():
            item.wiring.defaults()
            item.wiring.junk(self._rng)
        for name, item in self.items.items():
            setup = setups.get(name)
            self._set_up(item, FakeLoop(plant=DEFAULT_PLANT) if setup in (None, FakeLoop()) else setup)
        # A trigger, a recorder, a lease and whatever moves step by step want each scan for themselves.
        self._may_pass = (
            not self.snippets
            and all(is_plain(loop) for loop in station.loops)
            and not any(process.rig.is_stepped for process in self.processes.values())
        )
        self._show_mode()

    def scan(self, elapsed_ns: int | None = None) -> None:
        """Run one scan that comes `elapsed_ns` after the one before; `scan_ns` by default."""
        with quiet(all="ignore"):
            self._scan(self.scan_ns if elapsed_ns is None else elapsed_ns)

    def _scan(self, elapsed: int) -> None:
        self.now_ns += elapsed
        while self._script and self._script[0][0] <= self.now_ns:
            self._script.pop(0)[2](self)
        for process in self.processes.values():
            process.advance(elapsed)
        if not self.is_running:
            return
        for process in self._sensed:
            process.sense()
        for snippet in self.snippets:
            snippet.scan(elapsed)
        for run in self._program:
            run(self.now_ns, elapsed)
        for process in self.processes.values():
            process.drive()
        self.scans += 1
        if self._is_first_scan:
            self._is_first_scan = False
            self._show_mode()

    def advance(self, duration_ns: int) -> None:
        """Let time pass: run as many scans as fit, and keep the rest for the next call."""
        self._owed_ns += duration_ns
        with quiet(all="ignore"):
            while self._owed_ns >= (due_ns := self._slow[0] if self._slow else self.scan_ns):
                if self._slow:
                    self._slow.popleft()
                elif idle := self._idle_scans():
                    self._pass(idle)
                    continue
                self._owed_ns -= due_ns
                self._scan(due_ns)

    def _idle_scans(self) -> int:
        """How many of the scans that are owed would only take PV in."""
        if not self._may_pass or not self.is_running or self._is_first_scan:
            return 0
        most_ns = self._owed_ns
        if self._script:
            most_ns = min(most_ns, self._script[0][0] - self.now_ns - 1)
        for item in self.items.values():
            most_ns = min(most_ns, item.idle_ns() - 1)
        return max(most_ns, 0) // self.scan_ns

    def _pass(self, scans: int) -> None:
        """Run so many idle scans as one: whatever is seen behind them is what they would have left one by one."""
        elapsed_ns = scans * self.scan_ns
        self.now_ns += elapsed_ns
        self._owed_ns -= elapsed_ns
        self.scans += scans
        for process in self.processes.values():
            process.advance(elapsed_ns)
        for _ in range(scans - 1):
            for process in self._sensed:
                process.overlook()
        for process in self._sensed:
            process.sense()
        for item in self.items.values():
            item.idle(elapsed_ns)

    def warm_up(self, duration_ns: int) -> None:
        """Let time pass before anybody looks; a clock that was handed in goes on from there."""
        self.advance(duration_ns)
        self._origin_ns -= duration_ns

    def answer(self, request: Request) -> tuple[int, ...] | None:
        """Carry out one request; see `transports.base.Device`."""
        return self.answer_all([request])[0]

    def answer_all(self, requests: Sequence[Request]) -> list[tuple[int, ...] | None]:
        """Carry out several requests between the same two scans."""
        if self._clock is not None:
            self.advance(self._clock.now_ns() - self._origin_ns - self.now_ns - self._owed_ns)
        return [self._carried_out(request) for request in requests]

    def _carried_out(self, request: Request) -> tuple[int, ...] | None:
        if request.unit != self.station.unit:
            return None
        self._refuse(request)
        if isinstance(request, Read):
            return self.memory.read(request.table, request.address, request.count)
        self.memory.write(request.table, request.address, request.values)
        self.writes.append(Written(self.now_ns, "link", request.table, request.address, request.values))
        return ()

    # What a person or the rest of the program does.

    def read(self, loop: str, operand: str) -> Any:
        """Return an operand's value: bool, int, REAL, or the words of I_MV."""
        return self._item(loop).wiring.get(operand)

    def write(self, loop: str, operand: str, value: Any, *, who: str = "program") -> None:
        """Write an operand between two scans, as the rest of the program or another master does.

        Raises:
            StateError: No such loop or operand.
            CodecError: The kind cannot hold the value, or the operand is a constant.
        """
        item = self._item(loop)
        item.wiring.put(operand, value)
        place = address(item.loop, self.memory.devices, operand)
        words = (int(value),) if place.is_bit else tuple(item.wiring.words(operand).tolist())
        self.writes.append(Written(self.now_ns, who, place.table, place.address, words))

    def at(self, time_ns: int, action: Callable[[FakePlc], None]) -> None:
        """Do something at the beginning of the first scan that ends at or after this time of the PLC."""
        self._script.append((time_ns, len(self._script), action))
        self._script.sort(key=lambda entry: entry[:2])

    def stop(self) -> None:
        """Go to STOP: the program stands, memory stays, outputs go to 0."""
        self.is_running = False
        for process in self.processes.values():
            process.release()
        self._show_mode()

    def run(self) -> None:
        """Go to RUN; every instruction goes on from what it holds."""
        if not self.is_running:
            self.is_running = True
            self._is_first_scan = True
            for item in self.items.values():
                item.stopped()
            self._show_mode()

    def restart(self, *, is_retained: bool) -> None:
        """Cut the power: what stands in no register is lost, and all registers too unless they are retained."""
        if not is_retained:
            self.memory.clear()
        for task in self._tasks:
            task.power_up(is_retained=is_retained)
        for snippet in self.snippets:
            snippet.power_up()
        self.is_running = True
        self._is_first_scan = True
        self._show_mode()

    # Misbehaviour.

    def fail(self, loop: str, name: str | None) -> None:
        """Make a loop's arithmetic wrong from its next execution on (`fake.faults`), or right again with None."""
        item = self._item(loop)
        item.fail(None if name is None else fault_named(name, item.loop.controller))

    def refuse(self, table: Table, first: int, last: int, code: int, count: int | None = None) -> None:
        """Answer requests that touch first…last with an exception, `count` times or for ever."""
        self.refusals.append(Refusal(table, first, last, code, count))

    def slow_down(self, scan_ns: int, count: int = 1) -> None:
        """Let the next `count` scans of `advance` take `scan_ns` each."""
        self._slow.extend([scan_ns] * count)

    def miss(self, loop: str, count: int = 1) -> None:
        """Leave out the next executions that are due."""
        self._item(loop).skip += count

    def freeze_pv(self, loop: str, is_frozen: bool = True) -> None:
        """Let PV's register stand still while the process goes on."""
        process = self.processes.get(self._item(loop).loop.name)
        if process is None:
            raise StateError(f"loop {loop} has no process, so that its PV stands still anyway")
        process.is_frozen = is_frozen

    # What happened.

    def executed(self, loop: str) -> int:
        """How often the loop's instruction has been executed since power-up."""
        return self._item(loop).executed

    def log(self, loop: str) -> Sequence[Execution]:
        """The loop's last executions, oldest first."""
        return tuple(self._item(loop).log)

    def _item(self, loop: str) -> PidItem:
        try:
            return self.items[loop]
        except KeyError:
            near = get_close_matches(loop, self.items, 1, 0.5)
            raise StateError(
                f"station {self.station.name} has no loop `{loop}`, it has {', '.join(self.items)}",
                hint=f"did you mean `{near[0]}`?" if near else None,
            ) from None

    def _set_up(self, item: PidItem, setup: FakeLoop) -> None:
        mv = item.loop.controller.operand_of(item.loop.controller.roles.mv)
        if setup.plant is not None and item.wiring.is_register(mv):
            self.processes[item.loop.name] = process = Process(item.wiring, setup.plant, self._rng)
            process.sense()
            if isinstance(item, CallItem) and item.loop.holds_pv:
                item.sense = process.sense
            else:
                self._sensed.append(process)
            # A relay that turns at every flicker of the sensor would measure the noise.
            item.hysteresis = 4.0 * setup.plant.noise
        for operand, value in setup.initial.items():
            item.wiring.put(operand, value)
        if item.loop.name in self.processes:
            self.processes[item.loop.name].drive()

    def _refuse(self, request: Request) -> None:
        if self.busy > 0:
            self.busy -= 1
            raise PlcRefusedError("the fake PLC is busy", code=BUSY)
        count = request.count if isinstance(request, Read) else len(request.values)
        for each in self.refusals:
            is_hit = each.table == request.table and request.address <= each.last
            if is_hit and each.first < request.address + count and each.count != 0:
                if each.count is not None:
                    each.count -= 1
                raise PlcRefusedError(
                    f"the fake PLC refuses {each.table.value} {each.first:#06x}…{each.last:#06x}", code=each.code
                )

    def _system_flags(self) -> dict[int, BitCell]:
        """The SM flags that show the mode, as far as the map has them; others, as SM401, stay off."""
        found: dict[int, BitCell] = {}
        for number in (ALWAYS_ON, FIRST_ON, FIRST_OFF, IS_RUNNING):
            try:
                found[number] = self.memory.bit_at(self.memory.devices.address(Device("SM", number), bits=True))
            except CodecError:
                continue
        return found

    def _show_mode(self) -> None:
        states = {
            ALWAYS_ON: self.is_running,
            FIRST_ON: self.is_running and self._is_first_scan,
            FIRST_OFF: self.is_running and not self._is_first_scan,
            IS_RUNNING: self.is_running,
        }
        for number, cell in self._flags.items():
            cell.put(states[number])
        if self.station.running is not None:
            self.memory.bit_at(self.memory.devices.address(self.station.running, bits=True)).put(self.is_running)
