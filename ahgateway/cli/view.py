"""How a monitor's reports reach the terminal or the pipe: live table, plain lines or JSON lines."""

from __future__ import annotations

import json
import sys
from enum import Enum
from types import TracebackType
from typing import TYPE_CHECKING

import typer

if TYPE_CHECKING:
    from ahgateway.apps.monitor import Monitor, Report
    from ahgateway.clock import Clock
    from ahgateway.tui.live import LiveTable


class Output(Enum):
    """What stdout carries."""

    TEXT = "text"
    JSON = "json"


class View:
    """Shows reports as they come and the summary at the end; a context manager around the run."""

    def __init__(
        self,
        monitor: Monitor,
        clock: Clock,
        output: Output,
        coverage_min: float,
        title: str,
        *,
        is_table: bool = True,
        has_screen: bool = False,
    ) -> None:
        """Prepare.

        Args:
            monitor: Whose reports come.
            clock: The clock of the run.
            output: What stdout carries.
            coverage_min: What the summary is argued with.
            title: Stands above the table.
            is_table: In a terminal, a table; False for lines there too.
            has_screen: A screen shows the reports; only the summary is left.
        """
        self._monitor = monitor
        self._is_table = is_table and not has_screen
        self._has_screen = has_screen
        self._clock = clock
        self._output = output
        self._coverage_min = coverage_min
        self._title = title
        self._live: LiveTable | None = None
        self._status_ns: dict[str, int] = {}

    def __enter__(self) -> View:
        if self._is_table and self._output is Output.TEXT and sys.stdout.isatty():
            from rich.console import Console

            from ahgateway.tui.live import LiveTable

            self._live = LiveTable(self._monitor, self._clock, Console(), self._title)
            self._live.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._live is not None:
            self._live.__exit__(kind, error, trace)
        if kind is not None:
            return
        if self._output is Output.JSON:
            from ahgateway.apps.report import summary_json

            for watch in self._monitor.watches:
                print_json(summary_json(self._monitor, watch.follower, self._clock.utc_ns(), self._coverage_min))
            return
        from ahgateway.apps.lines import summary_lines

        for line in summary_lines(self._monitor, self._coverage_min):
            typer.echo(line)

    def show(self, report: Report) -> None:
        """Take in one report."""
        if self._has_screen:
            return
        if self._output is Output.JSON:
            from ahgateway.apps.report import as_json

            found = as_json(report)
            if found is not None:
                print_json(found)
        elif self._live is not None:
            self._live.show(report)
        else:
            self._plain(report)

    def note(self, line: str) -> None:
        """Say something that is no report: below the table, or on stderr."""
        if self._live is not None:
            self._live.note(line)
        else:
            typer.echo(line, err=True)

    def _plain(self, report: Report) -> None:
        from ahgateway.apps.lines import event_line, status_line
        from ahgateway.apps.monitor import Sample
        from ahgateway.clock import SECOND

        line = event_line(report)
        if line is not None:
            typer.echo(line)
        if isinstance(report.event, Sample) and report.utc_ns - self._status_ns.get(report.loop, 0) >= SECOND:
            self._status_ns[report.loop] = report.utc_ns
            follower = next(watch.follower for watch in self._monitor.watches if watch.loop.name == report.loop)
            way = self._monitor.way(report.loop)
            typer.echo(status_line(follower, report.utc_ns, self._clock.now_ns(), way))


def print_json(found: dict[str, object]) -> None:
    """Print one object as one line."""
    typer.echo(json.dumps(found, allow_nan=False, ensure_ascii=False))
