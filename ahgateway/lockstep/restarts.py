"""What a standstill can have done to the history, and what the first execution behind it says: did it start anew?

The manual says that EN off leaves all data as it is (spec A.8/8) and nothing of STOP. Pictures show both where the
profile names `en` and `running`. This file alone decides what such an execution excludes. What no word shows, D's
filter, is followed over the last executions before the standstill.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

from ahgateway.codec.station import Loop
from ahgateway.core.dialect import EnOnHistory, FirstHistory, StopHistory
from ahgateway.core.real import same_bits
from ahgateway.lockstep.anchor import anchored, is_anchor
from ahgateway.lockstep.picture import Picture
from ahgateway.lockstep.reads import input_variants
from ahgateway.lockstep.shadow import Bound, Shadow, explain, judged_names, merged, recalled
from ahgateway.lockstep.trace import Observation, observed, variants

SURVIVORS_MAX = 64
"""So many dialects that are left are asked; where more are left, too little is known to ask."""

FOLLOWED = 6
"""So many executions before a standstill are followed, where there are so many in a row."""

AXES = {"en_on_history": ("enabled", EnOnHistory), "stop_history": ("running", StopHistory)}


def fallen(
    loop: Loop, pictures: Sequence[Picture], survivors: Sequence[Any], first_history: Iterable[int]
) -> dict[str, set[int]]:
    """Return, axis by axis, the values with which no surviving dialect explains the execution behind a standstill.

    Args:
        loop: The loop; its own dialect does not count.
        pictures: Its pictures in order.
        survivors: Dialects that explain everything else.
        first_history: What is left of that axis: it decides what starting anew means.
    """
    dialects = [each._replace(first_history=FirstHistory(value)) for each in survivors for value in first_history]
    found: dict[str, set[int]] = {}
    if loop.controller.law_ts is None or not 0 < len(dialects) <= SURVIVORS_MAX:
        return found
    loops = [replace(loop, dialect=each) for each in dialects]
    executions = observed(pictures, loop)
    for name, (attr, axis) in AXES.items():
        kept, anew = int(axis(0)), int(axis(1))
        for last, before, after in _standstills(loop, pictures, attr):
            run = _run(loop, executions, last)
            shadows = [(each, _known(each, run, last)) for each in loops]
            fits = {
                kept: any(_explains(each, shadow, before, after) for each, shadow in shadows),
                anew: any(_explains(each, _anew(shadow), before, after) for each, shadow in shadows),
            }
            # Where neither explains it, something else happened.
            if any(fits.values()):
                found.setdefault(name, set()).update(value for value, is_fit in fits.items() if not is_fit)
    return {name: gone for name, gone in found.items() if len(gone) == 1}


def _standstills(loop: Loop, pictures: Sequence[Picture], attr: str) -> Iterator[tuple[Picture, Picture, Picture]]:
    """The picture behind the last execution before a standstill, and those around the first execution after it."""
    names = [name for name in judged_names(loop) if name != "MOUT"]
    last: Picture | None = None
    stood = False
    for before, after in pairwise(pictures):
        if before.aligned_since_ns != after.aligned_since_ns:
            last, stood = None, False
        stood = stood or getattr(before, attr) is False or getattr(after, attr) is False
        if all(same_bits(before.seen[name], after.seen[name]) for name in names):
            continue
        if stood and last is not None and getattr(after, attr):
            yield last, before, after
        last, stood = after, getattr(after, attr) is False


def _run(loop: Loop, executions: Sequence[Observation], last: Picture) -> Sequence[Observation]:
    """The executions up to the last one, without a gap, from one on behind which what is hidden is bounded."""
    at = next((n for n, each in enumerate(executions) if each.after is last), -1)
    pairs = [(each.before, each.after) for each in executions]
    begin = found = at
    while begin >= 0 and at - begin < 2 * FOLLOWED:
        if is_anchor(loop, pairs, begin, is_next=executions[begin].is_next):
            found = begin
            if at - begin >= FOLLOWED:
                break
        if not executions[begin].is_next:
            break
        begin -= 1
    return executions[found : at + 1] if at >= 0 else ()


def _known(loop: Loop, run: Sequence[Observation], last: Picture) -> Shadow:
    """What the last execution can have left hidden."""
    if not run:
        return recalled(loop, (last.inputs,), last.seen)
    shadow = anchored(loop, run[0].before, run[0].after)
    for each in run[1:]:
        fits = explain(loop, shadow, variants(loop, each), each.after.seen, judged_names(loop)).fits
        shadow = merged(fit.after for fit in fits)
    return shadow or recalled(loop, (last.inputs,), last.seen)


def _anew(shadow: Shadow) -> Shadow:
    return merged(Bound(each.low._replace(valid=False), each.high._replace(valid=False)) for each in shadow)


def _explains(loop: Loop, shadow: Shadow, before: Picture, after: Picture) -> bool:
    """Tell whether what was hidden explains the first execution behind the standstill."""
    return bool(explain(loop, shadow, input_variants(loop, before, after), after.seen, judged_names(loop)).fits)


def restarted(shadow: Shadow) -> Shadow:
    """Add the possibility that the instruction has lost its history, as after a restart or a long gap."""
    return merged([*shadow, *forgotten(shadow)])


def forgotten(shadow: Shadow) -> Shadow:
    """The same without history."""
    return tuple(
        Bound(bound.low._replace(valid=False), bound.high._replace(valid=False))
        for bound in shadow
        if hasattr(bound.low, "valid")
    )


def began_anew(loop: Loop, before: Picture, after: Picture) -> bool:
    """Tell whether one execution between two pictures comes out by bits where the instruction had lost its history.

    So it is behind a restart that kept its registers; where nothing hidden can be recalled, nothing is told.
    """
    variants = input_variants(loop, before, after)
    fresh = merged(forgotten(recalled(loop, variants, before.seen)))
    if not fresh:
        return False
    return bool(explain(loop, fresh, variants, after.seen, judged_names(loop)).fits)
