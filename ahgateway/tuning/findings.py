"""What was found in a record: refusals, warnings and notes, each with its number and what to do."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class Weight(Enum):
    """How much a finding weighs: no proposal is made, a proposal is made with it beside, or it only informs."""

    REFUSED = "refused"
    WARNING = "warning"
    NOTE = "note"


@dataclass(frozen=True, slots=True)
class Finding:
    """One finding.

    Attributes:
        name: Stable name: `noisy`, `saturated`, `not-excited`, `drifting`, `stuck-valve` and so on.
        weight: What follows from it.
        text: One sentence with both numbers, no full stop.
        hint: What the reader can do.
    """

    name: str
    weight: Weight
    text: str
    hint: str = ""


def refused(findings: tuple[Finding, ...]) -> tuple[Finding, ...]:
    """Return those that forbid a proposal."""
    return tuple(finding for finding in findings if finding.weight is Weight.REFUSED)
