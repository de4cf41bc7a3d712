"""`monitor --web`: the page in a browser, its address, and the token without which it stays on this machine."""

from __future__ import annotations

import contextlib
import os
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from pathlib import Path

    from ahgateway.apps.board import Board
    from ahgateway.apps.monitor import Monitor
    from ahgateway.codec.station import Station

Web = Annotated[bool, typer.Option("--web", help="Show the run in a browser too: trends, verdicts, log; read-only.")]
WebPort = Annotated[int, typer.Option(metavar="PORT", help="Port of the page; 0 takes a free one.", min=0, max=65535)]
WebHost = Annotated[
    str,
    typer.Option(
        metavar="ADDRESS",
        help="Address of the page; any but 127.0.0.1 lets others on the network look, who need the printed token.",
    ),
]
PORT = 8480
TOKEN = "AHGATEWAY_WEB_TOKEN"
"""Environment variable with the token, for those who want the same one every day."""
TOKEN_LENGTH_MIN = 16


@dataclass(frozen=True, slots=True)
class Page:
    """What the options of a command say."""

    is_on: bool
    port: int
    host: str


@contextlib.asynccontextmanager
async def paged(
    page: Page,
    station: Station,
    board: Board,
    monitor: Monitor,
    path: Callable[[], Path | None],
    say: Callable[[str], object],
) -> AsyncIterator[None]:
    """Serve the page around a run and say where.

    Args:
        page: What was asked for.
        station: What is followed.
        board: The run.
        monitor: Whose reports feed the board.
        path: The recording that is written, None without one.
        say: Tells the user.

    Raises:
        StateError: The extra is not installed, the port is taken, or the token is too short.
    """
    from ahgateway.errors import StateError

    try:
        from ahgateway.web.server import Source, is_loopback, served
    except ModuleNotFoundError as error:
        raise StateError(
            f"`--web` needs `{error.name}`, which is not installed", hint="pip install 'ahgateway[web]'"
        ) from error
    from ahgateway.apps.history import History
    from ahgateway.apps.replay import ReplayMonitor

    player = None
    history = History(board, path)
    if isinstance(monitor, ReplayMonitor):
        player, played = monitor.player, monitor.recording.path
        history = History(board, lambda: played, is_replay=True)
    token = "" if is_loopback(page.host) else _token()
    source = Source(board, history, station.name, player, page.host, token)
    async with served(source, page.port) as port:
        host = f"[{page.host}]" if ":" in page.host else page.host
        say(f"page at http://{host}:{port}/{f'?token={token}' if token else ''}")
        if token:
            say(
                f"warning: the page is open to the network at {page.host}, unencrypted; "
                "whoever has the token sees this run, nobody can change anything"
            )
        yield


def _token() -> str:
    """The user's own token, or a new one.

    Raises:
        StateError: The user's own is too short to keep anybody out.
    """
    import secrets

    from ahgateway.errors import StateError

    own = os.environ.get(TOKEN)
    if own is None:
        return secrets.token_urlsafe(24)
    if len(own) < TOKEN_LENGTH_MIN:
        raise StateError(
            f"{TOKEN}: has {len(own)} characters, at least {TOKEN_LENGTH_MIN} are asked for",
            hint="unset it, and a token is made and printed",
        )
    return own
