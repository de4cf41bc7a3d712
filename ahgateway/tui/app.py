"""The screen that stays open all day: loops, one loop, link, log. A view of a board; it cannot write to a PLC.

Reports change the board only; the screen follows eight times a second and draws nothing but the page in front.
"""

from __future__ import annotations

import asyncio
import contextlib
import locale
import sys
from collections.abc import AsyncIterator, Callable, Sequence
from typing import ClassVar

from textual.app import App, ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal, Vertical
from textual.filter import LineFilter
from textual.screen import Screen
from textual.widgets import Input, TabbedContent, TabPane

from ahgateway.apps.board import Board, Note
from ahgateway.apps.lanes import lanes_of
from ahgateway.apps.lines import clock_time
from ahgateway.apps.moments import moment_ns
from ahgateway.apps.player import Player
from ahgateway.apps.rows import loop_row
from ahgateway.apps.signs import is_legacy
from ahgateway.clock import SECOND
from ahgateway.errors import ProfileError, StateError
from ahgateway.tui.console import StandIns
from ahgateway.tui.event_log import EventLog
from ahgateway.tui.health_panel import health_lines
from ahgateway.tui.keys_line import KeysLine
from ahgateway.tui.lines_panel import Line, LinesPanel, plain
from ahgateway.tui.link_page import link_lines
from ahgateway.tui.loops_table import STYLE, LoopsTable
from ahgateway.tui.note_box import NoteBox
from ahgateway.tui.operands_panel import operand_lines
from ahgateway.tui.terms_panel import terms_lines
from ahgateway.tui.trend import SPANS_S, Trend

REDRAWS_PER_SECOND = 8
PLAYING = frozenset({"pause", "skip", "speed", "go"})
"""Actions that only a recording has."""
ONLY_ON = {"trouble": "loops", "turn": "loop", "span": "loop", "plain": "loop"}
"""Actions that only one page has."""
BREAKPOINTS = ((0, "-narrow"), (132, "-wide"))
"""From so many columns on, the loop page stands in two columns."""


class MonitorApp(App[None]):
    """Whoever runs the monitor feeds the board; the screen ends when the user quits or `exit` is called."""

    ENABLE_COMMAND_PALETTE = False
    CSS = """
    Screen { overflow: hidden; }
    #status { height: 1; background: $panel; overflow: hidden; }
    TabbedContent { height: 1fr; }
    TabbedContent > ContentSwitcher { height: 1fr; }
    TabPane { height: 1fr; padding: 0 1; }
    #loop-head { height: 1; overflow: hidden; }
    #loop-left { width: 1fr; }
    #loop-right { width: 68; padding-left: 2; }
    #terms, #health, #operands { margin-top: 1; }
    .-narrow #loop-body { layout: vertical; overflow-y: auto; }
    .-narrow #loop-left, .-narrow #loop-right { width: 100%; height: auto; padding-left: 0; }
    .-narrow Trend { height: 14; }
    .-narrow #operands { height: 24; }
    """
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("1", "page('loops')", "loops", show=False),
        Binding("2", "page('loop')", "loop", show=False),
        Binding("3", "page('link')", "link", show=False),
        Binding("4", "page('log')", "log", show=False),
        Binding("q,ctrl+c", "quit", "quit", key_display="q"),
        Binding("n", "note", "note"),
        Binding("m", "mark", "marker"),
        Binding("space", "pause", "pause", priority=True),
        Binding("left", "skip(-10)", "10 s back", key_display="←", priority=True),
        Binding("right", "skip(10)", "on", key_display="→", priority=True),
        Binding("shift+left", "skip(-60)", show=False, priority=True),
        Binding("shift+right", "skip(60)", show=False, priority=True),
        Binding("less_than_sign,comma", "speed(-1)", "slower", key_display="<"),
        Binding("greater_than_sign,full_stop", "speed(1)", "faster", key_display=">"),
        Binding("g", "go", "go to"),
        Binding("t", "trouble", "only what needs a look"),
        Binding("slash", "filter", "filter", key_display="/"),
        Binding("left_square_bracket", "turn(-1)", "previous", key_display="["),
        Binding("right_square_bracket", "turn(1)", "next", key_display="]"),
        Binding("plus,equals_sign", "span(1)", "longer", key_display="+"),
        Binding("minus", "span(-1)", "shorter", key_display="-"),
        Binding("a", "plain", "ASCII"),
        Binding("up", "scroll(0, -1)", show=False),
        Binding("down", "scroll(0, 1)", show=False),
        Binding("pageup", "scroll(0, -10)", show=False),
        Binding("pagedown", "scroll(0, 10)", show=False),
        Binding("home", "scroll(0, -100000)", show=False),
        Binding("end", "scroll(0, 100000)", show=False),
        Binding("left", "scroll(-10, 0)", show=False),
        Binding("right", "scroll(10, 0)", show=False),
    ]

    def __init__(
        self,
        board: Board,
        title: str,
        *,
        on_note: Callable[[Note], None] | None = None,
        player: Player | None = None,
        encoding: str = "",
        is_ticking: bool = True,
    ) -> None:
        """Make the screen.

        Args:
            board: What is shown.
            title: What the station is called.
            on_note: Is told every note and marker, to keep them.
            player: Plays the recording that is shown; None for a live run.
            encoding: What the console can show; "" asks the system.
            is_ticking: False when the caller redraws.
        """
        super().__init__()
        self.HORIZONTAL_BREAKPOINTS = list(BREAKPOINTS)
        self._board = board
        self._title = title
        self._on_note = on_note
        self._player = player
        encoding = encoding or sys.stdout.encoding or locale.getpreferredencoding(False)
        self._is_legacy = is_legacy(encoding)
        self._stand_ins = StandIns(encoding)
        self._is_ticking = is_ticking
        self._names = list(board.watches)
        self._chosen = self._names[0]
        self._span = 0
        self._marks = 0
        self._keys_of = "loops"
        self.redraws = 0

    def compose(self) -> ComposeResult:
        """Status above, four pages, keys below."""
        yield LinesPanel(id="status")
        with TabbedContent(initial="loops"):
            with TabPane("1 loops", id="loops"):
                yield LoopsTable(self._board)
            with TabPane("2 loop", id="loop"):
                yield LinesPanel(id="loop-head")
                with Horizontal(id="loop-body"):
                    with Vertical(id="loop-left"):
                        yield Trend(id="trend")
                        yield LinesPanel(fits=True, id="health")
                    with Vertical(id="loop-right"):
                        yield LinesPanel(fits=True, id="terms")
                        yield LinesPanel(id="operands")
            with TabPane("3 link", id="link"):
                yield LinesPanel(id="link-lines")
            with TabPane("4 log", id="log"):
                yield EventLog(self._board)
        yield KeysLine()

    def on_mount(self) -> None:
        """Start to redraw; a console that cannot show Braille gets plain characters."""
        self.query_one(Trend).is_plain = self._is_legacy
        self.query_one(LoopsTable).take_focus()
        if self._is_ticking:
            self.set_interval(1 / REDRAWS_PER_SECOND, self.redraw)

    def get_line_filters(self) -> Sequence[LineFilter]:
        """Stand-ins come last, where the console lacks our signs."""
        found = super().get_line_filters()
        return [*found, self._stand_ins] if self._is_legacy else found

    def redraw(self) -> None:
        """Bring the page in front up to date, and the figures of one loop's health."""
        self.redraws += 1
        board = self._board
        board.health(self._chosen if self.page == "loop" else board.oldest_health())
        self._base.query_one("#status", LinesPanel).put([self._status()])
        if self.page == "loops":
            self._base.query_one(LoopsTable).show()
        elif self.page == "loop":
            self._loop_page()
        elif self.page == "link":
            panel = self._base.query_one("#link-lines", LinesPanel)
            panel.put(plain(line) for line in link_lines(board, max(20, panel.size.width - 36)))
        else:
            self._base.query_one(EventLog).show()

    @property
    def page(self) -> str:
        """Name of the page in front."""
        return self._base.query_one(TabbedContent).active

    @property
    def _base(self) -> Screen[object]:
        """The screen of the pages, also while a box that asks for a note lies above it."""
        return self.screen_stack[0]

    def _status(self) -> Line:
        monitor = self._board.monitor
        link = "link up" if monitor.is_up else "LINK DOWN"
        diverged = sum(watch.follower.counts.diverged > 0 for watch in monitor.watches)
        stale = sum(self._board.freshness(watch).is_stale for watch in monitor.watches)
        count = len(monitor.watches)
        parts = [self._title, f"{count} loop{'s' if count != 1 else ''}", link]
        if stale:
            parts.append(f"{stale} STALE")
        parts.append(f"{diverged} DIVERGED" if diverged else "none diverged")
        parts.append(clock_time(self._board.clock.utc_ns()).partition(".")[0] + "Z")
        if self._player is not None:
            parts.append(self._player.text())
        alarm = not monitor.is_up or diverged or stale
        return (("  │  ".join(parts), "bold reverse" if alarm else ""),)

    def _loop_page(self) -> None:
        board, name = self._board, self._chosen
        watch = board.watches[name]
        row = loop_row(board, watch)
        word, counts = row.word, row.counts
        fresh = board.freshness(watch)
        age = "no picture" if fresh.age_ns is None else f"{fresh.age_ns / SECOND:.1f} s old"
        head = (
            (name, "bold"),
            (f"  {watch.loop.controller.name}  ", ""),
            (word, STYLE.get(word, "")),
            (f"  proven {counts.proven} of {counts.total} ({row.coverage})  diverged {counts.diverged}", ""),
            (f"  {age}", ""),
        )
        self._base.query_one("#loop-head", LinesPanel).put([head])
        until_s = board.clock.utc_ns() / SECOND
        span_s = SPANS_S[self._span]
        trace = board.trails.trails[name].trace(until_s - span_s)
        units = (watch.loop.pv_unit, watch.loop.mv_unit)
        trend = self._base.query_one(Trend)
        trend.show(trace, until_s, span_s, units, lanes_of(watch.loop), is_stale=fresh.is_stale)
        terms, operands, figures = (
            self._base.query_one(f"#{id}", LinesPanel) for id in ("terms", "operands", "health")
        )
        terms.put(terms_lines(board, watch, terms.size.width))
        operands.put(operand_lines(board, watch))
        lines = health_lines(board.known_health(name), board.statement(name), units, figures.size.width)
        figures.put(plain(line) for line in lines)

    def action_page(self, name: str) -> None:
        """Bring a page to the front."""
        self._base.query_one(TabbedContent).active = name
        # A key typed into a field that is no longer in front would be lost.
        self.set_focus(None)
        if name == "loops":
            self._base.query_one(LoopsTable).take_focus()
        self.call_after_refresh(self.redraw)

    def action_turn(self, step: int) -> None:
        """Show the next or the previous loop."""
        self._chosen = self._names[(self._names.index(self._chosen) + step) % len(self._names)]
        self.redraw()

    def action_span(self, step: int) -> None:
        """Make the trend longer or shorter."""
        self._span = min(max(self._span + step, 0), len(SPANS_S) - 1)
        self.redraw()

    def action_plain(self) -> None:
        """Change between Braille and ASCII."""
        trend = self._base.query_one(Trend)
        trend.is_plain = not trend.is_plain
        self.redraw()

    def action_scroll(self, x: int, y: int) -> None:
        """Move what is longer or wider than the page; the loops move themselves."""
        is_narrow = self._base.has_class("-narrow")
        moved = {"loop": "#loop-body" if is_narrow else "#operands", "link": "#link-lines", "log": "#log-lines"}
        if self.page in moved:
            self._base.query_one(moved[self.page]).scroll_relative(x, y, animate=False)

    def action_trouble(self) -> None:
        """Show only the loops that need a look, or all of them again."""
        table = self._base.query_one(LoopsTable)
        table.is_filtered = not table.is_filtered
        table.show()

    def action_filter(self) -> None:
        """Go to the log's filter."""
        self.action_page("log")
        self._base.query_one("#log-filter", Input).focus()

    def action_mark(self) -> None:
        """Set a numbered marker now."""
        self._marks += 1
        self._keep(f"marker {self._marks}")

    def action_note(self) -> None:
        """Ask for a note."""
        self.push_screen(NoteBox("note, Enter keeps it"), lambda text: self._keep(text) if text else None)

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool | None:
        """Keys of a page are there on that page; those of the player with one only, never while somebody writes."""
        if action in ONLY_ON:
            return self._keys_of == ONLY_ON[action]
        if action not in PLAYING:
            return True
        return self._player is not None and not isinstance(self.focused, Input)

    def action_pause(self) -> None:
        """Let the recording stand, or go on."""
        if self._player is not None:
            self._player.pause()
            self.redraw()

    def action_speed(self, steps: int) -> None:
        """Play the recording faster or slower."""
        if self._player is not None:
            self._player.faster(steps)
            self.redraw()

    def action_skip(self, seconds: int) -> None:
        """Go on or back in the recording."""
        if self._player is not None:
            self._player.skip(seconds * SECOND)
            self.redraw()

    def action_go(self) -> None:
        """Ask for a moment of the recording."""
        self.push_screen(NoteBox("go to: seconds from the start, or UTC 2026-11-22T03:04:05"), self._go)

    def _go(self, text: str | None) -> None:
        player = self._player
        if not text or player is None:
            return
        try:
            player.seek_utc(moment_ns(text, "go to", player.first_utc_ns))
        except ProfileError as error:
            self.notify(f"{error.message}; {error.hint}", severity="error", timeout=10)
        self.redraw()

    def _keep(self, text: str) -> None:
        note = self._board.note(text)
        if self._on_note is not None:
            self._on_note(note)
        self.notify(text, timeout=2)
        self.redraw()

    def on_loops_table_opened(self, event: LoopsTable.Opened) -> None:
        """Enter or a click on a loop shows its page."""
        self._chosen = event.name
        self.action_page("loop")

    def on_tabbed_content_tab_activated(self, _: TabbedContent.TabActivated) -> None:
        """A tab clicked is drawn as soon as it has its size, and its keys are shown."""
        if self._keys_of != self.page:
            self._keys_of = self.page
            self.refresh_bindings()
        self.call_after_refresh(self.redraw)

    def on_input_submitted(self, _: Input.Submitted) -> None:
        """Enter in the filter gives the keys back."""
        self.set_focus(None)


@contextlib.asynccontextmanager
async def shown(app: MonitorApp, stop: asyncio.Event) -> AsyncIterator[MonitorApp]:
    """Show a screen around a run; when the user quits, `stop` is set.

    Raises:
        StateError: The terminal could not be driven.
    """
    task = asyncio.ensure_future(app.run_async())
    task.add_done_callback(lambda _: stop.set())
    try:
        yield app
    finally:
        if not task.done():
            app.exit()
        await task
    if app.return_code:
        raise StateError("the screen ended with an error", hint="`--plain` prints lines instead")
