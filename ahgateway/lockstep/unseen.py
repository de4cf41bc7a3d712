"""What executions that nobody saw, and scans between them, can have left behind: all that is possible is kept.

This file alone advances a shadow without a picture; `counting` asks it for the executions between two of them.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from ahgateway.codec.station import Loop
from ahgateway.core import flags as flag
from ahgateway.core.controllers.delta import limit
from ahgateway.core.dialect import Freeze, Limits
from ahgateway.core.real import REAL, from_order, order, quiet, same_bits
from ahgateway.lockstep import loose
from ahgateway.lockstep.interval import first_for, intervals
from ahgateway.lockstep.picture import Picture
from ahgateway.lockstep.reads import input_variants
from ahgateway.lockstep.shadow import (
    Bound,
    Fit,
    Shadow,
    explain,
    judged_names,
    merged,
    open_attr,
    open_terms,
    state_key,
    stepped,
    unrecorded,
)

PARTS_MAX = 64
"""Into no more parts than this is a bound cut: where a transfer set the integral from an open D, one for each of its
values."""

ADVANCED_MAX = 512
"""More states than this behind an unseen execution are not even sorted: where Ts is measured, each is its own."""


def advanced(loop: Loop, shadow: Shadow, inputs: Any) -> Shadow:
    """Return what the shadow can be behind one more execution of which nothing was seen; () when that is anything.

    A bound that is limited in one way at its low end and in another at its high end encloses nothing: it is cut.
    """
    found: list[Bound] = []
    for bound in shadow:
        possible = intervals(loop, inputs)
        if not possible.is_whole:
            return ()
        for ts in possible.values:
            parts = _alike(loop, inputs, bound, ts)
            if not parts:
                return ()
            for part in parts:
                after, low_terms, high_terms = stepped(loop, inputs, part, ts)
                # MV is not seen either. What reads it again is a transfer from manual, where it was MOUT, and a limit
                # that was reached, which is the same all through this part.
                after = Bound(after.low, after.high._replace(mv=after.low.mv))
                if not _is_one_real(after):
                    return ()
                fit = Fit(inputs, part, after, low_terms, open_terms(low_terms, high_terms), ts)
                found.extend(each.after for each in unrecorded(loop, fit))
        if len(found) > ADVANCED_MAX:
            return ()
    return merged(found)


def lingered(loop: Loop, shadow: Shadow, before: Picture, after: Picture, executions_max: int) -> Shadow:
    """Add what up to `executions_max` executions that changed no word can have left hidden."""
    names = tuple(name for name in judged_names(loop) if name != "MOUT")
    bounds = list(shadow)
    front = list(shadow)
    known = {(state_key(bound.low), state_key(bound.high)) for bound in bounds}
    variants = input_variants(loop, before, after)
    for _ in range(min(executions_max, 4)):
        reached = [fit.after for bound in front for fit in explain(loop, (bound,), variants, after.seen, names).fits]
        front = []
        for bound in reached:
            key = (state_key(bound.low), state_key(bound.high))
            if key not in known:
                known.add(key)
                front.append(bound)
        if not front:
            break
        bounds.extend(front)
    # Nothing new: what stood apart stays apart.
    return shadow if len(bounds) == len(shadow) else merged(bounds)


def refreshed(loop: Loop, picture: Picture) -> REAL | None:
    """Where a scan in manual puts MV, in a dialect in which it follows MOUT scan by scan; None in any other case."""
    inputs = picture.inputs
    if loop.controller.law_ts is None or not loop.dialect.manual_refresh:
        return None
    if not (inputs.pid_run and inputs.pid_man and inputs.pid_mode != 1):
        return None
    low, high = inputs.mv_min, inputs.mv_max
    if high < low and loop.dialect.limits != Limits.AS_WRITTEN:
        low, high = high, low
    return limit(low, inputs.mout, high)


def _is_one_real(bound: Bound) -> bool:
    """Tell whether the ends differ in one REAL at most: an integral that was set from an open D goes along with it."""
    pairs = zip(bound.low, bound.high, strict=True)
    return sum(isinstance(low, np.floating) and not same_bits(low, high) for low, high in pairs) <= 1


def _alike(loop: Loop, inputs: Any, bound: Bound, ts: REAL) -> list[Bound]:
    """Cut a bound into parts that are limited alike at both ends, and so all through, and that leave one integral.

    [] where rounding hides where to cut, or where there are too many.
    """
    attr = open_attr(bound)

    def kind(position: int) -> tuple[Any, ...]:
        state = bound.low if attr is None else bound.low._replace(**{attr: from_order(position)})
        with quiet(all="ignore"):
            after, terms = loop.controller.step(inputs, state, loop.dialect, ts)
        same = (terms.flags, order(after.i))
        if loop.dialect.freeze != Freeze.PREVIOUS_MV:
            return same
        sides = (side for edge in (inputs.mv_min, inputs.mv_max) for side in (after.mv > edge, after.mv < edge))
        return *same, *sides

    if attr is None:
        return [bound]
    start, last = sorted((order(getattr(bound.low, attr)), order(getattr(bound.high, attr))))
    end_kind = kind(last)
    is_loose = attr == "d" and loose.is_loose(loop)
    if loop.dialect.freeze_test and loop.dialect.limit_edge and _passes_limit(loop, inputs, bound, ts):
        # A sum without D freezes at the very limit, and on neither side of it.
        return []
    is_set = end_kind[0] & (flag.BUMPLESS | flag.MANUAL | flag.FROZEN)
    if kind(start) == end_kind and not (is_loose and is_set):
        return [bound]
    if is_loose:
        return []
    found: list[Bound] = []
    while start <= last:
        if len(found) == PARTS_MAX:
            return []
        same = kind(start)
        end = last if same == end_kind else first_for(start, last, partial(_differs, kind, same)) - 1
        low, high = (bound.low._replace(**{attr: from_order(each)}) for each in (start, end))
        found.append(Bound(low, high))
        start = end + 1
    return found


def _passes_limit(loop: Loop, inputs: Any, bound: Bound, ts: REAL) -> bool:
    """Tell whether the sum comes to a limit between both ends."""
    with quiet(all="ignore"):
        sums = [float(loop.controller.step(inputs, end, loop.dialect, ts)[1].raw) for end in bound]
    return any(not max(sums) < edge and not min(sums) > edge for edge in (inputs.mv_min, inputs.mv_max))


def _differs(kind: Callable[[int], tuple[Any, ...]], same: tuple[Any, ...], position: int) -> bool:
    return kind(position) != same
