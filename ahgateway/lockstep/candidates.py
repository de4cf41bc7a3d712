"""Candidates of a search: partial dialects, what each can have left hidden, and how they are carried along a trace.

This file decides when an axis is split and when it is joined again. It judges nothing itself: `core.sift` does.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Hashable, Mapping
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
from ahgateway.core.sieve import sieve
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

FALLEN_MAX = 256
"""So many candidates that fell last are compared with what the PLC wrote."""

PACE_MAX = 512
"""What a question splits is joined again after so many executions at most; after one where questions are rare."""


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
        asked_at: The execution that asked last.
        pace: Executions after which what it asked is joined again.
    """

    fixed: dict[str, int]
    at: int = 0
    low: Rows = field(default_factory=lambda: np.empty((0, 0)))
    high: Rows = field(default_factory=lambda: np.empty((0, 0)))
    explained: int = 0
    informative: int = 0
    wait: int = 1
    asked_at: int = -1
    pace: int = 1

    def state(self) -> Hashable:
        """Where it is and what it can have left hidden, as something to compare."""
        if len(self.low) == 1:
            return self.at, self.low.tobytes(), self.high.tobytes()
        rows = frozenset((low.tobytes(), high.tobytes()) for low, high in zip(self.low, self.high, strict=True))
        return self.at, rows

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


def joined(loop: Loop, candidates: list[C], only: Collection[str] = ()) -> list[C]:
    """Make an axis open again where all its values leave the same; one of a few axes where those are given."""
    if len(candidates) < 2:
        return candidates
    groups: dict[Hashable, list[C]] = {}
    for candidate in candidates:
        groups.setdefault(candidate.state(), []).append(candidate)
    return [each for group in groups.values() for each in _opened(loop, group, only)]


def _opened(loop: Loop, group: list[C], only: Collection[str]) -> list[C]:
    """The same for candidates that left the same."""
    if len(group) < 2:
        return group
    first = group[0].fixed.items()
    names = sorted({name for each in group for name, _ in each.fixed.items() ^ first}, reverse=True)
    left = {tuple([each.fixed.get(name) for name in names]): each for each in group}
    for at, name in enumerate(names):
        if only and name not in only:
            continue
        groups: dict[tuple[int | None, ...], list[tuple[int | None, ...]]] = {}
        for point in left:
            groups.setdefault(point[:at] + point[at + 1 :], []).append(point)
        for points in groups.values() if len(groups) < len(left) else ():
            values = {point[at] for point in points}
            if len(points) > 1 and (None in values or values >= set(values_of(loop, left[points[0]].fixed, name))):
                best = copy(max((left.pop(point) for point in points), key=lambda each: each.explained))
                best.fixed = {other: value for other, value in best.fixed.items() if other != name}
                left[(*points[0][:at], None, *points[0][at + 1 :])] = best
    return list(left.values())


class Carrier:
    """Carries candidates along one trace.

    Args:
        loop: The loop; its own dialect does not count.
        pairs: Pictures before and behind each execution.
        trace: The same as columns.
        compiled: Walk with the compiled law.
        steps_max: How many executions all candidates may walk.

    Attributes:
        fallen_at: The last execution that made a candidate fall, -1 while none has fallen.
        walked: Executions walked so far, by all candidates.
    """

    def __init__(
        self, loop: Loop, pairs: list[tuple[Picture, Picture]], trace: Trace, *, compiled: bool, steps_max: int
    ) -> None:
        self._loop = loop
        self._pairs = pairs
        self._trace = trace
        self._compiled = compiled
        self._sift = sieve(loop.controller, compiled)
        self._fields = len(loop.controller.state())
        room = ROOM if "d" in loop.controller.state()._fields else ROOM_WITHOUT
        self._room, self._left = sift.room_for(room, self._fields, FALLEN_MAX)
        self._values, self._twin = _tables(loop)
        self._next_anchor = _next_true(trace.anchors)
        self._next_gap = _next_true(~trace.follows)
        self._informed = np.concatenate(([0], np.cumsum(trace.informs))).tolist()
        self._fallen: list[tuple[Candidate, Rows]] = []
        self.fallen_at = -1
        self.walked = 0
        self._steps_max = steps_max

    @property
    def is_out_of_steps(self) -> bool:
        """True when more was walked than may be: what is carried from then on is not to be relied on."""
        return self.walked > self._steps_max

    def carried(self, candidate: Candidate, stop: int, *, is_split: bool = False) -> list[Candidate]:
        """Carry a candidate to an execution; it may have become several, or none.

        What a question split is not begun anew when it is lost: most of it is one again then.
        """
        waiting, done = [candidate], []
        while waiting and not self.is_out_of_steps:
            one = waiting.pop()
            if one.at >= stop or (is_split and not len(one.low)):
                done.append(one)
            elif len(one.low):
                waiting.extend(self._walked(one, stop))
            else:
                waiting.extend(self._begun(one, stop))
        return done

    def _begun(self, one: Candidate, stop: int) -> list[Candidate]:
        """Begin behind the next execution that allows it."""
        number = self._next_anchor[one.at]
        if number >= stop:
            one.at = stop
            return [one]
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
        """Walk to the next question and past it, or to the end of what follows without a gap."""
        first, end, room = one.at, min(self._next_gap[one.at], stop), self._room
        nothing = np.empty((0, self._fields))
        if end == first:
            return [replace(one, low=nothing, high=nothing)]
        room.stack[0], count = asked_row(one.fixed), len(one.low)
        room.low[:count], room.high[:count] = one.low, one.high
        at, why, count, depth, kept, fell = self._sifted(first, end, count, 1)
        came = replace(one, at=at, low=room.low[:count].copy(), high=room.high[:count].copy())
        came.explained += at - first
        came.informative += self._informed[at] - self._informed[first]
        if why == sift.DONE:
            return [came]
        if why == sift.FELL:
            self._falls(came, room.stack[:1])
            return []
        if why == sift.LOST:
            return [_waiting(came, 1 if at - first > WAIT_MAX else min(2 * one.wait, WAIT_MAX), stop)]
        assert why == sift.ASKED
        _set_pace(came)
        self._falls(came, self._left.fell[:fell])
        split = self._taken(came, kept, stop)
        while depth and not self.is_out_of_steps:
            _, _, _, depth, kept, fell = self._sifted(at, at + 1, count, depth)
            split += self._taken(came, kept, stop)
        return self._rejoined(came, split, stop)

    def _sifted(self, first: int, stop: int, count: int, depth: int) -> tuple[int, int, int, int, int, int]:
        trace = self._trace
        *found, steps = self._sift(
            first, stop, trace.starts, trace.rows, trace.seen, trace.judged, self._loop.scan_ms_max,
            self._values, self._twin, self._room, self._left, count, depth,
        )  # fmt: skip
        self.walked += steps
        return tuple(found)

    def _falls(self, one: Candidate, rows: Rows) -> None:
        """Remember what fell last, for a look at it when nothing is left."""
        if not len(rows) or one.at < self.fallen_at:
            return
        if one.at > self.fallen_at:
            self._fallen, self.fallen_at = [], one.at
        if len(self._fallen) < FALLEN_MAX:
            self._fallen.append((one, rows.copy()))

    @property
    def fallen(self) -> list[Candidate]:
        """Candidates at the last execution that made one fall, as they stood before it."""
        return [replace(one, fixed=_fixed(row, one.fixed)) for one, rows in self._fallen for row in rows][:FALLEN_MAX]

    def _taken(self, one: Candidate, kept: int, stop: int) -> list[Candidate]:
        """What came through the execution that asked, a candidate for each combination of what it asked."""
        left, found, begin = self._left, [], 0
        is_open = left.rows[:kept, AXIS_COUNT:FIRST_ASKED]
        asked = [at for at in np.flatnonzero((is_open == 0).any(axis=0)).tolist() if AXIS_NAMES[at] not in one.fixed]
        whys, ends, rows = left.why[:kept].tolist(), left.ends[:kept].tolist(), left.rows[:kept].tolist()
        informative = one.informative + self._informed[one.at + 1] - self._informed[one.at]
        for why, row, end in zip(whys, rows, ends, strict=True):
            fixed = one.fixed | {AXIS_NAMES[at]: row[at] for at in asked if not row[AXIS_COUNT + at]}
            if why == sift.LOST:
                found.append(replace(_waiting(one, min(2 * one.wait, WAIT_MAX), stop), fixed=fixed))
            else:
                low, high = left.low[begin:end].copy(), left.high[begin:end].copy()
                known = one.explained + 1, informative, one.wait, one.asked_at, one.pace
                found.append(Candidate(fixed, one.at + 1, low, high, *known))
            begin = end
        return found

    def _rejoined(self, one: Candidate, split: list[Candidate], stop: int) -> list[Candidate]:
        """Join what a question split where it leaves the same, and again when it was carried on for a while.

        For how long depends on how rare such questions are: each of them costs all its values.
        """
        asked = {name for each in split for name in each.fixed} - one.fixed.keys()
        beyond = min(one.at + one.pace, stop)
        carried = [after for each in split for after in self.carried(each, beyond, is_split=True)]
        return joined(self._loop, carried, asked)


def _waiting(one: Candidate, wait: int, stop: int) -> Candidate:
    """A candidate that was lost: it begins anew when it has let some executions pass."""
    nothing = np.empty((0, one.low.shape[1]))
    return replace(one, low=nothing, high=nothing, at=min(one.at + one.wait, stop), wait=wait)


def _set_pace(one: Candidate) -> None:
    """Tell how far what is asked now is carried before it is joined: further where the last question was near."""
    one.pace = min(2 * one.pace, PACE_MAX) if one.at <= one.asked_at + 2 * one.pace else 1
    one.asked_at = one.at


def _fixed(row: Rows, known: Fixed) -> dict[str, int]:
    """The axes that a dialect has fixed, those first that were known before."""
    asked = np.flatnonzero(row[AXIS_COUNT:FIRST_ASKED] == 0).tolist()
    return {**known, **{AXIS_NAMES[place]: int(row[place]) for place in asked if AXIS_NAMES[place] not in known}}


def _tables(loop: Loop) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """The values of each axis that differ for this loop, and the one that is another's twin, as a sieve takes them."""
    values = [values_of(loop, {"ts_source": TsSource.MS}, name) for name in AXIS_NAMES]
    width = max(map(len, values))
    places = [AXIS_NAMES.index(name) for name in ("ts_unit", "ts_source")]
    twin = [places[0], TsUnit.TEN_MS, places[1], TsSource.NOMINAL] if counts_ten_ms(loop) else [-1] * 4
    return np.array([each + [-1] * (width - len(each)) for each in values], np.int64), np.array(twin, np.int64)


def _next_true(flags: npt.NDArray[np.bool_]) -> list[int]:
    """Place of the first one that is set from each place on; the length where there is none."""
    places = np.where(flags, np.arange(len(flags)), len(flags))
    return [int(place) for place in np.minimum.accumulate(places[::-1])[::-1]]


def _state(loop: Loop, row: Rows) -> Any:
    start = loop.controller.state()
    return loop.controller.state(
        *[REAL(x) if isinstance(value, np.floating) else type(value)(x) for x, value in zip(row, start, strict=True)]
    )
