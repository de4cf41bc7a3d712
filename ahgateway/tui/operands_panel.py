"""Every operand of one loop with its device and value; what changed is marked, with the value before."""

from __future__ import annotations

from ahgateway.apps.board import Board
from ahgateway.apps.lines import clock_time, shown
from ahgateway.apps.monitor import Watch
from ahgateway.codec.station import Const, Loop
from ahgateway.core.operands import Kind, Operand
from ahgateway.tui.lines_panel import Line, columns

HEADS = (" ", "operand", "device", "value", "unit", "changed")
RIGHT = frozenset({3})


def operand_lines(board: Board, watch: Watch) -> list[Line]:
    """Return a loop's operands as lines, each changed one with a star and its values."""
    picture = watch.follower.picture
    is_stale = board.freshness(watch).is_stale
    changes = board.changes[watch.loop.name]
    rows = [tuple((head, "bold underline" if head != " " else "") for head in HEADS)]
    for operand in watch.loop.controller.operands:
        if operand.kind is Kind.BLOCK:
            continue
        value = getattr(picture.inputs, operand.attr, None) if picture is not None else None
        if value is None and picture is not None:
            value = picture.seen.get(operand.name)
        text = "-" if value is None else shown(value)
        change = changes.get(operand.name)
        style = "bold yellow" if change else ""
        history = ""
        if change is not None:
            when = clock_time(change[0]).partition(".")[0]
            history = f"{when} {shown(change[1].old)} -> {shown(change[1].new)}"
        rows.append(
            (
                ("*" if change else " ", style),
                (operand.name, style),
                (where(watch.loop, operand), ""),
                (f"({text})" if is_stale and value is not None else text, ""),
                (unit(watch.loop, operand), ""),
                (history, style),
            )
        )
    return columns(rows, RIGHT)


def where(loop: Loop, operand: Operand) -> str:
    """The operand's device as the program writes it; a literal has none."""
    binding = loop.bindings.get(operand.name)
    if binding is None:
        return "-"
    return "literal" if isinstance(binding, Const) else str(binding)


def unit(loop: Loop, operand: Operand) -> str:
    """The operand's unit, the loop's own where it is PV or MV."""
    return {"PV": loop.pv_unit, "MV": loop.mv_unit}.get(operand.unit, operand.unit)
