"""One sign for what was said of an execution, for time lines; of two the worse is the larger: a maximum hides none."""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum
from typing import Any

from ahgateway.core.verdict import Proof, Verdict, Weight
from ahgateway.lockstep.judge import Execution


class Mark(IntEnum):
    """What a moment of a time line shows; NONE where no execution was judged, TRIVIAL where nothing was computed."""

    NONE = 0
    TRIVIAL = 1
    PROVEN = 2
    AGREES = 3
    UNOBSERVABLE = 4
    LINK = 5
    DIVERGED = 6


TEXTS: Mapping[Mark, str] = {
    Mark.PROVEN: "MATCH by bits, informative",
    Mark.TRIVIAL: "MATCH by bits, trivial",
    Mark.AGREES: "MATCH by ULP or tolerance",
    Mark.UNOBSERVABLE: "UNOBSERVABLE",
    Mark.LINK: "LINK: nothing known",
    Mark.DIVERGED: "DIVERGED",
}
"""What a legend says of each."""

SIGNS: Mapping[Mark, str] = {
    Mark.NONE: " ",
    Mark.PROVEN: "=",
    Mark.TRIVIAL: "-",
    Mark.AGREES: "~",
    Mark.UNOBSERVABLE: "?",
    Mark.LINK: "x",
    Mark.DIVERGED: "!",
}
"""The same in one character of ASCII, told apart without colour."""

_OTHERS = {Verdict.DIVERGED: Mark.DIVERGED, Verdict.UNOBSERVABLE: Mark.UNOBSERVABLE, Verdict.LINK: Mark.LINK}


def mark_of(execution: Execution) -> Mark:
    """Return the mark of an execution."""
    return _mark(execution.verdict, execution.proof, execution.weight)


def mark_recorded(found: Mapping[str, Any]) -> Mark:
    """Return the mark of a verdict as a recording keeps it."""
    proof, weight = found["proof"], found["class"]
    return _mark(Verdict(found["verdict"]), Proof(proof) if proof else None, Weight(weight) if weight else None)


def _mark(verdict: Verdict, proof: Proof | None, weight: Weight | None) -> Mark:
    if verdict in _OTHERS:
        return _OTHERS[verdict]
    if proof in (Proof.ULP, Proof.TOLERANCE):
        return Mark.AGREES
    return Mark.PROVEN if weight is Weight.INFORMATIVE else Mark.TRIVIAL
