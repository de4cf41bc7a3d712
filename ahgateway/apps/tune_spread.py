"""Repeated experiments on one loop: how far model and gains spread from one to the next.

This file alone decides which of several results speaks for all: the one with the process gain in the middle.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import mean, stdev
from typing import Any

from ahgateway.apps.report import number
from ahgateway.apps.tune import Tuning
from ahgateway.tuning.models import Kind
from ahgateway.tuning.propose import GAIN_NAMES


@dataclass(frozen=True, slots=True)
class Row:
    """One number over all repeats.

    Attributes:
        name: A parameter of the model, or rule and operand.
        values: One for each repeat that has it, in their order.
        claimed: Mean of half the 95 % intervals that the single results claim; None for gains.
    """

    name: str
    values: tuple[float, ...]
    claimed: float | None = None

    @property
    def mean(self) -> float:
        return mean(self.values)

    @property
    def deviation(self) -> float:
        """Standard deviation from repeat to repeat; 0 for a single one."""
        return stdev(self.values) if len(self.values) > 1 else 0.0


@dataclass(frozen=True, slots=True)
class Spread:
    """What repeats say together.

    Attributes:
        count: How many experiments.
        refused: How many of them gave no model.
        kinds: How often each model was chosen; parameters are those of the most frequent.
        rows: Parameters, then the gains of every rule that all of these repeats have.
    """

    count: int
    refused: int
    kinds: tuple[tuple[str, int], ...]
    rows: tuple[Row, ...]


def middle(results: Sequence[Tuning]) -> int:
    """Return the place of the result that speaks for all; the first when every one was refused."""
    gains = {place: each.identified.fit.model.gain for place, each in enumerate(results)
             if each.identified.fit is not None and not each.is_refused}  # fmt: skip
    if not gains:
        return 0
    ordered = sorted(gains, key=lambda place: gains[place])
    return ordered[(len(ordered) - 1) // 2]


def spread(results: Sequence[Tuning]) -> Spread:
    """Return how far the results of repeated experiments lie apart."""
    good = [each for each in results if each.identified.fit is not None and not each.is_refused]
    kinds = Counter(each.identified.fit.model.kind for each in good if each.identified.fit is not None)
    common = kinds.most_common(1)[0][0] if kinds else None
    alike = [each.identified.fit for each in good
             if each.identified.fit is not None and each.identified.fit.model.kind is common]  # fmt: skip
    rows = []
    for name in _parameters(common):
        values = tuple(float(getattr(fit.model, name)) for fit in alike)
        rows.append(Row(name, values, mean(fit.interval[name] for fit in alike)))
    # The gains of a rule are what counts for the loop, whichever model they came from.
    for rule in (proposal.name for proposal in (good[0].found if good else ())):
        found = [each for result in good for each in result.found if each.name == rule]
        if len(found) < len(good):
            continue
        for gain in GAIN_NAMES:
            numbers = tuple(float(each.settings[gain]) for each in found if gain in each.settings)
            if any(numbers):
                rows.append(Row(f"{rule} {gain}", numbers))
    counted = tuple((kind.value, times) for kind, times in kinds.most_common())
    return Spread(len(results), len(results) - len(good), counted, tuple(rows))


def _parameters(kind: Kind | None) -> tuple[str, ...]:
    if kind is None:
        return ()
    also = {Kind.FOPDT: ("tau_s",), Kind.SOPDT: ("tau_s", "zeta"), Kind.IPDT: ()}[kind]
    return ("gain", "dead_time_s", *also)


HEADS = ("repeats", "mean", "deviation", "smallest", "largest", "claimed ±")


def cells(row: Row) -> list[str]:
    """Return one row of text under `HEADS`."""
    claimed = "-" if row.claimed is None else f"{row.claimed:.2g}"
    numbers = (f"{row.mean:.4g}", f"{row.deviation:.2g}", f"{min(row.values):.4g}", f"{max(row.values):.4g}")
    return [row.name, *numbers, claimed]


def as_text(found: Spread, rules: Sequence[str] = ()) -> str:
    """Return the spread as a table: the model, and the gains of these rules; the report and the JSON form have all."""
    shown = [row for row in found.rows if row.claimed is not None or row.name.rpartition(" ")[0] in rules]
    models = ", ".join(f"{name} {times} times" for name, times in found.kinds) or "no model"
    table = [list(HEADS), *(cells(row) for row in shown)]
    widths = [max(len(row[column]) for row in table) for column in range(len(HEADS))]
    lines = [f"{found.count} experiments, {found.refused} refused: {models}"]
    lines += ["  " + "  ".join(f"{cell:<{wide}}" for cell, wide in zip(row, widths, strict=True)).rstrip()
              for row in table]  # fmt: skip
    return "\n".join(lines)


def as_json(found: Spread) -> dict[str, Any]:
    """Return the spread as one object."""
    return {
        "count": found.count,
        "refused": found.refused,
        "models": dict(found.kinds),
        "rows": [
            {
                "name": row.name, "mean": row.mean, "deviation": row.deviation,
                "values": list(row.values), "claimed": None if row.claimed is None else number(row.claimed),
            }
            for row in found.rows
        ],
    }  # fmt: skip
