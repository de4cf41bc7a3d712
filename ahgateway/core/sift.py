"""Carry everything that a controller can remember along a trace, in one partial dialect, until an execution says more.

What can be remembered is a set of elements: each is a lowest and a highest state that differ at most in the content of
D's filter. An execution keeps of each element what reproduces its words. The walk stops where no element is left, and
where one cannot be followed by bits; where an open axis is read, that execution is run with each of its values, and
with those of every axis that these ask in turn. The caller goes on from there. This file decides what is consistent
with what was seen; it does not know where dialects or a trace come from.

Theory of operation: the law is monotone in the content, each operation rounding monotonically, so that the two ends
enclose all between, and bisection cuts off what does not reproduce the words. Filters that rounding keeps from being
monotone (`is_rough`) are followed value by value instead. Where the interval is measured, I_MV alone cuts the ticks of
the clock down, by bisection too. The walk is compiled with the law, or interpreted, from this one source.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ahgateway.core import flags as flag
from ahgateway.core.compiling import AXIS_COUNT, FIRST_ASKED
from ahgateway.core.controllers.delta_terms import is_rough, ticks_per_second
from ahgateway.core.real import REAL
from ahgateway.core.sides import NEVER, ZERO, is_open, remembers_ts, same, side
from ahgateway.core.ticks import cut

DONE, ASKED, FELL, LOST = 0, 1, 2, 3
"""Why a walk stopped: at its end; an open axis was read; no element was left; it cannot be followed by bits."""

NEAR = 32
"""How many of the elements found last are looked through for one that is the same."""

FEW = 8
"""So few ticks of a clock are tried one by one."""

MANY = 256
"""More ticks than this that may all be true are not followed: they leave a filter open, or a limit hides which."""

CONTENTS = 256
"""More contents of a filter than this are not followed where the interval is measured: each tick makes another."""

PAIRS = 8192
"""More pairs of a content and a tick than this are not tried for one element."""

# Filled in for each law by `sieve`: its step and interval, and small functions made from its tuples.
step: Any = None
law_ts: Any = None
nominal_ts: Any = None
read: Any = None
taken: Any = None
unpacked: Any = None
pack: Any = None
words: Any = None
with_content: Any = None
content: Any = None
extended: Any = False
content_at: Any = -1
cross_at: Any = -1
i_at: Any = 0
pv1_at: Any = -1


class Room(NamedTuple):
    """Where a walk works: as many rows as there can be elements, lowest and highest states, a field a column.

    Attributes:
        stack: Dialects to run, as `asked_row` makes them, a row each.
        low: Lowest state of each element to begin with.
        high: Highest state of each.
        own_low: Room for one dialect's own.
        own_high: The same.
        next_low: Room for what they become.
        next_high: The same.
    """

    stack: Any
    low: Any
    high: Any
    own_low: Any
    own_high: Any
    next_low: Any
    next_high: Any


class Left(NamedTuple):
    """What an execution that asks leaves, a row for each dialect that came through it.

    Attributes:
        rows: The dialects.
        why: DONE, or LOST where nothing can be followed.
        ends: Where each one's elements end in `low` and `high`.
        low: Lowest states of all of them, one dialect after the other.
        high: Highest states.
        fell: Dialects that fell there, as many as there is room for.
    """

    rows: Any
    why: Any
    ends: Any
    low: Any
    high: Any
    fell: Any


STACK = 1024
"""Room for dialects on the stack: one for each value of each axis that one execution can ask, and more."""


def room_for(elements: int, fields: int, fallen: int) -> tuple[Room, Left]:
    """Make room for so many elements of states with so many fields, and for so many dialects that fell."""
    width = FIRST_ASKED + 1
    states = [np.zeros((elements, fields)) for _ in range(6)]
    low, high = (np.zeros((2 * elements, fields)) for _ in range(2))
    why, ends = (np.zeros(STACK, np.int64) for _ in range(2))
    stack, rows, fell = (np.zeros((length, width), np.int64) for length in (STACK, STACK, fallen))
    return Room(stack, *states), Left(rows, why, ends, low, high, fell)


def sift(
    first: int,
    stop: int,
    starts: Any,
    rows: Any,
    seen: Any,
    judged: Any,
    scan_ms: int,
    values: Any,
    twin: Any,
    room: Any,
    left: Any,
    count: int,
    depth: int,
) -> Any:
    """Walk from one execution to another; where an open axis is asked, run that execution with each of its values.

    Equal arguments give equal bits, compiled or not.

    Args:
        first: Execution to begin with; the elements are those before it.
        stop: Execution before which to end.
        starts: Where each execution's sets of inputs begin in `rows`, one more than there are executions.
        rows: A row for each set of inputs that an execution can have read, an input a column, in binary64.
        seen: PV of the last execution, I_MV, MV and MOUT behind each execution, n by 4.
        judged: Which of the four stand in the PLC's memory.
        scan_ms: Longest scan, which bounds a measured interval.
        values: The values of each axis, a row each, filled up with -1.
        twin: Axis, value, other axis, other value: that value is not tried where the other axis has that one.
        room: `Room` with the elements before `first`, and the dialect to ask at the bottom of its stack.
        left: `Left`, which takes what an execution that asks leaves.
        count: How many elements there are.
        depth: How many dialects stand on the stack: 1, or more to go on where `left` was full.

    Returns:
        The execution at which it stopped, why, how many elements there are before it in `room`, how many dialects are
        still on the stack, how many came through an execution that asks and how many fell there, and how many steps
        the law was walked.
    """
    if depth == 1:
        at, why, low, high, count = followed(
            first, stop, starts, rows, seen, judged, scan_ms, taken(room.stack, 0), room.low, room.high, count,
            room.next_low, room.next_high,
        )  # fmt: skip
        steps = (at - first + 1) * max(1, count)
        if low is not room.low:
            room.low[:count] = low[:count]
            room.high[:count] = high[:count]
        if why != ASKED:
            return at, why, count, 0, 0, 0, steps
        room.stack[0, FIRST_ASKED] = -1
    else:
        at, steps = first, 0
    kept, fell, used = 0, 0, 0
    while depth > 0 and kept < len(left.why) and used + len(room.low) <= len(left.low):
        depth -= 1
        dialect = taken(room.stack, depth)
        room.own_low[:count] = room.low[:count]
        room.own_high[:count] = room.high[:count]
        _, why, low, high, many = followed(
            at, at + 1, starts, rows, seen, judged, scan_ms, dialect, room.own_low, room.own_high, count,
            room.next_low, room.next_high,
        )  # fmt: skip
        steps += max(1, count)
        if why == ASKED:
            depth = spread(room.stack, depth, dialect[FIRST_ASKED], values, twin)
        elif why == FELL:
            if fell < len(left.fell):
                left.fell[fell] = room.stack[depth]
                fell += 1
        else:
            many = many if why == DONE else 0
            left.rows[kept] = room.stack[depth]
            left.why[kept] = why
            left.low[used : used + many] = low[:many]
            left.high[used : used + many] = high[:many]
            used += many
            left.ends[kept] = used
            kept += 1
    return at, ASKED, count, depth, kept, fell, steps


def spread(stack: Any, depth: int, axis: int, values: Any, twin: Any) -> int:
    """Put a dialect with each value of an axis on the stack, in the place of the one that asked; the new depth."""
    asked = stack[depth].copy()
    asked[AXIS_COUNT + axis], asked[FIRST_ASKED] = 0, -1
    for value in values[axis]:
        is_twin = axis == twin[0] and value == twin[1] and asked[twin[2]] == twin[3]
        if value < 0 or is_twin:
            continue
        stack[depth] = asked
        stack[depth, axis] = value
        depth += 1
    return depth


def followed(
    first: int,
    stop: int,
    starts: Any,
    rows: Any,
    seen: Any,
    judged: Any,
    scan_ms: int,
    dialect: Any,
    low: Any,
    high: Any,
    count: int,
    next_low: Any,
    next_high: Any,
) -> Any:
    """Walk in one dialect; the execution at which it stopped, why, and the elements before it and how many they are."""
    for k in range(first, stop):
        kept = 0
        for v in range(starts[k], starts[k + 1]):
            operands = read(rows, v)
            hides = hides_pv(operands, dialect)
            if hides and forgets(operands):
                if stands(low, count, seen[k], judged):
                    return k, ASKED if dialect[FIRST_ASKED] >= 0 else LOST, low, high, count
                continue
            if loosens(operands, dialect):
                count = loosened(low, high, count)
            for e in range(count):
                kept = advanced(
                    operands, dialect, seen[k], judged, hides, scan_ms, low, high, e, next_low, next_high, kept
                )
                if dialect[FIRST_ASKED] >= 0:
                    return k, ASKED, low, high, count
                if kept < 0:
                    return k, LOST, low, high, count
        if kept == 0:
            return k, FELL, low, high, count
        low, high, next_low, next_high = next_low, next_high, low, high
        count = kept
    return stop, DONE, low, high, count


def advanced(
    operands: Any,
    dialect: Any,
    seen: Any,
    judged: Any,
    hides: bool,
    scan_ms: int,
    low: Any,
    high: Any,
    e: int,
    next_low: Any,
    next_high: Any,
    kept: int,
) -> int:
    """Add what one element becomes; the new number of elements, -1 when it cannot be followed."""
    lowest, highest = unpacked(low, e), unpacked(high, e)
    exact = wavers(operands, dialect)
    begin, end = 0, 0
    if exact and is_open(lowest, highest):
        begin, end = place(content(lowest)), place(content(highest))
        if end - begin >= len(next_low):
            return -1
    per_second = ticks_per_second(dialect)
    first, last = 0, 0
    if per_second:
        nominal = int(np.rint(np.float64(nominal_ts(operands)) * per_second))
        slack = max(1, -(-scan_ms * per_second // 1000))
        first, last = max(1, nominal - slack), nominal + slack
        if (last - first > FEW or end > begin) and not hides:
            first, last = cut(operands, dialect, lowest, highest, seen, judged, first, last)
        if last - first > MANY or (end - begin + 1) * (last - first + 1) > PAIRS:
            return kept if dialect[FIRST_ASKED] >= 0 else -1
    for position in range(begin, end + 1):
        if end > begin:
            lowest = highest = with_content(lowest, real_at(position))
        before = kept
        for ticks in range(first, last + 1):
            ts = law_ts(operands, dialect, ticks)
            kept = fitted(operands, dialect, seen, judged, hides, lowest, highest, ts, exact, next_low, next_high, kept)
            if kept < 0 or dialect[FIRST_ASKED] >= 0:
                return kept
            if kept > before and not remembers_ts(operands):
                break
        if per_second and kept > CONTENTS:
            return -1
    return kept


def fitted(
    operands: Any,
    dialect: Any,
    seen: Any,
    judged: Any,
    hides: bool,
    lowest: Any,
    highest: Any,
    ts: Any,
    exact: bool,
    next_low: Any,
    next_high: Any,
    kept: int,
) -> int:
    """Add what reproduces the words with one interval; the new number of elements, -1 when it cannot be followed."""
    after, terms = step(operands, lowest, dialect, ts)
    if dialect[FIRST_ASKED] >= 0:
        return kept
    where = side(after, terms, seen, judged, hides)
    if not is_open(lowest, highest):
        return kept if where else added(after, after, seen, hides, exact, next_low, next_high, kept)
    far, far_terms = step(operands, highest, dialect, ts)
    if dialect[FIRST_ASKED] >= 0:
        return kept
    if (terms.flags ^ far_terms.flags) & flag.FROZEN:
        return -1
    if terms.flags & flag.BUMPLESS and (same(seen[2], operands.mv_max) or same(seen[2], operands.mv_min)):
        # Whether the integral goes on at once hangs on the last bits of the sum.
        return -1
    there = side(far, far_terms, seen, judged, hides)
    if where == 0 and there == 0:
        return added(after, far, seen, hides, exact, next_low, next_high, kept)
    if there in (where, NEVER) or where == NEVER:
        return kept
    # Cut off what lies below and above: positions count the REALs between the ends.
    sign = -1 if where > there else 1
    bottom, top = place(content(lowest)), place(content(highest))
    start, beyond = bottom, top + 1
    while start < beyond:
        middle = (start + beyond) // 2
        if sign * side_at(operands, dialect, seen, judged, hides, lowest, middle, ts) >= 0:
            beyond = middle
        else:
            start = middle + 1
    finish, beyond = start, top + 1
    while finish < beyond:
        middle = (finish + beyond) // 2
        if sign * side_at(operands, dialect, seen, judged, hides, lowest, middle, ts) > 0:
            beyond = middle
        else:
            finish = middle + 1
    if finish <= start:
        return kept
    near, near_terms = step(operands, with_content(lowest, real_at(start)), dialect, ts)
    far, far_terms = step(operands, with_content(lowest, real_at(finish - 1)), dialect, ts)
    if side(near, near_terms, seen, judged, hides) or side(far, far_terms, seen, judged, hides):
        return -1
    return added(near, far, seen, hides, exact, next_low, next_high, kept)


def side_at(
    operands: Any, dialect: Any, seen: Any, judged: Any, hides: bool, state: Any, position: int, ts: Any
) -> int:
    """Where the words lie with the content at this position."""
    after, terms = step(operands, with_content(state, real_at(position)), dialect, ts)
    return side(after, terms, seen, judged, hides)


def added(first: Any, last: Any, seen: Any, hides: bool, exact: bool, next_low: Any, next_high: Any, kept: int) -> int:
    """Add an element, or widen one that has all but the content in common; -1 when there is no more room."""
    if kept >= len(next_low):
        return -1
    if content(first) > content(last):
        first, last = last, first
    pack(first, next_low, kept)
    pack(last, next_high, kept)
    if hides:
        # What I_MV follows from is a PV that nobody saw: it is taken as shown.
        next_low[kept, i_at] = next_high[kept, i_at] = seen[1]
    for j in range(max(0, kept - NEAR), kept):
        if not in_common(next_low, j, kept):
            continue
        if content_at < 0:
            return kept
        if not exact:
            next_low[j, content_at] = min(next_low[j, content_at], next_low[kept, content_at])
            next_high[j, content_at] = max(next_high[j, content_at], next_high[kept, content_at])
            return kept
        if next_low[j, content_at] == next_low[kept, content_at]:
            return kept
    return kept + 1


def in_common(rows: Any, j: int, k: int) -> bool:
    """Tell whether two states differ at most in the content."""
    is_same = True
    for column in range(rows.shape[1]):
        is_same = is_same and (column == content_at or rows[j, column] == rows[k, column])
    return is_same


def loosens(operands: Any, dialect: Any) -> bool:
    """Tell whether PV may have passed SV between the executions, where the cross status is kept scan by scan."""
    if cross_at < 0 or operands.err_dbw == ZERO:
        return False
    return bool(dialect.cross_scan) and not dialect.cross_band


def loosened(low: Any, high: Any, count: int) -> int:
    """Add to each element the one with the other cross status, where there is room; the new number of elements."""
    for e in range(count):
        if 2 * count > len(low):
            break
        low[count + e] = low[e]
        high[count + e] = high[e]
        low[count + e, cross_at] = high[count + e, cross_at] = 1.0 - low[e, cross_at]
    wider = count if 2 * count > len(low) else 2 * count
    kept = 0
    for e in range(wider):
        is_known = False
        for j in range(kept):
            if in_common(low, j, e) and (content_at < 0 or low[j, content_at] == low[e, content_at]):
                is_known = True
        if not is_known:
            low[kept] = low[e]
            high[kept] = high[e]
            kept += 1
    return kept


def hides_pv(operands: Any, dialect: Any) -> bool:
    """Tell whether the execution leaves no trace of the PV that it read, and I_MV follows from that."""
    if not operands.pid_run or not operands.pid_man:
        return False
    return bool(dialect.manual_history) and bool(dialect.manual_integral)


def forgets(operands: Any) -> bool:
    """Tell whether a PV that nobody saw would leave the filter or the cross status open."""
    return bool(extended and (operands.td_kd > ZERO or operands.err_dbw != ZERO))


def stands(low: Any, count: int, seen: Any, judged: Any) -> bool:
    """Tell whether the record of the last PV is as some element has it, as it must be where the history stands."""
    stood = not judged[0]
    for e in range(count):
        stood = stood or same(REAL(low[e, pv1_at]), REAL(seen[0]))
    return stood


def wavers(operands: Any, dialect: Any) -> bool:
    """Tell whether the content has to be followed value by value."""
    return bool(extended and operands.td_kd > ZERO and operands.tf > ZERO and is_rough(dialect))


def place(x: Any) -> int:
    """Number of a REAL, neighbours differing by one and both zeros 0."""
    held = np.empty(1, np.float32)
    held[0] = x
    pattern = int(held.view(np.int32)[0])
    return pattern if pattern >= 0 else -(pattern & 0x7FFFFFFF)


def real_at(position: int) -> Any:
    """Inverse of `place`."""
    held = np.empty(1, np.int32)
    held[0] = abs(position)
    x = held.view(np.float32)[0]
    return -x if position < 0 else x
