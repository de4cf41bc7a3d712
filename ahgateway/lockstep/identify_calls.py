"""Learn the dialect of PID_REG_CE, PID_Temp or MELSEC PID: eliminate every one that a single call contradicts.

This file alone decides what pictures say about these axes. It writes nothing and knows no file.

Theory of operation: as in `identify`, a candidate is a partial dialect, the axes that some call asked for. Here each
candidate is a block that is followed by the judge itself (`Calls`), so that what falls is exactly what would diverge.
An axis is split at the first call that asks for it and joined again when all its values leave the same.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

from ahgateway.codec.station import Loop, Tolerance
from ahgateway.core.verdict import Verdict, Weight
from ahgateway.lockstep.call_shadow import distance_of
from ahgateway.lockstep.calls import Calls
from ahgateway.lockstep.candidates import branched, joined, values_of
from ahgateway.lockstep.follow import cycle_ns
from ahgateway.lockstep.identify import Identification, Unexplained
from ahgateway.lockstep.judge import Execution
from ahgateway.lockstep.picture import Picture, predicted
from ahgateway.lockstep.shadow import judged_names

CANDIDATES_MAX = 2000
"""More than this are too many to follow: the trace is not fit to decide, and says so."""


@dataclass(slots=True)
class Followed:
    """A partial dialect and the block as it is followed in it."""

    fixed: dict[str, int]
    calls: Calls
    explained: int = 0
    informative: int = 0

    def state(self) -> Hashable:
        """What it can have left hidden, as something to compare."""
        return self.calls.known()


def identify_calls(loop: Loop, pictures: Sequence[Picture]) -> Identification:
    """Eliminate the dialects that pictures contradict.

    Args:
        loop: The loop; of its own dialect only the numbers count.
        pictures: In order; a line that had to be aligned anew breaks the chain.
    """
    # Bits alone count here, whatever the profile tolerates.
    loop = replace(loop, tolerance=Tolerance())
    left = [Followed({}, Calls(loop, blames=False))]
    for number, (before, after) in enumerate(pairwise(pictures)):
        if before.aligned_since_ns != after.aligned_since_ns:
            for each in left:
                each.calls.forget()
            continue
        came: list[Followed] = []
        fallen: list[Followed] = []
        for each in left:
            for fixed, (calls, events) in branched(loop, each.fixed, _seeing(loop, each, before, after)):
                verdicts = [event for event in events if isinstance(event, Execution)]
                now = Followed(fixed, calls, each.explained, each.informative)
                if any(event.verdict is Verdict.DIVERGED for event in verdicts):
                    fallen.append(now)
                    continue
                right = [event for event in verdicts if event.verdict is Verdict.MATCH]
                now.explained += len(right)
                now.informative += sum(event.weight is Weight.INFORMATIVE for event in right)
                came.append(now)
        if not came:
            return _none(loop, number, after, fallen)
        left = joined(loop, came)
        if len(left) > CANDIDATES_MAX:
            return replace(_result(loop, left), is_crowded=True)
    return _result(loop, left)


def _seeing(loop: Loop, one: Followed, before: Picture, after: Picture) -> Any:
    """What one candidate makes of the next picture, as a function of the dialect."""

    def run(dialect: Any) -> tuple[Calls, list[Any]]:
        calls = one.calls.read_as(dialect)
        return calls, calls.see(before, after, cycle_ns(calls.loop, after))

    return run


def _dialect_of(loop: Loop, fixed: dict[str, int]) -> Any:
    return loop.controller.dialect._replace(
        **{name: getattr(loop.dialect, name) for name in loop.controller.numbers},
        **{name: loop.controller.axes[name](value) for name, value in fixed.items()},
    )


def _result(loop: Loop, left: list[Followed]) -> Identification:
    values = {
        name: tuple(
            value for value in values_of(loop, {}, name) if any(each.fixed.get(name, value) == value for each in left)
        )
        for name in loop.controller.axes
    }
    best = max(left, key=lambda each: each.explained)
    survivors = tuple(dict.fromkeys(_dialect_of(loop, each.fixed) for each in left))
    return Identification(values, survivors, best.explained, best.informative)


def _none(loop: Loop, number: int, after: Picture, fallen: list[Followed]) -> Identification:
    """Show the call at which the last candidate fell, beside the one that came closest."""
    names = judged_names(loop)
    closest: tuple[tuple[int, int], Unexplained] | None = None
    for each in fallen:
        missed = each.calls.missed
        assert missed is not None, "a candidate that fell had a prediction"
        ref = predicted(loop.controller, missed.after.low, missed.terms)
        apart = distance_of(names, ref, after.seen)
        if closest is None or apart < closest[0]:
            words = {name: (after.seen[name], ref[name]) for name in names}
            closest = (apart, Unexplained(number, words, missed.terms, _dialect_of(loop, each.fixed)))
    assert closest is not None, "the last candidate fell at a call"
    best = max(fallen, key=lambda each: each.explained)
    nothing: dict[str, tuple[int, ...]] = dict.fromkeys(loop.controller.axes, ())
    return Identification(nothing, (), best.explained, best.informative, closest[1])
