"""A filter over the whole screen for consoles that lack our signs."""

from __future__ import annotations

from rich.segment import Segment
from textual.color import Color
from textual.filter import LineFilter

from ahgateway.apps.signs import shown_in


class StandIns(LineFilter):
    """Shows each sign that the console's encoding lacks by its stand-in of the same width."""

    def __init__(self, encoding: str) -> None:
        super().__init__()
        self._encoding = encoding

    def apply(self, segments: list[Segment], background: Color) -> list[Segment]:
        """Return the segments of one line with stand-ins."""
        return [
            Segment(shown_in(text, self._encoding), style, control) if not text.isascii() else segment
            for segment in segments
            for text, style, control in (segment,)
        ]
