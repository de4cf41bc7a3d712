"""`ahgateway monitor`: follow every loop of a profile on a live PLC."""

from __future__ import annotations

import contextlib
import os
import sys
from typing import TYPE_CHECKING, Annotated

import typer

from ahgateway.cli.page import PORT, Page, Web, WebHost, WebPort
from ahgateway.cli.repro import Repro
from ahgateway.cli.stepping import Arm, Plan, show_plan, stepped
from ahgateway.cli.tape import Keep, Record, Recorded, RecordFrames, RollHours, RollMb
from ahgateway.cli.trace import Trace, traced
from ahgateway.cli.view import Output, View

if TYPE_CHECKING:
    from collections.abc import Iterator

    from ahgateway.apps.board import Board
    from ahgateway.apps.monitor import Monitor
    from ahgateway.apps.player import Player
    from ahgateway.codec.station import Station
    from ahgateway.transports.base import Tap

WRITES_PER_SECOND = 10


def monitor(
    profile: Annotated[str, typer.Argument(help="Profile file, or the name of a shipped example such as `demo`.")],
    target: Annotated[
        str | None,
        typer.Option(help="Link to use instead of the profile's, such as modbus+tcp://192.0.2.10:502?unit=1."),
    ] = None,
    duration: Annotated[float | None, typer.Option(help="Stop after so many seconds.", min=0.0)] = None,
    output: Annotated[Output, typer.Option(help="text for people, json for one object per line.")] = Output.TEXT,
    coverage: Annotated[
        float, typer.Option(help="Smallest share of executions proven by bits for exit code 0.", min=0.0, max=1.0)
    ] = 0.0,
    plain: Annotated[bool, typer.Option("--plain", help="Lines instead of the screen, in a terminal too.")] = False,
    metrics: Annotated[
        int | None,
        typer.Option(
            metavar="PORT", help="Serve Prometheus metrics on 127.0.0.1; 0 takes a free port.", min=0, max=65535
        ),
    ] = None,
    web: Web = False,
    web_port: WebPort = PORT,
    web_host: WebHost = "127.0.0.1",
    record: Record = None,
    record_frames: RecordFrames = False,
    roll_mb: RollMb = None,
    roll_hours: RollHours = None,
    keep: Keep = None,
    repro: Repro = None,
    trace: Trace = None,
    plan: Plan = False,
    arm: Arm = None,
) -> None:
    """Follow every loop of a profile and compare each execution with the reference.

    Only reads, but with --arm on a bench: that sets the loop's trigger once for each execution. In a terminal it opens
    a screen whose keys stand at its foot; otherwise, or with --plain, it prints lines, or JSON lines with --output
    json. Ends at --duration, with Ctrl-C or with q. Exit code 0 when executions were compared and none diverged, 1 when
    one diverged, 3 when nothing could be compared or less than --coverage.

    With --record everything seen is kept in a file, for `ahgateway replay`. The target replay://FILE follows such a
    recording instead of a PLC: as fast as it goes, or ?speed=1 times as fast as it was. On the screen and with --web it
    is played, ?speed=1 when nothing else is said, and stays open at its end; the screen's keys pause it and seek in it.

    Example: ahgateway monitor line3.toml --target modbus+tcp://192.0.2.10:502?unit=1 --duration 60
    Example: ahgateway monitor line3.toml --web --record shift.ahrec
    Example: ahgateway monitor line3.toml --plan
    """
    import asyncio

    from ahgateway.cli.targets import resolved
    from ahgateway.schema.profile import load

    loaded = load(profile)
    station = stepped(resolved(loaded.station(), target), arm)
    if plan:
        with traced(trace, station) as tap:
            raise typer.Exit(asyncio.run(show_plan(station, output, tap)))
    tape = Recorded(record, record_frames, roll_mb, roll_hours, keep, loaded.text)
    with traced(trace, station) as tap:
        page = Page(web, web_port, web_host)
        ran = _monitor(
            station, duration, output, coverage, tape, page, plain=plain, metrics=metrics, tap=tap, repro=repro
        )
        raise typer.Exit(asyncio.run(ran))


async def _monitor(
    station: Station,
    duration_s: float | None,
    output: Output,
    coverage_min: float,
    tape: Recorded,
    page: Page,
    *,
    plain: bool,
    metrics: int | None,
    tap: Tap | None,
    repro: str | None,
) -> int:
    from ahgateway.apps.board import Board
    from ahgateway.cli.interrupt import stop_event
    from ahgateway.cli.page import paged
    from ahgateway.cli.repro import reproduced
    from ahgateway.cli.run import Taps, followed
    from ahgateway.cli.tape import recorded
    from ahgateway.clock import SECOND

    duration_ns = None if duration_s is None else round(duration_s * SECOND)
    # The screen is drawn on stderr: redirected into a file it would not be seen, nor could it be left.
    has_terminal = all(each.isatty() for each in (sys.stdin, sys.stdout, sys.stderr))
    has_screen = output is Output.TEXT and not plain and has_terminal
    is_shown = has_screen or page.is_on
    taps = Taps([tap] if tap is not None else [])
    async with (
        followed(station, taps if is_shown or tape.frames or tap else None, plays=is_shown and tape.path is None) as (
            watched,
            clock,
        ),
        contextlib.AsyncExitStack() as stack,
    ):
        board = Board(watched, clock) if is_shown or metrics is not None else None
        if board is not None:
            taps.more(board.frame)
        stop = stack.enter_context(stop_event())
        view = stack.enter_context(
            View(watched, clock, output, coverage_min, station.name, is_table=False, has_screen=has_screen)
        )
        say = board.note if board is not None and has_screen else view.note
        sink = stack.enter_context(recorded(tape, station, clock, say))
        divergences = stack.enter_context(reproduced(repro, watched.station))
        taps.more(sink.frame)
        player = _played(watched, board)
        if board is not None:
            if metrics is not None:
                stack.enter_context(_metrics(board, metrics))
            if page.is_on:
                await stack.enter_async_context(paged(page, station, board, watched, lambda: sink.path, say))
        if board is not None and has_screen:
            # Before Textual is imported: however long a key is held down, the terminal is written to so often a second.
            os.environ.setdefault("TEXTUAL_FPS", str(WRITES_PER_SECOND))
            from ahgateway.tui.app import MonitorApp, shown

            screen = MonitorApp(
                board, station.name, on_note=lambda note: sink.note(note.utc_ns, note.text), player=player
            )
            await stack.enter_async_context(shown(screen, stop))
        async for report in watched.reports(duration_ns=duration_ns, stop=stop):
            if board is not None:
                board.take(report)
            view.show(report)
            sink.take(report)
            divergences.take(report)
    return int(watched.outcome(coverage_min))


def _played(watched: Monitor, board: Board | None) -> Player | None:
    """Return the player of a recording; when it is sought in, the board forgets what lies behind the place."""
    from ahgateway.apps.replay import ReplayMonitor

    if not isinstance(watched, ReplayMonitor):
        return None
    if board is not None:
        watched.on_jump, watched.on_frame = board.cut, board.frame
    return watched.player


@contextlib.contextmanager
def _metrics(board: Board, port: int) -> Iterator[None]:
    from ahgateway.errors import StateError

    try:
        from ahgateway.apps.metrics import HOST, served
    except ModuleNotFoundError as error:
        raise StateError(
            f"`--metrics` needs `{error.name}`, which is not installed", hint="pip install 'ahgateway[metrics]'"
        ) from error
    with served(board, port) as found:
        typer.echo(f"metrics at http://{HOST}:{found}/metrics", err=True)
        yield
