"""`ahgateway can`: look at a CAN bus, write an EDS, put the fake PLC on a bus."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from ahgateway.cli.can_dump import dump
from ahgateway.cli.view import Output, print_json
from ahgateway.clock import utc_text

if TYPE_CHECKING:
    from ahgateway.codec.station import Station
    from ahgateway.fake.plc import FakePlc

app = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode=None,
    help="Look at a CAN bus, write an EDS, put the fake PLC on a bus.",
)


app.command()(dump)


@app.command()
def serve(
    profile: Annotated[str, typer.Argument(metavar="PROFILE", help="Profile, or a shipped example: can.")],
    target: Annotated[
        str | None, typer.Option(help="Bus and node instead of the profile's: canopen://slcan/dev/ttyACM0?node=3.")
    ] = None,
    sync: Annotated[bool, typer.Option(help="Also send SYNC at the profile's period.")] = False,
    scan_ms: Annotated[float, typer.Option(min=0.1, max=1000.0, help="Time of one PLC scan.")] = 5.0,
    seed: Annotated[int, typer.Option(help="Seed of noise and of the system's words.")] = 0,
) -> None:
    """Run the fake PLC of a profile as a node on a CAN bus until Ctrl-C; for benches only, it sends frames.

    Example: ahgateway can serve can --target "canopen://slcan/dev/ttyACM0?node=3&bitrate=500000" --sync
    """
    import asyncio

    from ahgateway.errors import ProfileError
    from ahgateway.fake.plc import FakePlc
    from ahgateway.schema.profile import load
    from ahgateway.transports.uri import parse_uri

    loaded = load(profile)
    station = loaded.station()
    parsed = parse_uri(target or station.target)
    if parsed.scheme != "canopen" or "node" not in parsed.options:
        raise ProfileError(f"`{parsed.text}` names no node on a CAN bus", key="target", hint="add ?node=3")
    if station.can is None:
        raise ProfileError("is missing, it says which objects the node holds", file=profile, key="station.can")
    plc = FakePlc(station, loaded.fake_setup(), seed=seed, scan_ns=round(scan_ms * 1_000_000))
    asyncio.run(_serve(plc, parsed.text, sync))


async def _serve(plc: FakePlc, text: str, sends_sync: bool) -> None:
    from ahgateway.cli.interrupt import stop_event
    from ahgateway.clock import WallClock
    from ahgateway.fake.can import CanPlc
    from ahgateway.fake.serve import until
    from ahgateway.transports.can.bus import bus_for
    from ahgateway.transports.can.node import CanNode
    from ahgateway.transports.can.server import serve_node
    from ahgateway.transports.uri import parse_uri

    target, clock, can = parse_uri(text), WallClock(), plc.station.can
    assert can is not None
    node = CanNode(
        int(target.options["node"]),
        CanPlc(plc, can, plc.station.unit),
        sync_cob_id=can.sync.cob_id,
        sync_period_us=can.sync.period_us if sends_sync else 0,
    )
    with stop_event() as stop:
        server = await serve_node(node, bus_for(target, clock), clock)
        try:
            typer.echo(f"fake PLC {plc.station.name} is node {node.node} at {text}; Ctrl-C ends it", err=True)
            await until(stop, plc, clock)
        finally:
            await server.close()


@app.command()
def eds(
    profile: Annotated[str, typer.Argument(metavar="PROFILE", help="Profile, or a shipped example: can.")],
) -> None:
    """Print the EDS of the gateway as a node of the PLC's master, for the tool that configures the master.

    Example: ahgateway can eds line3.toml > gateway.eds
    """
    from ahgateway import __version__
    from ahgateway.codec.can_eds import eds as eds_text
    from ahgateway.codec.can_eds import node_layout
    from ahgateway.schema.profile import load

    typer.echo(eds_text(node_layout(load(profile).station()), version=__version__), nl=False)


@app.command()
def node(
    profile: Annotated[str, typer.Argument(metavar="PROFILE", help="Profile whose loops the master sends.")],
    target: Annotated[
        str, typer.Argument(metavar="TARGET", help="Bus and own node-ID: canopen://socketcan/can0?node=5")
    ],
    duration: Annotated[float | None, typer.Option(help="Stop after so many seconds.", min=0.0)] = None,
    output: Annotated[Output, typer.Option(help="text for people, json for one object per line.")] = Output.TEXT,
) -> None:
    """Be a node of the PLC's master, as `can eds` describes it, and print every value that comes.

    It answers its master and sends boot-up and heartbeat, nothing else. Exit code 0 when values came, 3 when none did.

    Example: ahgateway can node line3.toml "canopen://socketcan/can0?node=5"
    """
    import asyncio

    from ahgateway.errors import ProfileError
    from ahgateway.schema.profile import load
    from ahgateway.transports.uri import parse_uri

    parsed = parse_uri(target)
    if parsed.scheme != "canopen" or "node" not in parsed.options:
        raise ProfileError(f"`{parsed.text}` names no node on a CAN bus", key="target", hint="add ?node=5")
    raise typer.Exit(asyncio.run(_node(load(profile).station(), parsed.text, duration, output)))


async def _node(station: Station, text: str, duration_s: float | None, output: Output) -> int:
    import asyncio
    import contextlib

    from ahgateway.cli.interrupt import stop_event
    from ahgateway.clock import WallClock
    from ahgateway.codec.can_eds import NodeValue, node_layout, real_text
    from ahgateway.transports.can.bus import bus_for
    from ahgateway.transports.can.gateway import GatewayContent
    from ahgateway.transports.can.node import CanNode
    from ahgateway.transports.can.server import serve_node
    from ahgateway.transports.uri import parse_uri

    clock, target, came = WallClock(), parse_uri(text), 0

    def show(value: NodeValue, packed: bytes) -> None:
        nonlocal came
        came += 1
        bits, shown = packed[::-1].hex(), real_text(packed)
        if output is Output.JSON:
            print_json(
                {"kind": "value", "utc_ns": clock.utc_ns(), "loop": value.loop, "name": value.name}
                | {"bits": f"0x{bits}", "text": shown}
            )
        else:
            typer.echo(f"{utc_text(clock.utc_ns())}  {value.loop} {value.name} {shown} (0x{bits})")

    own = int(target.options["node"])
    content = GatewayContent(node_layout(station), own, show)
    with stop_event() as stop:
        server = await serve_node(CanNode(own, content, starts_operational=False), bus_for(target, clock), clock)
        try:
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(duration_s):
                    await stop.wait()
        finally:
            await server.close()
    return 0 if came else 3
