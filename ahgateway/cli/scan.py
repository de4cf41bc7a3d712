"""`ahgateway scan`: who answers on this line or host?"""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from ahgateway.cli.trace import Trace
from ahgateway.cli.view import Output, print_json

if TYPE_CHECKING:
    from collections.abc import Iterator

    from ahgateway.apps.scan import Answer
    from ahgateway.codec.devices import Address
    from ahgateway.codec.station import Station
    from ahgateway.transports.base import LinkFigures

SERIAL_UNITS, TCP_UNITS = "1-247", "0-10,255"


def scan(
    target: Annotated[
        str, typer.Argument(help="Link, such as modbus+ascii:///dev/ttyUSB0, or a host for Modbus TCP on port 502.")
    ],
    units: Annotated[
        str | None,
        typer.Option(metavar="LIST", help=f"Whom to ask; {SERIAL_UNITS} on a line, {TCP_UNITS} on TCP by default."),
    ] = None,
    timeout_ms: Annotated[int, typer.Option(help="Wait so long for each unit.", min=1, max=60_000)] = 200,
    seconds: Annotated[float, typer.Option(help="Ask nobody after so many seconds.", min=0.1)] = 120.0,
    device: Annotated[str, typer.Option(help="Register that is read as the proof.")] = "D0",
    device_map: Annotated[str, typer.Option(help="Device map that knows where it stands.")] = "ah500",
    output: Annotated[Output, typer.Option(help="text for people, json for one object per unit.")] = Output.TEXT,
    trace: Trace = None,
) -> None:
    """Ask every unit of a line or host for one register and say who answers.

    Only reads. Who answers is asked again in another length, as the proof; a refusal is an answer. How long it can
    take is said first. Exit code 0 when somebody answered, 3 when nobody did.

    Example: ahgateway scan modbus+rtu:///dev/ttyUSB0?baud=19200 --units 1-32

    Example: ahgateway scan 192.0.2.10
    """
    import asyncio

    from ahgateway.apps.scan import units_of
    from ahgateway.codec.devices import parse_device
    from ahgateway.codec.station import Pacing, Station
    from ahgateway.errors import ProfileError
    from ahgateway.schema import device_map as maps
    from ahgateway.transports.uri import parse_uri

    parsed = parse_uri(target if "://" in target else f"modbus+tcp://{target}")
    if parsed.scheme in ("canopen", "replay"):
        raise ProfileError(
            f"`{target}`: {parsed.scheme} has no Modbus units to ask", key="target", hint="for CAN see `ahgateway can`"
        )
    is_tcp = parsed.scheme in ("modbus+tcp", "fake")
    asked = units_of(units or (TCP_UNITS if is_tcp else SERIAL_UNITS))
    if not is_tcp and 0 in asked:
        raise ProfileError("unit 0 is everybody on a serial line and nobody answers", key="--units", hint="1-247")
    devices = maps.load(device_map)
    place = devices.address(parse_device(device))
    station = Station("scan", parsed.text, asked[0], devices, (), pacing=Pacing(reply_timeout_ms=timeout_ms))
    raise typer.Exit(asyncio.run(_scan(station, asked, place, seconds, output, trace)))


async def _scan(
    station: Station, units: tuple[int, ...], place: Address, seconds: float, output: Output, trace: str | None
) -> int:
    from ahgateway.apps.scan import scan as answers
    from ahgateway.cli.interrupt import stop_event
    from ahgateway.cli.targets import open_target
    from ahgateway.cli.trace import traced
    from ahgateway.clock import SECOND, WallClock

    clock = WallClock()
    _say_how_long(station, units, seconds)
    asked = there = 0
    with traced(trace, station) as tap, stop_event() as stop:
        async with open_target(station, clock, tap) as link:
            ends_ns = clock.now_ns() + round(seconds * SECOND)
            async for answer in answers(link, clock, units, ends_ns, table=place.table, address=place.address):
                asked += 1
                there += answer.is_there
                _show(answer, output)
                if stop.is_set():
                    break
    left = f"; {len(units) - asked} not asked, the time was over" if asked < len(units) else ""
    typer.echo(f"{asked} units asked, {there} answered{left}{'' if there else _unused(link.figures)}", err=True)
    return 0 if there else 3


def _unused(figures: LinkFigures) -> str:
    if figures.late:
        return f"; {figures.late} answers came too late, raise --timeout-ms"
    if figures.garbage_bytes:
        return f"; {figures.garbage_bytes} bytes were no answer, or came too late for one: --timeout-ms waits longer"
    return ""


def _say_how_long(station: Station, units: tuple[int, ...], seconds: float) -> None:
    longest = min(seconds, len(units) * (station.pacing.reply_timeout_ms + 50) / 1000)
    typer.echo(f"asking {len(units)} units at {station.target}, about {longest:.0f} s when all are silent", err=True)


def _show(answer: Answer, output: Output) -> None:
    if output is Output.JSON:
        print_json(
            {
                "kind": "scan",
                "unit": answer.unit,
                "there": answer.is_there,
                "proven": answer.is_proven,
                "text": answer.text,
                "words": list(answer.words),
                "round_trip_ms": answer.round_trip_ns / 1e6 if answer.round_trip_ns else None,
            }
        )
        return
    for line in _lines(answer):
        typer.echo(line)


def _lines(answer: Answer) -> Iterator[str]:
    if answer.text == "silent":
        return
    words = " ".join(f"{word:04X}" for word in answer.words)
    took = f", {answer.round_trip_ns / 1e6:.1f} ms" if answer.round_trip_ns else ""
    proof = "" if answer.is_proven or not answer.is_there else ", not proven"
    yield f"unit {answer.unit}: {answer.text}{': ' + words if words else ''}{took}{proof}"
