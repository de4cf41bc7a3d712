"""What the first execution behind a standstill says of the history: whether EN off, or STOP, made it start anew.

The manual says that EN off leaves all data as it is (spec A.8/8) and nothing of STOP. Pictures show both where the
profile names `en` and `running`. This file alone decides what such an execution excludes.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

from ahgateway.codec.station import Loop
from ahgateway.core.dialect import EnOnHistory, FirstHistory, StopHistory
from ahgateway.core.real import same_bits
from ahgateway.lockstep.picture import Picture
from ahgateway.lockstep.shadow import began_anew, explain, input_variants, judged_names, recalled

SURVIVORS_MAX = 16
"""So many dialects that are left are asked; where more are left, too little is known to ask."""

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
    for name, (attr, axis) in AXES.items():
        kept, anew = int(axis(0)), int(axis(1))
        for last, before, after in _standstills(loop, pictures, attr):
            loops = [replace(loop, dialect=each) for each in dialects]
            fits = {
                kept: any(_goes_on(each, last, before, after) for each in loops),
                anew: any(began_anew(each, before, after) for each in loops),
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


def _goes_on(loop: Loop, last: Picture, before: Picture, after: Picture) -> bool:
    """Tell whether the history of the last execution explains the first one behind the standstill."""
    shadow = recalled(loop, (last.inputs,), last.seen)
    return bool(explain(loop, shadow, input_variants(loop, before, after), after.seen, judged_names(loop)).fits)
