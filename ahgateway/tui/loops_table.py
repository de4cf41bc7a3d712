"""Every loop of the station in one line: verdict, coverage, age, values, health; lines are chosen by key or mouse."""

from __future__ import annotations

from typing import ClassVar

from textual import events
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Vertical
from textual.message import Message

from ahgateway.apps.board import Board
from ahgateway.apps.monitor import Watch
from ahgateway.apps.rows import loop_row
from ahgateway.clock import SECOND
from ahgateway.tui.lines_panel import Line, LinesPanel, columns

COLUMNS = ("loop", "verdict", "proven", "of", "diverged", "SV", "PV", "MV", "mode", "way", "age", "health", "findings")
RIGHT = frozenset({2, 3, 4, 5, 6, 7, 10})
STYLE = {
    "MATCH": "green",
    "DIVERGED": "bold red",
    "UNOBSERVABLE": "yellow",
    "STALE": "bold magenta",
    "LINK DOWN": "bold magenta",
    "REFUSED": "bold magenta",
}


class Rows(LinesPanel):
    """The lines below the head; one of them is chosen."""

    can_focus = True
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("up", "move(-1)", show=False),
        Binding("down", "move(1)", show=False),
        Binding("pageup", "move(-20)", show=False),
        Binding("pagedown", "move(20)", show=False),
        Binding("home", "move(-1000000)", show=False),
        Binding("end", "move(1000000)", show=False),
        Binding("enter", "choose", show=False),
    ]

    class Chosen(Message):
        """Enter or a click: the number of the line, from 0."""

        def __init__(self, index: int) -> None:
            super().__init__()
            self.index = index

    def __init__(self, count: int) -> None:
        super().__init__()
        self.index = 0
        self._count = count

    def action_move(self, step: int) -> None:
        """Choose another line and keep it in sight."""
        self.index = min(max(self.index + step, 0), self._count - 1)
        height = max(1, self.scrollable_content_region.height)
        top = self.scroll_offset.y
        if not top <= self.index < top + height:
            self.scroll_to(y=self.index if self.index < top else self.index - height + 1, animate=False)
        self.post_message(Rows.Chosen(-1))

    def action_choose(self) -> None:
        """Open the chosen line."""
        self.post_message(Rows.Chosen(self.index))

    def on_click(self, event: events.Click) -> None:
        """Choose a line and open it."""
        index = event.y + self.scroll_offset.y
        if 0 <= index < self._count:
            self.index = index
            self.action_choose()


class LoopsTable(Vertical):
    """The first screen."""

    DEFAULT_CSS = "LoopsTable #loops-head { height: 1; overflow: hidden; }"

    class Opened(Message):
        """A loop's page is wanted."""

        def __init__(self, name: str) -> None:
            super().__init__()
            self.name = name

    def __init__(self, board: Board) -> None:
        super().__init__()
        self._board = board
        self._names = list(board.watches)

    def compose(self) -> ComposeResult:
        """A head that stays, lines that scroll."""
        yield LinesPanel(id="loops-head")
        yield Rows(len(self._names))

    def show(self) -> None:
        """Bring every line up to date."""
        rows = self.query_one(Rows)
        head: tuple[tuple[str, str], ...] = tuple((each, "bold underline") for each in COLUMNS)
        lines = columns([head, *(self._row(watch) for watch in self._board.watches.values())], RIGHT)
        marked = [_pointed(line, is_chosen=index == rows.index) for index, line in enumerate(lines[1:])]
        self.query_one("#loops-head", LinesPanel).put([_pointed(lines[0], is_chosen=False)])
        rows.put(marked)

    def take_focus(self) -> None:
        """Give the keys to the lines."""
        self.query_one(Rows).focus()

    def on_rows_chosen(self, event: Rows.Chosen) -> None:
        """Draw the pointer where it is now, or open the loop."""
        if event.index < 0:
            self.show()
        else:
            self.post_message(LoopsTable.Opened(self._names[event.index]))

    def _row(self, watch: Watch) -> tuple[tuple[str, str], ...]:
        row = loop_row(self._board, watch)
        counts = row.counts
        values = [f"({value})" if row.is_stale else value for value in row.values]
        dim = "dim" if row.is_stale else ""
        return (
            (row.name, "bold"),
            (row.word, STYLE.get(row.word, "")),
            (f"{counts.proven} {counts.coverage:.0%}", ""),
            (str(counts.total), ""),
            (str(counts.diverged), "bold red" if counts.diverged else ""),
            *((value, dim) for value in values),
            (row.mode, dim),
            (row.way, dim),
            ("-" if row.age_ns is None else f"{row.age_ns / SECOND:.1f} s", dim),
            (row.health, ""),
            (row.notes, ""),
        )


def _pointed(line: Line, *, is_chosen: bool) -> Line:
    """A line with the pointer before it; the chosen one is underlined too, for eyes that miss the sign."""
    if not is_chosen:
        return (("  ", ""), *line)
    return (("> ", "bold"), *((text, f"{style} underline".strip()) for text, style in line))
