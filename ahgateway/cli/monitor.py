"""`ahgateway monitor`: follow every loop of a profile on a live PLC."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Callable
from enum import Enum
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from ahgateway.apps.monitor import Monitor, Report
    from ahgateway.clock import Clock
    from ahgateway.codec.station import Station


class Output(Enum):
    """What stdout carries."""

    TEXT = "text"
    JSON = "json"


def monitor(
    profile: Annotated[str, typer.Argument(help="Profile file, or the name of a shipped example such as `demo`.")],
    target: Annotated[
        str | None,
        typer.Option(help="Link to use instead of the profile's, such as modbus+tcp://192.0.2.10:502?unit=1."),
    ] = None,
    duration: Annotated[float | None, typer.Option(help="Stop after so many seconds.", min=0.0)] = None,
    output: Annotated[Output, typer.Option(help="text for people, json for one object per line.")] = Output.TEXT,
    coverage: Annotated[
        float, typer.Option(help="Smallest share of executions proven by bits for exit code 0.", min=0.0, max=1.0)
    ] = 0.0,
) -> None:
    """Follow every loop of a profile and compare each execution with the reference.

    Only reads. In a terminal it draws a live table; otherwise it prints plain lines, or JSON lines with --output
    json. Ends at --duration or with Ctrl-C. Exit code 0 when executions were compared and none diverged, 1 when one
    diverged, 3 when nothing could be compared or less than --coverage.

    Example: ahgateway monitor line3.toml --target modbus+tcp://192.0.2.10:502?unit=1 --duration 60
    """
    from ahgateway.clock import WallClock
    from ahgateway.schema.profile import load

    station = load(profile).station()
    code = asyncio.run(_monitor(station, target or station.target, WallClock(), duration, output, coverage))
    raise typer.Exit(code)


async def _monitor(
    station: Station, target: str, clock: Clock, duration_s: float | None, output: Output, coverage_min: float
) -> int:
    from dataclasses import replace

    from ahgateway.apps.monitor import Monitor
    from ahgateway.cli.interrupt import stop_event
    from ahgateway.clock import SECOND
    from ahgateway.core.verdict import outcome
    from ahgateway.transports.uri import open_link, parse_uri

    unit = parse_uri(target).options.get("unit")
    if unit is not None:
        station = replace(station, unit=int(unit))
    link = open_link(target, clock, station.pacing)
    watched = Monitor(station, link, clock)
    duration_ns = None if duration_s is None else round(duration_s * SECOND)
    try:
        with stop_event() as stop, view(watched, clock, output, coverage_min, station.name) as show:
            async for report in watched.reports(duration_ns=duration_ns, stop=stop):
                show(report)
    finally:
        await link.close()
    return int(outcome(watched.total(), coverage_min))


class view:  # noqa: N801 - reads as a function: `with view(...) as show`
    """The way a monitor's reports reach the person or the pipe; ends with the summary."""

    def __init__(self, monitor: Monitor, clock: Clock, output: Output, coverage_min: float, title: str) -> None:
        self._monitor = monitor
        self._clock = clock
        self._output = output
        self._coverage_min = coverage_min
        self._title = title
        self._status_ns: dict[str, int] = {}

    def __enter__(self) -> Callable[[Report], None]:
        if self._output is Output.JSON:
            return self._json
        if sys.stdout.isatty():
            from rich.console import Console

            from ahgateway.tui.live import LiveTable

            self._live = LiveTable(self._monitor, self._clock, Console(), self._title)
            self._live.__enter__()
            return self._live.show
        return self._plain

    def __exit__(self, *details: object) -> None:
        if hasattr(self, "_live"):
            self._live.__exit__(None, None, None)
        if details[0] is not None:
            return
        if self._output is Output.JSON:
            from ahgateway.apps.report import summary_json

            for watch in self._monitor.watches:
                utc_ns = self._clock.utc_ns()
                _print_json(summary_json(self._monitor, watch.follower, utc_ns, self._coverage_min))
            return
        from ahgateway.tui.lines import summary_lines

        for line in summary_lines(self._monitor, self._coverage_min):
            typer.echo(line)

    def _json(self, report: Report) -> None:
        from ahgateway.apps.report import as_json

        found = as_json(report)
        if found is not None:
            _print_json(found)

    def _plain(self, report: Report) -> None:
        from ahgateway.apps.monitor import Sample
        from ahgateway.clock import SECOND
        from ahgateway.tui.lines import event_line, status_line

        line = event_line(report)
        if line is not None:
            typer.echo(line)
        if isinstance(report.event, Sample) and report.utc_ns - self._status_ns.get(report.loop, 0) >= SECOND:
            self._status_ns[report.loop] = report.utc_ns
            follower = next(watch.follower for watch in self._monitor.watches if watch.loop.name == report.loop)
            typer.echo(status_line(follower, report.utc_ns, self._clock.now_ns()))


def _print_json(found: dict[str, object]) -> None:
    import json

    typer.echo(json.dumps(found, allow_nan=False, ensure_ascii=False))
