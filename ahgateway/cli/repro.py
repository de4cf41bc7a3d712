"""`--repro` on every command that judges: divergences as small files that play without a PLC."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from ahgateway.apps.monitor import Report
    from ahgateway.apps.repro import Repros
    from ahgateway.codec.station import Station

Repro = Annotated[
    str | None,
    typer.Option(
        "--repro",
        metavar="DIR",
        help="Write each loop's divergence here: the smallest file that still differs, and a pytest case on it.",
    ),
]


class Divergences:
    """Takes reports; does nothing when nobody asked for files."""

    def __init__(self, repros: Repros | None) -> None:
        self._repros = repros

    def take(self, report: Report) -> None:
        """Take in one report."""
        if self._repros is not None:
            self._repros.take(report)


@contextlib.contextmanager
def reproduced(folder: str | None, station: Station) -> Iterator[Divergences]:
    """Yield where a run's reports go; the files are written when it ends, and how to run them is said on stderr.

    Raises:
        StateError: The folder cannot be written to.
    """
    if folder is None:
        yield Divergences(None)
        return
    from ahgateway.apps.repro import Repros

    repros = Repros(station)
    yield Divergences(repros)
    tests = repros.write(Path(folder))
    for path in tests:
        typer.echo(f"divergence written, run it with: python -m pytest {path}", err=True)
    if not tests:
        typer.echo(f"nothing diverged, nothing was written to {folder}", err=True)
