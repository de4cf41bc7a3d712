"""A loop's operands wired to the memory: found once, then read and written without searching.

What the instruction leaves in memory is its state: an integral that a person changed is the integral of the next
execution (MANUAL: the user may clear or change I_MV+0), and MV is what the MV register holds.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from ahgateway.codec.block import address, timed
from ahgateway.codec.block import defaults as block_defaults
from ahgateway.codec.station import Const, Loop
from ahgateway.codec.words import decode, encode
from ahgateway.core.controllers import Seen, replaced
from ahgateway.core.operands import Kind, Operand
from ahgateway.errors import StateError
from ahgateway.fake.memory import Memory, Words, real_view

EN = "EN"


class Wiring:
    """The operands of one loop.

    Attributes:
        loop: The loop.
        enabled: Reads the EN contact; always true where none is bound.
    """

    def __init__(self, loop: Loop, memory: Memory) -> None:
        self.loop = loop
        self._memory = memory
        rows = {row.attr: row for row in loop.controller.operands}
        self._readers: dict[str, Callable[[], Any]] = {}
        self._inputs = [self._reader(rows[attr]) for attr in loop.controller.input_names]
        self.enabled: Callable[[], bool] = (
            memory.bit_at(address(loop, memory.devices, EN)).get
            if loop.en is not None or self.is_register(EN)
            else _always
        )
        self._left: list[tuple[Seen, Callable[[Any], None]]] = []
        self._kept: list[tuple[str, Any]] = []
        for seen in loop.controller.seen:
            if isinstance(loop.bindings[seen.operand], Const):
                continue
            self._left.append((seen, self._writer(seen)))
            path = seen.path(loop.controller.state())
            if path:
                self._kept.append((path, real_view(self.words(seen.operand)[2 * seen.dword :])))

    def inputs(self) -> Any:
        """Read what a step reads: the controller's NamedTuple, REALs with their bits kept."""
        read = self.loop.controller.inputs(*[read() for read in self._inputs])
        return read if self.loop.interval_ms is None else timed(self.loop, read)

    def recalled(self, state: Any) -> Any:
        """Return the state with every part that stands in memory taken from there."""
        for path, view in self._kept:
            state = replaced(state, path, view[0])
        return state

    def leave(self, state: Any, terms: Any) -> None:
        """Write what the instruction owns: its double words of I_MV, MV, and MOUT where it is a register."""
        for seen, put in self._left:
            put(seen.stored(state, terms))

    def _writer(self, seen: Seen) -> Callable[[Any], None]:
        """Return what stores a value where the instruction leaves it."""
        if seen.kind is Kind.BOOL:
            return self._memory.bit_at(address(self.loop, self._memory.devices, seen.operand)).put
        words = self.words(seen.operand)[2 * seen.dword :]
        view = {Kind.REAL: real_view, Kind.INT: _int_view, Kind.DINT: _dint_view}[seen.kind](words)

        def put(value: Any) -> None:
            view[0] = value

        return put

    def words(self, operand: str) -> Words:
        """Return a live view of an operand's words."""
        row = self.loop.controller.operand(operand)
        return self._memory.words_at(address(self.loop, self._memory.devices, operand), max(1, row.words))

    def is_register(self, operand: str) -> bool:
        """Tell whether the operand stands in memory; a constant of the program does not."""
        return operand in self.loop.bindings and not isinstance(self.loop.bindings[operand], Const)

    def get(self, operand: str) -> Any:
        """Return an operand's value, or the EN contact."""
        read = self._readers.get(operand)
        if read is None:
            is_contact = operand == EN and not self._has_row(EN)
            read = self._readers[operand] = self.enabled if is_contact else self._reader(self._row(operand))
        return read()

    def put(self, operand: str, value: Any) -> None:
        """Write an operand's value into its device.

        Raises:
            CodecError: The kind cannot hold it, or the operand is a constant of the program.
            StateError: The instruction has no such operand.
        """
        if operand == EN and not self._has_row(EN):
            self._memory.bit_at(address(self.loop, self._memory.devices, EN)).put(bool(value))
        else:
            row = self._row(operand)
            place = address(self.loop, self._memory.devices, operand)
            words = encode(row.kind, value)
            if row.kind is Kind.BOOL:
                self._memory.bit_at(place).put(bool(words[0]))
            else:
                self._memory.words_at(place, len(words))[:] = words
        self._memory.generation += 1

    def _has_row(self, operand: str) -> bool:
        return operand in self.loop.bindings

    def put_all(self, values: Mapping[str, Any]) -> None:
        """Write several operands; those that are constants of the program keep what the program says."""
        for operand, value in values.items():
            if (operand == EN and self.loop.en is not None) or self.is_register(operand):
                self.put(operand, value)

    def defaults(self) -> None:
        """Write every operand's default (ASSUMED, spec A.1 and B.1), and close EN unless it is triggered."""
        rows = self.loop.controller.operands
        raw = block_defaults(self.loop.controller)
        self.put_all({row.name: decode(row.kind, raw[row.name]) for row in rows})
        if self.loop.en is not None:
            self.put(EN, self.loop.trigger is None)

    def junk(self, rng: random.Random) -> None:
        """Fill the words of I_MV that are the system's with anything: nobody may build on them (spec ah500 §1.5)."""
        for row in self.loop.controller.operands:
            if row.kind is not Kind.BLOCK or not self.is_register(row.name):
                continue
            owned = {
                2 * seen.dword + half
                for seen in self.loop.controller.seen
                if seen.operand == row.name
                for half in (0, 1)
            }
            words = self.words(row.name)
            for index in range(row.words):
                if index not in owned:
                    words[index] = rng.getrandbits(16)

    def _row(self, operand: str) -> Operand:
        try:
            return self.loop.controller.operand(operand)
        except KeyError:
            names = ", ".join(row.name for row in self.loop.controller.operands)
            raise StateError(
                f"loop {self.loop.name}: {self.loop.controller.name} has no operand `{operand}`", hint=f"it has {names}"
            ) from None

    def _reader(self, row: Operand) -> Callable[[], Any]:
        binding = self.loop.bindings[row.name]
        if isinstance(binding, Const):
            return partial(_same, decode(row.kind, encode(row.kind, binding.value)))
        if row.kind is Kind.BOOL:
            return self._memory.bit_at(address(self.loop, self._memory.devices, row.name)).get
        words = self.words(row.name)
        if row.kind is Kind.REAL:
            return partial(real_view(words).__getitem__, 0)
        if row.kind is Kind.DINT:
            return partial(_whole, words.view("<i4"))
        if row.kind is Kind.INT:
            return partial(_whole, words.view("<i2"))
        return partial(_block, words)


def _always() -> bool:
    return True


def _same(value: Any) -> Any:
    return value


def _int_view(words: Words) -> Any:
    return words[:1].view("<i2")


def _dint_view(words: Words) -> Any:
    return words[:2].view("<i4")


def _whole(view: Any) -> int:
    return int(view[0])


def _block(words: Words) -> tuple[int, ...]:
    return tuple(words.tolist())
