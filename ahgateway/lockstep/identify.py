"""Learn a PLC's dialect from a trace: eliminate every arithmetic that misses one bit of one execution.

This file alone decides what a trace says about the axes. It writes nothing and knows no file.

Theory of operation: a candidate is a partial dialect, the axes that some execution has asked for, and the shadow that
it leaves. The law tells which axes it reads, so an axis is split only at the first execution where it matters, and is
joined again when all its values leave the same. Thousands of combinations are thinned out first without splitting
(`thinning`): I_MV alone decides the integral's axes, MV less P, I and BIAS the derivative's. What survives explains
every execution by bits; when nothing does, the first execution that none explains is shown, word by word.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, TypeVar

from ahgateway.codec.station import Loop
from ahgateway.core.dialect import AXES, Dialect, IntegralStore, TsUnit
from ahgateway.core.dialect_axes import TABLE, Axis
from ahgateway.core.real import REAL, same_bits
from ahgateway.lockstep.anchor import anchored, first_anchor, is_anchor, is_lost
from ahgateway.lockstep.picture import Picture, predicted
from ahgateway.lockstep.shadow import (
    Shadow,
    explain,
    input_variants,
    judged_names,
    merged,
    state_key,
    without_pv,
)
from ahgateway.lockstep.thinning import is_dependent, thinned

CANDIDATES_MAX = 3000
"""More candidates than this after one execution: the trace is not fit to decide, and says so."""

STEPS_MAX = 200_000
"""Executions of the law in one search, beside `STEPS_FREE` for each of the trace's: about 20 s of one core at worst."""

STEPS_FREE = 100
STEPS_EACH_MAX = 50_000
"""An execution that takes more is passed over, and the search begins again behind it: later ones cost less."""

Fixed = Mapping[str, int]
T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Observation:
    """One execution between two pictures.

    Attributes:
        before: Picture before it.
        after: Picture behind it.
        is_next: Nothing that could leave a trace happened between this one and the observation before.
    """

    before: Picture
    after: Picture
    is_next: bool = True


@dataclass(frozen=True, slots=True)
class Unexplained:
    """The first execution that no candidate explains.

    Attributes:
        number: Its place in the trace, from 0.
        words: Seen word to what the PLC wrote and what the closest candidate computes.
        terms: Every term of that candidate.
        dialect: That candidate.
    """

    number: int
    words: Mapping[str, tuple[REAL, REAL]]
    terms: Any
    dialect: Dialect


@dataclass(frozen=True, slots=True)
class Identification:
    """What a trace says about the dialect.

    Attributes:
        values: Axis to the values that explain everything; all of them where nothing asked.
        survivors: Combinations of the axes that were asked and still fit.
        executions: Executions that were explained by bits.
        informative: Those among them in which something was computed.
        unexplained: The execution at which the last candidate fell, None when some survive.
        is_crowded: More combinations fit than can be followed: the trace has too few plain executions, automatic,
            between the limits, without dead band.
        is_cut: The search ran out of steps; what came after `executions` was not looked at.
    """

    values: Mapping[str, tuple[int, ...]]
    survivors: tuple[Dialect, ...]
    executions: int
    informative: int
    unexplained: Unexplained | None = None
    is_crowded: bool = False
    is_cut: bool = False

    @property
    def is_named(self) -> bool:
        """Tell whether at least one dialect explains the trace, and something was explained at all."""
        return self.unexplained is None and bool(self.survivors) and self.informative > 0

    def decided(self) -> dict[str, int]:
        """Axes of which one value is left, and the coarsest clock: a finer one would explain the same."""
        return {
            name: values[0]
            for name, values in self.values.items()
            if len(values) == 1 or (name == "ts_source" and 0 < len(values) < len(AXES[name]))
        }

    def open_axes(self, instruction: str) -> tuple[Axis, ...]:
        """Axes of this instruction that the trace leaves open, in the order of the table."""
        return tuple(axis for axis in TABLE if axis.concerns(instruction) and len(self.values[axis.name]) > 1)


class Asked:
    """A dialect that remembers which open axes were read; an open one reads as its default."""

    __slots__ = ("_fixed", "asked")

    def __init__(self, fixed: Fixed) -> None:
        self._fixed = fixed
        self.asked: list[str] = []

    def __getattr__(self, name: str) -> int:
        try:
            return self._fixed[name]
        except KeyError:
            if name not in AXES:
                raise AttributeError(name) from None
            if name not in self.asked:
                self.asked.append(name)
            return 0


@dataclass(slots=True)
class _Candidate:
    fixed: dict[str, int]
    shadow: Shadow

    def key(self) -> tuple[tuple[tuple[int, ...], tuple[int, ...]], ...]:
        return tuple(sorted((state_key(bound.low), state_key(bound.high)) for bound in self.shadow))


class _SpentError(Exception):
    """One execution, or the search, has used up its steps."""


@dataclass(slots=True)
class _Budget:
    """Counts what the search costs: executions of the law."""

    total: int
    each: int = STEPS_EACH_MAX

    def counted(self, loop: Loop) -> Loop:
        """Return the loop with a law that is counted."""
        law = loop.controller.step

        def step(inputs: Any, state: Any, dialect: Any, ts: REAL) -> tuple[Any, Any]:
            self.total -= 1
            self.each -= 1
            if self.total < 0 or self.each < 0:
                raise _SpentError
            return law(inputs, state, dialect, ts)

        return replace(loop, controller=replace(loop.controller, step=step))


def branched(fixed: dict[str, int], run: Callable[[Any], T | None]) -> list[tuple[dict[str, int], T]]:
    """Run with every combination of the open axes that the run asks for; runs that return None are dropped."""
    probe = Asked(fixed)
    result = run(probe)
    if not probe.asked:
        return [] if result is None else [(fixed, result)]
    axis = probe.asked[0]
    found = []
    for value in AXES[axis]:
        found.extend(branched({**fixed, axis: int(value)}, run))
    return found


def joined(candidates: list[_Candidate], known: Fixed) -> list[_Candidate]:
    """Make an axis open again where all its values leave the same shadow."""
    axes = {name for candidate in candidates for name in candidate.fixed if name not in known}
    for axis in sorted(axes, reverse=True):
        groups: dict[Any, list[_Candidate]] = {}
        for candidate in candidates:
            rest = tuple(sorted((name, value) for name, value in candidate.fixed.items() if name != axis))
            groups.setdefault((rest, candidate.key()), []).append(candidate)
        candidates = []
        for (rest, _), group in groups.items():
            values = {candidate.fixed[axis] for candidate in group if axis in candidate.fixed}
            if len(values) == len(AXES[axis]):
                candidates.append(_Candidate(dict(rest), group[0].shadow))
            else:
                candidates.extend(group)
    return candidates


def identify(loop: Loop, observations: Sequence[Observation], *, steps_max: int = STEPS_MAX) -> Identification:
    """Eliminate the dialects that a trace contradicts.

    Args:
        loop: The loop; its own dialect does not count.
        observations: Executions in order, each between two pictures and alone there.
        steps_max: How often the search may execute the law, beside `STEPS_FREE` for each execution.
    """
    pairs = [(each.before, each.after) for each in observations]
    starts, has_kc = thinned(loop, pairs), is_dependent(pairs)
    candidates = [_Candidate(dict(fixed), ()) for fixed in starts]
    if not any(starts):
        return replace(_result(candidates, 0, 0, has_kc), is_crowded=True)
    executions, informative, budget = 0, 0, _Budget(steps_max + STEPS_FREE * len(pairs))
    counted = budget.counted(loop)
    first = first_anchor(replace(loop, dialect=_dialect(starts[0])), pairs, [each.is_next for each in observations])
    for number, each in enumerate(observations):
        if number < first:
            continue
        is_tuning = 1 in (each.before.inputs.pid_mode, each.after.inputs.pid_mode)
        if is_tuning or not each.is_next:
            for candidate in candidates:
                candidate.shadow = ()
        if is_tuning:
            continue
        may_begin = is_anchor(loop, pairs, number, is_next=each.is_next)
        budget.each = STEPS_EACH_MAX
        try:
            left = [after for one in candidates for after in _advanced(counted, one, each, may_begin)]
        except _SpentError:
            if budget.total < 0:
                return replace(_result(candidates, executions, informative, has_kc), is_cut=True)
            for candidate in candidates:
                candidate.shadow = ()
            continue
        if not left:
            return _none(loop, candidates, each, number, executions, informative)
        if any(candidate.shadow for candidate in candidates):
            executions += 1
            informative += any(
                not same_bits(each.before.seen[name], each.after.seen[name])
                for name in ("I_MV", "MV")
                if name in each.after.seen
            )
        candidates = left
        if len(candidates) > CANDIDATES_MAX:
            return replace(_result(candidates, executions, informative, has_kc), is_crowded=True)
    return _result(candidates, executions, informative, has_kc)


def _advanced(loop: Loop, candidate: _Candidate, each: Observation, may_begin: bool) -> list[_Candidate]:
    """What a candidate becomes behind one execution: nothing when it does not explain it."""
    if not candidate.shadow:
        return _seeded(loop, candidate, each) if may_begin else [candidate]
    variants = _variants(loop, each)
    names = judged_names(loop)

    def run(dialect: Any) -> Shadow | None:
        asking = replace(loop, dialect=dialect)
        found = explain(asking, candidate.shadow, variants, each.after.seen, names)
        if found.fits:
            behind = merged(fit.after for fit in found.fits)
            return () if is_lost(behind) else behind
        return without_pv(asking, candidate.shadow, variants, each.after.seen) or None

    grown = [_Candidate(fixed, shadow) for fixed, shadow in branched(candidate.fixed, run)]
    return joined(grown, candidate.fixed) if len(grown) > 1 else grown


def _variants(loop: Loop, each: Observation) -> list[Any]:
    """What the execution can have read; in automatic its PV is the one that it recorded, and no other is tried.

    With a PV that was never used the law may run into its limits and ask for axes that say nothing here.
    """
    recorded = [each.after.seen[word.name] for word in loop.controller.seen if word.attr == "pv1"]
    return [
        inputs
        for inputs in input_variants(loop, each.before, each.after)
        if not recorded or not inputs.pid_run or inputs.pid_man or same_bits(inputs.pv, recorded[0])
    ]


def _seeded(loop: Loop, candidate: _Candidate, each: Observation) -> list[_Candidate]:
    """Begin behind an execution: every hidden state that it can have left."""

    def run(dialect: Any) -> Shadow:
        return anchored(replace(loop, dialect=dialect), each.before, each.after)

    grown = [_Candidate(fixed, shadow) for fixed, shadow in branched(candidate.fixed, run)]
    return joined(grown, candidate.fixed) if len(grown) > 1 else grown


def _dialect(fixed: Fixed) -> Dialect:
    return Dialect(**{name: AXES[name](value) for name, value in fixed.items()})  # type: ignore[arg-type]


def _result(candidates: list[_Candidate], executions: int, informative: int, has_kc: bool) -> Identification:
    values = {}
    for name, axis in AXES.items():
        found: set[int] = set()
        for candidate in candidates:
            found |= _same_as(candidate.fixed, name, has_kc)
        values[name] = tuple(int(value) for value in axis if int(value) in found)
    survivors = tuple(dict.fromkeys(_dialect(candidate.fixed) for candidate in candidates))
    return Identification(values, survivors, executions, informative)


def _same_as(fixed: Fixed, name: str, has_kc: bool) -> set[int]:
    """Values of an axis that this candidate stands for: its own, and those that could not have made a difference."""
    every = {int(value) for value in AXES[name]}
    unit = fixed.get("ts_unit")
    if name not in fixed or (unit == TsUnit.LEFT_OUT and name in ("ts_source", "product")):
        return every
    value = fixed[name]
    if name == "ts_source" and unit == TsUnit.SECONDS:
        return {finer for finer in every if finer >= value}
    if name == "integral_store" and value == IntegralStore.TERM and not has_kc:
        return {value, int(IntegralStore.WITHOUT_KC)}
    return {value}


def _none(
    loop: Loop, candidates: list[_Candidate], each: Observation, number: int, executions: int, informative: int
) -> Identification:
    """Show the execution at which the last candidate fell, beside the candidate that came closest."""
    variants, names = input_variants(loop, each.before, each.after), judged_names(loop)
    closest: tuple[int, Unexplained] | None = None
    for candidate in candidates[:256]:
        dialect = _dialect(candidate.fixed)
        found = explain(replace(loop, dialect=dialect), candidate.shadow, variants, each.after.seen, names)
        if found.nearest is None:
            continue
        ref = predicted(loop.controller, found.nearest.after.low, found.nearest.terms)
        words = {name: (each.after.seen[name], ref[name]) for name in names}
        wrong = sum(not same_bits(plc, computed) for plc, computed in words.values())
        if closest is None or wrong < closest[0]:
            closest = (wrong, Unexplained(number, words, found.nearest.terms, dialect))
    assert closest is not None, "a candidate with a shadow has a prediction"
    values: dict[str, tuple[int, ...]] = dict.fromkeys(AXES, ())
    return Identification(values, (), executions, informative, closest[1])


def observed(pictures: Sequence[Picture], loop: Loop) -> list[Observation]:
    """Return the executions that show themselves between consecutive pictures, each alone in its interval.

    Two pictures further apart than one and a half CYCLE, an I_MV that somebody wrote, and a link that was away break
    the chain: the next observation is not the next execution.
    """
    found: list[Observation] = []
    is_next = False
    names = judged_names(loop)
    for before, after in pairwise(pictures):
        cycle_ns = round(float(loop.controller.nominal_ts(after.inputs)) * 1e9)
        if after.last_ns - before.sent_ns > 1.5 * cycle_ns or before.aligned_since_ns != after.aligned_since_ns:
            is_next = False
            continue
        changed = {name for name in names if not same_bits(before.seen[name], after.seen[name])}
        if not changed - {"MOUT"}:
            continue
        if changed == {"I_MV"}:
            is_next = False
            continue
        found.append(Observation(before, after, is_next))
        is_next = True
    return found
