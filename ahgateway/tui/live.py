"""The live table of a terminal: every loop with values, terms, verdict and coverage; at most ten redraws a second."""

from __future__ import annotations

from collections import deque
from types import TracebackType

from rich.console import Console, Group
from rich.live import Live
from rich.table import Table
from rich.text import Text

from ahgateway.apps.lines import event_line, link_line, shown
from ahgateway.apps.monitor import Monitor, Report
from ahgateway.clock import SECOND, Clock
from ahgateway.core.verdict import Verdict
from ahgateway.lockstep.follow import Follower, output_of, process_value_of, target_of, verdict_now

REDRAWS_PER_SECOND = 8
EVENTS_SHOWN = 8
STALE_NS = 2 * SECOND
STYLE = {Verdict.MATCH: "green", Verdict.DIVERGED: "bold red", Verdict.UNOBSERVABLE: "yellow", Verdict.LINK: "magenta"}


class LiveTable:
    """A rich live display; use as a context manager, feed it reports."""

    def __init__(self, monitor: Monitor, clock: Clock, console: Console, title: str) -> None:
        self._monitor = monitor
        self._clock = clock
        self._title = title
        self._events: deque[str] = deque(maxlen=EVENTS_SHOWN)
        self._live = Live(console=console, auto_refresh=False, get_renderable=self._draw, transient=False)
        self._drawn_ns = 0

    def __enter__(self) -> LiveTable:
        self._live.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._live.refresh()
        self._live.stop()

    def note(self, line: str) -> None:
        """Add a line below the table."""
        self._events.append(line)
        self.tick()

    def show(self, report: Report) -> None:
        """Take in a report; the screen follows within an eighth of a second."""
        line = event_line(report)
        if line is not None:
            self._events.append(line)
        self.tick()

    def tick(self) -> None:
        """Redraw when it is time."""
        now_ns = self._clock.now_ns()
        if now_ns - self._drawn_ns >= SECOND // REDRAWS_PER_SECOND:
            self._drawn_ns = now_ns
            self._live.refresh()

    def _draw(self) -> Group:
        table = Table(title=self._title, expand=True)
        for head in ("loop", "SV", "PV", "MV", "P", "I", "D", "BIAS", "verdict", "proven", "diverged", "age"):
            table.add_column(head, justify="left" if head in ("loop", "verdict") else "right", no_wrap=True)
        for watch in self._monitor.watches:
            table.add_row(*self._row(watch.follower))
        lines = [Text(line, overflow="fold") for line in self._events]
        return Group(table, Text(link_line(self._monitor.link.target, self._monitor.link.figures)), *lines)

    def _row(self, follower: Follower) -> list[Text]:
        picture = follower.picture
        if picture is None:
            state = "LINK DOWN" if not self._monitor.is_up else "WAITING"
            return [Text(follower.loop.name), *[Text("-")] * 7, Text(state, "magenta"), *[Text("-")] * 3]
        age_ns = self._clock.now_ns() - picture.last_ns
        is_stale = age_ns > STALE_NS
        terms = follower.last.terms if follower.last else None
        loop = follower.loop
        values = [target_of(loop, picture), process_value_of(loop, picture), output_of(loop, picture)]
        cells = [shown(value) for value in values]
        cells += [shown(getattr(terms, name)) if hasattr(terms, name) else "-" for name in ("p", "i", "d", "bias")]
        counts = follower.summary()
        verdict = verdict_now(follower)
        label = verdict.value if verdict else (", ".join(follower.findings) or "WAITING")
        return [
            Text(follower.loop.name),
            *(Text(f"({cell})" if is_stale else cell, "dim" if is_stale else "") for cell in cells),
            Text("STALE" if is_stale else label, STYLE.get(verdict, "") if verdict else ""),
            Text(f"{counts.proven}/{counts.total} {counts.coverage:.0%}"),
            Text(str(counts.diverged), "bold red" if counts.diverged else ""),
            Text(f"{age_ns / SECOND:.1f} s"),
        ]
