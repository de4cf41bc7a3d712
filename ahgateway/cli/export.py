"""`ahgateway export`: a recording as CSV, Parquet or MCAP."""

from __future__ import annotations

from enum import Enum
from typing import Annotated

import typer


class Format(Enum):
    """What other programs read."""

    CSV = "csv"
    PARQUET = "parquet"
    MCAP = "mcap"


def export(
    file: Annotated[str, typer.Argument(help="Recording, as --record made it; it may still be written.")],
    to: Annotated[Format, typer.Option(help="csv and parquet: one file per loop; mcap: one file.")] = Format.CSV,
    out: Annotated[str | None, typer.Option(help="File for one loop or mcap, else a directory; it is made.")] = None,
    loop: Annotated[list[str] | None, typer.Option(help="Only this loop; may be given several times.")] = None,
) -> None:
    """Write a recording for other programs: absolute time in UTC, units, operands as the manual spells them.

    CSV opens in Excel, pandas and DuckDB, Parquet in pandas and DuckDB, MCAP in Foxglove and PlotJuggler. Nothing is
    rounded: every REAL reads back to its bits. The names of the files stand on stdout.

    Example: ahgateway export demo.ahrec --to parquet --out trends
    """
    from pathlib import Path

    from ahgateway.apps.export import export as write
    from ahgateway.recording.reader import Recording

    source = Path(file)
    place = Path(out) if out else source.with_suffix(".mcap") if to is Format.MCAP else source.with_suffix("")
    with Recording(source) as recording:
        for path in write(recording, to.value, place, tuple(loop or ())):
            typer.echo(str(path))
