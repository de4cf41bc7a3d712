"""`ahgateway doctor`: is this machine, this line, this PLC good enough for what the profile asks?"""

from __future__ import annotations

from statistics import median
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ahgateway.cli.trace import Trace
from ahgateway.cli.view import Output, print_json

if TYPE_CHECKING:
    from ahgateway.apps.doctor import Check, Findings, LoopTime
    from ahgateway.clock import Clock
    from ahgateway.codec.station import Station

MILLISECOND_NS = 1_000_000


def doctor(
    profile: Annotated[str | None, typer.Argument(help="Profile file, or the name of a shipped example.")] = None,
    target: Annotated[
        str | None,
        typer.Option(help="Link to use instead of the profile's, such as modbus+rtu:///dev/ttyUSB0?baud=115200."),
    ] = None,
    output: Annotated[Output, typer.Option(help="text for people, json for one object.")] = Output.TEXT,
    trace: Trace = None,
) -> None:
    """Check ports, adapter, clock and line, and say whether the loops of a profile can be followed over it.

    Only reads. Without a profile and a target it looks at this machine alone. With a profile each loop's requests are
    measured, a minute at most, against the least time that the wire allows. Exit code 0 when nothing failed, 3 when
    the line does not answer or a loop cannot be followed.

    Example: ahgateway doctor line3.toml --target modbus+rtu:///dev/ttyUSB0?baud=115200
    """
    import asyncio

    from ahgateway.cli.targets import resolved
    from ahgateway.schema.profile import load

    station = None
    if profile is not None:
        station = resolved(load(profile).station(), target)
    elif target is not None:
        station = resolved(_bare(), target)
    found = asyncio.run(_examined(station, trace, silent=output is Output.JSON))
    if output is Output.JSON:
        print_json(_json(station, found))
    else:
        for line in _table(found):
            typer.echo(line)
    raise typer.Exit(0 if found.is_good else 3)


def _bare() -> Station:
    """A station of which nothing is known but that it is there."""
    from ahgateway.codec.station import Station
    from ahgateway.schema import device_map

    return Station("this PLC", "", 1, device_map.load("ah500"), ())


async def _examined(station: Station | None, trace: str | None, *, silent: bool) -> Findings:
    from ahgateway.apps import doctor as app
    from ahgateway.clock import WallClock

    clock = WallClock()
    found = app.Findings()

    def take(*checks: Check) -> None:
        found.checks += checks
        if not silent:
            for check in checks:
                typer.echo(_line(check))

    async for check in app.check_clock(clock):
        take(check)
    if station is None:
        take(*app.check_ports())
        return found
    await _line_examined(station, clock, trace, found, take)
    return found


async def _line_examined(station: Station, clock: Clock, trace: str | None, found: Findings, take: Any) -> None:
    from ahgateway.apps import doctor as app
    from ahgateway.cli.targets import open_target
    from ahgateway.cli.trace import traced
    from ahgateway.transports.uri import parse_uri

    line = app.line_behind(parse_uri(station.target))
    if line is not None:
        take(*app.check_port(line))
        if not found.is_good:
            return
    with traced(trace, station) as tap:
        async with open_target(station, clock, tap) as link:
            if not station.loops:
                take(await app.check_answer(link, station.unit))
            for loop in station.loops:
                measured, checks = await app.measure(station, loop, link, clock)
                found.loops.append(measured)
                take(*checks)
                if checks and not link.figures.replies:
                    break  # nobody is there: one time-out says it
            take(*app.judge(found), *app.check_cycles(link.figures))


def _line(check: Check) -> str:
    text = f"{check.outcome.value:<5} {check.name}: {check.text}"
    return f"{text}\n      hint: {check.hint}" if check.hint else text


def _table(found: Findings) -> list[str]:
    """Every request with its times, in ms; nothing when none was measured."""
    rows = [["loop", "request", "wire floor", "best", "median", "worst", "share of floor"]]
    for loop in found.loops:
        for each in loop.requests:
            if each.took_ns:
                plural = "s" if each.read.count != 1 else ""
                place = f"{each.read.count} {each.read.table.value}{plural} from 0x{each.read.address:04X}"
                figures = (each.floor_ns, min(each.took_ns), round(median(each.took_ns)), max(each.took_ns))
                share = f"{each.floor_ns / figures[2]:.0%}" if each.floor_ns and figures[2] else "-"
                rows.append([loop.loop, place, *(_ms(figure) for figure in figures), share])
    if len(rows) == 1:
        return []
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    lines = ["  ".join(f"{cell:<{width}}" for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]
    return ["", "times in ms", *lines]


def _ms(ns: int | None) -> str:
    return "-" if ns is None else f"{ns / MILLISECOND_NS:.2f}"


def _json(station: Station | None, found: Findings) -> dict[str, object]:
    return {
        "kind": "doctor",
        "station": station.name if station else None,
        "target": station.target if station else None,
        "good": found.is_good,
        "checks": [
            {"name": each.name, "outcome": each.outcome.value, "text": each.text, "hint": each.hint}
            for each in found.checks
        ],
        "round_ms": found.round_ns / MILLISECOND_NS,
        "loops": [_loop_json(loop) for loop in found.loops],
    }


def _loop_json(loop: LoopTime) -> dict[str, object]:
    def ms(ns: int | None) -> float | None:
        return None if ns is None else ns / MILLISECOND_NS

    return {
        "loop": loop.loop,
        "requests_per_picture": loop.sent,
        "picture_ms": ms(loop.picture_ns) if loop.picture_ns else None,
        "floor_ms": ms(loop.floor_ns),
        "cycle_ms": ms(loop.cycle_ns),
        "requests": [
            {
                "table": each.read.table.value,
                "address": each.read.address,
                "count": each.read.count,
                "floor_ms": ms(each.floor_ns),
                "best_ms": ms(min(each.took_ns)) if each.took_ns else None,
                "median_ms": ms(round(median(each.took_ns))) if each.took_ns else None,
                "worst_ms": ms(max(each.took_ns)) if each.took_ns else None,
                "measured": len(each.took_ns),
            }
            for each in loop.requests
        ],
    }
