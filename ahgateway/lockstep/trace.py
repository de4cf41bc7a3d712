"""A trace as columns: what each execution can have read, what it left, where it follows the one before.

This file decides which sets of inputs an execution between two pictures can have read, for the search of a dialect.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from ahgateway.codec.station import Loop
from ahgateway.core.real import REAL, same_bits
from ahgateway.lockstep.anchor import is_anchor
from ahgateway.lockstep.picture import Picture
from ahgateway.lockstep.reads import input_variants
from ahgateway.lockstep.shadow import judged_names, state_key

WORDS = ("pv1", "i", "mv", "mout")
"""What a sieve takes of each execution, in this order."""


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


@dataclass(frozen=True)
class Trace:
    """Executions as columns.

    Attributes:
        starts: Where each execution's sets of inputs begin, one more than there are executions.
        rows: A row for each set of inputs, an input a column; binary64 holds each of them exactly.
        seen: `WORDS` behind each execution, n by 4.
        judged: Which of these stand in the PLC's memory.
        anchors: Behind which executions a search may begin.
        follows: Which executions can be followed from the one before.
        informs: Which executions computed something.
    """

    starts: npt.NDArray[np.int64]
    rows: npt.NDArray[np.float64]
    seen: npt.NDArray[np.float32]
    judged: npt.NDArray[np.bool_]
    anchors: npt.NDArray[np.bool_]
    follows: npt.NDArray[np.bool_]
    informs: npt.NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.follows)


def columns(loop: Loop, observations: Sequence[Observation]) -> Trace:
    """Put a trace into columns."""
    pairs = [(each.before, each.after) for each in observations]
    starts, rows = [0], []
    for each in observations:
        rows.extend(variants(loop, each))
        starts.append(len(rows))
    by_attr = {word.attr: word.name for word in loop.controller.seen}
    judged = judged_names(loop)
    tuning = [any(loop.controller.tunes(picture.inputs, picture.seen) for picture in pair) for pair in pairs]
    return Trace(
        np.array(starts, np.int64),
        np.array(rows, np.float64).reshape(len(rows), len(loop.controller.input_names)),
        np.array([[after.seen.get(by_attr[attr], REAL(0)) for attr in WORDS] for _, after in pairs], np.float32),
        np.array([by_attr[attr] in judged for attr in WORDS]),
        np.array([not tuning[n] and is_anchor(loop, pairs, n, is_next=o.is_next) for n, o in enumerate(observations)]),
        np.array([n > 0 and o.is_next and not tuning[n] for n, o in enumerate(observations)]),
        np.array([_computes(*pair) for pair in pairs]),
    )


def _computes(before: Picture, after: Picture) -> bool:
    return any(name in after.seen and not same_bits(before.seen[name], after.seen[name]) for name in ("I_MV", "MV"))


def variants(loop: Loop, each: Observation) -> list[Any]:
    """What the execution can have read; in automatic its PV is the one that it recorded, and no other is tried.

    With a PV that was never used the law may run into its limits and ask for axes that say nothing here.
    """
    recorded = [each.after.seen[word.name] for word in loop.controller.seen if word.attr == "pv1"]
    found: dict[tuple[int, ...], Any] = {}
    for inputs in input_variants(loop, each.before, each.after):
        if not recorded or not inputs.pid_run or inputs.pid_man or same_bits(inputs.pv, recorded[0]):
            found.setdefault(state_key(inputs), inputs)
    return list(found.values())


def observed(pictures: Sequence[Picture], loop: Loop) -> list[Observation]:
    """Return the executions that show themselves between consecutive pictures, each alone in its interval.

    Two pictures further apart than one and a half CYCLE, an I_MV that somebody wrote, and a link that was away break
    the chain: the next observation is not the next execution. So does a time in which another execution can have
    changed no word at all, though it moved what is hidden, and an MV that alone follows MOUT in manual: some dialects
    do that between two executions. With PID_RUN off, an execution that changes no word is one where another operand
    than PV was changed and stood for long enough: it may leave something hidden.
    """
    found: list[Observation] = []
    is_next = False
    names = judged_names(loop)
    known_ns = 0
    rest: Picture | None = None
    slack_ns = loop.scan_ms_max * 1_000_000
    for before, after in pairwise(pictures):
        cycle_ns = round(float(loop.controller.nominal_ts(after.inputs)) * 1e9)
        if after.last_ns - before.sent_ns > 1.5 * cycle_ns or before.aligned_since_ns != after.aligned_since_ns:
            is_next, rest = False, None
            continue
        changed = {name for name in names if not same_bits(before.seen[name], after.seen[name])}
        if not changed - {"MOUT"}:
            if not _is_idle(before, after):
                rest = after
                continue
            # PID_RUN = FALSE leaves what it finds, however often it is executed with the same operands.
            if rest is None:
                known_ns = after.last_ns
            elif after.sent_ns - rest.last_ns > cycle_ns + slack_ns:
                found.append(Observation(rest, after, is_next))
                is_next, rest, known_ns = True, None, after.last_ns
            continue
        rest = None
        if changed == {"I_MV"} or (changed <= {"MV", "MOUT"} and _can_be_refresh(before, after)):
            is_next = False
            continue
        # At least so long after the last one: more than one CYCLE, and one scan of delay, holds another.
        if found and before.sent_ns - max(known_ns, found[-1].after.last_ns) > cycle_ns + slack_ns:
            is_next = False
        found.append(Observation(before, after, is_next))
        is_next = True
    return found


def _can_be_refresh(before: Picture, after: Picture) -> bool:
    return all(
        getattr(each.inputs, "pid_run", True) and getattr(each.inputs, "pid_man", False) for each in (before, after)
    )


def _is_idle(before: Picture, after: Picture) -> bool:
    """Tell whether the instruction stood through this, PID_RUN off and nothing but PV on the move."""
    left, right = before.inputs, after.inputs
    if getattr(left, "pid_run", True) or getattr(right, "pid_run", True):
        return False
    return bool(left._replace(pv=right.pv) == right) and before.enabled is not False and before.running is not False
