"""Cut down the ticks of a clock that an execution can have measured: its words allow few of them.

Nothing may be cut off that can be true. I_MV is monotone in the interval, each operation rounding monotonically. MV is
so but for the rounding of what D's filter remembers, which is another one at each tick: it is cut that much wider.
"""

from __future__ import annotations

from typing import Any

from ahgateway.core import flags as flag
from ahgateway.core.compiling import FIRST_ASKED
from ahgateway.core.dialect import Filter, FilterContent, ManualIntegral
from ahgateway.core.real import REAL
from ahgateway.core.sides import ONE, ZERO, is_open, remembers_ts, same, side

ROUNDINGS = REAL(2.0**-20)
"""8 roundings, each of 2**-24, twice."""

# Filled in for each law by `sieve`.
step: Any = None
law_ts: Any = None
content: Any = None
extended: Any = False


def cut(
    operands: Any, dialect: Any, state: Any, highest: Any, seen: Any, judged: Any, first: int, last: int
) -> tuple[int, int]:
    """Cut a range of ticks down to those that put I_MV right, or MV where I_MV does not depend on them.

    Each is monotone in the interval as long as neither a limit nor a transfer has a part in it; else the range stays.
    While the content is open I_MV alone cuts, and only where no content between both ends brings a limit in: to each
    content MV gives other ticks.
    """
    near, near_terms = step(operands, state, dialect, law_ts(operands, dialect, first))
    far, far_terms = step(operands, state, dialect, law_ts(operands, dialect, last))
    flags = near_terms.flags
    if flags != far_terms.flags or flags & (flag.BUMPLESS | flag.BAD_INPUT) or dialect[FIRST_ASKED] >= 0:
        return first, last
    if flags & flag.MANUAL and dialect.manual_integral == ManualIntegral.TRACKS:
        # It follows from D, as where a transfer sets it.
        return first, last
    by_i = not same(near.i, far.i)
    if is_open(state, highest):
        _, least_terms = step(operands, highest, dialect, law_ts(operands, dialect, first))
        _, most_terms = step(operands, highest, dialect, law_ts(operands, dialect, last))
        if not by_i or flags & flag.FROZEN or least_terms.flags != flags or most_terms.flags != flags:
            return first, last
        if not (is_clear(operands, least_terms, first, last) and is_clear(operands, most_terms, first, last)):
            return first, last
    if by_i and flags & flag.FROZEN:
        # Computed back from MV it is not monotone: D stands in it twice, and all but cancels.
        return first, last
    if (
        by_i
        and same(state.i, seen[1])
        and not (is_clear(operands, near_terms, first, last) and is_clear(operands, far_terms, first, last))
    ):
        return first, last
    is_wavy = extended and not by_i and remembers_ts(operands) and operands.tf > ZERO
    if not by_i and same(near.mv, far.mv) and same(near_terms.d, far_terms.d):
        if is_wavy and (near_terms.d != ZERO or dialect.filter_content == FilterContent.INPUT):
            # Alike at both ends, but not for that between them.
            return first, last
        if side(near, near_terms, seen, judged, False):
            return 1, 0
        return first, last if remembers_ts(operands) else first
    wanted = seen[1] if by_i else seen[2]
    if not (judged[1] if by_i else judged[2]):
        return first, last
    slack = ZERO
    if extended and is_wavy:
        if dialect.filter == Filter.EXACT and dialect.filter_content != FilterContent.INPUT:
            # What decays and what comes in can turn it round between the ends.
            return first, last
        slack = blur(operands, dialect, state, near, near_terms, law_ts(operands, dialect, first))
        slack = max(slack, blur(operands, dialect, state, far, far_terms, law_ts(operands, dialect, first)))
        if not abs(near.mv - far.mv) > slack + slack:
            return first, last
    sign = ONE
    if (near.i > far.i) if by_i else (near.mv > far.mv):
        sign = -ONE
    start, is_free = reached(operands, dialect, state, first, last + 1, sign, wanted - sign * slack, by_i, flags, False)
    if not is_free:
        return first, last
    beyond, is_free = reached(operands, dialect, state, start, last + 1, sign, wanted + sign * slack, by_i, flags, True)
    return (start, beyond - 1) if is_free else (first, last)


def blur(operands: Any, dialect: Any, state: Any, after: Any, terms: Any, ts: Any) -> Any:
    """By how much MV can be off what it is without rounding, twice over: a filter's content is rounded at each tick.

    At most 8 roundings of the contents before and behind, as D takes them, and as many of the terms of the sum.
    """
    kc = abs(operands.kc_kp) if operands.pid_eq else ONE
    steep = kc if dialect.dependent_sum else ONE
    if dialect.filter_content == FilterContent.INPUT:
        steep = operands.td_kd * kc / ts
    elif dialect.filter_content:
        steep = operands.td_kd * kc
    moved = (abs(content(state)) + abs(content(after))) * (ONE + ts / operands.tf)
    size = abs(terms.p) + abs(terms.d) + abs(terms.bias) + abs(terms.raw) + abs(after.i)
    return ROUNDINGS * (steep * moved + size)


def is_clear(operands: Any, terms: Any, first: int, last: int) -> bool:
    """Tell whether no tick between two can carry the sum over a limit that neither end passes.

    The sum is a line in the interval, and D over it: between the ends it leaves their chord by a part of D that is at
    most the square of the relative range.
    """
    share = REAL(last - first) / REAL(first)
    bulge = abs(terms.d) * (share * share) + abs(terms.raw) * REAL(1e-5)
    return bool(abs(terms.raw - operands.mv_max) > bulge and abs(terms.raw - operands.mv_min) > bulge)


def reached(
    operands: Any,
    dialect: Any,
    state: Any,
    start: int,
    beyond: int,
    sign: Any,
    wanted: Any,
    by_i: bool,
    flags: int,
    is_past: bool,
) -> tuple[int, bool]:
    """First tick at which what was wanted is reached, or passed; and whether nothing else had a part on the way."""
    while start < beyond:
        middle = (start + beyond) // 2
        after, terms = step(operands, state, dialect, law_ts(operands, dialect, middle))
        if terms.flags != flags:
            return start, False
        value = after.i if by_i else after.mv
        if sign * value > sign * wanted or (not is_past and value == wanted):
            beyond = middle
        else:
            start = middle + 1
    return start, True
