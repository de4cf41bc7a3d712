"""`ahgateway plc-code`: Structured Text for the PLC's own program, made from the profile."""

from __future__ import annotations

import json
from enum import Enum
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from ahgateway.cli.view import Output

if TYPE_CHECKING:
    from ahgateway.codec.station import Loop


class Row(NamedTuple):
    """One kind of snippet.

    Attributes:
        place: Function of station and loop that returns the text, as `module:function`.
        table: Attribute of the loop that must not be None: the profile's table of that name.
    """

    place: str
    table: str


KINDS: dict[str, Row] = {
    "heartbeat": Row("ahgateway.codec.lease_text:heartbeat", "lease"),
    "recorder": Row("ahgateway.codec.recorder_text:recorder", "recorder"),
    "trigger": Row("ahgateway.codec.recorder_text:trigger", "trigger"),
}
"""Kind of snippet to who makes it."""

Kind = Enum("Kind", {name: name for name in KINDS}, type=str)  # type: ignore[misc]


def plc_code(
    kind: Annotated[
        Kind,
        typer.Argument(
            help=(
                "heartbeat: the PLC puts a loop back when the gateway vanishes; recorder: it records every scan or "
                "call; trigger: it lets one execution through at a time."
            )
        ),
    ],
    profile: Annotated[str, typer.Argument(help="Profile file, or the name of a shipped example such as `demo`.")],
    loop: Annotated[
        str | None, typer.Option(metavar="LOOP", help="This loop only; all that have one otherwise.")
    ] = None,
    file: Annotated[Path | None, typer.Option("--file", help="Write it there instead of to stdout.")] = None,
    output: Annotated[Output, typer.Option(help="text for ISPSoft, json for machines.")] = Output.TEXT,
) -> None:
    """Write Structured Text for ISPSoft, made from the tables of a profile; sends nothing to any PLC.

    It was never compiled by Delta's tool: read it and try it on a bench first.

    Example: ahgateway plc-code heartbeat demo --loop TIC-101 --file lease.st
    """
    from ahgateway.errors import ProfileError
    from ahgateway.schema.profile import load

    loaded = load(profile)
    station = loaded.station()
    row = KINDS[kind.value]
    wanted = _loops(list(station.loops), loop, row, loaded.file)
    module, _, function = row.place.partition(":")
    make = getattr(import_module(module), function)
    texts = {each.name: make(station, each) for each in wanted}
    if output is Output.JSON:
        text = json.dumps({"kind": kind.value, "station": station.name, "loops": texts}, ensure_ascii=False) + "\n"
    else:
        text = "\n".join(texts.values())
    if file is None:
        typer.echo(text, nl=False)
        return
    try:
        file.write_text(text, encoding="utf-8", newline="\n")
    except OSError as error:
        raise ProfileError(f"cannot be written: {error.strerror}", file=str(file)) from error


def _loops(loops: list[Loop], name: str | None, row: Row, file: str) -> list[Loop]:
    """The loop that was named, or all whose profile has the table."""
    from ahgateway.errors import ProfileError

    named = [loop for loop in loops if name in (None, loop.name)]
    if not named:
        raise ProfileError(f"no loop `{name}`, it has {', '.join(loop.name for loop in loops)}", file=file)
    found = [loop for loop in named if getattr(loop, row.table) is not None]
    if not found:
        key = f"loops.{named[0].name}.{row.table}"
        raise ProfileError(
            "is missing, and no snippet is made without it", file=file, key=key,
            hint=f"add the table [{key}]; docs/reference/plc-code.md has one",
        )  # fmt: skip
    return found
