"""`ahgateway fake`: run the PLC of a profile on this machine, for rehearsals without iron."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

if TYPE_CHECKING:
    from ahgateway.fake.plc import FakePlc

MILLISECOND_NS = 1_000_000
SECOND_NS = 1_000_000_000


class Planned(NamedTuple):
    """One wrong piece of arithmetic to come: the text typed, and what it means."""

    text: str
    loop: str
    name: str
    at_s: float


def fake(
    profile: Annotated[str, typer.Argument(metavar="PROFILE", help="Path of a profile, or a shipped example: demo.")],
    tcp: Annotated[
        int | None, typer.Option(metavar="PORT", min=0, max=65535, help="Modbus TCP port, 0 takes a free one.")
    ] = None,
    at: Annotated[
        str | None,
        typer.Option(metavar="TARGET", help="Any other Modbus wire: modbus+rtu:///dev/ttyUSB1, modbus+ascii+tcp://…"),
    ] = None,
    host: Annotated[str, typer.Option(help="Address to listen on.")] = "127.0.0.1",
    scan_ms: Annotated[float, typer.Option(min=0.1, max=1000.0, help="Time of one PLC scan.")] = 5.0,
    seed: Annotated[int, typer.Option(help="Seed of noise and of the system's words.")] = 0,
    connections: Annotated[int, typer.Option(min=1, max=1024, help="Most connections at a time.")] = 32,
    words: Annotated[int, typer.Option(min=1, max=125, help="Most words in one request.")] = 125,
    fault: Annotated[
        list[str] | None,
        typer.Option(metavar="LOOP:NAME[@SECONDS]", help="Compute wrongly from then on; may be given several times."),
    ] = None,
) -> None:
    """Run the PLC of a profile on this machine until Ctrl-C; it touches no real PLC.

    Every loop computes with the reference controllers on a simulated process. It listens at --tcp or, on a serial port
    or through RTU or ASCII over TCP, at --at. The port is printed when 0 was asked for; everything else is said on
    stderr.

    Example: ahgateway fake demo --tcp 5020 --fault TIC-101:ki-1-percent@60

    Example: ahgateway fake demo --at "modbus+ascii:///dev/ttyUSB1?baud=9600"
    """
    import asyncio

    from ahgateway.errors import ProfileError
    from ahgateway.fake.plc import FakePlc
    from ahgateway.schema.profile import load

    if (tcp is None) == (at is None):
        raise ProfileError("give either --tcp PORT or --at TARGET", hint="--tcp 0 takes a free port")
    loaded = load(profile)
    plc = FakePlc(
        loaded.station(),
        loaded.fake_setup(),
        seed=seed,
        scan_ns=round(scan_ms * MILLISECOND_NS),
        words_max=words,
    )
    for text in fault or []:
        _plan(plc, _planned(plc, text))
    asyncio.run(_serve(plc, at, host, tcp or 0, connections))


def _planned(plc: FakePlc, text: str) -> Planned:
    from ahgateway.errors import ProfileError, StateError
    from ahgateway.fake.faults import fault as fault_named

    place, _, seconds = text.partition("@")
    loop, colon, name = place.rpartition(":")
    try:
        at_s = float(seconds or 0.0)
        if not colon or not 0.0 <= at_s < float("inf"):
            raise ValueError
    except ValueError:
        raise ProfileError(
            f"`{text}` is no fault", key="--fault", hint="write LOOP:NAME@SECONDS, as TIC-101:ki-1-percent@60"
        ) from None
    if loop not in plc.items:
        raise ProfileError(
            f"`{text}`: station {plc.station.name} has no loop `{loop}`, it has {', '.join(plc.items)}", key="--fault"
        )
    try:
        fault_named(name, plc.items[loop].loop.controller)
    except StateError as error:
        raise ProfileError(f"`{text}`: {error.message}", key="--fault", hint=error.hint) from error
    return Planned(text, loop, name, at_s)


def _plan(plc: FakePlc, planned: Planned) -> None:
    def act(plc: FakePlc) -> None:
        plc.fail(planned.loop, planned.name)
        typer.echo(f"{planned.loop} computes wrongly from now on: {planned.name}", err=True)

    plc.at(round(planned.at_s * SECOND_NS), act)


async def _serve(plc: FakePlc, at: str | None, host: str, port: int, connections_max: int) -> None:
    from ahgateway.cli.interrupt import stop_event
    from ahgateway.clock import WallClock
    from ahgateway.fake.serve import until
    from ahgateway.transports.server import serve_tcp
    from ahgateway.transports.serving import serve_at
    from ahgateway.transports.uri import parse_uri

    clock = WallClock()
    with stop_event() as stop:
        if at is None:
            server = await serve_tcp(plc, host, port, clock=clock, connections_max=connections_max)
            where = f"modbus+tcp://{host}:{server.port}?unit={plc.station.unit}"
            closing = server.close
            if port == 0:
                typer.echo(str(server.port))
        else:
            where = at
            closing = (await serve_at(plc, parse_uri(at), clock, connections_max=connections_max)).close
        try:
            loops = ", ".join(plc.items)
            typer.echo(f"fake PLC {plc.station.name} at {where} with {loops}; Ctrl-C ends it", err=True)
            await until(stop, plc, clock)
        finally:
            await closing()
    typer.echo(f"fake PLC {plc.station.name} ended after {plc.now_ns / SECOND_NS:.1f} s of scans", err=True)
