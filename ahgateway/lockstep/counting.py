"""How many executions lie between two pictures, and what they are worth, when there can have been several.

This file alone infers counts. It extends the shadow's search from one execution to k, one after the other, and leaves
the verdict on the last of them to `judge`.

Theory of operation: the shadow is run 0…k executions on from the last picture. The executions between read the
operands and PV of the picture before until some moment, those of the picture behind from then on; the last one read
what it recorded. One count alone that reproduces every word is proof: all those executions followed the law. Several
counts prove the last execution, and the least count is claimed. When no count does, the law was broken only if what
was read in between is known: PV stands still and can do nothing else (`pv_rate_max` = 0), and at most one operand
changed; or if the integral lies where no PV within bounds could have brought it. Otherwise nobody can tell.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

from ahgateway.clock import SECOND
from ahgateway.codec.station import Loop
from ahgateway.core.controllers.delta_terms import ticks_per_second
from ahgateway.core.dialect import FilterContent, Freeze, Integrator
from ahgateway.core.real import REAL, quiet, same_bits
from ahgateway.core.verdict import Verdict
from ahgateway.lockstep.anchor import anchored
from ahgateway.lockstep.causes import blame_any
from ahgateway.lockstep.interval import unlimited
from ahgateway.lockstep.judge import SEVERAL, TRIVIAL_FLAGS, Execution, judge
from ahgateway.lockstep.picture import Picture, predicted
from ahgateway.lockstep.reads import changed_inputs, input_variants
from ahgateway.lockstep.shadow import (
    Bound,
    Explanation,
    Fit,
    Shadow,
    apart,
    distance,
    explain,
    judged_names,
    merged,
    patched,
    recalled,
)
from ahgateway.lockstep.suspects import Blame, Suspect, agreeing, sizeless
from ahgateway.lockstep.thinning import is_plain
from ahgateway.lockstep.unseen import advanced

LED_MAX = 6
"""Of runs longer than this no cause is sought: there are too many."""

COUNT_MAX = 12
"""More executions than this between two pictures are not counted out."""

MARGIN = 2.0**-20
"""Of the integral and of each step: more than rounding can lose in so many executions."""

UNKNOWN_BETWEEN = (
    "no number of executions reproduces the words with the PV of either picture, and what PV was between is not known"
)
LAST_ONLY = "several counts of executions fit; the last execution is proven, the least count is claimed"


@dataclass(frozen=True, slots=True)
class _Count:
    """One count of executions: what the shadow can be before the last of them, and what that explains.

    It is whole unless the shadow was lost on some way there, behind an unseen execution that can have left anything.
    """

    executions: int
    before: Shadow
    found: Explanation
    is_whole: bool


def counted(
    loop: Loop,
    shadow: Shadow,
    before: Picture,
    after: Picture,
    executions: tuple[int, int],
    suspects: tuple[Suspect, ...] = (),
) -> tuple[Execution, Shadow]:
    """Judge the executions between two pictures, of which there can have been several.

    Args:
        loop: The loop, one of Delta's.
        shadow: What the instruction can have remembered at `before`; () when nothing is known.
        before: Picture before them.
        after: Picture behind them; its words differ, or it is known how many there were.
        executions: Least and most of them, by time or by count.
        suspects: What this loop is already suspected of.

    Returns:
        One execution that stands for them all, and the shadow behind them.
    """
    least, most = max(1, executions[0]), executions[1]
    is_tuning = 1 in (before.inputs.pid_mode, after.inputs.pid_mode)
    if not shadow or is_tuning or most <= 1:
        return judge(loop, shadow, before, after, most, suspects)
    again = _again(loop, shadow, before, after, most, suspects) if suspects else None
    if again is not None:
        return again
    every = [each for each in _counts(loop, shadow, before, after, most) if each.executions >= least]
    fitting = [each for each in every if each.found.fits]
    if not fitting and not same_bits(before.seen["MOUT"], after.seen["MOUT"]):
        # It was written behind the last of them.
        every = [
            each for each in _counts(loop, shadow, before, after, most, _but_mout(loop)) if each.executions >= least
        ]
        fitting = [each for each in every if each.found.fits]
    is_whole = most <= COUNT_MAX and all(each.is_whole for each in every)
    is_all_known = is_whole and is_known(loop, before, after)
    fresh = _fresh(loop, shadow, before, after)
    if len(fitting) == 1 and is_whole:
        only = fitting[0]
        execution, behind = judge(loop, only.before, before, after, 1, suspects if only.executions == 1 else ())
        behind = behind if is_all_known or _is_pinned(only, before, after) else merged((*behind, *fresh))
        return replace(execution, count=only.executions), behind
    if fitting:
        least_fit = fitting[0]
        execution, behind = judge(loop, least_fit.before, before, after, 1)
        other = () if is_all_known else fresh
        kept = merged((*(fit.after for each in fitting for fit in each.found.fits), *other))
        reason = LAST_ONLY if execution.verdict is Verdict.MATCH else execution.reason
        return replace(execution, count=least_fit.executions, reason=reason), kept or fresh
    if is_all_known or (is_whole and is_out_of_reach(loop, shadow, before, after, most)):
        blamed = _blamed(loop, shadow, before, after, most)
        if blamed is not None:
            return _diverged(loop, blamed, before, after)
        nearest = min(every, key=lambda each: each.found.distance)
        execution, behind = judge(loop, nearest.before, before, after, 1, suspects)
        return replace(execution, count=nearest.executions), behind
    execution, behind = judge(loop, shadow, before, after, most, suspects)
    if execution.reason == SEVERAL:
        return replace(execution, reason=UNKNOWN_BETWEEN), fresh
    return execution, behind


def _again(
    loop: Loop, shadow: Shadow, before: Picture, after: Picture, most: int, suspects: tuple[Suspect, ...]
) -> tuple[Execution, Shadow] | None:
    """Behind a divergence what is hidden is open and would excuse anything; the same cause of the same size is none."""
    settled, _ = apart(shadow)
    fits = led(loop, settled, before, after, most)
    if not fits or explains(loop, settled, before, after, most):
        return None
    blamed = blame_any(loop, fits, before, after, suspects)
    kept = agreeing(suspects, blamed.suspects)
    return _diverged(loop, replace(blamed, suspects=kept), before, after) if kept else None


def _blamed(loop: Loop, shadow: Shadow, before: Picture, after: Picture, most: int) -> Blame | None:
    """Blame a run of executions from a state that is settled; else from one that is open, but for no size."""
    settled, still_open = apart(shadow)
    fits = led(loop, settled, before, after, most)
    blamed = blame_any(loop, fits, before, after) if fits else None
    if blamed is not None and blamed.cause != "unknown":
        return blamed
    others = led(loop, still_open, before, after, most)
    return (sizeless(blame_any(loop, others, before, after)) if others else None) or blamed


def _diverged(loop: Loop, blamed: Blame, before: Picture, after: Picture) -> tuple[Execution, Shadow]:
    """The verdict on executions that no count of them explains, and the shadow behind them: the reference's, or any."""
    fit: Fit = blamed.fit
    behind = (*patched(loop, fit, after.seen), *recalled(loop, (after.inputs, before.inputs), after.seen))
    count = len(fit.lead) + 1
    return Execution(Verdict.DIVERGED, terms=fit.terms, inputs=fit.inputs, blame=blamed, count=count), behind


def led(loop: Loop, shadow: Shadow, before: Picture, after: Picture, most: int) -> list[Fit]:
    """Every run of executions that there can have been, as the reference makes it, the nearest first; [] if unknown.

    It is known where all that they read is, but for the moment of one change, and where Ts is not measured.
    """
    if not is_known(loop, before, after) or ticks_per_second(loop.dialect):
        return []
    early, late = before.inputs, after.inputs
    pv = next((after.seen[word.name] for word in loop.controller.seen if word.attr == "pv1"), late.pv)
    early, late = early._replace(pv=pv), late._replace(pv=pv)
    names = judged_names(loop)
    found = []
    for bound in shadow:
        for executions in range(1, min(most, LED_MAX) + 1):
            for olds in range(executions + 1) if changed_inputs(loop, before, after) else (0,):
                reads = (*(early,) * olds, *(late,) * (executions - olds))
                fit = _run(loop, bound, reads)
                words = predicted(loop.controller, fit.after.low, fit.terms)
                found.append((distance(names, words, after.seen), fit))
    found.sort(key=lambda each: each[0])
    return [fit for _, fit in found]


def _run(loop: Loop, bound: Bound, reads: tuple[Any, ...]) -> Fit:
    """Executions that read this one after the other, from both ends of a bound; terms of its low end."""
    ends = []
    for end in bound[:1] if bound.is_point else (bound.high, bound.low):
        state = end
        with quiet(all="ignore"):
            for read in reads:
                ts = loop.controller.ts(read, loop.dialect)
                state, terms = loop.controller.step(read, state, loop.dialect, ts)
        ends.append(state)
    return Fit(reads[-1], bound, Bound(ends[-1], ends[0]), terms, (), ts, reads[:-1])


def reproduced(loop: Loop, shadow: Shadow, before: Picture, after: Picture, most: int) -> list[Fit]:
    """Every fit by which some number of executions leaves the words."""
    return [fit for each in _counts(loop, shadow, before, after, most) for fit in each.found.fits]


def _is_pinned(only: _Count, before: Picture, after: Picture) -> bool:
    """Tell whether the words leave no room for other PVs than were supposed: one execution, or an integral that moved.

    Where the law held the integral, another PV in between leaves the same words and another memory.
    """
    if only.executions == 1:
        return True
    is_free = not any(fit.terms.flags & TRIVIAL_FLAGS for fit in only.found.fits)
    return is_free and not same_bits(before.seen["I_MV"], after.seen["I_MV"])


def _fresh(loop: Loop, shadow: Shadow, before: Picture, after: Picture) -> Shadow:
    """Start anew behind executions that were not explained; behind a plain one MV itself bounds D's filter."""
    fresh = recalled(loop, (after.inputs, before.inputs), after.seen)
    if any(bound.low.man1 or not bound.low.valid for bound in shadow) or not is_plain(loop, (before, after)):
        return fresh
    dialect = loop.dialect
    if not hasattr(after.inputs, "tf"):
        return fresh
    if dialect.integral_used or dialect.filter_content == FilterContent.INPUT:
        # There the last execution alone does not give D away: it takes what the one before it left.
        last = _just_before(loop, before, after)
        return fresh if last is None else anchored(loop, last, after)
    return anchored(loop, before, after)


def _just_before(loop: Loop, before: Picture, after: Picture) -> Picture | None:
    """The picture that there would have been just before the last execution, where nothing but the integral moved."""
    states = recalled(loop, (after.inputs,), after.seen)
    is_moved = not is_known(loop, before, after) or loop.dialect.integrator == Integrator.DVP
    if is_moved or ticks_per_second(loop.dialect) or not states:
        return None
    wide = unlimited(after.inputs)
    step = _path(loop, wide, states[0].low._replace(d=REAL(0)), (after.inputs.pv,))[0]
    return replace(before, seen={**before.seen, "I_MV": REAL(float(after.seen["I_MV"]) - step)})


def explains(loop: Loop, shadow: Shadow, before: Picture, after: Picture, most: int) -> bool:
    """Tell whether some number of executions leaves the words as they are, but for an MOUT that was written since."""
    return any(each.found.may_fit for each in _counts(loop, shadow, before, after, most, _but_mout(loop)))


def _but_mout(loop: Loop) -> tuple[str, ...]:
    return tuple(name for name in judged_names(loop) if name != "MOUT")


def _counts(
    loop: Loop, shadow: Shadow, before: Picture, after: Picture, most: int, words: tuple[str, ...] = ()
) -> Iterator[_Count]:
    """Run the shadow on, execution by execution, and see what each number of them explains, of these words or all."""
    names = words or judged_names(loop)
    variants = input_variants(loop, before, after)
    early, late = before.inputs, after.inputs
    is_still = same_bits(early.pv, late.pv) and not changed_inputs(loop, before, after)
    # Behind k executions: all of them read the early values, or the last 1…k of them the late ones.
    all_early, switched = shadow, Shadow()
    is_whole = True
    for executions in range(1, min(most, COUNT_MAX) + 1):
        reached = merged((*all_early, *switched))
        found = explain(loop, reached, variants, after.seen, names)
        yield _Count(executions, reached, found, is_whole and bool(reached) and found.is_whole)
        switched = () if is_still else advanced(loop, reached, late)
        all_early = advanced(loop, all_early, early)
        is_whole = is_whole and bool(all_early and (is_still or switched))


def is_known(loop: Loop, before: Picture, after: Picture) -> bool:
    """Tell whether all that the executions between two pictures read is known, but for the moment of one change."""
    if loop.pv_rate_max != 0 or len(changed_inputs(loop, before, after)) > 1:
        return False
    recorded = [(before.seen[word.name], after.seen[word.name]) for word in loop.controller.seen if word.attr == "pv1"]
    pvs = [before.inputs.pv, after.inputs.pv, *(pv for pair in recorded for pv in pair)]
    return all(same_bits(pvs[0], pv) for pv in pvs)


def is_out_of_reach(loop: Loop, shadow: Shadow, before: Picture, after: Picture, most: int) -> bool:
    """Tell whether no PV within its bounds brings the integral to where it is, in as many executions as there can be.

    It says nothing, False, unless the integral is a plain sum: automatic at both ends, no operand changed, and a
    dialect in which a limit only holds the integral.
    """
    bounds = pv_bounds(loop, before, after)
    read = after.inputs
    is_plain = loop.dialect.integrator != Integrator.DVP and loop.dialect.freeze != Freeze.BACK_CALCULATED
    is_automatic = read.pid_run and not read.pid_man and not any(bound.low.man1 for bound in shadow)
    if bounds is None or not is_plain or not is_automatic or changed_inputs(loop, before, after):
        return False
    wide = unlimited(read)
    steps = [0.0]
    for first in bounds:
        for bound in shadow:
            if not bound.low.valid:
                return False
            steps.extend(_path(loop, wide, bound.low, (first, *bounds)))
    old, new = float(before.seen["I_MV"]), float(after.seen["I_MV"])
    slack = MARGIN * (abs(old) + abs(new) + most * max(map(abs, steps)))
    return not old + most * min(steps) - slack <= new <= old + most * max(steps) + slack


def _path(loop: Loop, read: Any, state: Any, pvs: tuple[REAL, ...]) -> list[float]:
    """How far the integral moves at each of these PVs, one execution after the other."""
    found = []
    ts = loop.controller.ts(read, loop.dialect, round(float(loop.controller.nominal_ts(read)) * 1e6))
    for pv in pvs:
        with quiet(all="ignore"):
            after, _ = loop.controller.step(read._replace(pv=pv), state, loop.dialect, ts)
        found.append(float(after.i) - float(state.i))
        state = after
    return found


def pv_bounds(loop: Loop, before: Picture, after: Picture) -> tuple[REAL, REAL] | None:
    """Lowest and highest PV that there can have been between two pictures; None where nobody said what bounds it."""
    recorded = [after.seen[word.name] for word in loop.controller.seen if word.attr == "pv1"]
    pvs = [float(pv) for pv in (before.inputs.pv, after.inputs.pv, *recorded)]
    if loop.pv_rate_max is not None:
        way = loop.pv_rate_max * (after.last_ns - before.sent_ns) / SECOND
        return REAL(min(pvs) - way), REAL(max(pvs) + way)
    if loop.pv_range is not None:
        return REAL(min(*pvs, loop.pv_range[0])), REAL(max(*pvs, loop.pv_range[1]))
    return None
