"""D's filter where rounding keeps the law from being monotone in what it remembers: bounds that enclose it yet.

Forward Euler and alpha add a share of a difference to the content, and a filter before the difference makes D of two
contents that lie close together: there neighbouring contents can come out in the other order. This file alone says by
how much. A bound of few values is followed value by value; of a wide one, everything is possible that the roundings of
one execution can have moved, and nothing else.

Source:
    PROVEN by the roundings of each operation (2**-24 of its result): of the content, those of the difference, of the
    product and of the sum; of MV, at most eight of the largest term in any order of the sum. Both count twice, for two
    contents that are compared, and the latter twice again.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ahgateway.codec.station import Loop
from ahgateway.core import flags as flag
from ahgateway.core.controllers.delta import gain
from ahgateway.core.controllers.delta_terms import is_rough
from ahgateway.core.dialect import FilterContent
from ahgateway.core.real import REAL, from_order, order, quiet, same_bits
from ahgateway.lockstep.picture import predicted

VALUES_MAX = 64
"""A bound of no more values than this is followed value by value."""

ROUNDING = 2.0**-23
"""Two roundings, one of each of two contents that are compared, as a share of the result."""

SUM_ROUNDINGS = 16
"""So many of them in the largest term: a sum of four in any order, its products and its limits, twice."""

NOT_COMPUTED = flag.STOPPED | flag.AUTOTUNE | flag.BAD_INPUT
NOT_FREE = flag.MANUAL | flag.BUMPLESS


def is_loose(loop: Loop) -> bool:
    """Tell whether the dialect's filter rounds so that the law is monotone in its content but for rounding."""
    return loop.controller.law_ts is not None and is_rough(loop.dialect)


def values(low: Any, high: Any) -> list[REAL] | None:
    """Every content from one state's to another's where they are few, else None."""
    first, last = sorted((order(low.d), order(high.d)))
    if last - first > VALUES_MAX:
        return None
    return [from_order(position) for position in range(first, last + 1)]


def enclosing(loop: Loop, inputs: Any, ts: REAL, ends: tuple[Any, Any], after: tuple[Any, Any]) -> tuple[Any, Any]:
    """Widen both ends behind an execution until they enclose what every content between can have become."""
    low, high = after
    contents = values(*ends)
    if contents is not None:
        with quiet(all="ignore"):
            reached = [
                loop.controller.step(inputs, ends[0]._replace(d=each), loop.dialect, ts)[0].d for each in contents
            ]
        return low._replace(d=min(reached, key=order)), high._replace(d=max(reached, key=order))
    if all(same_bits(before.d, behind.d) for before, behind in zip(ends, after, strict=True)):
        return low, high
    lost = max(lost_in(before.d, behind.d) for before in ends for behind in after)
    with quiet(all="ignore"):
        return low._replace(d=REAL(low.d - lost)), high._replace(d=REAL(high.d + lost))


def lost_in(before: REAL, after: REAL) -> float:
    """By how much a content can be off for rounding, and one end of a bound from the other."""
    return ROUNDING * (abs(float(after)) + 2.0 * abs(float(after) - float(before)))


def roughness(loop: Loop, inputs: Any, ts: REAL, before: Any, after: Any, terms: Any) -> float:
    """By how much MV can be out of the order of the contents, as bounded by every rounding of one execution."""
    size = abs(float(terms.p)) + abs(float(terms.d)) + abs(float(terms.bias)) + abs(float(terms.raw))
    return _rough_d(loop, inputs, ts, before, after, terms) + SUM_ROUNDINGS * ROUNDING * size


def _rough_d(loop: Loop, inputs: Any, ts: REAL, before: Any, after: Any, terms: Any) -> float:
    """By how much D can be out of the order of the contents."""
    kc = abs(float(gain(inputs.kc_kp)))
    kd = abs(float(gain(inputs.td_kd))) * (kc if inputs.pid_eq else 1.0)
    steep = kc if inputs.pid_eq and loop.dialect.dependent_sum else 1.0
    if loop.dialect.filter_content == FilterContent.INPUT:
        steep = kd / float(ts)
    elif loop.dialect.filter_content:
        steep = kd
    return steep * lost_in(before.d, after.d) + 4 * ROUNDING * abs(float(terms.d))


def is_same_between(loop: Loop, fit: Any, names: tuple[str, ...], words: Mapping[str, REAL]) -> bool:
    """Tell whether a bound whose two ends leave the same words leaves them all through.

    The sum is monotone in D, whatever its order: what two contents leave of which D lies beyond that of every content
    between, all between leave.
    """
    low, high = (_reached(loop, fit, end) for end in fit.before)
    if low[1].flags != high[1].flags:
        return False
    if low[1].flags & NOT_COMPUTED:
        return True
    pairs = zip(fit.before, (low, high), strict=True)
    rough = 2.0 * max(_rough_d(loop, fit.inputs, fit.ts, before, *reached) for before, reached in pairs)
    width = float(fit.before.high.d) - float(fit.before.low.d)
    moved = abs(float(high[1].d) - float(low[1].d))
    if not rough < moved:
        return False
    margin = 2.0 * rough * width / moved
    with quiet(all="ignore"):
        ends = REAL(fit.before.low.d - margin), REAL(fit.before.high.d + margin)
    for end in ends:
        after, terms = _reached(loop, fit, fit.before.low._replace(d=end))
        found = predicted(loop.controller, after, terms)
        if any(not same_bits(found[name], words[name]) for name in names):
            return False
    return True


def _reached(loop: Loop, fit: Any, state: Any) -> tuple[Any, Any]:
    with quiet(all="ignore"):
        return loop.controller.step(fit.inputs, state, loop.dialect, fit.ts)


def side(loop: Loop, inputs: Any, state: Any, seen: Mapping[str, REAL], ts: REAL) -> int:
    """Tell whether this content and all beyond it surely leave MV below (-1) or above (1) what was seen, else 0."""
    with quiet(all="ignore"):
        after, terms = loop.controller.step(inputs, state, loop.dialect, ts)
    if terms.flags & NOT_FREE:
        return 0
    low, high = sorted((float(inputs.mv_min), float(inputs.mv_max)))
    mv, wanted = float(after.mv), float(seen["MV"])
    if mv in (low, high):
        mv = min(mv, float(terms.raw)) if mv == low else max(mv, float(terms.raw))
    rough = roughness(loop, inputs, ts, state, after, terms)
    if mv + rough < wanted:
        return 0 if wanted <= low else -1
    return 1 if mv - rough > wanted and wanted < high else 0


def is_excluded(
    loop: Loop,
    fit: Any,
    names: tuple[str, ...],
    low: Mapping[str, REAL],
    high: Mapping[str, REAL],
    seen: Mapping[str, REAL],
    rough: float,
) -> bool:
    """Tell whether a word that both ends predict alike rules out every content between: roundings apart for MV.

    The integral is one where neither end is limited, MV is not at a limit, and it does not follow from D; else where
    that can be shown of both ends, as of a transfer that takes MV for the integral.
    """
    is_set = bool(fit.terms.flags & (NOT_FREE | flag.FROZEN))
    edges = (fit.inputs.mv_min, fit.inputs.mv_max)
    is_inside = not any(same_bits(seen["MV"], edge) for edge in edges if "MV" in seen)
    for name in names:
        if not same_bits(low[name], high[name]) or same_bits(low[name], seen[name]):
            continue
        if name in ("MV", "MOUT"):
            if abs(float(low[name]) - float(seen[name])) > rough:
                return True
        elif name != "I_MV" or (is_inside and not is_set) or is_same_between(loop, fit, ("I_MV",), low):
            return True
    return False
