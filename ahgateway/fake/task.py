"""The task in which an instruction stands: when it is called, and what the program does behind each call.

In the cyclic task the instruction is called once in each scan; in an interval task once in each period, some of which
may end in one scan. Behind the call come, in this order, the trigger, which closes the instruction's contact again,
and the recorder. Both have nothing that the program of a real PLC lacks: operands, SM402, a word that an interval task
counts up for the time, and their own words.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ahgateway.clock import MILLISECOND
from ahgateway.codec.block import EN
from ahgateway.codec.record_layout import RANGE
from ahgateway.codec.station import Loop
from ahgateway.codec.ways import Each, Place, Recorder
from ahgateway.fake.memory import BitCell, Memory, Words
from ahgateway.fake.program import PidItem
from ahgateway.fake.wiring import Wiring

WORD = 0xFFFF


def is_plain(loop: Loop) -> bool:
    """Tell whether the loop's instruction is called once in each scan and nothing stands behind it."""
    return loop.interval_ms is None and loop.trigger is None and loop.recorder is None


class Task:
    """One instruction, its trigger and its recorder, called as its task is; `item` is the instruction."""

    def __init__(self, item: PidItem, memory: Memory, first: BitCell | None) -> None:
        loop = item.loop
        self.item = item
        self._interval_ns = None if loop.interval_ms is None else loop.interval_ms * MILLISECOND
        self._gathered_ns = 0
        self._trigger = None if loop.trigger is None else _Trigger(item, memory)
        self._recorder = None if loop.recorder is None else RecorderItem(loop, item.wiring, memory, first)

    def power_up(self, *, is_retained: bool) -> None:
        """Forget what stands in no register."""
        self.item.power_up()
        self._gathered_ns = 0
        if self._recorder is not None and not is_retained:
            self._recorder.power_up()

    def run(self, now_ns: int, elapsed_ns: int) -> None:
        """Take part in one scan."""
        if self._interval_ns is None:
            self._call(now_ns, elapsed_ns)
            return
        self._gathered_ns += elapsed_ns
        while self._gathered_ns >= self._interval_ns:
            self._gathered_ns -= self._interval_ns
            self._call(now_ns, self._interval_ns)

    def _call(self, now_ns: int, elapsed_ns: int) -> None:
        self.item.scan(now_ns, elapsed_ns)
        if self._trigger is not None:
            self._trigger.close(elapsed_ns)
        if self._recorder is not None:
            self._recorder.scan(elapsed_ns)


class _Trigger:
    """Opens the contact again: behind one call of an interval task, or behind a scan that changed what is seen.

    In the cyclic task it opens at the latest when it was closed for CYCLE, as an execution may change nothing.
    """

    def __init__(self, item: PidItem, memory: Memory) -> None:
        loop = item.loop
        assert loop.trigger is not None
        self._loop, self._wiring = loop, item.wiring
        self._coil = memory.bit_at(memory.devices.address(loop.trigger.coil, bits=True))
        self._count = memory.words_at(memory.devices.address(loop.trigger.counter), 1)
        self._gathered_ns = 0
        operands = dict.fromkeys(seen.operand for seen in loop.controller.seen if item.wiring.is_register(seen.operand))
        self._watched = [
            item.wiring.words(seen.operand)[2 * seen.dword : 2 * seen.dword + 2]
            for seen in loop.controller.seen
            if seen.operand in operands
        ]
        self._before = self._words()

    def _words(self) -> list[int]:
        return [word for words in self._watched for word in words.tolist()]

    def close(self, elapsed_ns: int) -> None:
        before, self._before = self._before, self._words()
        if not self._coil.get():
            self._gathered_ns = 0
            return
        self._gathered_ns += elapsed_ns
        if self._loop.interval_ms is None:
            cycle_s = float(self._loop.controller.nominal_ts(self._wiring.inputs()))
            if self._before == before and self._gathered_ns < round(cycle_s * 1000) * MILLISECOND:
                return
        self._gathered_ns = 0
        self._coil.put(False)
        self._count[0] = (int(self._count[0]) + 1) % RANGE


class RecorderItem:
    """Fills the ring: one record behind each scan or call, or behind each scan that changed a recorded word."""

    def __init__(self, loop: Loop, wiring: Wiring, memory: Memory, first: BitCell | None) -> None:
        layout = loop.recorder
        assert layout is not None
        self._layout: Recorder = layout
        place = memory.devices.address(layout.ring)
        self._ring = memory.words_at(place, layout.words)
        self._head = memory.words_at(memory.devices.address(layout.head), 1)
        self._first = first
        self._fields = [(where, _reader(name, loop, wiring, memory)) for name, where in layout.fields.items()]
        self.power_up()

    def power_up(self) -> None:
        """The words in which the snippet counts are 0."""
        self._sequence = 0
        self._gathered_ns = 0
        self._before: list[int] | None = None
        self._head[0] = self._layout.records - 1 if self._layout.is_last else 0

    def scan(self, elapsed_ns: int) -> None:
        """Make a record of what stands in the operands now."""
        layout = self._layout
        self._gathered_ns += elapsed_ns
        body = [0] * layout.length
        for where, read in self._fields:
            _put(body, where, read())
        is_first = self._first is not None and self._first.get()
        if layout.each is Each.CHANGE and body == self._before and not is_first:
            return
        self._before = list(body)
        if layout.first is not None and is_first:
            _put(body, layout.first, (1,))
        if layout.time is not None:
            _number(body, layout.time, layout.time_words, self._gathered_ns // layout.time_unit_ns % layout.times)
        self._sequence = (self._sequence + 1) % layout.sequences
        _number(body, layout.sequence, layout.sequence_words, self._sequence)
        if layout.sequence_end is not None:
            _number(body, layout.sequence_end, layout.sequence_words, self._sequence)
        slot = (int(self._head[0]) + layout.is_last) % layout.records
        self._ring[layout.slot(slot) : layout.slot(slot) + layout.length] = body
        self._head[0] = slot if layout.is_last else (slot + 1) % layout.records


def _reader(name: str, loop: Loop, wiring: Wiring, memory: Memory) -> Callable[[], tuple[int, ...]]:
    """Return what reads a field's words, or its bit as one 0 or 1."""
    if name == EN:
        return lambda: (int(wiring.enabled()),)
    for seen in loop.controller.seen:
        if seen.name == name:
            return _words_reader(seen.operand, 2 * seen.dword, loop, wiring, memory)
    return _words_reader(name, 0, loop, wiring, memory)


def _words_reader(
    operand: str, first: int, loop: Loop, wiring: Wiring, memory: Memory
) -> Callable[[], tuple[int, ...]]:
    row = loop.controller.operand(operand)
    if not row.words:
        place: Any = loop.bindings[operand]
        cell = memory.bit_at(memory.devices.address(place, bits=True))
        return lambda: (int(cell.get()),)
    words: Words = wiring.words(operand)[first : first + min(row.words, 2)]
    return lambda: tuple(words.tolist())


def _put(body: list[int], where: Place, words: tuple[int, ...]) -> None:
    if where.bit is not None:
        body[where.offset] |= words[0] << where.bit
    else:
        body[where.offset : where.offset + len(words)] = words


def _number(body: list[int], offset: int, count: int, value: int) -> None:
    for position in range(count):
        body[offset + position] = value >> 16 * position & WORD
