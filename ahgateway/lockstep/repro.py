"""From a divergence to the smallest case that shows it: what it read, what was remembered, the likeliest cause.

This file decides what of a divergence goes into the file; its form is `core.repro`. The sequence is as short as it can
be: one execution from the state before it, since that is known, or as many as lie between two slow pictures; a field of
the state that changes no word is left at its default. Where one REAL of the state is only bounded, both ends go in, and
neither may reproduce the words.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

from ahgateway.codec.station import Loop
from ahgateway.core.operands import Kind
from ahgateway.core.real import REAL
from ahgateway.core.repro import Case, Change, Execution, differences, without_what_does_not_matter
from ahgateway.lockstep.call_shadow import names_for, open_path
from ahgateway.lockstep.cause_pages import code_of
from ahgateway.lockstep.picture import Picture
from ahgateway.lockstep.shadow import Fit, judged_names
from ahgateway.lockstep.suspects import Blame, Suspect


def case_of(loop: Loop, blame: Blame, after: Picture, suspects: Iterable[Suspect] = ()) -> Case | None:
    """Return a divergence as the smallest case that still differs; None when it rests on more than was known.

    Args:
        loop: The loop.
        blame: What was said of the divergence.
        after: The picture behind it.
        suspects: What stands for all of the loop's divergences; tried before the divergence's own.
    """
    fit: Fit | None = blame.fit
    if fit is None:
        return None
    controller = loop.controller
    names = judged_names(loop) if controller.begin is None else names_for(loop, fit.before)
    ts = controller.ts(fit.inputs, loop.dialect) if fit.ts is None else fit.ts
    unseen = [Execution(read, controller.ts(read, loop.dialect), {}) for read in fit.lead]
    executions = (*unseen, Execution(fit.inputs, ts, {name: after.seen[name] for name in names}))
    starts = (fit.before.low, fit.before.high) if open_path(fit.before) else (fit.before.low,)
    told = {
        "loop": loop.name,
        "tick": after.tick,
        "utc_ns": after.utc_ns,
        "cause": blame.cause,
        "code": code_of(blame.cause),
        "evidence": blame.suspects[0].evidence,
    }
    case = Case(controller, loop.dialect, starts, executions, None, told)
    if not differences(case):
        return None
    for suspect in (*suspects, *blame.suspects):
        change = change_of(loop, suspect, fit.inputs)
        if change is not None and not differences(case, change):
            case = replace(case, likeliest=change)
            break
    return without_what_does_not_matter(case)


def change_of(loop: Loop, suspect: Suspect, inputs: Any) -> Change | None:
    """Return a suspect as a change of operands or dialect; None when it is no such thing."""
    controller = loop.controller
    if suspect.cause == "missed-execution":
        return Change(times=2)
    if suspect.cause == "cycle" and suspect.estimate is not None:
        return Change(ts=REAL(suspect.estimate.value))
    if suspect.setting and suspect.setting != "off":
        pairs = (each.split(" = ") for each in suspect.setting.split(", "))
        return Change(dialect={axis: controller.axes[axis][value.upper()] for axis, value in pairs})
    row = next((row for row in controller.operands if row.name == suspect.operand), None)
    if row is None or row.attr not in controller.input_names:
        return None
    if suspect.estimate is not None:
        return Change({row.attr: REAL(suspect.estimate.value)})
    if row.kind is Kind.BOOL:
        return Change({row.attr: not getattr(inputs, row.attr)})
    if suspect.cause == "gain":
        held = getattr(inputs, row.attr)
        size = float(held) * suspect.ratio
        return Change({row.attr: REAL(size) if row.kind is Kind.REAL else round(size)})
    return None
