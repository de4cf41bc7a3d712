"""`ahgateway import`: a recording from someone else's trend."""

from __future__ import annotations

from typing import Annotated

import typer

from ahgateway.cli.tune import pairs


def import_(
    file: Annotated[str, typer.Argument(help="CSV file: a line of names, then rows; comma, semicolon or tab.")],
    out: Annotated[str, typer.Option(help="Recording to make, such as trend.ahrec; it must be new.")],
    instruction: Annotated[str, typer.Option(help="DPID or DPIDE: which operands there are.")] = "DPIDE",
    loop: Annotated[str, typer.Option(help="Name of the loop in the recording.")] = "L1",
    map_: Annotated[
        list[str] | None, typer.Option("--map", help="OPERAND=COLUMN or time=COLUMN; may be given several times.")
    ] = None,
    set_: Annotated[
        list[str] | None, typer.Option("--set", help="OPERAND=VALUE that it had all the time; several times.")
    ] = None,
    start: Annotated[
        str | None, typer.Option(help="UTC of second 0, 2026-11-22T03:04:05, where times are seconds.")
    ] = None,
) -> None:
    """Make a recording from a CSV trend of another program.

    Columns are found by their usual names (time, SV or SP, PV, MV or OP, operands as the manual spells them), or as
    --map says; `SV [°C]` gives the unit too. Times are seconds, or date and time of ISO 8601 in UTC. Such a recording
    can be exported, looked at and tuned from; it cannot be judged, since a trend lacks what an instruction remembers.

    Example: ahgateway import trend.csv --out trend.ahrec --map time=Date --map PV=TT101 --set CYCLE=200
    """
    from pathlib import Path

    from ahgateway.apps.import_trend import Trend, import_csv
    from ahgateway.apps.moments import moment_ns

    trend = Trend(
        instruction,
        loop,
        pairs(map_ or [], "--map"),
        pairs(set_ or [], "--set"),
        moment_ns(start, "--start", 0) if start else 0,
    )
    count = import_csv(Path(file), Path(out), trend)
    typer.echo(f"{out}: {count} rows")
