"""The shadow of a block that counts calls or rounds its output: sets of states, each with at most one open REAL.

For PID_REG_CE, PID_Temp and MELSEC PID more is hidden than for Delta's instructions (phases of pulses, calls until the
law is due, the unrounded sum), and it cannot be told from one picture. So their shadow starts where the controller says
that it can (`Controller.begin`), and what a state cannot predict yet (`Controller.veiled`) is not judged. This file
alone decides what is consistent with what such a block shows; it gives no verdicts.

Theory of operation: as in `shadow`: every set of inputs that the call can have read is tried on every bound; both ends
of a bound are stepped; what predicts other values than were seen is dropped, what straddles them is narrowed.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from ahgateway.codec.station import Loop
from ahgateway.core.controllers.controller import replaced
from ahgateway.core.real import bits, from_order, order, quiet
from ahgateway.lockstep.picture import Picture, predicted
from ahgateway.lockstep.reads import orders
from ahgateway.lockstep.shadow import Bound, Explanation, Fit, Shadow, judged_names

BOUNDS_MAX = 96
"""More possibilities than this are no knowledge: the shadow starts again."""


def key_of(value: Any) -> int:
    """The bits of a value: of a REAL its pattern, of anything else the integer."""
    return bits(value) if isinstance(value, np.floating) else int(value)


def same(left: Any, right: Any) -> bool:
    """Tell whether two values have the same bits; most of them can be compared as numbers, which is quicker."""
    if left is right:
        return True
    return bool(left == right) if left and left == left else key_of(left) == key_of(right)


def flat(state: Any, prefix: str = "") -> list[tuple[str, Any]]:
    """Every field of a state with its dotted path."""
    found: list[tuple[str, Any]] = []
    for name, value in zip(state._fields, state, strict=True):
        if hasattr(value, "_fields"):
            found.extend(flat(value, f"{prefix}{name}."))
        else:
            found.append((prefix + name, value))
    return found


def field_at(state: Any, path: str) -> Any:
    """The field at a dotted path."""
    for name in path.split("."):
        state = getattr(state, name)
    return state


def open_path(bound: Bound) -> str:
    """Path of the REAL in which both ends differ, empty when they do not."""
    if bound.low is bound.high:
        return ""
    for (path, low), (_, high) in zip(flat(bound.low), flat(bound.high), strict=True):
        if not same(low, high):
            return path
    return ""


def merged(bounds: Iterable[Bound]) -> Shadow:
    """Drop doubles and join bounds that differ only in their open REAL; too many are no knowledge and give ()."""
    found: dict[tuple[Any, ...], Bound] = {}
    for bound in bounds:
        path = open_path(bound)
        key = (path, *(0 if name == path else key_of(value) for name, value in flat(bound.low)))
        known = found.get(key)
        found[key] = bound if known is None or not path else _hull(known, bound, path)
    return tuple(found.values()) if len(found) <= BOUNDS_MAX else ()


def _hull(left: Bound, right: Bound, path: str) -> Bound:
    def place(state: Any) -> int:
        return order(field_at(state, path))

    return Bound(min(left.low, right.low, key=place), max(left.high, right.high, key=place))


def shown(loop: Loop, picture: Picture) -> dict[str, Any]:
    """What the block publishes, by the attribute of its terms."""
    return {seen.attr: picture.seen[seen.name] for seen in loop.controller.seen if seen.name in picture.seen}


def fed_back(loop: Loop) -> frozenset[str]:
    """Inputs that are the block's own outputs; they are no change by anybody else."""
    read = loop.controller.input_names
    return frozenset(
        row.attr for seen in loop.controller.seen if (row := loop.controller.operand(seen.operand)).attr in read
    )


def may_be_written(loop: Loop, before: Picture, after: Picture) -> bool:
    """Tell whether all that changed may also have been written by somebody without a call: no counter counts calls."""
    moved = {seen for seen in loop.controller.seen if key_of(before.seen[seen.name]) != key_of(after.seen[seen.name])}
    own = fed_back(loop)
    return before.count is None and bool(moved) and all(loop.controller.operand(s.operand).attr in own for s in moved)


def pv_attrs(loop: Loop) -> frozenset[str]:
    """Inputs that can hold the process value."""
    return frozenset(loop.controller.operand(name).attr for name in loop.controller.roles.pvs)


def changed(loop: Loop, before: Picture, after: Picture) -> list[str]:
    """Names of the inputs that somebody else changed between two pictures; the process value apart."""
    own = fed_back(loop) | pv_attrs(loop)
    return [
        name
        for name in loop.controller.input_names
        if name not in own and not same(getattr(before.inputs, name), getattr(after.inputs, name))
    ]


def reads(loop: Loop, before: Picture, after: Picture) -> list[Any]:
    """Every set of inputs that a call between two pictures can have read, likeliest first; none if PV is not known.

    Each changed operand was written before or after the call. The process value is what the block's own register
    holds behind the call, or what the block publishes of it.
    """
    names = changed(loop, before, after)
    pvs = {name: getattr(after.inputs, name) for name in pv_attrs(loop)}
    variants: list[Any] = []
    for subset in orders(names):
        mixed = before.inputs._replace(**pvs, **{name: getattr(after.inputs, name) for name in subset})
        if loop.holds_pv:
            variants.append(mixed)
        elif loop.controller.used is not None:
            variants.extend(loop.controller.used(mixed, shown(loop, after)))
    return variants


def started(loop: Loop, before: Picture | None, after: Picture, *, one_call: bool) -> Shadow:
    """Start a shadow behind a call that was seen, or at a contact that is off, where the controller says that it can.

    What stands in the registers later is not what the call read, so there is no start from a picture alone.

    Args:
        loop: The loop.
        before: The picture before, None where there is none.
        after: The picture.
        one_call: Between the two there was one call.
    """
    begin = loop.controller.begin
    assert begin is not None
    previous = shown(loop, before) if before is not None and one_call else None
    inputs = reads(loop, before or after, after) or [after.inputs]
    if not loop.holds_pv and loop.controller.used is None:
        # What the last execution read is not known, so only a start that does not ask for it is sound.
        inputs = [each for each in inputs if not loop.controller.computes(each)]
    found: list[Bound] = []
    for read in inputs:
        with quiet(all="ignore"):
            pairs = begin(read, shown(loop, after), previous, loop.dialect)
        if not pairs:
            return ()
        found.extend(Bound(*pair) for pair in pairs)
    return merged(found)


def stepped(loop: Loop, inputs: Any, bound: Bound) -> tuple[Bound, Any, Any]:
    """Step both ends; return the bound behind the call and the terms of either end."""
    controller = loop.controller
    ts = controller.ts(inputs, loop.dialect)
    with quiet(all="ignore"):
        low, low_terms = controller.step(inputs, bound.low, loop.dialect, ts)
        low = controller.veil(bound.low, low)
        if not open_path(bound):
            return Bound(low, low), low_terms, low_terms
        high, high_terms = controller.step(inputs, bound.high, loop.dialect, ts)
    return Bound(low, controller.veil(bound.high, high)), low_terms, high_terms


def names_for(loop: Loop, bound: Bound) -> tuple[str, ...]:
    """The values that this bound must predict."""
    veiled = loop.controller.veiled(bound.low)
    return tuple(name for name in judged_names(loop) if name not in veiled)


def agree(names: Iterable[str], left: Mapping[str, Any], right: Mapping[str, Any]) -> bool:
    """Tell whether both have the same bits under every name."""
    return all(same(left[name], right[name]) for name in names)


def explain(loop: Loop, shadow: Shadow, variants: Iterable[Any], seen: Mapping[str, Any]) -> Explanation:
    """Find every way in which one call turns the shadow into what was seen."""
    fits: list[Fit] = []
    is_decided = False
    nearest: tuple[tuple[int, int], Fit] | None = None
    for inputs in variants:
        predictions = set()
        fitting: list[Fit] = []
        for bound in shadow:
            names = names_for(loop, bound)
            after, low_terms, high_terms = stepped(loop, inputs, bound)
            low = predicted(loop.controller, after.low, low_terms)
            high = predicted(loop.controller, after.high, high_terms)
            predictions.add(tuple(key_of(low[name]) for name in names))
            predictions.add(tuple(key_of(high[name]) for name in names))
            fit = Fit(inputs, bound, after, low_terms, unsettled(low_terms, high_terms))
            if not agree(names, low, high):
                fitting.extend(_narrowed(loop, inputs, bound, seen))
            elif agree(names, low, seen):
                fitting.append(fit)
            distance = distance_of(names, low, seen)
            if nearest is None or distance < nearest[0]:
                nearest = (distance, fit)
        if fitting:
            fits.extend(fitting)
            is_decided = is_decided or len(predictions) == 1
    return Explanation(tuple(fits), is_decided, nearest[1] if nearest else None)


def unsettled(low: Any, high: Any) -> tuple[str, ...]:
    """Names of the terms in which the two ends of a bound differ."""
    if low is high:
        return ()
    return tuple(name for name, a, b in zip(low._fields, low, high, strict=True) if key_of(a) != key_of(b))


def distance_of(names: Iterable[str], left: Mapping[str, Any], right: Mapping[str, Any]) -> tuple[int, int]:
    """Rank a prediction: first how many values differ, then by how much in total."""
    wrong = apart = 0
    for name in names:
        a, b = left[name], right[name]
        if key_of(a) != key_of(b):
            wrong += 1
            apart += abs(order(a) - order(b)) if isinstance(a, np.floating) else abs(int(a) - int(b))
    return wrong, apart


def _narrowed(loop: Loop, inputs: Any, bound: Bound, seen: Mapping[str, Any]) -> list[Fit]:
    """Cut a bound down to the part that reproduces what was seen; nothing when no part does. The output rises in it."""
    path = open_path(bound)
    if not path:
        return []
    mv = loop.controller.roles.mv

    names = names_for(loop, bound)

    def at(position: int) -> dict[str, Any]:
        state = replaced(bound.low, path, from_order(position))
        after, terms, _ = stepped(loop, inputs, Bound(state, state))
        return predicted(loop.controller, after.low, terms)

    first, last = order(field_at(bound.low, path)), order(field_at(bound.high, path))
    low = _first(first, last, lambda position: at(position)[mv] >= seen[mv])
    high = _first(first, last, lambda position: at(position)[mv] > seen[mv]) - 1
    if low > high:
        return []
    # At a limit the output is the same for many; what else is seen, an integral that is frozen, changes at one place.
    if agree(names, at(low), seen):
        high = _first(low, high, lambda position: not agree(names, at(position), seen)) - 1
    elif agree(names, at(high), seen):
        low = _first(low, high, lambda position: agree(names, at(position), seen))
    else:
        return []
    part = Bound(replaced(bound.low, path, from_order(low)), replaced(bound.low, path, from_order(high)))
    after, terms, high_terms = stepped(loop, inputs, part)
    for state, said in ((after.low, terms), (after.high, high_terms)):
        if not agree(names, predicted(loop.controller, state, said), seen):
            return []
    return [Fit(inputs, part, after, terms, unsettled(terms, high_terms))]


def _first(low: int, high: int, holds: Any) -> int:
    """Smallest position in low…high for which a rising condition holds; high + 1 when it never does."""
    while low <= high:
        middle = (low + high) // 2
        if holds(middle):
            high = middle - 1
        else:
            low = middle + 1
    return low


def rejoined(loop: Loop, state: Any, seen: Mapping[str, Any]) -> Bound:
    """Go on from what the block shows, with the reference's own hidden state."""
    for word in loop.controller.seen:
        path = word.path(state)
        if path and word.name in seen:
            state = replaced(state, path, seen[word.name])
    if loop.controller.rejoin is None:
        return Bound(state, state)
    return Bound(*loop.controller.rejoin(state, {word.attr: seen[word.name] for word in loop.controller.seen}))


def lingered(loop: Loop, shadow: Shadow, before: Picture, after: Picture, calls_max: int) -> Shadow:
    """Add what up to `calls_max` calls that changed nothing visible can have left hidden."""
    bounds, front = list(shadow), list(shadow)
    variants = reads(loop, before, after)
    for _ in range(calls_max):
        front = [fit.after for bound in front for fit in explain(loop, (bound,), variants, after.seen).fits]
        if not front:
            break
        bounds.extend(front)
    return merged(bounds)
