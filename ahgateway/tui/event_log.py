"""What happened, newest last, with a filter: each word must occur in a line, `-word` must not."""

from __future__ import annotations

from textual.app import ComposeResult
from textual.containers import Vertical
from textual.widgets import Input, RichLog

from ahgateway.apps.board import Board, Note
from ahgateway.apps.monitor import Report
from ahgateway.apps.rows import log_line


class EventLog(Vertical):
    """Filter above, lines below."""

    # The place of the scroll bar is kept free: a line is wrapped once, for the room that stays.
    DEFAULT_CSS = "EventLog Input { height: 3; } EventLog RichLog { height: 1fr; scrollbar-gutter: stable; }"

    def __init__(self, board: Board, *, id: str | None = None) -> None:
        super().__init__(id=id)
        self._board = board
        self._shown = 0
        self._cuts = 0

    def compose(self) -> ComposeResult:
        """Filter and log."""
        yield Input(placeholder="filter: TIC-101 diverged -operand", id="log-filter")
        yield RichLog(max_lines=2000, wrap=True, id="log-lines")

    def show(self) -> None:
        """Add what is new; begin again where a recording was sought in."""
        if self._cuts != self._board.cut_count:
            self._cuts = self._board.cut_count
            self._again()
            return
        new = self._board.event_count - self._shown
        if new <= 0:
            return
        self._shown = self._board.event_count
        self._write(list(self._board.events)[-new:])

    def on_resize(self) -> None:
        """Wrap again for another width."""
        self._again()

    def on_input_changed(self, _: Input.Changed) -> None:
        """Begin again with what the filter lets through."""
        self._again()

    def _again(self) -> None:
        self.query_one(RichLog).clear()
        self._shown = self._board.event_count
        self._write(list(self._board.events))

    def _write(self, events: list[Report | Note]) -> None:
        wanted = self.query_one(Input).value
        log = self.query_one(RichLog)
        for event in events:
            line = log_line(event)
            if line is not None and lets_through(wanted, line):
                log.write(line)


def lets_through(wanted: str, line: str) -> bool:
    """Tell whether a line passes a filter; upper and lower case are one."""
    text = line.lower()
    for word in wanted.lower().split():
        is_against = word.startswith("-") and len(word) > 1
        if (word[1:] in text) if is_against else (word not in text):
            return False
    return True
