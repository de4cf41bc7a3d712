"""The keys at the foot of the screen, of the page in front."""

from __future__ import annotations

from textual.app import ComposeResult
from textual.widgets import Footer


class KeysLine(Footer):
    """A footer that forgets the keys that it showed before.

    Textual's own keeps every key it ever made as a watcher of `compact` until `compact` changes: some 300 kB for each
    page that is turned to.
    """

    def compose(self) -> ComposeResult:
        """Drop the watchers that are gone, then show what is bound now."""
        self.mutate_reactive(Footer.compact)
        yield from super().compose()
