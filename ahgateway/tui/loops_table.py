"""Every loop of the station in one line: verdict, coverage, age, values, health; lines are chosen by key or mouse."""

from __future__ import annotations

from typing import ClassVar

from textual import events
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Vertical
from textual.message import Message

from ahgateway.apps.board import Board
from ahgateway.apps.rows import LoopRow, loop_row
from ahgateway.clock import SECOND
from ahgateway.tui.lines_panel import Line, LinesPanel, columns, plain

COLUMNS = ("loop", "verdict", "proven", "diverged", "age", "SV", "PV", "MV", "mode", "health", "way", "findings")
"""What matters most stands at the left: a terminal of 80 columns shows it up to MV."""
RIGHT = frozenset({2, 3, 4, 5, 6, 7})
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
        Binding("left", "scroll_left", show=False),
        Binding("right", "scroll_right", show=False),
        Binding("enter", "choose", show=False),
    ]

    class Chosen(Message):
        """Enter or a click: the name of the loop; "" when only the pointer moved."""

        def __init__(self, name: str) -> None:
            super().__init__()
            self.name = name

    def __init__(self, names: list[str]) -> None:
        super().__init__()
        self._names = names
        self.index = 0

    def name_lines(self, names: list[str]) -> None:
        """Say which loop each line is; the pointer stays on its loop, or on its place when that is gone."""
        if names != self._names:
            chosen = self._names[self.index] if self._names else ""
            self.index = names.index(chosen) if chosen in names else max(0, min(self.index, len(names) - 1))
            self._names = names

    def action_move(self, step: int) -> None:
        """Choose another line and keep it in sight."""
        self.index = max(0, min(self.index + step, len(self._names) - 1))
        height = max(1, self.scrollable_content_region.height)
        top = self.scroll_offset.y
        if not top <= self.index < top + height:
            self.scroll_to(y=self.index if self.index < top else self.index - height + 1, animate=False)
        self.post_message(Rows.Chosen(""))

    def action_choose(self) -> None:
        """Open the chosen line."""
        if self._names:
            self.post_message(Rows.Chosen(self._names[self.index]))

    def on_click(self, event: events.Click) -> None:
        """Choose a line and open it."""
        index = event.y + self.scroll_offset.y
        if 0 <= index < len(self._names):
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
        self.is_filtered = False

    def compose(self) -> ComposeResult:
        """A head that stays, lines that scroll."""
        yield LinesPanel(id="loops-head")
        yield Rows(list(self._board.watches))

    def on_mount(self) -> None:
        """The head goes along when the lines are moved sideways."""
        self.watch(self.query_one(Rows), "scroll_x", self._sideways, init=False)

    def _sideways(self, scroll_x: float) -> None:
        self.query_one("#loops-head", LinesPanel).scroll_to(x=scroll_x, animate=False, force=True)

    def show(self) -> None:
        """Bring every line up to date."""
        rows = self.query_one(Rows)
        head: tuple[tuple[str, str], ...] = tuple((each, "bold underline") for each in COLUMNS)
        found = [loop_row(self._board, watch) for watch in self._board.watches.values()]
        if self.is_filtered:
            found = [row for row in found if row.needs_a_look]
        rows.name_lines([row.name for row in found])
        lines = columns([head, *(_cells(row) for row in found)], RIGHT)
        marked = [_pointed(line, is_chosen=index == rows.index) for index, line in enumerate(lines[1:])]
        self.query_one("#loops-head", LinesPanel).put([_pointed(lines[0], is_chosen=False)])
        rows.put(marked or [plain("no loop needs a look")])

    def take_focus(self) -> None:
        """Give the keys to the lines."""
        self.query_one(Rows).focus()

    def on_rows_chosen(self, event: Rows.Chosen) -> None:
        """Draw the pointer where it is now, or open the loop."""
        if event.name:
            self.post_message(LoopsTable.Opened(event.name))
        else:
            self.show()


def _cells(row: LoopRow) -> tuple[tuple[str, str], ...]:
    counts = row.counts
    *values, mode = [f"({text})" if row.is_stale and text != "-" else text for text in (*row.values, row.mode)]
    dim = "dim" if row.is_stale else ""
    return (
        (row.name, "bold"),
        (row.word, STYLE.get(row.word, "")),
        (f"{row.coverage} of {counts.total}", ""),
        (str(counts.diverged), "bold red" if counts.diverged else ""),
        ("-" if row.age_ns is None else f"{row.age_ns / SECOND:.1f} s", dim),
        *((value, dim) for value in values),
        (mode, dim),
        (row.health, dim),
        (row.way, dim),
        (row.notes, ""),
    )


def _pointed(line: Line, *, is_chosen: bool) -> Line:
    """A line with the pointer before it; the chosen one is underlined too, for eyes that miss the sign."""
    if not is_chosen:
        return (("  ", ""), *line)
    return (("> ", "bold"), *((text, f"{style} underline".strip()) for text, style in line))
