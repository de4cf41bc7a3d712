"""One execution's verdict: what the shadow predicted against what the PLC wrote.

This file alone turns an explanation into MATCH, DIVERGED or UNOBSERVABLE and says what the match is worth. It does
not know when executions are due, nor why one differs (`causes`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from ahgateway.codec.station import Loop
from ahgateway.core import flags as flag
from ahgateway.core.compare import compare, weakest
from ahgateway.core.real import REAL, same_bits
from ahgateway.core.verdict import Proof, Verdict, Weight
from ahgateway.lockstep.causes import blame_any
from ahgateway.lockstep.picture import Picture, predicted
from ahgateway.lockstep.reads import input_variants
from ahgateway.lockstep.shadow import (
    MISSED_WORD,
    Bound,
    Explanation,
    Fit,
    Shadow,
    apart,
    explain,
    is_missed_anyway,
    is_roughly_bounded,
    is_settled,
    judged_names,
    merged,
    patched,
    recalled,
    state_key,
    without_pv,
)
from ahgateway.lockstep.suspects import Blame, Suspect, agreeing, sizeless
from ahgateway.lockstep.unseen import refreshed

TRIVIAL_FLAGS = flag.MANUAL | flag.STOPPED | flag.BAD_INPUT | flag.AUTOTUNE | flag.FROZEN

KNOWN_MAX = 2
"""From so many states that are known causes are tried."""

SEEDING = "the first execution seen shows what the instruction remembers; judging starts with the next"
OPEN_STATE = "what the instruction remembers but does not show is not settled yet"
FINE_CLOCK = "Ts is measured by a clock so fine that more intervals than can be tried come out with this I_MV"
SEVERAL = "more than one execution fitted between two pictures; poll faster than CYCLE"
UNRECORDED_PV = "in manual this dialect records no PV, so that the integral cannot be predicted"
TUNING = "PID_MODE is 1: the auto-tuner's law is not published"


@dataclass(frozen=True, slots=True)
class Execution:
    """One execution of the instruction, judged.

    Attributes:
        verdict: MATCH, DIVERGED or UNOBSERVABLE; LINK when it was lost with the link.
        proof: How well a MATCH is known.
        weight: What a MATCH is worth.
        reason: Why there is no MATCH by bits, one sentence.
        terms: Every term of the reference; None when there was nothing to step from.
        open_terms: Terms whose last bits are not settled, because the PLC hides what they come from.
        inputs: What the execution read, as far as it could be told.
        blame: Where and why it left the reference; only when it DIVERGED.
        count: How many executions this one line stands for.
    """

    verdict: Verdict
    proof: Proof | None = None
    weight: Weight | None = None
    reason: str = ""
    terms: Any = None
    open_terms: tuple[str, ...] = ()
    inputs: Any = None
    blame: Blame | None = None
    count: int = 1
    written: tuple[str, ...] = field(default=())


def judge(
    loop: Loop,
    shadow: Shadow,
    before: Picture,
    after: Picture,
    executions_max: int,
    suspects: tuple[Suspect, ...] = (),
) -> tuple[Execution, Shadow]:
    """Judge the execution between two pictures whose words differ.

    Args:
        loop: The loop with its dialect and tolerance.
        shadow: What the instruction can have remembered at `before`; () when nothing is known.
        before: Picture before the execution.
        after: Picture behind it.
        executions_max: How many executions the time between the pictures allows, at least 1.
        suspects: What this loop is already suspected of.

    Returns:
        The execution, and the shadow behind it.
    """
    if 1 in (before.inputs.pid_mode, after.inputs.pid_mode):
        return Execution(Verdict.UNOBSERVABLE, reason=TUNING, inputs=after.inputs), ()
    if not shadow:
        if executions_max > 1:
            return Execution(Verdict.UNOBSERVABLE, reason=SEVERAL, inputs=after.inputs, count=executions_max), _fresh(
                loop, before, after
            )
        return Execution(Verdict.UNOBSERVABLE, reason=SEEDING, inputs=after.inputs), _fresh(loop, before, after)

    names = judged_names(loop)
    variants = input_variants(loop, before, after)
    found = explain(loop, shadow, variants, after.seen, names)
    if not found.is_whole:
        unknown = Execution(Verdict.UNOBSERVABLE, reason=FINE_CLOCK, inputs=after.inputs)
        execution = _agreed(loop, found, names, before, after) if found.is_decided else unknown
        return execution, _fresh(loop, before, after)
    if found.fits:
        again = None
        if not found.is_decided and suspects and executions_max == 1:
            again = _same_fault(loop, shadow, variants, before, after, suspects)
        if again is not None:
            return again[0], (*patched(loop, again[1], after.seen), *_fresh(loop, before, after))
        return _agreed(loop, found, names, before, after), merged(fit.after for fit in found.fits)
    overwritten = _overwritten_mout(loop, shadow, variants, before, after)
    if overwritten is not None:
        execution = _agreed(loop, overwritten, names, before, after, written=("MOUT",))
        return execution, merged(fit.after for fit in overwritten.fits)
    behind = _refreshed_mv(loop, shadow, variants, before, after)
    if behind is not None:
        execution = _agreed(loop, behind, names, before, after, written=("MV",))
        mv = after.seen["MV"]
        bounds = (Bound(fit.after.low._replace(mv=mv), fit.after.high._replace(mv=mv)) for fit in behind.fits)
        return execution, merged(bounds)
    unrecorded = without_pv(loop, shadow, variants, after.seen)
    if unrecorded:
        return Execution(Verdict.UNOBSERVABLE, reason=UNRECORDED_PV, inputs=after.inputs), unrecorded
    assert found.nearest is not None
    if _is_rough(loop, shadow, variants, after, found.nearest):
        return Execution(Verdict.UNOBSERVABLE, reason=OPEN_STATE, inputs=after.inputs), _fresh(loop, before, after)
    proof = _proof(loop, found.nearest, names, after.seen)
    if proof is not None:
        reason = f"agrees by {proof.value} only; the tolerance of the profile allows it"
        weight = weigh(found.nearest.terms, names, before, after)
        execution = Execution(Verdict.MATCH, proof, weight, reason, found.nearest.terms, inputs=found.nearest.inputs)
        return execution, (*patched(loop, found.nearest, after.seen), *_fresh(loop, before, after))
    if executions_max > 1:
        return Execution(Verdict.UNOBSERVABLE, reason=SEVERAL, inputs=after.inputs, count=executions_max), _fresh(
            loop, before, after
        )
    blamed = _of_readings(loop, shadow, variants, before, after, suspects)
    nearest: Fit = blamed.fit
    execution = Execution(Verdict.DIVERGED, terms=nearest.terms, inputs=nearest.inputs, blame=blamed)
    return execution, (*patched(loop, nearest, after.seen), *_fresh(loop, before, after))


def _is_rough(loop: Loop, shadow: Shadow, variants: list[Any], after: Picture, nearest: Fit) -> bool:
    """Tell whether the miss says nothing because of what is open, unless every set of inputs misses a word anyway."""
    if not is_roughly_bounded(loop, nearest, after.seen):
        return False
    names = judged_names(loop)
    every = (explain(loop, shadow, [read], after.seen, names).nearest for read in variants)
    return not all(each is not None and is_missed_anyway(loop, each, after.seen) for each in every)


def _fresh(loop: Loop, before: Picture, after: Picture) -> Shadow:
    """Start anew behind the execution: what a block that shows these words can remember."""
    return recalled(loop, (after.inputs,) if after.is_exact else (after.inputs, before.inputs), after.seen)


def _blamed(loop: Loop, fits: list[Fit], before: Picture, after: Picture, suspects: tuple[Suspect, ...]) -> Blame:
    """Ask for everything, but where the law that is suspected most explains this one too, for that alone."""
    if suspects and suspects[0].twist is not None:
        known = blame_any(loop, fits, before, after, suspects[:1])
        kept = agreeing(suspects[:1], known.suspects)
        if kept:
            # Last bits that a law explains by chance are rounding, once it misses others.
            rounding = (each for each in known.suspects if each.cause == "rounding" and each not in kept)
            return replace(known, suspects=(*kept, *rounding))
    return blame_any(loop, fits, before, after)


def _of_readings(
    loop: Loop, shadow: Shadow, variants: list[Any], before: Picture, after: Picture, suspects: tuple[Suspect, ...]
) -> Blame:
    """Blame the nearest reading; where that leads nowhere, another one, but only for what no size has to be fitted to.

    What is open would bend to any size, and so would a reading that misses more words: a write that came in time for
    the execution, or too late. Where all that a settled state leads to is a size, what an open one does to the bit
    stands beside it, for later executions to tell.
    """
    settled, still_open = apart(shadow)
    near, far = _nearest(loop, settled[:KNOWN_MAX] or still_open, variants, after)
    blamed = _blamed(loop, near, before, after, suspects)
    is_known = blamed.cause != "unknown"
    others = [] if is_known else [far]
    if settled and still_open and all(each.estimate is not None or not is_known for each in blamed.suspects):
        others.extend(_nearest(loop, still_open, variants, after))
    for fits in others:
        exact = sizeless(blame_any(loop, fits, before, after)) if fits else None
        if exact is not None:
            return replace(blamed, suspects=(*blamed.suspects, *exact.suspects)) if is_known else exact
    return blamed


def _nearest(loop: Loop, shadow: Shadow, variants: list[Any], after: Picture) -> tuple[list[Fit], list[Fit]]:
    """Where it came closest, from each state and with each set of inputs: likely readings, and those that miss more."""
    names = judged_names(loop)
    starts: list[Shadow] = [(bound,) for bound in shadow] if all(map(is_settled, shadow)) else [shadow]
    found = [explain(loop, start, [read], after.seen, names) for start in starts for read in variants]
    found.sort(key=lambda each: each.distance)
    # One that misses more words than the best is no likely reading.
    reach = found[0].distance + MISSED_WORD
    # Orders of a write that come to the same, or one state from two bounds, are asked once.
    once: dict[Any, tuple[Fit, bool]] = {}
    for each in found:
        if each.nearest is not None:
            key = state_key(each.nearest.before.low), state_key(each.nearest.inputs)
            once.setdefault(key, (each.nearest, each.distance < reach))
    near, far = ([fit for fit, is_near in once.values() if is_near is wanted] for wanted in (True, False))
    return near[:KNOWN_MAX], far[:KNOWN_MAX]


def _same_fault(
    loop: Loop,
    shadow: Shadow,
    variants: list[Any],
    before: Picture,
    after: Picture,
    suspects: tuple[Suspect, ...],
) -> tuple[Execution, Fit] | None:
    """Behind a divergence what is hidden is open and would excuse anything; the same cause of the same size is none."""
    settled, _ = apart(shadow)
    found = explain(loop, settled, variants, after.seen, judged_names(loop))
    if found.fits or found.nearest is None:
        return None
    fits, _ = _nearest(loop, settled[:KNOWN_MAX], variants, after)
    blamed = blame_any(loop, fits, before, after, suspects)
    kept = agreeing(suspects, blamed.suspects)
    if not kept:
        return None
    fit: Fit = blamed.fit
    return Execution(Verdict.DIVERGED, terms=fit.terms, inputs=fit.inputs, blame=replace(blamed, suspects=kept)), fit


def _agreed(
    loop: Loop,
    found: Explanation,
    names: tuple[str, ...],
    before: Picture,
    after: Picture,
    written: tuple[str, ...] = (),
) -> Execution:
    fit = found.fits[0]
    if not found.is_decided:
        return Execution(
            Verdict.UNOBSERVABLE,
            reason=OPEN_STATE,
            terms=fit.terms,
            open_terms=fit.open_terms,
            inputs=fit.inputs,
            written=written,
        )
    weight = weigh(fit.terms, names, before, after)
    return Execution(
        Verdict.MATCH,
        Proof.BITS,
        weight,
        terms=fit.terms,
        open_terms=fit.open_terms,
        inputs=fit.inputs,
        written=written,
    )


def weigh(terms: Any, names: tuple[str, ...], before: Picture, after: Picture) -> Weight:
    """Tell what a match is worth: another law would have left the same words when nothing was computed."""
    if terms.flags & TRIVIAL_FLAGS:
        return Weight.TRIVIAL
    computed = [name for name in names if name in ("I_MV", "MV")]
    if all(same_bits(before.seen[name], after.seen[name]) for name in computed):
        return Weight.TRIVIAL
    return Weight.INFORMATIVE


def _overwritten_mout(
    loop: Loop, shadow: Shadow, variants: list[Any], before: Picture, after: Picture
) -> Explanation | None:
    """Everything fits but MOUT, which holds a third value: somebody wrote it behind the execution."""
    names = judged_names(loop)
    if "MOUT" not in names or same_bits(before.seen["MOUT"], after.seen["MOUT"]):
        return None
    found = explain(loop, shadow, variants, after.seen, tuple(name for name in names if name != "MOUT"))
    return found if found.fits else None


def _refreshed_mv(
    loop: Loop, shadow: Shadow, variants: list[Any], before: Picture, after: Picture
) -> Explanation | None:
    """MV has followed a MOUT that was written behind the execution, at a scan and not at an execution of its own."""
    first, last = refreshed(loop, before), refreshed(loop, after)
    if first is None or last is None or same_bits(first, last) or not same_bits(last, after.seen["MV"]):
        return None
    names = tuple(name for name in judged_names(loop) if name != "MOUT")
    found = explain(loop, shadow, variants, {**after.seen, "MV": first}, names)
    return found if found.fits else None


def _proof(loop: Loop, fit: Fit, names: tuple[str, ...], seen: Mapping[str, REAL]) -> Proof | None:
    ref = predicted(loop.controller, fit.after.low, fit.terms)
    limits = loop.tolerance
    return weakest(
        tuple(
            compare(seen[name], ref[name], limits.ulp_max, limits.mv_max if name in ("I_MV", "MV", "MOUT") else 0.0)
            for name in names
        )
    )
