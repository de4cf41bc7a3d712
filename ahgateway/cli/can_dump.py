"""`ahgateway can dump`: every frame on a CAN bus, or in a recording, decoded as CANopen."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated

import typer

from ahgateway.cli.view import Output, print_json
from ahgateway.clock import utc_text

if TYPE_CHECKING:
    from ahgateway.codec.can_frame import CanFrame
    from ahgateway.codec.station import Station
    from ahgateway.transports.can.bus import CanBus
    from ahgateway.transports.can.reader import Trouble
    from ahgateway.transports.uri import Target


def dump(
    target: Annotated[
        str, typer.Argument(metavar="TARGET", help="Bus, such as canopen://socketcan/can0, or replay://FILE.")
    ],
    profile: Annotated[
        str | None, typer.Option(help="Profile whose PDOs are decoded; a recording brings its own.")
    ] = None,
    listen_only: Annotated[
        bool, typer.Option("--listen-only/--acknowledge", help="Do not even acknowledge, where the adapter can.")
    ] = True,
    duration: Annotated[float | None, typer.Option(help="Stop after so many seconds.", min=0.0)] = None,
    count: Annotated[int | None, typer.Option(help="Stop after so many frames.", min=1)] = None,
    output: Annotated[Output, typer.Option(help="text for people, json for one object per line.")] = Output.TEXT,
) -> None:
    """Print every frame on a bus, or in a recording, decoded as CANopen; it sends nothing.

    What happens to the adapter (lost, bus-off, error-passive, silent) is said on stderr, or is a line of its own with
    --output json. Exit code 0 when frames were seen, 3 when none were. A recording holds frames when it was made with
    --record-frames.

    Example: ahgateway can dump "canopen://socketcan/can0?bitrate=500000" --duration 5

    Example: ahgateway can dump replay://night.ahrec --output json
    """
    import asyncio

    from ahgateway.errors import ProfileError
    from ahgateway.schema.profile import load
    from ahgateway.transports.uri import parse_uri

    parsed = parse_uri(target)
    station = None if profile is None else load(profile).station()
    if parsed.scheme == "replay":
        raise typer.Exit(_recorded(parsed, station, duration, count, output))
    if parsed.scheme != "canopen":
        raise ProfileError(
            f"`{target}` is no CAN bus",
            key="target",
            hint="it looks like canopen://socketcan/can0, or replay://FILE for a recording of one",
        )
    from ahgateway.clock import WallClock
    from ahgateway.transports.can.bus import bus_for

    clock = WallClock()
    bus = bus_for(parsed, clock, is_listen_only=listen_only)
    raise typer.Exit(asyncio.run(_live(bus, clock.utc_ns() - clock.now_ns(), station, duration, count, output)))


async def _live(
    bus: CanBus,
    utc_offset_ns: int,
    station: Station | None,
    duration_s: float | None,
    count: int | None,
    output: Output,
) -> int:
    import asyncio
    import contextlib

    from ahgateway.cli.interrupt import stop_event

    with stop_event() as stop:
        shown = _Shown(station, count, output, stop.set)
        bus.subscribe(
            lambda frame: shown.frame(frame, frame.now_ns + utc_offset_ns),
            lambda trouble: shown.trouble(trouble, trouble.now_ns + utc_offset_ns),
        )
        try:
            await bus.open()
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(duration_s):
                    await stop.wait()
        finally:
            await bus.close()
    figures = bus.figures
    if output is Output.JSON:
        print_json(
            {"kind": "summary", "received": figures.received, "overflows": figures.overflows}
            | {"garbage": figures.garbage, "error_frames": figures.error_frames, "losses": figures.losses}
            | {"bus_offs": figures.bus_offs, "silences": figures.silences}
        )
    else:
        typer.echo(
            f"{figures.received} frames, {figures.overflows} overflowed, {figures.garbage} damaged, "
            f"{figures.error_frames} error frames, interface lost {figures.losses} times",
            err=True,
        )
    return 0 if figures.received else 3


def _recorded(
    target: Target, station: Station | None, duration_s: float | None, count: int | None, output: Output
) -> int:
    """Print the frames of a recording; `duration_s` is in the recording's own time."""
    from ahgateway.clock import SECOND
    from ahgateway.codec.can_frame import unpack
    from ahgateway.errors import ProfileError
    from ahgateway.recording.parts import opened

    found, first_ns = 0, 0
    with opened(target.path) as recording:
        wire = recording.station.target
        if not wire.startswith("canopen:"):
            raise ProfileError(
                f"was made over {wire}, its frames are no CAN frames",
                file=target.path,
                hint="`info` says what it holds",
            )
        shown = _Shown(station or recording.station, count, output, lambda: None)
        for now_ns, utc_ns, direction, packed in recording.frames():
            first_ns = first_ns or now_ns
            is_over = duration_s is not None and now_ns - first_ns > duration_s * SECOND
            if is_over or (count is not None and found >= count):
                break
            found += 1
            shown.frame(unpack(packed), utc_ns, direction)
    if output is Output.JSON:
        print_json({"kind": "summary", "recorded": found})
    else:
        typer.echo(f"{found} frames" + ("" if found else "; --record-frames keeps them"), err=True)
    return 0 if found else 3


class _Shown:
    """Where frames and trouble go, one line each."""

    def __init__(self, station: Station | None, count: int | None, output: Output, stop: Callable[[], object]) -> None:
        self._can = station.can if station is not None else None
        self._devices = station.devices if station is not None else None
        self._left = count
        self._output = output
        self._stop = stop

    def frame(self, frame: CanFrame, utc_ns: int, direction: str = "<") -> None:
        from ahgateway.codec.can_frame import service
        from ahgateway.codec.can_text import meaning

        if self._left == 0:
            return
        said = meaning(frame, self._can, self._devices)
        if self._output is Output.JSON:
            name, node = ("", 0) if frame.is_extended else service(frame.can_id)
            print_json(
                {"kind": "frame", "utc_ns": utc_ns, "direction": direction, "id": frame.can_id}
                | {"extended": frame.is_extended, "remote": frame.is_remote, "data": frame.data.hex()}
                | {"service": name, "node": node, "text": said}
            )
        else:
            typer.echo(f"{utc_text(utc_ns)} {direction} {frame!s:<32}  {said}".rstrip())
        if self._left is not None:
            self._left -= 1
            if self._left == 0:
                self._stop()

    def trouble(self, trouble: Trouble, utc_ns: int) -> None:
        if self._output is Output.JSON:
            print_json({"kind": "bus", "utc_ns": utc_ns, "name": trouble.name, "text": trouble.text})
        elif trouble.name != "open":
            typer.echo(f"{trouble.name}: {trouble.text}", err=True)
