"""Candidates of a search: partial dialects, what each can have left hidden, and how they are carried along a trace.

This file decides when an axis is split and when it is joined again. It judges nothing itself: `core.sift` does.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from copy import copy
from dataclasses import dataclass, field, replace
from typing import Any, Protocol, TypeVar

import numpy as np
import numpy.typing as npt

from ahgateway.codec.station import Loop
from ahgateway.core import sift
from ahgateway.core.compiling import AXIS_COUNT, FIRST_ASKED, asked_row
from ahgateway.core.controllers.melsec_dialect import NumberFormat
from ahgateway.core.dialect import AXES, Dialect, FormChange, IntegralStore, PresetOrder, TsSource, TsUnit
from ahgateway.core.operands import Kind
from ahgateway.core.real import REAL
from ahgateway.lockstep.anchor import anchored
from ahgateway.lockstep.picture import Picture
from ahgateway.lockstep.shadow import Bound, Shadow
from ahgateway.lockstep.thinning import counts_ten_ms
from ahgateway.lockstep.trace import Trace

Fixed = Mapping[str, int]
Rows = npt.NDArray[np.float64]
T = TypeVar("T")


class Held(Protocol):
    """A partial dialect, what it can have left hidden, and what it explained."""

    fixed: dict[str, int]
    explained: int

    def state(self) -> Hashable:
        """What it can have left hidden, as something to compare."""


C = TypeVar("C", bound=Held)

AXIS_NAMES = tuple(AXES)

SAME_ON_DPID: dict[str, int] = {
    "integral_store": IntegralStore.WITHOUT_KC,
    "preset_order": PresetOrder.BIAS_P_D,
    "form_change": FormChange.ONE_CELL,
}
"""Values that are their axis's default on a DPID, which has neither Kc nor BIAS nor PID_DE."""

ROOM = 4096
"""So many contents of a filter are followed value by value."""

ROOM_WITHOUT = 32
"""Elements of a law without a filter: its flags alone can be open."""

WAIT_MAX = 256
"""A candidate that is lost again and again begins anew after so many executions at most."""


class Asked:
    """A dialect that remembers which open axes were read; an open one reads as its default, 0.

    Axes that are numbers are not searched: they read as the profile has them.
    """

    __slots__ = ("_fixed", "_loop", "asked")

    def __init__(self, fixed: Fixed, loop: Loop) -> None:
        self._fixed = fixed
        self._loop = loop
        self.asked: list[str] = []

    def __getattr__(self, name: str) -> Any:
        try:
            return self._fixed[name]
        except KeyError:
            if name in self._loop.controller.numbers:
                return getattr(self._loop.dialect, name)
            if name not in self._loop.controller.axes:
                raise AttributeError(name) from None
            if name not in self.asked:
                self.asked.append(name)
            return 0


@dataclass(slots=True)
class Candidate:
    """A partial dialect, and what it can have left hidden behind the execution before `at`.

    Attributes:
        fixed: Axes that were asked, and their values.
        at: The next execution.
        low: Lowest state of each element, a field a column; no rows when nothing is known.
        high: Highest state of each.
        explained: Executions that it explained by bits.
        informative: Those in which something was computed.
        wait: Executions to let pass when it is lost again.
    """

    fixed: dict[str, int]
    at: int = 0
    low: Rows = field(default_factory=lambda: np.empty((0, 0)))
    high: Rows = field(default_factory=lambda: np.empty((0, 0)))
    explained: int = 0
    informative: int = 0
    wait: int = 1

    def state(self) -> frozenset[tuple[bytes, bytes]]:
        """What it can have left hidden, as something to compare."""
        return frozenset((low.tobytes(), high.tobytes()) for low, high in zip(self.low, self.high, strict=True))

    def shadow(self, loop: Loop) -> Shadow:
        """What it can have left hidden, as bounds."""
        return tuple(
            Bound(_state(loop, low), _state(loop, high)) for low, high in zip(self.low, self.high, strict=True)
        )


def dialect_of(fixed: Fixed) -> Dialect:
    """The dialect of a candidate; what was not asked is as by default."""
    return Dialect(**{name: AXES[name](value) for name, value in fixed.items()})  # type: ignore[arg-type]


def values_of(loop: Loop, fixed: Fixed, axis: str) -> list[int]:
    """Values of an axis that differ for this loop."""
    is_count = axis == "ts_unit" and counts_ten_ms(loop) and fixed.get("ts_source", 0) == TsSource.NOMINAL
    if axis == "number_format" and loop.controller.operand(loop.controller.roles.mv).kind is not Kind.REAL:
        # A register of whole numbers shows a REAL rounded: the first two values are one.
        return [int(value) for value in NumberFormat if value != NumberFormat.REAL]
    if loop.controller.name == "DPID" and axis in SAME_ON_DPID:
        return [int(value) for value in AXES[axis] if value != SAME_ON_DPID[axis]]
    return [int(value) for value in loop.controller.axes[axis] if not (is_count and value == TsUnit.TEN_MS)]


def branched(loop: Loop, fixed: dict[str, int], run: Callable[[Any], T | None]) -> list[tuple[dict[str, int], T]]:
    """Run with every combination of the open axes that the run asks for; runs that return None are dropped."""
    probe = Asked(fixed, loop)
    result = run(probe)
    if not probe.asked:
        return [] if result is None else [(fixed, result)]
    axis = probe.asked[0]
    found = []
    for value in values_of(loop, fixed, axis):
        found.extend(branched(loop, {**fixed, axis: value}, run))
    return found


def joined(loop: Loop, candidates: list[C]) -> list[C]:
    """Make an axis open again where all its values leave the same."""
    axes = {name for candidate in candidates for name in candidate.fixed}
    states = {id(candidate): candidate.state() for candidate in candidates}
    for axis in sorted(axes, reverse=True):
        groups: dict[Any, list[C]] = {}
        for candidate in candidates:
            rest = frozenset((name, value) for name, value in candidate.fixed.items() if name != axis)
            groups.setdefault((rest, states[id(candidate)]), []).append(candidate)
        candidates = []
        for (rest, state), group in groups.items():
            values = {candidate.fixed.get(axis) for candidate in group}
            if None in values or values >= set(values_of(loop, dict(rest), axis)):
                best = max(group, key=lambda each: each.explained)
                wider = copy(best)
                wider.fixed = dict(rest)
                states[id(wider)] = state
                candidates.append(wider)
            else:
                candidates.extend(group)
    return candidates


class Carrier:
    """Carries candidates along one trace.

    Args:
        loop: The loop; its own dialect does not count.
        pairs: Pictures before and behind each execution.
        trace: The same as columns.
        compiled: Walk with the compiled law.

    Attributes:
        fallen: Candidates at the last execution that made one fall, as they stood before it.
        fallen_at: That execution, -1 while none has fallen.
        walked: Executions walked so far, by all candidates.
    """

    def __init__(self, loop: Loop, pairs: list[tuple[Picture, Picture]], trace: Trace, *, compiled: bool) -> None:
        self._loop = loop
        self._pairs = pairs
        self._trace = trace
        self._compiled = compiled
        self._sift = sift.sieve(loop.controller, compiled)
        self._fields = len(loop.controller.state())
        self._room = ROOM if "d" in loop.controller.state()._fields else ROOM_WITHOUT
        self.fallen: list[Candidate] = []
        self.fallen_at = -1
        self.walked = 0

    def carried(self, candidate: Candidate, stop: int) -> list[Candidate]:
        """Carry a candidate to an execution; it may have become several, or none."""
        waiting, done = [candidate], []
        while waiting:
            one = waiting.pop()
            if one.at >= stop:
                done.append(one)
            elif len(one.low):
                waiting.extend(self._walked(one, stop))
            else:
                waiting.extend(self._begun(one, stop))
        return done

    def _begun(self, one: Candidate, stop: int) -> list[Candidate]:
        """Begin behind the next execution that allows it."""
        ahead = np.flatnonzero(self._trace.anchors[one.at : stop])
        if not len(ahead):
            one.at = stop
            return [one]
        number = one.at + int(ahead[0])
        before, after = self._pairs[number]

        def run(dialect: Any) -> Shadow:
            return anchored(replace(self._loop, dialect=dialect), before, after)

        found = []
        for fixed, shadow in branched(self._loop, one.fixed, run):
            low = np.array([[float(x) for x in bound.low] for bound in shadow]).reshape(-1, self._fields)
            high = np.array([[float(x) for x in bound.high] for bound in shadow]).reshape(-1, self._fields)
            found.append(replace(one, fixed=fixed, at=number + 1, low=low, high=high))
        return found

    def _walked(self, one: Candidate, stop: int) -> list[Candidate]:
        """Walk to the next question, or to the end of what follows without a gap."""
        follows = self._trace.follows
        if not follows[one.at]:
            one.low = one.high = np.empty((0, self._fields))
            return [one]
        gaps = np.flatnonzero(~follows[one.at : stop])
        end = one.at + int(gaps[0]) if len(gaps) else stop
        at, why, axis, low, high = self._sifted(one, end)
        self.walked += (at - one.at + 1) * max(1, len(one.low))
        came = replace(
            one,
            at=at,
            low=low,
            high=high,
            explained=one.explained + at - one.at,
            informative=one.informative + int(self._trace.informs[one.at : at].sum()),
        )
        if why == sift.DONE:
            return [came]
        if why == sift.FELL:
            if at >= self.fallen_at:
                self.fallen = [*(self.fallen if at == self.fallen_at else []), came]
                self.fallen_at = at
            return []
        if why == sift.LOST:
            nothing = np.empty((0, self._fields))
            wait = 1 if at - one.at > WAIT_MAX else min(2 * one.wait, WAIT_MAX)
            return [replace(came, at=min(at + one.wait, stop), low=nothing, high=nothing, wait=wait)]
        assert why == sift.ASKED
        return [replace(came, fixed={**came.fixed, axis: value}) for value in values_of(self._loop, came.fixed, axis)]

    def _sifted(self, one: Candidate, stop: int) -> tuple[int, int, str, Rows, Rows]:
        """Walk; where and why it stopped, the axis that was asked, and the elements."""
        trace, row = self._trace, asked_row(one.fixed)
        assert len(row) == FIRST_ASKED + 1 == 2 * AXIS_COUNT + 1
        dialect: Any = np.array(row, np.int64) if self._compiled else row
        count = len(one.low)
        low, high = (np.zeros((self._room, self._fields)) for _ in range(2))
        low[:count], high[:count] = one.low, one.high
        with np.errstate(all="ignore"):
            at, why, low, high, count = self._sift(
                one.at, stop, trace.starts, trace.columns, trace.seen, trace.judged, self._loop.scan_ms_max,
                dialect, low, high, count,
            )  # fmt: skip
        return int(at), why, AXIS_NAMES[int(dialect[FIRST_ASKED])], low[:count].copy(), high[:count].copy()


def _state(loop: Loop, row: Rows) -> Any:
    start = loop.controller.state()
    return loop.controller.state(
        *[REAL(x) if isinstance(value, np.floating) else type(value)(x) for x, value in zip(row, start, strict=True)]
    )
