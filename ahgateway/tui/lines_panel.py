"""Lines of styled text that scroll, drawn line by line: nothing is laid out again when a number changes."""

from __future__ import annotations

from collections.abc import Iterable

from rich.cells import cell_len
from rich.segment import Segment
from rich.style import Style
from textual.geometry import Size
from textual.scroll_view import ScrollView
from textual.strip import Strip

Line = tuple[tuple[str, str], ...]
"""Parts of one line: text and its style in rich's words, `` for none."""


def plain(text: str) -> Line:
    """A line without styles."""
    return ((text, ""),)


class LinesPanel(ScrollView):
    """Put lines in; what did not change is not drawn again."""

    DEFAULT_CSS = "LinesPanel { height: 1fr; scrollbar-size-vertical: 1; }"
    can_focus = False

    def __init__(self, *, fits: bool = False, id: str | None = None) -> None:
        """Make an empty panel; one that `fits` is as high as it has lines."""
        super().__init__(id=id)
        self._fits = fits
        self._lines: list[Line] = []

    def put(self, lines: Iterable[Line]) -> None:
        """Show these lines."""
        found = list(lines)
        if found == self._lines:
            return
        if len(found) != len(self._lines) and self._fits:
            self.styles.height = len(found)
        self._lines = found
        width = max((sum(cell_len(text) for text, _ in line) for line in found), default=0)
        if self.virtual_size != (width, len(found)):
            self.virtual_size = Size(width, len(found))
        self.refresh()

    def render_line(self, y: int) -> Strip:
        """Return one line of what is in sight."""
        scroll_x, scroll_y = self.scroll_offset
        width = self.scrollable_content_region.width
        base = self.rich_style
        index = y + scroll_y
        parts = self._lines[index] if index < len(self._lines) else ()
        strip = Strip([Segment(text, base + Style.parse(style) if style else base) for text, style in parts])
        return strip.crop_extend(scroll_x, scroll_x + width, base)


def columns(rows: list[tuple[tuple[str, str], ...]], right: frozenset[int]) -> list[Line]:
    """Return rows as lines with columns of equal width, two spaces apart; those in `right` stand at the right."""
    if not rows:
        return []
    widths = [max(cell_len(row[index][0]) for row in rows) for index in range(len(rows[0]))]
    return [
        tuple(
            (
                (" " * (width - cell_len(text)) + text if index in right else text + " " * (width - cell_len(text)))
                + ("  " if index + 1 < len(row) else ""),
                style,
            )
            for index, ((text, style), width) in enumerate(zip(row, widths, strict=True))
        )
        for row in rows
    ]
