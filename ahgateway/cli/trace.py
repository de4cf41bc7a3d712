"""`--trace` on every command that talks to a PLC: each frame with its time, decoded, as a line of a file."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from ahgateway.codec.station import Station
    from ahgateway.transports.base import Frame, Tap

Trace = Annotated[
    str | None,
    typer.Option(
        "--trace",
        metavar="FILE",
        help="Write every frame with its time, decoded, behind what is in this file; - is stderr.",
    ),
]


@contextlib.contextmanager
def traced(path: str | None, station: Station) -> Iterator[Tap | None]:
    """Yield a tap that writes frames as lines, None when no file was named.

    Raises:
        ProfileError: The file cannot be written.
    """
    if path is None:
        yield None
        return
    from ahgateway.errors import ProfileError
    from ahgateway.transports.tracer import line_maker
    from ahgateway.transports.uri import parse_uri

    line = line_maker(parse_uri(station.target).scheme, station.can, station.devices)
    with contextlib.ExitStack() as stack:
        out = sys.stderr
        if path != "-":
            try:
                out = stack.enter_context(open(path, "a", encoding="utf-8", newline="\n", buffering=1))
            except OSError as error:
                raise ProfileError(f"cannot be written: {error.strerror}", file=path, key="--trace") from error
        out.write(f"# {station.name} at {station.target}, unit {station.unit}; > out, < in, times in UTC\n")

        def tap(frame: Frame) -> None:
            out.write(line(frame) + "\n")

        yield tap
