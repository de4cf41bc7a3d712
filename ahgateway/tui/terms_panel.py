"""P, I, D, BIAS and MV: what the PLC shows beside what the reference computed, with the bits that tell them apart."""

from __future__ import annotations

from textwrap import wrap
from typing import Any

from ahgateway.apps.board import Board
from ahgateway.apps.lines import actuator_text, shown
from ahgateway.apps.monitor import Watch
from ahgateway.apps.rows import TermRow, term_rows
from ahgateway.core import flags
from ahgateway.tui.lines_panel import Line, columns, plain

HIDDEN = "not in memory"
RIGHT = frozenset({1, 2})


def terms_lines(board: Board, watch: Watch, width: int) -> list[Line]:
    """Return the last execution of a loop as lines; a stale side stands in parentheses."""
    picture, last = watch.follower.picture, watch.follower.last
    is_stale = board.freshness(watch).is_stale
    rows = [tuple((head, "bold underline") for head in ("term", "PLC", "reference", "compared"))]
    for row in term_rows(watch):
        left = shown(row.plc) if row.plc is not None else ("-" if picture is None else HIDDEN)
        right = "-" if row.ref is None else f"{'~' if row.is_open else ''}{shown(row.ref)}"
        if is_stale:
            left = left if row.plc is None else f"({left})"
            right = right if row.ref is None else f"({right})"
        rows.append(((row.name, "bold"), (left, ""), (right, ""), _compared(row)))
    terms: Any = last.terms if last is not None else None
    said = ", ".join(flags.names(terms.flags)) if terms is not None else ""
    reason = last.reason if last is not None else "no execution seen yet"
    below = "; ".join(part for part in (actuator_text(terms), said, reason) if part)
    # Two lines are always kept, so that nothing below jumps.
    rest = [*wrap(below, max(20, width)), "", ""][:2]
    return [*columns(rows, RIGHT), *(plain(line) for line in rest)]


def _compared(row: TermRow) -> tuple[str, str]:
    if row.is_same is None:
        return row.compared, ""
    return (f"= {row.compared}", "green") if row.is_same else (f"≠ {row.compared}", "bold red")
