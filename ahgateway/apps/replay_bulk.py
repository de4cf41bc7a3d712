"""A long recording in seconds: the law stepped along all its executions in one compiled walk, bits counted.

It answers one question: is each execution reproduced by one step of the law from the row before? That is no verdict:
an execution that is not reproduced may have been missed, torn or written to; following the recording tells. What the
instruction remembers but does not show comes from a follower, which is shown the head of the recording until it knows.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ahgateway.apps.replay import Changes, Replay, judged_again, picture_of
from ahgateway.codec.station import Const, Loop
from ahgateway.core.fast import column_types, walk, why_interpreted
from ahgateway.core.operands import Kind
from ahgateway.recording import layout
from ahgateway.recording.packing import Words
from ahgateway.recording.reader import Recording, spans
from ahgateway.recording.values import column

Columns = dict[str, Any]
WALKED = ("DPID", "DPIDE")
"""Controllers whose pictures hold what a walk forwards."""


@dataclass(frozen=True, slots=True)
class Bulk:
    """What a walk along one loop found.

    Attributes:
        loop: Its name.
        executions: Executions that were walked.
        differing: Those that one step of the law does not reproduce.
        first_tick: Tick of the first of these, None when there is none.
        followed: Rows at the head that were followed first, to learn what is hidden.
        is_compiled: The law ran compiled.
        note: What a person should know, one sentence, or nothing.
    """

    loop: str
    executions: int
    differing: int
    first_tick: int | None
    followed: int
    is_compiled: bool
    note: str = ""

    def line(self) -> str:
        """Return it as one line."""
        if not self.executions:
            return f"{self.loop}: no execution could be walked"
        road = "compiled" if self.is_compiled else "interpreted"
        text = f"{self.loop}: {self.executions} executions walked ({road}) after {self.followed} rows to learn from"
        if self.first_tick is None:
            return f"{text}: every one reproduced bit for bit"
        return (
            f"{text}: {self.differing} not reproduced, the first at tick {self.first_tick}; "
            f"`ahgateway replay` without --bulk says why"
        )

    def json(self) -> dict[str, Any]:
        """Return it as one JSON object."""
        return {"kind": "bulk", **{name: getattr(self, name) for name in self.__slots__}}


def bulk(recording: Recording, changes: Changes, loops: tuple[str, ...] = (), *, compiled: bool = True) -> list[Bulk]:
    """Walk along every loop of a recording, or those named.

    Raises:
        StateError: The recording has no such loop.
        CodecError: An axis or value of the dialect is not known.
    """
    station = judged_again(recording.station, changes)
    replay = Replay(recording, station, loops)
    return [_walked(recording, replay, name, compiled) for name in replay.followers]


def _walked(recording: Recording, replay: Replay, name: str, compiled: bool) -> Bulk:
    follower = replay.followers[name]
    loop = follower.loop
    if loop.controller.name not in WALKED:
        note = (
            f"{name}: --bulk knows {' and '.join(WALKED)}; `ahgateway replay` without it judges {loop.controller.name}"
        )
        return Bulk(name, 0, 0, None, 0, False, note)
    followed, state = 0, None
    for row in recording.rows({name}):
        follower.see(picture_of(loop, row))
        followed += 1
        state = follower.state
        if state is not None:
            break
    if state is None:
        return Bulk(name, 0, 0, None, followed, False, f"{name}: what the instruction remembers never became known")
    walker = Walker(loop, state, compiled)
    for ticks, words in _tail(recording, name, followed - 1):
        walker.take(ticks, words)
    note = why_interpreted()
    return Bulk(name, walker.executions, walker.differing, walker.first_tick, followed, walker.is_compiled, note)


def _tail(recording: Recording, name: str, skip: int) -> Iterator[tuple[NDArray[np.int64], Words]]:
    """Rows from the last one that was followed."""
    for block in recording.blocks(name):
        if skip < len(block.ticks):
            yield block.ticks[skip:], block.words[skip:]
        skip = max(0, skip - len(block.ticks))


class Walker:
    """Steps a law from block to block and counts."""

    def __init__(self, loop: Loop, state: Any, compiled: bool) -> None:
        self.executions = 0
        self.differing = 0
        self.first_tick: int | None = None
        self.is_compiled = False
        self._loop = loop
        self._state = state
        self._compiled = compiled
        self._spans = spans(layout.columns(loop))
        self._before: Words | None = None
        self._kinds = {row.attr: row for row in loop.controller.operands}
        bound = loop.bindings
        self._judged = [each for each in loop.controller.seen if not isinstance(bound[each.operand], Const)]

    def take(self, ticks: NDArray[np.int64], words: Words) -> None:
        """Walk the executions in these rows; the first row ever is only what the next are counted from."""
        before = words[:1] if self._before is None else self._before
        chain = np.concatenate([before, words]) if self._before is not None else words
        ticks = ticks if self._before is not None else ticks[1:]
        self._before = words[-1:].copy()
        columns = np.concatenate([self._place(each.operand, each.dword) for each in self._judged])
        watched = chain[:, columns]
        changed = (watched[1:] != watched[:-1]).any(axis=1)
        if not changed.any():
            return
        after, left = chain[1:][changed], chain[:-1][changed]
        self._compare(ticks[changed], left, after)

    def _compare(self, ticks: NDArray[np.int64], left: Words, after: Words) -> None:
        controller = self._loop.controller
        inputs: Columns = {name: self._column(after, name) for name in controller.input_names}
        fields = self._state._fields
        shown = {each.attr: each for each in self._judged if each.attr in fields}
        if "pv1" in shown:
            inputs["pv"] = self._real(after, shown["pv1"].operand, shown["pv1"].dword)
        seen = {attr: self._real(left, each.operand, each.dword) for attr, each in shown.items()}
        found = walk(
            controller, inputs, self._state, self._loop.dialect, self._ts(inputs), seen=seen, compiled=self._compiled
        )
        self.is_compiled = found.is_compiled
        same = np.ones(len(ticks), bool)
        for each in self._judged:
            ref = (found.state if each.attr in fields else found.terms)[each.attr]
            same &= _same(ref, self._real(after, each.operand, each.dword))
        self._state = type(self._state)(*[found.state[name][-1] for name in fields])
        self.executions += len(ticks)
        self.differing += int((~same).sum())
        if self.first_tick is None and not same.all():
            self.first_tick = int(ticks[~same][0])

    def _ts(self, inputs: Columns) -> NDArray[np.float32]:
        """Ts of each execution; CYCLE seldom changes."""
        controller, found = self._loop.controller, np.empty(len(inputs["cycle"]), np.float32)
        sample = controller.inputs()
        for cycle in np.unique(inputs["cycle"]).tolist():
            found[inputs["cycle"] == cycle] = controller.ts(sample._replace(cycle=cycle), self._loop.dialect)
        return found

    def _place(self, operand: str, dword: int) -> NDArray[np.int64]:
        first, _ = self._spans[operand]
        return np.arange(first + 2 * dword, first + 2 * dword + 2)

    def _real(self, words: Words, operand: str, dword: int = 0) -> NDArray[np.float32]:
        first, _ = self._spans[operand]
        return column(words, Kind.REAL, first + 2 * dword)

    def _column(self, words: Words, attr: str) -> Any:
        row = self._kinds[attr]
        first, end = self._spans[row.name]
        values = column(words, row.kind, first, end - first)
        return values.astype(column_types(self._loop.controller)[attr])


def _same(left: NDArray[np.float32], right: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Equal bits, where all NaNs are one."""
    equal = left.view(np.uint32) == right.view(np.uint32)
    found: NDArray[np.bool_] = equal | (np.isnan(left) & np.isnan(right))
    return found
