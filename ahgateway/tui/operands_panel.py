"""Every operand of one loop with its device and value; what changed is marked, with the value before."""

from __future__ import annotations

from ahgateway.apps.board import Board
from ahgateway.apps.lines import clock_time, shown
from ahgateway.apps.monitor import Watch
from ahgateway.apps.rows import operand_rows
from ahgateway.tui.lines_panel import Line, columns

HEADS = (" ", "operand", "device", "value", "unit", "changed")
RIGHT = frozenset({3})


def operand_lines(board: Board, watch: Watch) -> list[Line]:
    """Return a loop's operands as lines, each changed one with a star and its values."""
    is_stale = board.freshness(watch).is_stale
    rows = [tuple((head, "bold underline" if head != " " else "") for head in HEADS)]
    for row in operand_rows(board, watch):
        style = "bold yellow" if row.change else ""
        history = ""
        if row.change is not None:
            utc_ns, change = row.change
            history = f"{clock_time(utc_ns).partition('.')[0]} {shown(change.old)} -> {shown(change.new)}"
        rows.append(
            (
                ("*" if row.change else " ", style),
                (row.name, style),
                (row.device, ""),
                (f"({row.value})" if is_stale and row.value != "-" else row.value, ""),
                (row.unit, ""),
                (history, style),
            )
        )
    return columns(rows, RIGHT)
