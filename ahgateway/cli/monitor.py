"""`ahgateway monitor`: follow every loop of a profile on a live PLC."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from ahgateway.cli.view import Output, View

if TYPE_CHECKING:
    from ahgateway.codec.station import Station


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
    import asyncio

    from ahgateway.cli.targets import resolved
    from ahgateway.schema.profile import load

    station = resolved(load(profile).station(), target)
    raise typer.Exit(asyncio.run(_monitor(station, duration, output, coverage)))


async def _monitor(station: Station, duration_s: float | None, output: Output, coverage_min: float) -> int:
    from ahgateway.apps.monitor import Monitor
    from ahgateway.cli.interrupt import stop_event
    from ahgateway.cli.targets import open_target
    from ahgateway.clock import SECOND, WallClock

    clock = WallClock()
    duration_ns = None if duration_s is None else round(duration_s * SECOND)
    async with open_target(station, clock) as link:
        watched = Monitor(station, link, clock)
        with stop_event() as stop, View(watched, clock, output, coverage_min, station.name) as view:
            async for report in watched.reports(duration_ns=duration_ns, stop=stop):
                view.show(report)
    return int(watched.outcome(coverage_min))
