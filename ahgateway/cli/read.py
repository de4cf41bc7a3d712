"""`ahgateway read`: what stands at a device, or in every operand of a loop."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ahgateway.cli.trace import Trace
from ahgateway.cli.view import Output, print_json

if TYPE_CHECKING:
    from ahgateway.apps.read import Reading
    from ahgateway.codec.station import Station

FORMS = ("real", "dint", "int", "word", "bits")


def read(
    profile: Annotated[str, typer.Argument(help="Profile file, or the name of a shipped example such as `demo`.")],
    devices: Annotated[list[str] | None, typer.Argument(metavar="DEVICE…", help="Devices such as D100 or M1.")] = None,
    form: Annotated[
        str | None,
        typer.Option("--as", metavar="|".join(FORMS), help="How to read it; without it as the profile says."),
    ] = None,
    count: Annotated[int, typer.Option(help="So many values from each device on.", min=1, max=1000)] = 1,
    loop: Annotated[str | None, typer.Option(metavar="LOOP", help="Every operand of this loop, at one moment.")] = None,
    target: Annotated[
        str | None,
        typer.Option(help="Link to use instead of the profile's, such as modbus+tcp://192.0.2.10:502?unit=1."),
    ] = None,
    output: Annotated[Output, typer.Option(help="text for people, json for one object.")] = Output.TEXT,
    trace: Trace = None,
) -> None:
    """Read devices, or every operand of a loop, once.

    Only reads. Each value stands with its device, its unit and its words, low word first. A loop's operands are read
    so that all of them stood there at one moment. Exit code 0 when it was read, 3 when the link or the PLC said no.

    Example: ahgateway read demo D100 M1 --as real --target modbus+tcp://192.0.2.10:502?unit=1

    Example: ahgateway read demo --loop TIC-101
    """
    import asyncio

    from ahgateway.cli.targets import resolved
    from ahgateway.errors import ProfileError
    from ahgateway.schema.profile import load

    if bool(devices) == (loop is not None):
        raise ProfileError("say what to read: devices, or --loop NAME", hint="`ahgateway read demo D100 --as real`")
    if loop is not None and (form is not None or count != 1):
        raise ProfileError("--as and --count belong to devices; a loop's operands have their own kinds")
    if form is not None and form not in FORMS:
        raise ProfileError(f"`{form}` is not one of {', '.join(FORMS)}", key="--as")
    station = resolved(load(profile).station(), target)
    asyncio.run(_read(station, devices or [], form, count, loop, output, trace))


async def _read(
    station: Station,
    devices: list[str],
    form: str | None,
    count: int,
    loop: str | None,
    output: Output,
    trace: str | None,
) -> None:
    from ahgateway.apps.read import Form, read_devices, read_loop, wanted
    from ahgateway.cli.gate_place import loop_named
    from ahgateway.cli.targets import open_target
    from ahgateway.cli.trace import traced
    from ahgateway.clock import WallClock

    clock = WallClock()
    found = loop_named(station, loop) if loop is not None else None
    asked = wanted(station, devices, None if form is None else Form(form), count)
    with traced(trace, station) as tap:
        async with open_target(station, clock, tap) as link:
            if found is None:
                readings: list[Reading] | None = await read_devices(station, link, clock, asked)
            else:
                readings = await read_loop(station, found, link, clock)
    if readings is None:
        typer.echo(f"loop {loop}: an execution fell into every attempt to read it, nothing is shown", err=True)
        typer.echo("\nhint: the line is too slow for this CYCLE; `ahgateway doctor` says by how much", err=True)
        raise typer.Exit(3)
    if output is Output.JSON:
        print_json(_json(station, loop, readings))
        return
    for line in _lines(readings):
        typer.echo(line)


def _json(station: Station, loop: str | None, readings: list[Reading]) -> dict[str, object]:
    from ahgateway.clock import SECOND

    return {
        "kind": "read",
        "station": station.name,
        "target": station.target,
        "unit": station.unit,
        "loop": loop,
        "values": [
            {
                "name": each.name or None,
                "device": each.device,
                "as": each.form,
                "value": _plain(each.value),
                "unit": each.unit,
                "words": list(each.words),
                "t": each.utc_ns / SECOND,
                "aligned_since": None if each.aligned_utc_ns is None else each.aligned_utc_ns / SECOND,
            }
            for each in readings
        ],
    }


def _plain(value: Any) -> Any:
    """Return the value as JSON has it; what JSON has not (NaN, infinity) as its name, a REAL exactly."""
    if value is None or isinstance(value, bool | int):
        return value
    if isinstance(value, tuple):
        return list(value)
    number = float(value)
    return number if math.isfinite(number) else str(number)


def _lines(readings: list[Reading]) -> list[str]:
    rows = [[each.device or "-", each.name, each.form, _text(each), _words(each)] for each in readings]
    widths = [max(len(row[column]) for row in rows) for column in range(5)]
    return [
        "  ".join(f"{cell:<{width}}" for cell, width in zip(row, widths, strict=True) if width).rstrip() for row in rows
    ]


def _text(reading: Reading) -> str:
    value = reading.value
    if value is None:
        return ""
    if isinstance(value, bool):
        return "on" if value else "off"
    if isinstance(value, tuple):
        bits = "".join(str(bit) for bit in reversed(value))
        return " ".join(bits[start : start + 4] for start in range(0, len(bits), 4))
    times = "× " if reading.unit[:1].isdigit() else ""  # CYCLE of DPID counts 10 ms
    return f"{value!s} {times}{reading.unit}".rstrip()


def _words(reading: Reading) -> str:
    if reading.form in ("bool", "bits") and len(reading.words) == 1 and isinstance(reading.value, bool):
        return ""
    return " ".join(f"{word:04X}" for word in reading.words)
