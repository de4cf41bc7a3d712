"""What the instruction writes into registers that it reads: limits exchanged, gains and CYCLE clamped, MOUT.

This file alone decides what such a register excludes. A register that changes to just the value that the instruction
would write, beside an execution, is taken for the instruction's own doing; one that an execution left as it was is not.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from typing import Any

from ahgateway.codec.station import Loop
from ahgateway.core.controllers.delta import gain
from ahgateway.core.dialect import AXES, Clamped, Limits, MoutAuto, RunOffMout
from ahgateway.core.operands import Kind
from ahgateway.core.real import same_bits
from ahgateway.lockstep.picture import Picture
from ahgateway.lockstep.shadow import judged_names

OFTEN = 2
"""So often MOUT must have become what the instruction would write: an operator, too, may write a 0 or a limit there."""


def fallen(loop: Loop, pictures: Sequence[Picture]) -> dict[str, set[int]]:
    """Return, axis by axis, the values that the registers exclude."""
    if loop.controller.law_ts is None:
        return {}
    names = [name for name in judged_names(loop) if name != "MOUT"]
    steps = [
        (before, after, any(not same_bits(before.seen[name], after.seen[name]) for name in names))
        for before, after in pairwise(pictures)
        if before.aligned_since_ns == after.aligned_since_ns
    ]
    rules: dict[str, Callable[..., Iterator[int]]] = {
        "limits": _limits,
        "clamped": _clamped,
        "run_off_mout": _stopped,
        "mout_auto": _in_manual,
    }
    found = {name: set(rule(loop, steps)) for name, rule in rules.items()}
    return {name: gone for name, gone in found.items() if gone and len(gone) < len(AXES[name])}


Steps = Sequence[tuple[Picture, Picture, bool]]


def _limits(loop: Loop, steps: Steps) -> Iterator[int]:
    """MV_MAX below MV_MIN: exchanged by an execution, or left through one that began and ended so."""
    was_reversed = False
    for before, after, has_happened in steps:
        old, new = before.inputs, after.inputs
        is_reversed = bool(new.mv_max < new.mv_min)
        if old.mv_max < old.mv_min and same_bits(old.mv_max, new.mv_min) and same_bits(old.mv_min, new.mv_max):
            yield int(Limits.EXCHANGED)
            yield int(Limits.AS_WRITTEN)
        if was_reversed and is_reversed and has_happened and old.pid_run and new.pid_run:
            yield int(Limits.WRITTEN_BACK)
        was_reversed = is_reversed


def _clamped(loop: Loop, steps: Steps) -> Iterator[int]:
    """A gain below 0, or a CYCLE out of range: clamped by an execution, or left through one."""
    rows = {row.attr: row for row in loop.controller.operands}
    gains = [name for name in ("kp", "ki", "kd", "kc_kp", "ti_ki", "td_kd", "tf") if name in rows]
    for before, after, has_happened in steps:
        for name in [*gains, "cycle"]:
            old, new = getattr(before.inputs, name), getattr(after.inputs, name)
            if not has_happened or _within(rows[name], old) == old:
                continue
            if new == old and before.inputs.pid_run and after.inputs.pid_run:
                yield int(Clamped.WRITTEN_BACK)
            elif new == _within(rows[name], old):
                yield int(Clamped.INTERNAL)


def _within(row: Any, value: Any) -> Any:
    """The value as the manual clamps it; what is no number is left out."""
    if row.kind is Kind.REAL:
        return gain(value) if value == value else value
    return min(max(value, int(row.minimum)), int(row.maximum))


def _stopped(loop: Loop, steps: Steps) -> Iterator[int]:
    """MOUT under MOUT_AUTO when PID_RUN = FALSE puts MV to 0."""
    times = 0
    for before, after, _ in steps:
        read = after.inputs
        if read.pid_run or not read.mout_auto or not before.inputs.mout_auto or before.inputs.mout == 0:
            continue
        if before.seen["MV"] != 0 and after.seen["MV"] == 0:
            times += int(read.mout == 0)
            if same_bits(read.mout, before.inputs.mout):
                yield int(RunOffMout.FOLLOWS)
    if times >= OFTEN:
        yield int(RunOffMout.KEPT)


def _in_manual(loop: Loop, steps: Steps) -> Iterator[int]:
    """MOUT beyond the limits in manual under MOUT_AUTO."""
    times = 0
    for before, after, _ in steps:
        old, new = before.inputs, after.inputs
        is_such = all(each.pid_run and each.pid_man and each.mout_auto for each in (old, new))
        if is_such and not same_bits(old.mout, new.mout) and not new.mv_min <= old.mout <= new.mv_max:
            times += int(new.mout in (new.mv_min, new.mv_max) and same_bits(new.mout, after.seen["MV"]))
    if times >= OFTEN:
        yield int(MoutAuto.AUTOMATIC)
