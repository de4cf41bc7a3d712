"""Where the search of a trace may begin with D's filter known: behind a plain execution MV itself bounds it.

On a plain execution, automatic, between the limits, without dead band and no transfer, MV is the sum of P, I, D and
BIAS, so that D lies within the rounding of that sum. This keeps a search away from contents that no loop can hold, at
which the law would run into its limits and ask for axes that the trace never touches.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from ahgateway.codec.station import Loop
from ahgateway.core.controllers import delta_terms as terms_of
from ahgateway.core.controllers.delta import gain
from ahgateway.core.dialect import Filter, FilterContent
from ahgateway.core.real import REAL, quiet
from ahgateway.lockstep.interval import intervals
from ahgateway.lockstep.picture import Picture
from ahgateway.lockstep.shadow import Bound, Shadow, merged, recalled
from ahgateway.lockstep.thinning import first_plain, is_plain

ROUNDING = 2.0**-21
"""8 roundings of everything that was added: two of P, three sums and two products are the most that any order has."""

OPEN_MIN = 1e20
"""An end of a bound beyond this was never seen in words, it is the edge of what is thinkable."""


def is_anchor(loop: Loop, pairs: Sequence[tuple[Picture, Picture]], number: int, *, is_next: bool) -> bool:
    """Tell whether a search may begin behind this execution: nothing of D is open, or MV bounds it.

    Args:
        loop: The loop.
        pairs: Pictures before and behind each execution of the trace.
        number: Place of the execution in it.
        is_next: It follows the execution before it in the trace.
    """
    read = pairs[number][1].inputs
    if not hasattr(read, "tf") or not read.td_kd > 0:
        return True
    if not is_next or number == 0 or (read.pid_eq and not read.kc_kp > 0):
        return False
    if _form(pairs[number - 1][1].inputs) != _form(read):
        # The integral may have been rescaled before it was used, and no word shows that.
        return False
    # The execution before was plain too, so that this one is no transfer from manual.
    return is_plain(loop, pairs[number - 1]) and is_plain(loop, pairs[number])


def _form(read: Any) -> tuple[bool, bool, bool]:
    return read.pid_eq, read.pid_de, read.pid_dir


def is_lost(shadow: Shadow) -> bool:
    """Tell whether D's filter can be anything in one of the bounds."""
    return any(abs(float(getattr(end, "d", 0.0))) > OPEN_MIN for bound in shadow for end in bound)


def anchored(loop: Loop, before: Picture, after: Picture) -> Shadow:
    """Start a shadow behind an execution for which `is_anchor` holds, D's filter bounded by MV."""
    shadow = recalled(loop, (after.inputs, before.inputs), after.seen)
    if not is_lost(shadow):
        return shadow
    low, high = _content(loop, before, after)
    return merged(Bound(bound.low._replace(d=low), bound.high._replace(d=high)) for bound in shadow)


def first_anchor(loop: Loop, pairs: Sequence[tuple[Picture, Picture]], follows: Sequence[bool]) -> int:
    """Place of the execution to begin at; the first plain one when there is no anchor.

    Best is an anchor after which P, I and BIAS stay between the limits without D: while the filter is still open to its
    last bits, nothing of what a limit does is asked for.

    Args:
        loop: The loop, its dialect one that can be true.
        pairs: Pictures before and behind each execution of the trace.
        follows: Whether each execution follows the one before it in the trace.
    """
    first = first_plain(loop, pairs)
    found = [n for n in range(first, len(pairs)) if is_anchor(loop, pairs, n, is_next=follows[n])]
    calm = (n for n in found if n + 1 < len(pairs) and _is_calm(loop, pairs[n]) and _is_calm(loop, pairs[n + 1]))
    return next(calm, found[0] if found else first)


def _is_calm(loop: Loop, pair: tuple[Picture, Picture]) -> bool:
    if not is_plain(loop, pair) or not hasattr(pair[1].inputs, "tf"):
        return is_plain(loop, pair)
    p, integrals, bias = _without_d(loop, *pair)
    low, high = sorted((float(pair[1].inputs.mv_min), float(pair[1].inputs.mv_max)))
    return all(low < p + integral + bias < high for integral in integrals)


def _without_d(loop: Loop, before: Picture, after: Picture) -> tuple[float, tuple[float, float], float]:
    """P, what I can be, and BIAS."""
    read, dialect = after.inputs, loop.dialect
    kc, ti_ki = gain(read.kc_kp), gain(read.ti_ki)
    pv = next(after.seen[word.name] for word in loop.controller.seen if word.attr == "pv1")
    e = float(read.sv) - float(pv)
    p = float(kc) * (e if read.pid_dir != bool(dialect.direction) else -e)
    used = before if ti_ki > 0 and dialect.integral_used else after
    return p, _integrals(loop, read, ti_ki, kc, used.seen["I_MV"]), float(read.bias)


def _content(loop: Loop, before: Picture, after: Picture) -> tuple[REAL, REAL]:
    """Least and largest content of the filter with which the sum comes out as MV."""
    read, dialect = after.inputs, loop.dialect
    kc, td_kd, tf = gain(read.kc_kp), gain(read.td_kd), gain(read.tf)
    p, integrals, bias = _without_d(loop, before, after)
    mv = float(after.seen["MV"])
    left = [mv - p - integral - bias for integral in integrals]
    size = abs(p) + max(map(abs, integrals)) + abs(bias) + abs(mv) + max(map(abs, left))
    slack = ROUNDING * size
    is_factored = bool(read.pid_eq and dialect.dependent_sum)
    low, high = min(left) - slack, max(left) + slack
    if tf > 0 and dialect.filter != Filter.IGNORED and dialect.filter_content == FilterContent.SLOPE:
        factor = float(td_kd) * (float(kc) if read.pid_eq else 1.0)
    elif dialect.filter_content == FilterContent.INPUT:
        return _input_content(loop, before, after, low, high)
    else:
        factor = float(kc) if is_factored else 1.0
    return _outward(low / factor, -math.inf), _outward(high / factor, math.inf)


def _input_content(loop: Loop, before: Picture, after: Picture, low: float, high: float) -> tuple[REAL, REAL]:
    """Least and largest content of a filter that stands before the difference, from what D can be.

    D is Kd * (what the content moved) / Ts, and each filter moves towards x by a known share of the distance.
    """
    read, dialect = after.inputs, loop.dialect
    recorded = next(word.name for word in loop.controller.seen if word.attr == "pv1")
    sign = 1.0 if read.pid_dir != bool(dialect.direction) else -1.0
    xs = []
    for picture in (after, before):
        pv, sv = float(picture.seen[recorded]), float(picture.inputs.sv)
        xs.append(-sign * pv if read.pid_de else sign * (sv - pv))
    x, x1 = xs
    tf = float(gain(read.tf))
    if read.pid_eq and tf > 0 and dialect.tf_unit:
        tf *= float(read.td_kd)
    kd = float(gain(read.td_kd)) * (float(gain(read.kc_kp)) if read.pid_eq else 1.0)
    if not tf > 0 or dialect.filter == Filter.IGNORED:
        return REAL(x), REAL(x)
    spans = [float(ts) for ts in intervals(loop, read).values]
    ends: list[float] = []
    for ts in (min(spans), max(spans)):
        # The difference of two numbers near x loses what they are rounded by.
        lost = 4 * 2.0**-23 * (abs(x) + abs(x1)) * kd / ts
        ends += [_behind(dialect, x, x1, d * ts / kd, tf, ts) for d in (low - lost, high + lost)]
    size = 8 * 2.0**-23 * (abs(x) + abs(x1) + max(map(abs, ends)))
    return _outward(min(ends) - size, -math.inf), _outward(max(ends) + size, math.inf)


def _behind(dialect: Any, x: float, x1: float, moved: float, tf: float, ts: float) -> float:
    """The content behind an execution in which it moved by so much."""
    if dialect.filter == Filter.FORWARD:
        return x - moved * (tf - ts) / ts
    if dialect.filter == Filter.TUSTIN:
        return (x + x1 - moved * (2 * tf + ts) / ts) / 2 + moved
    if dialect.filter == Filter.EXACT:
        kept = math.exp(-ts / tf)
        return x - moved * kept / (1.0 - kept)
    return x - moved * tf / ts


def _integrals(loop: Loop, read: Any, ti_ki: REAL, kc: REAL, i: REAL) -> tuple[float, float]:
    """The integral term, or both that it can be where integration is off."""
    if not ti_ki > 0:
        return 0.0, float(i)
    with quiet(all="ignore"):
        term = float(terms_of.term(loop.dialect, bool(read.pid_eq), ti_ki, kc, i))
    return term, term


def _outward(x: float, way: float) -> REAL:
    return REAL(np.nextafter(REAL(x), REAL(way)))
