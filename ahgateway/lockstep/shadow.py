"""The shadow: what the controller can have in its hidden memory, carried from execution to execution.

What a PLC does not show (D filter, cross status, previous error, manual history) is carried, not invented. The shadow
is a set of bounds: each is a lowest and a highest state that differ in at most one REAL, in which the law is
monotone; every operation rounds monotonically, so stepping both ends bounds every state between them exactly.
An execution keeps what reproduces its words and drops the rest. This file alone decides what is consistent with what
was seen; it gives no verdicts.

Theory of operation: `explain` tries each set of inputs that the execution can have read against each bound. A bound
whose two ends predict the same words is decided; one whose ends differ is narrowed by bisection to the part that
reproduces the words, if there is one.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from ahgateway.codec.station import Const, Loop
from ahgateway.core import flags as flag
from ahgateway.core.controllers.delta_terms import transfer_kind
from ahgateway.core.controllers.dpide import D_BOUND
from ahgateway.core.dialect import CrossBand, CrossScan, FilterContent, Freeze, ManualFilter
from ahgateway.core.real import REAL, bits, from_order, order, quiet, same_bits
from ahgateway.lockstep import loose
from ahgateway.lockstep.interval import first_for, intervals, is_ruled_out, unlimited
from ahgateway.lockstep.picture import predicted

BOUNDS_MAX = 48
"""More possibilities than this are no knowledge: the shadow starts again from the block."""

SETTLED_ULP = 1 << 16
"""A bound this narrow is as good as one state when it comes to causes; a fresh one spans all REALs."""

NOTHING = 2.0**-22
"""A content that is known to this share of MV moves no more than its last bit."""

UNBOUNDED = 1e20
"""No loop holds such a value."""

MISSED_WORD = 1 << 40
"""Missing one word more weighs heavier than missing others by whatever."""


class Bound(NamedTuple):
    """Two states that enclose a possibility; equal when nothing is open."""

    low: Any
    high: Any

    @property
    def is_point(self) -> bool:
        """True when both ends have the same bits."""
        return self.low is self.high or state_key(self.low) == state_key(self.high)


Shadow = tuple[Bound, ...]
Names = tuple[str, ...]


class Fit(NamedTuple):
    """One way to explain an execution: what it read, what was before and after, and what it says of itself.

    `open_terms` names the terms whose last bits are not settled, though every word that can be seen is. `lead` is what
    executions just before it read that nobody saw, oldest first; then `before` is the state before the first of them.
    """

    inputs: Any
    before: Bound
    after: Bound
    terms: Any
    open_terms: tuple[str, ...] = ()
    ts: REAL | None = None
    lead: tuple[Any, ...] = ()


@dataclass(frozen=True, slots=True)
class Explanation:
    """What the shadow makes of an execution.

    Attributes:
        fits: Every way that reproduces the words; empty when none does.
        is_decided: The words were predicted before they were seen: all that was open predicted the same.
        nearest: The prediction that comes closest, decided or not, when nothing fits.
        distance: Rank of `nearest`: how many words it misses, then by how much.
        is_whole: Every Ts that the execution can have had was tried; else it may have fitted with one that was not.
    """

    fits: tuple[Fit, ...]
    is_decided: bool
    nearest: Fit | None
    distance: int = 0
    is_whole: bool = True

    @property
    def may_fit(self) -> bool:
        """Tell whether the execution fits, or may with a Ts that was not tried."""
        return bool(self.fits) or not self.is_whole


def state_key(state: Any) -> tuple[int, ...]:
    """The bits of a state, as something to compare and to look up."""
    return tuple(bits(field) if isinstance(field, np.floating) else int(field) for field in state)


def judged_names(loop: Loop) -> tuple[str, ...]:
    """The seen words that stand in the PLC's memory, in the order in which they are blamed."""
    return tuple(seen.name for seen in loop.controller.seen if not isinstance(loop.bindings.get(seen.operand), Const))


def _key(names: Iterable[str], words: Mapping[str, REAL]) -> tuple[int, ...]:
    """The bits under every name, as something to compare and to look up."""
    return tuple([bits(words[name]) for name in names])


def same_words(names: Iterable[str], left: Mapping[str, REAL], right: Mapping[str, REAL]) -> bool:
    """Tell whether both have the same bits under every name."""
    return all(same_bits(left[name], right[name]) for name in names)


def recalled(loop: Loop, inputs: Iterable[Any], seen: Mapping[str, REAL]) -> Shadow:
    """Start a shadow behind an execution whose words are known: every hidden state it can have left."""
    controller = loop.controller
    known = {word.attr: seen[word.name] for word in controller.seen if hasattr(controller.state(), word.attr)}
    # Delta's laws alone have a dialect in which less can be recalled.
    dialect = () if controller.law_ts is None else (loop.dialect,)
    found: list[Bound] = []
    for read in inputs:
        pairs = controller.recall(read, controller.state(**known), *dialect)
        if not pairs:
            # If the execution read this, its history is older than what was seen: nothing is known.
            return ()
        found.extend(Bound(*pair) for pair in pairs)
    return merged(found)


def merged(bounds: Iterable[Bound]) -> Shadow:
    """Join bounds that differ only in the open REAL into their hull; too many are no knowledge and give ().

    A settled state is not lost in the hull of open ones: it may turn out to be the right one.
    """
    hulls: dict[tuple[int, ...], Bound] = {}
    each = tuple(bounds)
    if len(each) < 2:
        return each
    for bound in each:
        attr = open_attr(bound)
        settled = zip(bound.low._fields, state_key(bound.low), strict=True)
        key = (int(is_settled(bound)), *(0 if name == (attr or "d") else value for name, value in settled))
        known = hulls.get(key)
        hulls[key] = bound if known is None else _hull(known, bound)
    return tuple(hulls.values()) if len(hulls) <= BOUNDS_MAX else ()


def open_attr(bound: Bound) -> str | None:
    """Name the REAL in which the two ends differ, None when they do not."""
    if bound.low is bound.high:
        return None
    for name, low, high in zip(bound.low._fields, bound.low, bound.high, strict=True):
        if isinstance(low, np.floating) and not same_bits(low, high):
            return str(name)
    return None


def is_settled(bound: Bound) -> bool:
    """Tell whether what is open is at most the last bits of one REAL."""
    attr = open_attr(bound)
    if attr is None:
        return True
    low, high = getattr(bound.low, attr), getattr(bound.high, attr)
    if order(high) - order(low) <= SETTLED_ULP:
        return True
    # About 0 there are more REALs than anywhere, and all of them together move no bit of MV.
    size = max(abs(float(bound.low.mv)), abs(float(bound.low.i)))
    return attr == "d" and abs(float(high) - float(low)) <= NOTHING * size


def apart(shadow: Shadow) -> tuple[Shadow, Shadow]:
    """What is settled, and what is still open."""
    settled = tuple(bound for bound in shadow if is_settled(bound))
    return settled, tuple(bound for bound in shadow if not is_settled(bound))


def open_terms(low: Any, high: Any) -> tuple[str, ...]:
    """Names of the terms in which the two ends of a bound differ."""
    if low is high:
        return ()
    return tuple(name for name, a, b in zip(low._fields, low, high, strict=True) if _bits_of(a) != _bits_of(b))


def _hull(left: Bound, right: Bound) -> Bound:
    attr = open_attr(left) or open_attr(right) or "d"
    if not hasattr(left.low, attr):
        return left
    low = min(left.low, right.low, key=lambda state: order(getattr(state, attr)))
    high = max(left.high, right.high, key=lambda state: order(getattr(state, attr)))
    return Bound(low, high)


def stepped(loop: Loop, inputs: Any, bound: Bound, ts: REAL) -> tuple[Bound, Any, Any]:
    """Step both ends; return the bound behind the execution and the terms of either end, in its order."""
    controller = loop.controller
    with quiet(all="ignore"):
        low, low_terms = controller.step(inputs, bound.low, loop.dialect, ts)
        if bound.is_point:
            return Bound(low, low), low_terms, low_terms
        high, high_terms = controller.step(inputs, bound.high, loop.dialect, ts)
    was_open = open_attr(bound)
    is_open_d = loose.is_loose(loop) and was_open == "d"
    # What was open stays in order; an integral that follows from it may run the other way, and shows itself.
    still = was_open is not None and not same_bits(getattr(low, was_open), getattr(high, was_open))
    attr = was_open if still else open_attr(Bound(low, high))
    if attr is not None and order(getattr(low, attr)) > order(getattr(high, attr)):
        low, high, low_terms, high_terms = high, low, high_terms, low_terms
    if is_open_d:
        low, high = loose.enclosing(loop, inputs, ts, bound, (low, high))
    return Bound(low, high), low_terms, high_terms


def _bits_of(value: Any) -> int:
    return bits(value) if isinstance(value, np.floating) else int(value)


def explain(
    loop: Loop, shadow: Shadow, variants: Iterable[Any], seen: Mapping[str, REAL], names: tuple[str, ...]
) -> Explanation:
    """Find every way in which one execution turns the shadow into the words that were seen under `names`."""
    fits: list[Fit] = []
    is_decided, is_whole = False, True
    nearest: tuple[int, Fit] | None = None
    shown = _key(names, seen)
    for inputs in variants:
        by_interval: dict[int, set[tuple[int, ...]]] = {}
        fitting: list[Fit] = []
        for bound, is_part in _split(loop, _passed_unseen(loop, inputs, shadow)):
            possible = intervals(loop, inputs, bound, seen.get("I_MV"))
            is_whole = is_whole and possible.is_whole
            is_open_d = open_attr(bound) == "d"
            for ts in possible.values:
                after, low_terms, high_terms = stepped(loop, inputs, bound, ts)
                low = predicted(loop.controller, after.low, low_terms)
                low_key = high_key = _key(names, low)
                high, is_point = low, after.low is after.high
                if not is_point:
                    high = predicted(loop.controller, after.high, high_terms)
                    high_key = _key(names, high)
                by_interval.setdefault(bits(ts), set()).update((low_key, high_key))
                fit = Fit(inputs, bound, after, low_terms, open_terms(low_terms, high_terms), ts)
                flags = low_terms.flags | high_terms.flags
                is_kinked = is_open_d and _is_kinked(loop, inputs, bound, flags, seen)
                if low_key != high_key and is_open_d and is_ruled_out(loop, inputs, bound, ts, seen):
                    pass
                elif is_kinked and loose.values(*bound) is None:
                    by_interval[bits(ts)].add(())
                    if _is_reachable(loop, fit, low, high, seen, names):
                        fitting.append(fit._replace(after=patched(loop, fit, seen)[0]))
                elif is_open_d and loop.dialect.limited_output and (low_terms.flags ^ high_terms.flags) & flag.FROZEN:
                    for part in _frozen_apart(loop, inputs, bound, ts):
                        fitting.extend(_narrowed(loop, inputs, part, seen, names, ts))
                elif is_kinked or (is_open_d and loose.is_loose(loop)):
                    between, found = _loosely(loop, fit, low, high, seen, names)
                    by_interval[bits(ts)].update(between)
                    fitting.extend(found)
                elif low_key != high_key:
                    is_set = flags & flag.BUMPLESS and not same_bits(low["I_MV"], high["I_MV"])
                    is_free = not flags & flag.FROZEN and not is_set
                    if not (is_free and _is_excluded(names, low, high, seen)):
                        fitting.extend(_narrowed(loop, inputs, bound, seen, names, ts))
                elif low_key == shown:
                    fitting.append(fit)
                if is_part:
                    continue
                missed = 0 if low_key == shown else distance(names, low, seen)
                if nearest is None or missed < nearest[0]:
                    nearest = (missed, fit)
        if fitting:
            fits.extend(each for fit in fitting for each in unrecorded(loop, fit))
            is_decided = is_decided or _is_told(by_interval, fitting, is_whole)
    if nearest is None:
        return Explanation(tuple(fits), is_decided, None)
    return Explanation(tuple(fits), is_decided, nearest[1], nearest[0], is_whole)


def _split(loop: Loop, shadow: Shadow) -> Iterator[tuple[Bound, bool]]:
    """The bounds, and by itself, as a part, a filter of the input that holds 0: it begins with what it meets."""
    for bound in shadow:
        yield bound, False
        if not bound.is_point and loop.dialect.filter_content == FilterContent.INPUT and bound.low.d < 0 < bound.high.d:
            empty = bound.low._replace(d=REAL(0))
            yield Bound(empty, empty), True


def _passed_unseen(loop: Loop, inputs: Any, shadow: Shadow) -> Shadow:
    """Open the cross status where the dialect evaluates it at each scan: PV may have passed SV and come back."""
    if loop.pv_rate_max == 0:
        return shadow
    if not shadow or not getattr(inputs, "err_dbw", 0) or not hasattr(shadow[0].low, "cross"):
        return shadow
    if loop.dialect.cross_scan != CrossScan.EACH_SCAN or loop.dialect.cross_band != CrossBand.ZERO_CROSS:
        return shadow
    return merged(
        Bound(bound.low._replace(cross=cross), bound.high._replace(cross=cross))
        for bound in shadow
        for cross in (False, True)
    )


def hides_pv(loop: Loop, inputs: Any) -> bool:
    """Tell whether an execution with these inputs leaves no trace of the PV that it read: manual, history held."""
    if loop.controller.law_ts is None or not inputs.pid_man or not inputs.pid_run:
        return False
    return bool(loop.dialect.manual_history)


def unrecorded(loop: Loop, fit: Fit) -> list[Fit]:
    """Open what follows from a PV that the execution did not record: D's filter and the cross status of DPIDE."""
    low, high = fit.after
    if not hasattr(low, "cross") or not hides_pv(loop, fit.inputs):
        return [fit]
    statuses: tuple[bool, ...] = (False,)
    if fit.inputs.err_dbw != 0 and loop.dialect.cross_band != CrossBand.OFF and not loop.dialect.cross_manual:
        statuses = (False, True)
    contents = [(low.d, high.d)]
    if fit.inputs.td_kd > 0 and loop.dialect.manual_filter == ManualFilter.RUNS:
        contents = [(-D_BOUND, D_BOUND)]
    elif fit.inputs.td_kd > 0 and loop.dialect.manual_filter == ManualFilter.CLEARED:
        # The law clears it where it would have changed.
        contents = [(REAL(0), REAL(0)), (fit.before.low.d, fit.before.high.d)]
    return [
        fit._replace(after=Bound(low._replace(d=first, cross=cross), high._replace(d=last, cross=cross)))
        for first, last in contents
        for cross in statuses
    ]


def without_pv(loop: Loop, shadow: Shadow, variants: Iterable[Any], seen: Mapping[str, REAL]) -> Shadow:
    """Go on behind an execution in which I_MV follows from a PV that no register shows; () when it was no such one."""
    hiding = [inputs for inputs in variants if hides_pv(loop, inputs) and loop.dialect.manual_integral]
    names = tuple(name for name in judged_names(loop) if name != "I_MV")
    found = explain(loop, shadow, hiding, seen, names)
    return merged(bound for fit in found.fits for bound in patched(loop, fit, seen))


def _frozen_apart(loop: Loop, inputs: Any, bound: Bound, ts: REAL) -> Iterator[Bound]:
    """Cut a bound of D where a limit begins to freeze the integral, and the output computed again jumps back."""

    def frozen(position: int) -> int:
        with quiet(all="ignore"):
            state = bound.low._replace(d=from_order(position))
            flags: int = loop.controller.step(inputs, state, loop.dialect, ts)[1].flags
        return flags & flag.FROZEN

    start, last = sorted((order(bound.low.d), order(bound.high.d)))
    while start <= last:
        same = frozen(start)
        end = first_for(start, last, lambda position, same=same: frozen(position) != same) - 1  # type: ignore[misc]
        yield Bound(bound.low._replace(d=from_order(start)), bound.low._replace(d=from_order(end)))
        start = end + 1


def _is_kinked(loop: Loop, inputs: Any, bound: Bound, flags: int, seen: Mapping[str, REAL]) -> bool:
    """Tell whether words need not follow D one way: where a limit sets the integral, or freezes it at the limit alone.

    So does a transfer at a limit: whether its integral goes on at once hangs on the last bits of the sum.
    """
    dialect = loop.dialect
    is_at_limit = bool(flags & flag.FROZEN) or any(
        same_bits(seen["MV"], edge) for edge in (inputs.mv_min, inputs.mv_max)
    )
    if flags & flag.MANUAL:
        return False
    if flags & flag.BUMPLESS and is_set_by_d(loop, inputs):
        return is_at_limit or bool(dialect.preset_limit)
    # A sum without D can freeze at the very limit alone, which an output that is computed again does not show.
    is_at_edge = bool(dialect.freeze_test and dialect.limit_edge)
    may_be_held = flags & flag.BUMPLESS or same_bits(seen["I_MV"], bound.low.i)
    if is_at_edge and dialect.limited_output and may_be_held:
        return True
    return is_at_limit and (is_at_edge or dialect.freeze == Freeze.BACK_CALCULATED)


def _is_reachable(
    loop: Loop, fit: Fit, low: Mapping[str, REAL], high: Mapping[str, REAL], seen: Mapping[str, REAL], names: Names
) -> bool:
    """Tell whether some content may leave the words, as far as they do not follow from it: PV, and an integral."""
    own = [word.name for word in loop.controller.seen if word.attr == "pv1" and word.name in names]
    if any(not same_bits(low[name], seen[name]) for name in own):
        return False
    is_set = fit.terms.flags & flag.BUMPLESS or loop.dialect.freeze == Freeze.BACK_CALCULATED
    if is_set or fit.ts is None or "I_MV" not in names:
        return True
    wide = unlimited(fit.inputs)
    with quiet(all="ignore"):
        free, _ = loop.controller.step(wide, fit.before.low._replace(d=REAL(0)), loop.dialect, fit.ts)
    return any(same_bits(seen["I_MV"], i) for i in (low["I_MV"], high["I_MV"], free.i, fit.before.low.i))


def _is_excluded(
    names: Iterable[str], low: Mapping[str, REAL], high: Mapping[str, REAL], seen: Mapping[str, REAL]
) -> bool:
    """A word that both ends predict alike is that of every state between them; it is not what was seen."""
    return any(same_bits(low[name], high[name]) and not same_bits(low[name], seen[name]) for name in names)


def _is_told(by_interval: Mapping[int, set[tuple[int, ...]]], fitting: list[Fit], is_whole: bool) -> bool:
    """One interval alone reproduces the words, or all predict the same; and with it, so does all that was open."""
    intervals_that_fit = {bits(fit.ts) for fit in fitting if fit.ts is not None}
    if len(intervals_that_fit) == 1 and is_whole:
        return len(by_interval[intervals_that_fit.pop()]) == 1
    return len(set().union(*by_interval.values())) == 1


def distance(names: Iterable[str], left: Mapping[str, REAL], right: Mapping[str, REAL]) -> int:
    """Rank a prediction: first how many words differ, then by how much in total."""
    total = 0
    for name in names:
        if not same_bits(left[name], right[name]):
            total += MISSED_WORD
            total += min(abs(order(left[name]) - order(right[name])), 1 << 33)
    return total


def _narrowed(
    loop: Loop, inputs: Any, bound: Bound, seen: Mapping[str, REAL], names: tuple[str, ...], ts: REAL
) -> list[Fit]:
    """Cut a bound down to the part that reproduces the words; nothing when no part does.

    Of a loose filter's bound everything is kept that roundings can have brought there, and few values are tried.
    """
    attr = open_attr(bound)
    if attr is None:
        return []
    is_rough = attr == "d" and loose.is_loose(loop)

    @cache
    def side(position: int) -> int:
        if is_rough:
            # A filter that holds 0 begins anew and is no part of any order; `_split` has it apart.
            state = bound.low._replace(d=from_order(position or 1))
            return loose.side(loop, inputs, state, seen, ts)
        state = bound.low._replace(**{attr: from_order(position)})
        return _side(loop, inputs, state, seen, names, ts)

    low, high = sorted((order(getattr(bound.low, attr)), order(getattr(bound.high, attr))))
    sign = -1 if side(low) > side(high) else 1
    first = first_for(low, high, lambda position: sign * side(position) >= 0)
    last = first_for(low, high, lambda position: sign * side(position) > 0) - 1
    if first > last:
        return []
    part = Bound(bound.low._replace(**{attr: from_order(first)}), bound.low._replace(**{attr: from_order(last)}))
    after, terms, high_terms = stepped(loop, inputs, part, ts)
    fit = Fit(inputs, part, after, terms, open_terms(terms, high_terms), ts)
    if is_rough and loose.values(*part) is not None:
        return _loosely(loop, fit, {}, {}, seen, names)[1]
    if is_rough:
        # Ends within the roundings predict neighbours of what was seen; what is shown is no longer open.
        return [fit._replace(after=patched(loop, fit, seen)[0])]
    for words in (predicted(loop.controller, after.low, terms), predicted(loop.controller, after.high, high_terms)):
        if not same_words(names, words, seen):
            return []
    return [fit]


def _loosely(
    loop: Loop, fit: Fit, low: Mapping[str, REAL], high: Mapping[str, REAL], seen: Mapping[str, REAL], names: Names
) -> tuple[set[tuple[int, ...]], list[Fit]]:
    """What the contents of a loose filter's bound predict beside its ends, and the part that reproduces the words."""
    contents = loose.values(*fit.before)
    assert fit.ts is not None
    if contents is None:
        if same_words(names, low, high) and loose.is_same_between(loop, fit, names, low):
            return set(), [fit] if same_words(names, low, seen) else []
        # Too many to try: there may be others between, so that nothing is decided.
        rough = loose.roughness(loop, fit.inputs, fit.ts, fit.before.low, fit.after.low, fit.terms)
        if loose.is_excluded(loop, fit, names, low, high, seen, rough):
            return {()}, []
        return {()}, _narrowed(loop, fit.inputs, fit.before, seen, names, fit.ts)
    found, predictions = [], set()
    for each in contents:
        point = fit.before.low._replace(d=each)
        after, terms, _ = stepped(loop, fit.inputs, Bound(point, point), fit.ts)
        words = predicted(loop.controller, after.low, terms)
        predictions.add(tuple(bits(words[name]) for name in names))
        if same_words(names, words, seen):
            found.append(Fit(fit.inputs, Bound(point, point), after, terms, (), fit.ts))
    return predictions, _joined(found)


def _joined(fits: list[Fit]) -> list[Fit]:
    """Fits that differ in D's filter alone as one, whose bounds enclose them all."""
    if len(fits) < 2 or len({state_key(fit.after.low._replace(d=REAL(0))) for fit in fits}) > 1:
        return fits
    before = _hull(fits[0].before, fits[-1].before)
    contents = sorted((fit.after.low.d for fit in fits), key=order)
    after = Bound(fits[0].after.low._replace(d=contents[0]), fits[0].after.low._replace(d=contents[-1]))
    open_ones = open_terms(fits[0].terms, fits[-1].terms)
    return [Fit(fits[0].inputs, before, after, fits[0].terms, open_ones, fits[0].ts)]


def _side(loop: Loop, inputs: Any, state: Any, seen: Mapping[str, REAL], names: tuple[str, ...], ts: REAL) -> int:
    """Tell whether this state's prediction lies below (-1), on (0) or above (1) what was seen."""
    with quiet(all="ignore"):
        after, terms = loop.controller.step(inputs, state, loop.dialect, ts)
    is_set = terms.flags & flag.BUMPLESS and "I_MV" in names and is_set_by_d(loop, inputs)
    if is_set and not same_bits(after.i, seen["I_MV"]):
        # The sum is MV again but for rounding, which goes to and fro with D; the integral falls with it.
        return -1 if after.i > seen["I_MV"] else 1
    if not same_bits(after.mv, seen["MV"]):
        return -1 if after.mv < seen["MV"] else 1
    words = predicted(loop.controller, after, terms)
    if same_words(names, words, seen):
        return 0
    if not same_bits(words["MV"], seen["MV"]):
        return -1 if words["MV"] < seen["MV"] else 1
    if terms.flags & (flag.BUMPLESS | flag.MANUAL):
        # An integral that is set takes D off; in manual it may follow MV so.
        return -1 if words["I_MV"] > seen["I_MV"] else 1
    if terms.flags & flag.FREEZE_HI:
        return 1
    if terms.flags & flag.FREEZE_LO:
        return -1
    return -1 if seen["MV"] >= max(inputs.mv_max, inputs.mv_min) else 1


def is_set_by_d(loop: Loop, inputs: Any) -> bool:
    """Tell whether D has a part in the integral with which automatic begins after manual."""
    return transfer_kind(inputs.pid_mode, loop.dialect) == 1 and not loop.dialect.preset_d


def is_unbounded(bound: Bound) -> bool:
    """Tell whether an end of a bound was never seen in words: it is the edge of what is thinkable."""
    attr = open_attr(bound)
    return attr is not None and max(abs(float(getattr(end, attr))) for end in bound) > UNBOUNDED


def is_roughly_bounded(loop: Loop, fit: Fit, seen: Mapping[str, REAL]) -> bool:
    """Tell whether a miss says nothing, because the ends of an open bound need not enclose the truth.

    So it is at a limit, in manual and in a transfer, where what is followed stands or jumps while D is open.
    """
    if fit.before.is_point or loop.controller.law_ts is None:
        return False
    read = fit.inputs
    is_at_limit = any(same_bits(seen["MV"], edge) for edge in (read.mv_min, read.mv_max))
    is_transfer = bool(fit.before.low.man1 or read.pid_man)
    if (is_at_limit or is_transfer) and is_unbounded(fit.before):
        return True
    is_at_limit |= bool(fit.terms.flags & flag.FROZEN)
    return is_at_limit and loop.dialect.freeze == Freeze.BACK_CALCULATED


def is_missed_anyway(loop: Loop, fit: Fit, seen: Mapping[str, REAL]) -> bool:
    """Tell whether a word is missed with every content of D's filter alike."""
    if open_attr(fit.before) != "d" or fit.ts is None:
        return False
    if is_ruled_out(loop, fit.inputs, fit.before, fit.ts, seen):
        return True
    after, low_terms, high_terms = stepped(loop, fit.inputs, fit.before, fit.ts)
    low, high = predicted(loop.controller, after.low, low_terms), predicted(loop.controller, after.high, high_terms)
    return any(
        same_bits(low[name], high[name])
        and not same_bits(low[name], seen[name])
        and loose.is_same_between(loop, fit, (name,), low)
        for name in judged_names(loop)
    )


def patched(loop: Loop, fit: Fit, seen: Mapping[str, REAL]) -> Shadow:
    """Go on from what the PLC shows, with the reference's own hidden state."""
    shown = {word.attr: seen[word.name] for word in loop.controller.seen if hasattr(fit.after.low, word.attr)}
    return (Bound(fit.after.low._replace(**shown), fit.after.high._replace(**shown)),)
