"""`ahgateway proxy`: a line between a client and a PLC that goes wrong on purpose."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from ahgateway.transports.fault import Fault, Script
    from ahgateway.transports.uri import Target


def proxy(
    listen: Annotated[int, typer.Option(metavar="PORT", help="TCP port, 0 takes a free one.", min=0, max=65535)],
    to: Annotated[str, typer.Option(metavar="TARGET", help="Where the PLC is; a serial port or a host.")],
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
    framing over TCP: for a serial RTU line, modbus+rtu+tcp://127.0.0.1:PORT. Ends with Ctrl-C.

    Example: ahgateway proxy --listen 5021 --to modbus+tcp://192.0.2.10 --seed 7
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
    asyncio.run(_proxy(target, host, listen, _script(target, faults, seed, rate)))


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


async def _proxy(target: Target, host: str, port: int, script: Script) -> None:
    from ahgateway.cli.interrupt import stop_event
    from ahgateway.clock import WallClock
    from ahgateway.transports.proxy import FaultProxy

    def said(number: int, fault: Fault, what: str) -> None:
        typer.echo(f"FAULT exchange {number}: {fault.value}: {what}")

    found = FaultProxy(target, script, WallClock(), said, lambda why: typer.echo(f"client dropped: {why}", err=True))
    await found.listen(host, port)
    with stop_event() as stop:
        try:
            if port == 0:
                typer.echo(str(found.port))
            is_on = "FAULTS ARE ON: this line lies" if script.rules else "no faults asked for, nothing is changed"
            typer.echo(f"{host}:{found.port} -> {target.text}; {is_on}; Ctrl-C ends it", err=True)
            await stop.wait()
        finally:
            await found.close()
    typer.echo(f"{found.exchanges} exchanges, {found.faults} spoiled", err=True)
