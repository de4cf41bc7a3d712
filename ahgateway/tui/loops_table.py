"""Every loop of the station in one line: verdict, coverage, age, values, health."""

from __future__ import annotations

from rich.text import Text
from textual.widgets import DataTable

from ahgateway.apps.board import Board
from ahgateway.apps.health import label
from ahgateway.apps.monitor import Watch
from ahgateway.clock import SECOND
from ahgateway.tui.lines import shown

COLUMNS = ("loop", "verdict", "proven", "of", "diverged", "SV", "PV", "MV", "mode", "age", "health", "findings")
RIGHT = frozenset({"proven", "of", "diverged", "SV", "PV", "MV", "age"})
STYLE = {
    "MATCH": "green",
    "DIVERGED": "bold red",
    "UNOBSERVABLE": "yellow",
    "STALE": "bold magenta",
    "LINK DOWN": "bold magenta",
    "REFUSED": "bold magenta",
}


class LoopsTable(DataTable[Text]):
    """The first screen; only cells that changed are written."""

    def __init__(self, board: Board) -> None:
        super().__init__(cursor_type="row", zebra_stripes=True, id="loops-table")
        self._board = board
        self._written: dict[tuple[str, str], Text] = {}

    def on_mount(self) -> None:
        """Lay out columns and rows once; loops do not come and go."""
        for head in COLUMNS:
            self.add_column(Text(head, justify="right" if head in RIGHT else "left"), key=head)
        for name, watch in self._board.watches.items():
            row = self._row(watch)
            self.add_row(*row.values(), key=name)
            self._written.update({(name, head): cell for head, cell in row.items()})

    def show(self) -> None:
        """Bring the cells up to date."""
        for name, watch in self._board.watches.items():
            for head, cell in self._row(watch).items():
                before = self._written.get((name, head))
                if before is None or before.plain != cell.plain or before.style != cell.style:
                    self.update_cell(name, head, cell, update_width=before is None or len(before) < len(cell))
                    self._written[name, head] = cell

    def _row(self, watch: Watch) -> dict[str, Text]:
        board, name = self._board, watch.loop.name
        picture = watch.follower.picture
        fresh = board.freshness(watch)
        word = board.word(watch)
        counts = watch.follower.summary()
        values = ["-"] * 3
        mode, age = "-", "-"
        if picture is not None and fresh.age_ns is not None:
            values = [shown(value) for value in (picture.inputs.sv, picture.inputs.pv, picture.seen["MV"])]
            mode = mode_word(picture.inputs)
            age = f"{fresh.age_ns / SECOND:.1f} s"
        if fresh.is_stale:
            values = [f"({value})" for value in values]
        dim = "dim" if fresh.is_stale else ""
        cells = {
            "loop": (name, "bold"),
            "verdict": (word, STYLE.get(word, "")),
            "proven": (f"{counts.proven} {counts.coverage:.0%}", ""),
            "of": (str(counts.total), ""),
            "diverged": (str(counts.diverged), "bold red" if counts.diverged else ""),
            "SV": (values[0], dim),
            "PV": (values[1], dim),
            "MV": (values[2], dim),
            "mode": (mode, dim),
            "age": (age, dim),
            "health": (label(board.known_health(name)), ""),
            "findings": (watch.refused or ", ".join(watch.follower.findings), ""),
        }
        return {
            head: Text(text, style, justify="right" if head in RIGHT else "left")
            for head, (text, style) in cells.items()
        }


def mode_word(inputs: object) -> str:
    """Return `auto`, `manual`, `tuning` or `off` from a controller's inputs."""
    if not getattr(inputs, "pid_run", True):
        return "off"
    if getattr(inputs, "pid_mode", 0) == 1:
        return "tuning"
    return "manual" if getattr(inputs, "pid_man", False) else "auto"
