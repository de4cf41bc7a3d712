"""Why a call of PID_REG_CE, PID_Temp or MELSEC PID left the reference: one change of an operand, switch or dialect.

As in `causes`: a cause is named when the law, changed in just this way, reproduces everything that the block wrote.
Fitted factors come from the output alone and are then tried on all values.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from math import isfinite
from typing import Any

import numpy as np

from ahgateway.codec.station import Loop
from ahgateway.core.controllers import replaced
from ahgateway.core.operands import Kind
from ahgateway.core.real import REAL
from ahgateway.lockstep.call_shadow import agree, field_at, key_of, may_be_written, names_for, pv_attrs, stepped
from ahgateway.lockstep.picture import Picture, predicted
from ahgateway.lockstep.shadow import Bound, Fit
from ahgateway.lockstep.suspects import Blame, Suspect

RATIO_MIN, RATIO_MAX = 0.2, 5.0
"""A gain that would have to be wrong by more than this explains nothing."""

FIT_SHARE = 1e-4
"""How far a fitted factor may leave the output from what was written, as a share of it."""

SIZE_MAX = 1e30
"""Larger values stand for `no limit`."""

TRIES = 6
NEIGHBOURS = 4
"""Rounding of a sum computed back is no more than this many REALs away."""

DIRECTIONS = frozenset({"ACTION"})


class _Case:
    """One call that left the reference, as the hypotheses see it."""

    def __init__(self, loop: Loop, fit: Fit, before: Picture, after: Picture) -> None:
        self.loop, self.fit, self.before, self.after = loop, fit, before, after
        self.names = names_for(loop, fit.before)

    def run(self, inputs: Any = None, loop: Loop | None = None) -> dict[str, Any]:
        """Step the law with something changed; return what it leaves."""
        read = self.fit.inputs if inputs is None else inputs
        after, terms, _ = stepped(loop or self.loop, read, Bound(self.fit.before.low, self.fit.before.low))
        return predicted(self.loop.controller, after.low, terms)

    def reproduces(self, words: Mapping[str, Any]) -> bool:
        return agree(self.names, words, self.after.seen)


def blame_call(loop: Loop, fit: Fit, before: Picture, after: Picture) -> Blame:
    """Say which value left first, and what reproduces what the block wrote."""
    case = _Case(loop, fit, before, after)
    suspects = [suspect for hypothesis in HYPOTHESES for suspect in hypothesis(case)]
    if may_be_written(loop, before, after):
        mv = loop.controller.roles.mv
        evidence = f"{mv} {float(after.seen[mv]):g} written without a call looks the same; a counter of the calls tells"
        suspects.append(Suspect("operand-written", evidence, mv))
    if not suspects:
        suspects = [Suspect("unknown", "no single change of an operand, switch or dialect reproduces what was written")]
    ref = case.run()
    wrong = [name for name in case.names if key_of(ref[name]) != key_of(after.seen[name])]
    name = wrong[0] if wrong else loop.controller.roles.mv
    return Blame(name, after.seen[name], ref[name], tuple(suspects), fit)


def _switches(case: _Case) -> list[Suspect]:
    """A switch that the block saw the other way round."""
    found = []
    for row in case.loop.controller.operands:
        if row.kind is not Kind.BOOL or row.attr not in case.loop.controller.input_names:
            continue
        flipped = case.fit.inputs._replace(**{row.attr: not getattr(case.fit.inputs, row.attr)})
        if case.reproduces(case.run(flipped)):
            cause = "direction" if row.name in DIRECTIONS else "mode-change"
            found.append(Suspect(cause, f"{row.name} acts the other way round", row.name))
    return found


def _stale_pv(case: _Case) -> list[Suspect]:
    found = []
    for attr in sorted(pv_attrs(case.loop)):
        old = getattr(case.before.inputs, attr)
        if key_of(old) == key_of(getattr(case.fit.inputs, attr)):
            continue
        if case.reproduces(case.run(case.fit.inputs._replace(**{attr: old}))):
            found.append(Suspect("stale-pv", f"the value before, {float(old):g}, reproduces it", attr.upper()))
    return found


def _other_dialect(case: _Case) -> list[Suspect]:
    found = []
    for axis, values in case.loop.controller.axes.items():
        for value in values:
            if value == getattr(case.loop.dialect, axis):
                continue
            other = replace(case.loop, dialect=case.loop.dialect._replace(**{axis: value}))
            if case.reproduces(case.run(loop=other)):
                found.append(Suspect("dialect", f"{axis} = {value.name.lower()} reproduces it"))
    return found


def _calls(case: _Case) -> list[Suspect]:
    """The block was called twice, or wrote nothing new."""
    once, _, _ = stepped(case.loop, case.fit.inputs, case.fit.before)
    twice, terms, _ = stepped(case.loop, case.fit.inputs, once)
    if case.reproduces(predicted(case.loop.controller, twice.low, terms)):
        return [Suspect("missed-execution", "two calls with these inputs reproduce it")]
    return []


def _integral(case: _Case) -> list[Suspect]:
    """Everything follows from another integral: somebody wrote it, or the block has summed another one."""
    name = case.loop.controller.roles.integral
    words = {word.name: word for word in case.loop.controller.seen}
    path = words[name].path(case.fit.before.low) if name else ""
    if not path:
        return []
    ref, seen = case.run()[name], case.after.seen[name]
    start = REAL(float(field_at(case.fit.before.low, path)) + float(seen) - float(ref))
    for direction in (REAL(-np.inf), REAL(np.inf)):
        value = start
        for _ in range(NEIGHBOURS):
            state = replaced(case.fit.before.low, path, value)
            after, terms, _ = stepped(case.loop, case.fit.inputs, Bound(state, state))
            if case.reproduces(predicted(case.loop.controller, after.low, terms)):
                held = float(field_at(case.fit.before.low, path))
                evidence = f"all agrees with {name} {float(value):g} before the call, {held:g} was seen"
                return [Suspect("operand-written", evidence, name), Suspect("integral", evidence, name)]
            value = np.nextafter(value, direction)
    return []


def _gains(case: _Case) -> list[Suspect]:
    """An operand that acts with another size than its register shows; the smallest change first."""
    found = []
    for row in case.loop.controller.operands:
        # A whole number without a unit is a set of bits or a choice, and has no size.
        is_sized = row.kind is Kind.REAL or (row.kind is Kind.INT and row.unit)
        if is_sized and row.minimum is not None and 0 <= row.minimum <= 1:
            value = getattr(case.fit.inputs, row.attr, None)
            if value is None or not 0 < value < SIZE_MAX:
                continue
            ratio = _fitted(case, _scaling(case, row.attr, float(value)))
            if ratio is not None:
                evidence = f"{row.name} acts as {float(value) * ratio:.7g}, its register holds {float(value):.7g}"
                found.append(Suspect("gain", f"{evidence} ({ratio - 1:+.3%})", row.name, ratio))
    return sorted(found, key=lambda suspect: abs(suspect.ratio - 1.0))


def _scaling(case: _Case, attr: str, value: float) -> Callable[[float], float]:
    mv = case.loop.controller.roles.mv

    def output(ratio: float) -> float:
        return float(case.run(case.fit.inputs._replace(**{attr: REAL(value * ratio)}))[mv])

    return output


def _fitted(case: _Case, output: Callable[[float], float]) -> float | None:
    """Solve for the factor under which the output is what the block wrote; None when none does."""
    seen = case.after.seen[case.loop.controller.roles.mv]
    target, ratio = float(seen), 1.0
    is_real = isinstance(seen, np.floating)
    if not isfinite(target) or abs(output(1.0) - target) <= (abs(target) * 2.0**-23 if is_real else 0.5):
        return None
    for _ in range(TRIES):
        here, there = output(ratio), output(ratio * 1.0078125)
        slope = (there - here) / (ratio * 0.0078125)
        if not isfinite(slope) or slope == 0.0:
            return None
        ratio += (target - here) / slope
        if not isfinite(ratio) or not RATIO_MIN < ratio < RATIO_MAX:
            return None
    return ratio if abs(output(ratio) - target) <= max(FIT_SHARE * abs(target), 0.0 if is_real else 0.5) else None


HYPOTHESES: tuple[Callable[[_Case], list[Suspect]], ...] = (
    _switches,
    _stale_pv,
    _other_dialect,
    _calls,
    _gains,
    _integral,
)
"""Tried in this order; exact ones stand before fitted ones."""
