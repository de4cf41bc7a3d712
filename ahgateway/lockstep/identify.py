"""Learn a PLC's dialect from a trace: eliminate every arithmetic that misses one bit of one execution.

This file alone decides what a trace says about the axes. It writes nothing and knows no file.

Theory of operation: a candidate is a partial dialect, the axes that some execution has asked for, and what it can have
left hidden. The law tells which axes it reads, so an axis is split only at the first execution where it matters, and is
joined again when all its values leave the same. Thousands of combinations are thinned out first without splitting
(`thinning`): I_MV alone decides the integral's axes, MV less P, I and BIAS the derivative's. What is left is carried
along the trace by `core.sift`, from one question to the next. What survives explains every execution by bits; when
nothing does, the first execution that none explains is shown, word by word.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.util import find_spec
from typing import Any

from ahgateway.codec.station import Loop
from ahgateway.core.controllers.block_axes import axes_of
from ahgateway.core.dialect import AXES, Dialect, IntegralStore, TsUnit
from ahgateway.core.dialect_axes import Axis
from ahgateway.core.real import REAL, order, quiet, same_bits
from ahgateway.lockstep.anchor import anchored, first_anchor
from ahgateway.lockstep.candidates import SAME_ON_DPID, Candidate, Carrier, Fixed, dialect_of, joined, values_of
from ahgateway.lockstep.crossings import taken
from ahgateway.lockstep.picture import predicted
from ahgateway.lockstep.reads import input_variants
from ahgateway.lockstep.shadow import Shadow, explain, judged_names
from ahgateway.lockstep.thinning import is_dependent, thinned
from ahgateway.lockstep.trace import Observation, columns, observed

__all__ = ["Identification", "Observation", "Unexplained", "identify", "observed"]

CANDIDATES_MAX = 3000
"""More candidates than this after one stretch: the trace is not fit to decide, and says so."""

STEPS_MAX = 2_000_000
"""Executions walked in one search by all candidates, beside `STEPS_FREE` for each execution of the trace."""

STEPS_FREE = 200

STRETCH_MAX = 512
"""Candidates are joined after so many executions at most; sooner while they are many."""

MANY = 64
"""More candidates than this are joined again soon."""

FAST_FROM = 1500
"""Traces of so many executions are worth the seconds that it takes to compile the law."""

FAST_FROM_FILTERED = 20
"""The same for a law with a filter, whose content may have to be followed value by value, thousands of them."""


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
    dialect: Any


@dataclass(frozen=True, slots=True)
class Identification:
    """What a trace says about the dialect.

    Attributes:
        values: Axis to the values that explain everything; all of them where nothing asked.
        survivors: Combinations of the axes that were asked and still fit.
        executions: Executions that were explained by bits.
        informative: Those among them in which something was computed.
        unexplained: The execution at which the last candidate fell, None when some survive.
        is_crowded: Nothing is named: the trace has too few plain executions, automatic, between the limits, without
            dead band, to begin with; or more combinations fit up to `executions` than can be followed.
        is_cut: The search ran out of steps; what came after `executions` was not looked at.
        plain: Plain executions that were found, where they were too few to begin with.
    """

    values: Mapping[str, tuple[int, ...]]
    survivors: tuple[Any, ...]
    executions: int
    informative: int
    unexplained: Unexplained | None = None
    is_crowded: bool = False
    is_cut: bool = False
    plain: int = 0

    @property
    def is_named(self) -> bool:
        """Tell whether at least one dialect explains the trace, and something was explained at all."""
        return self.unexplained is None and not self.is_crowded and bool(self.survivors) and self.informative > 0

    def decided(self) -> dict[str, int]:
        """Axes of which one value is left, and the coarsest clock: a finer one would explain the same."""
        return {
            name: values[0]
            for name, values in self.values.items()
            if len(values) == 1 or (name == "ts_source" and 0 < len(values) < len(AXES[name]))
        }

    def open_axes(self, instruction: str) -> tuple[Axis, ...]:
        """Axes of this instruction that the trace leaves open, in the order of the table."""
        return tuple(axis for axis in axes_of(instruction) if len(self.values[axis.name]) > 1)


def identify(
    loop: Loop,
    observations: Sequence[Observation],
    *,
    steps_max: int = STEPS_MAX,
    compiled: bool | None = None,
    starts: Sequence[Fixed] | None = None,
    known: Fixed | None = None,
) -> Identification:
    """Eliminate the dialects that a trace contradicts.

    Args:
        loop: The loop; its own dialect does not count.
        observations: Executions in order, each between two pictures and alone there.
        steps_max: How many executions all candidates may walk, beside `STEPS_FREE` for each of the trace.
        compiled: Compile the law, which decides the same; None: where numba is installed and the trace is long.
        starts: Partial dialects to begin with; None: those that a first pass over the trace leaves.
        known: Axes that something else than the words has told.
    """
    pairs = [(each.before, each.after) for each in observations]
    follows = [each.is_next for each in observations]
    has_kc = is_dependent(pairs)
    begun = [dict(fixed) for fixed in starts or ()]
    if starts is None:
        begun, fell, plain = thinned(loop, pairs, follows)
        if fell is not None:
            return _none_integrates(loop, observations, *fell)
        if not begun:
            return replace(_result(loop, [Candidate({})], has_kc), is_crowded=True, plain=plain)
    candidates = [Candidate(dict(fixed)) for fixed in taken(begun, known or {})]
    if compiled is None:
        is_filtered = any(getattr(before.inputs, "tf", 0) > 0 for before, _ in pairs)
        compiled = len(pairs) >= (FAST_FROM_FILTERED if is_filtered else FAST_FROM) and find_spec("numba") is not None
    steps_max += STEPS_FREE * len(pairs)
    carrier = Carrier(loop, pairs, columns(loop, observations), compiled=compiled, steps_max=steps_max)
    at = first_anchor(replace(loop, dialect=dialect_of(candidates[0].fixed)), pairs, follows)
    for candidate in candidates:
        candidate.at = at
    stretch = 1
    while at < len(pairs):
        stop = min(at + stretch, len(pairs))
        with quiet(all="ignore"):
            left = [after for candidate in candidates for after in carrier.carried(candidate, stop)]
        if carrier.is_out_of_steps:
            return replace(_result(loop, candidates, has_kc), is_cut=True)
        if not left:
            return _none(loop, carrier, observations)
        at, candidates = stop, joined(loop, left)
        if len(candidates) > CANDIDATES_MAX:
            return replace(_result(loop, candidates, has_kc), is_crowded=True)
        stretch = max(1, stretch // 4) if len(candidates) > MANY else min(2 * stretch, STRETCH_MAX)
    return _result(loop, candidates, has_kc)


def _result(loop: Loop, candidates: list[Candidate], has_kc: bool) -> Identification:
    values = {}
    for name, axis in AXES.items():
        found: set[int] = set()
        for candidate in candidates:
            found |= _same_as(loop, candidate.fixed, name, has_kc)
        values[name] = tuple(int(value) for value in axis if int(value) in found)
    survivors = tuple(dict.fromkeys(dialect_of(candidate.fixed) for candidate in candidates))
    best = max(candidates, key=lambda each: each.explained)
    return Identification(values, survivors, best.explained, best.informative)


def _same_as(loop: Loop, fixed: Fixed, name: str, has_kc: bool) -> set[int]:
    """Values of an axis that this candidate stands for: its own, and those that could not have made a difference."""
    every = set(values_of(loop, fixed, name)) if name in SAME_ON_DPID else {int(value) for value in AXES[name]}
    unit = fixed.get("ts_unit")
    if name not in fixed or (unit == TsUnit.LEFT_OUT and name in ("ts_source", "product")):
        return every
    value = fixed[name]
    if name == "ts_source" and unit == TsUnit.SECONDS:
        return {finer for finer in every if finer >= value}
    if name == "integral_store" and value == IntegralStore.TERM and not has_kc:
        return {value, int(IntegralStore.WITHOUT_KC)} & every
    return {value}


def _none(loop: Loop, carrier: Carrier, observations: Sequence[Observation]) -> Identification:
    """Show the execution at which the last candidate fell, beside the candidate that came closest."""
    each = observations[carrier.fallen_at]
    fallen = carrier.fallen
    closest: tuple[tuple[int, int], Unexplained] | None = None
    for candidate in fallen:
        found = _beside(loop, dialect_of(candidate.fixed), candidate.shadow(loop), each, carrier.fallen_at)
        if found is not None and (closest is None or found[0] < closest[0]):
            closest = found
    assert closest is not None, "a candidate that fell had a prediction"
    values: dict[str, tuple[int, ...]] = dict.fromkeys(AXES, ())
    best = max(fallen, key=lambda each: each.explained)
    return Identification(values, (), best.explained, best.informative, closest[1])


def _none_integrates(loop: Loop, observations: Sequence[Observation], number: int, fixed: Fixed) -> Identification:
    """Show the execution at which the last combination of the integral's axes fell, beside that one."""
    dialect, last = dialect_of(fixed), observations[number - 1]
    shadow = anchored(replace(loop, dialect=dialect), last.before, last.after)
    closest = _beside(loop, dialect, shadow, observations[number], number)
    assert closest is not None, "behind a plain execution its state is known"
    return Identification(dict.fromkeys(AXES, ()), (), 0, 0, closest[1])


def _beside(
    loop: Loop, dialect: Dialect, shadow: Shadow, each: Observation, number: int
) -> tuple[tuple[int, int], Unexplained] | None:
    """What the PLC wrote beside what a dialect makes of the same: how far it is off, and all its words."""
    variants, names = input_variants(loop, each.before, each.after), judged_names(loop)
    found = explain(replace(loop, dialect=dialect), shadow, variants, each.after.seen, names)
    if found.nearest is None:
        return None
    ref = predicted(loop.controller, found.nearest.after.low, found.nearest.terms)
    words = {name: (each.after.seen[name], ref[name]) for name in names}
    wrong = sum(not same_bits(plc, computed) for plc, computed in words.values())
    far = sum(abs(order(plc) - order(computed)) for plc, computed in words.values())
    return (wrong, far), Unexplained(number, words, found.nearest.terms, dialect)
