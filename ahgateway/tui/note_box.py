"""Asks for one line of text: a note, or a moment to go to."""

from __future__ import annotations

from typing import ClassVar

from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.screen import ModalScreen
from textual.widgets import Input, Label


class NoteBox(ModalScreen[str]):
    """Returns the text, empty when it was given up."""

    DEFAULT_CSS = """
    NoteBox { align: center middle; }
    NoteBox Label { width: 70%; padding: 0 1; background: $panel; }
    NoteBox Input { width: 70%; }
    """
    BINDINGS: ClassVar[list[BindingType]] = [Binding("escape", "give_up", "give up")]

    def __init__(self, label: str) -> None:
        super().__init__()
        self._label = label

    def compose(self) -> ComposeResult:
        """Label and line."""
        yield Label(f"{self._label}; Escape gives up")
        yield Input(max_length=500)

    def on_input_submitted(self, event: Input.Submitted) -> None:
        """Hand back what was written."""
        self.dismiss(event.value.strip())

    def action_give_up(self) -> None:
        """Hand back nothing."""
        self.dismiss("")
