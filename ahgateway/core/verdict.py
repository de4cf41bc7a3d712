"""How an execution is judged, and how the judged executions make a run's outcome.

This file alone decides what a run may claim. It does not know how an execution was seen or compared.

Theory of operation: a run is DIFFERENT if anything diverged, else INCONCLUSIVE if it cannot claim enough, else PASS.
It claims executions proven by bits; agreement by ULP or tolerance is shown apart and covers nothing. A run that
compared nothing, or only executions which any controller would have passed, is never a pass.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum, IntEnum


class Verdict(Enum):
    """One execution's verdict; only DIVERGED says that the product is broken, LINK that the bench is."""

    MATCH = "MATCH"
    DIVERGED = "DIVERGED"
    UNOBSERVABLE = "UNOBSERVABLE"
    LINK = "LINK"


class Proof(Enum):
    """How well a MATCH is known, best first."""

    BITS = "bits"
    ULP = "ulp"
    TOLERANCE = "tolerance"


class Weight(Enum):
    """What a MATCH by bits is worth: TRIVIAL at a fixed point, saturated, in manual or inside the dead band."""

    INFORMATIVE = "informative"
    TRIVIAL = "trivial"


class Exit(IntEnum):
    """Exit codes of every command: pass, a difference, usage or profile, cannot claim enough, our own fault."""

    PASS = 0
    DIFFERENT = 1
    USAGE = 2
    INCONCLUSIVE = 3
    FAULT = 4


@dataclass(frozen=True, slots=True)
class Counts:
    """Executions of a run, each counted once.

    Attributes:
        informative: MATCH by bits that another controller would have failed.
        trivial: MATCH by bits at a fixed point, saturated, in manual or inside the dead band.
        ulp: MATCH by ULP.
        tolerance: MATCH by tolerance.
        diverged: Executions that differ.
        unobservable: Executions of which too little was seen.
        link: Executions lost with the link.
        expected: How many there must have been, from a counter or the clock; 0 when nobody knows.
    """

    informative: int = 0
    trivial: int = 0
    ulp: int = 0
    tolerance: int = 0
    diverged: int = 0
    unobservable: int = 0
    link: int = 0
    expected: int = 0

    @property
    def proven(self) -> int:
        """Executions that match by bits."""
        return self.informative + self.trivial

    @property
    def compared(self) -> int:
        """Executions of which the outputs were compared, whatever came out."""
        return self.proven + self.ulp + self.tolerance + self.diverged

    @property
    def total(self) -> int:
        """The denominator of the coverage: those counted here, or those expected when that is more."""
        return max(self.compared + self.unobservable + self.link, self.expected)

    @property
    def coverage(self) -> float:
        """Share of the executions that is proven by bits, 0…1; 0 when there were none."""
        return self.proven / self.total if self.total else 0.0

    def plus(self, verdict: Verdict, proof: Proof | None = None, weight: Weight | None = None) -> Counts:
        """Return the counts with one more execution.

        Args:
            verdict: Its verdict.
            proof: How well a MATCH is known; None counts as bits.
            weight: What a MATCH by bits is worth; None counts as trivial, the smaller claim.
        """
        name = _SLOT.get(verdict)
        if name is None:
            name = {Proof.ULP: "ulp", Proof.TOLERANCE: "tolerance"}.get(proof) if proof else None
        if name is None:
            name = "informative" if weight is Weight.INFORMATIVE else "trivial"
        values = {field: getattr(self, field) for field in self.__slots__}
        values[name] += 1
        return Counts(**values)

    def __add__(self, other: Counts) -> Counts:
        return Counts(*(getattr(self, field) + getattr(other, field) for field in self.__slots__))


LINK_SHARE_MAX = 0.5
"""A run that lost more than this share of its executions with the link cannot claim enough, whatever was asked."""

_SLOT = {Verdict.DIVERGED: "diverged", Verdict.UNOBSERVABLE: "unobservable", Verdict.LINK: "link"}


def outcome(counts: Counts, coverage_min: float) -> Exit:
    """Return what a run may claim: PASS, DIFFERENT or INCONCLUSIVE.

    Args:
        counts: The executions of the run, of all loops together or of one.
        coverage_min: Smallest share proven by bits, itself included, 0…1; 0 also lets agreement by ULP or tolerance
            pass, never nothing.

    Raises:
        ValueError: `coverage_min` lies outside 0…1.
    """
    return _argued(counts, coverage_min)[0]


def run_outcome(loops: Iterable[Counts], coverage_min: float) -> Exit:
    """Return what a run over several loops may claim: no more than its worst loop allows.

    A loop of which nothing was compared makes the run inconclusive; one that only rested does not, as long as
    another was informative.
    """
    each = tuple(loops)
    total = sum(each, Counts())
    if total.diverged:
        return Exit.DIFFERENT
    whole = outcome(total, coverage_min)
    silent = any(not counts.compared for counts in each)
    short = any(counts.coverage < coverage_min or counts.link > LINK_SHARE_MAX * counts.total for counts in each)
    return Exit.INCONCLUSIVE if silent or short else whole


def reason(counts: Counts, coverage_min: float) -> str:
    """Return why `outcome` says what it says, as one sentence without a full stop."""
    return _argued(counts, coverage_min)[1]


def _argued(counts: Counts, coverage_min: float) -> tuple[Exit, str]:
    if not 0.0 <= coverage_min <= 1.0:
        raise ValueError(f"coverage_min must lie within 0 to 1: {coverage_min}")
    if counts.diverged:
        return Exit.DIFFERENT, f"{counts.diverged} of {counts.compared} compared executions diverged"
    if not counts.compared:
        return Exit.INCONCLUSIVE, "nothing was compared"
    if not counts.informative + counts.ulp + counts.tolerance:
        return Exit.INCONCLUSIVE, f"all {counts.trivial} matches are trivial: the loop rested, or was limited or manual"
    if counts.link > LINK_SHARE_MAX * counts.total:
        return Exit.INCONCLUSIVE, f"{counts.link} of {counts.total} executions were lost with the link"
    if counts.coverage < coverage_min:
        return (
            Exit.INCONCLUSIVE,
            f"{counts.proven} of {counts.total} executions proven by bits ({counts.coverage:.1%}), "
            f"asked for {coverage_min:.1%}",
        )
    return Exit.PASS, f"{counts.proven} of {counts.total} executions proven by bits, none diverged"
