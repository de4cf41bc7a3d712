"""`ahgateway proxy`: a line between a client and a PLC that goes wrong on purpose."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from ahgateway.transports.fault import Fault, Script
    from ahgateway.transports.uri import Target


def proxy(
    to: Annotated[str, typer.Option(metavar="TARGET", help="Where the PLC is; a serial port or a host.")],
    listen: Annotated[
        int | None, typer.Option(metavar="PORT", help="TCP port for the client, 0 takes a free one.", min=0, max=65535)
    ] = None,
    on: Annotated[
        str | None,
        typer.Option(metavar="TARGET", help="Serial port for the client instead: modbus+rtu:///dev/ttyUSB1?baud=9600."),
    ] = None,
    host: Annotated[str, typer.Option(help="Address to listen on.")] = "127.0.0.1",
    faults: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Script of faults, `5 lost` or `rate 0.1 late,split` a line.")
    ] = None,
    seed: Annotated[int | None, typer.Option(help="Random faults, equal for equal seeds.")] = None,
    rate: Annotated[float, typer.Option(help="Share of exchanges that suffer with --seed alone.", max=1.0)] = 0.1,
) -> None:
    """Pass Modbus between a client and a PLC, and spoil the line on purpose when faults are asked for.

    Without --faults and --seed it changes nothing. With them every fault is printed. No request is ever altered: it is
    passed on, held back, or answered here in the PLC's place; only replies are spoiled. The client speaks the PLC's
    framing, over TCP (for a serial RTU line, modbus+rtu+tcp://127.0.0.1:PORT) or, with --on, on a serial port of its
    own. Ends with Ctrl-C.

    Example: ahgateway proxy --listen 5021 --to modbus+tcp://192.0.2.10 --seed 7

    Example: ahgateway proxy --on modbus+rtu:///dev/ttyUSB1 --to modbus+rtu:///dev/ttyUSB0 --faults bad.txt
    """
    import asyncio

    from ahgateway.errors import ProfileError
    from ahgateway.transports.proxy import WIRES
    from ahgateway.transports.uri import parse_uri

    target = parse_uri(to)
    if target.scheme not in WIRES:
        raise ProfileError(
            f"`{to}`: a proxy cannot stand before {target.scheme}", key="--to", hint=f"one of {', '.join(WIRES)}"
        )
    if rate <= 0.0:
        raise ProfileError(f"is {rate:g}, allowed above 0 up to 1", key="--rate")
    if (listen is None) == (on is None):
        raise ProfileError("give either --listen PORT or --on TARGET", hint="--listen 0 takes a free port")
    client = None if on is None else parse_uri(on)
    if client is not None and (not client.path or WIRES.get(client.scheme) != WIRES[target.scheme]):
        raise ProfileError(
            f"`{on}` is no serial port that speaks as `{to}` does",
            key="--on",
            hint=f"it looks like modbus+{WIRES[target.scheme]}:///dev/ttyUSB1; a client over TCP takes --listen",
        )
    asyncio.run(_proxy(target, client, host, listen or 0, _script(target, faults, seed, rate)))


def _script(target: Target, faults: Path | None, seed: int | None, rate: float) -> Script:
    from ahgateway.errors import ProfileError
    from ahgateway.transports.fault import DETECTABLE, Rule, Script, parse_script
    from ahgateway.transports.proxy import WIRES

    if faults is not None:
        try:
            text = faults.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise ProfileError(f"cannot be read: {error}", file=str(faults), key="--faults") from error
        return parse_script(text, str(faults), seed or 0)
    rules = () if seed is None else (Rule(DETECTABLE[WIRES[target.scheme]], rate=rate),)
    return Script(rules, seed or 0)


async def _proxy(target: Target, client: Target | None, host: str, port: int, script: Script) -> None:
    from ahgateway.cli.interrupt import stop_event
    from ahgateway.clock import WallClock
    from ahgateway.transports.proxy import FaultProxy
    from ahgateway.transports.uri import line_of

    def said(number: int, fault: Fault, what: str) -> None:
        typer.echo(f"FAULT exchange {number}: {fault.value}: {what}")

    found = FaultProxy(target, script, WallClock(), said, lambda why: typer.echo(f"client dropped: {why}", err=True))
    if client is None:
        await found.listen(host, port)
        where = f"{host}:{found.port}"
    else:
        await found.listen_on(line_of(client))
        where = client.text
    with stop_event() as stop:
        try:
            if client is None and port == 0:
                typer.echo(str(found.port))
            is_on = "FAULTS ARE ON: this line lies" if script.rules else "no faults asked for, nothing is changed"
            typer.echo(f"{where} -> {target.text}; {is_on}; Ctrl-C ends it", err=True)
            await stop.wait()
        finally:
            await found.close()
    typer.echo(f"{found.exchanges} exchanges, {found.faults} spoiled", err=True)
