"""The page in a browser: files and facts over HTTP, on this machine only unless a token is asked for.

This file alone decides who may read. It is read-only by construction: every handler knows GET and HEAD and nothing
else, and this floor may import neither the write gate nor a wire (an import contract). Nothing is fetched from
anywhere else: Bokeh's script comes out of its package, and the page's own policy forbids to ask another host.
"""

from __future__ import annotations

import contextlib
import hmac
import ipaddress
import json
import math
import socket
from collections.abc import AsyncIterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bokeh.settings import settings
from tornado.httpserver import HTTPServer
from tornado.web import Application, HTTPError, RequestHandler

from ahgateway.apps.board import Board
from ahgateway.apps.history import SLICES_MAX, History
from ahgateway.apps.player import Player
from ahgateway.apps.rows import frame_lines
from ahgateway.errors import AhGatewayError, StateError
from ahgateway.web import facts
from ahgateway.web.charts import chart

HOST = "127.0.0.1"
COOKIE = "ahgateway"
STATIC = Path(__file__).parent / "static"
TYPES = {".html": "text/html", ".css": "text/css", ".js": "text/javascript", ".svg": "image/svg+xml"}
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; "
    "connect-src 'self'; font-src 'self' data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
FRAMES_SHOWN = 40


@dataclass(frozen=True, slots=True)
class Source:
    """What is served.

    Attributes:
        board: The run.
        history: What can be looked back on.
        station: What the station is called.
        player: Who plays the recording; None for a live run.
        host: Address that is listened on.
        token: What a reader must know; empty for none.
    """

    board: Board
    history: History
    station: str
    player: Player | None = None
    host: str = HOST
    token: str = ""


def is_loopback(host: str) -> bool:
    """Tell whether an address belongs to this machine alone."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return False


class Reading(RequestHandler):
    """A door that only lets look."""

    SUPPORTED_METHODS = ("GET", "HEAD")
    source: Source

    def initialize(self, source: Source) -> None:
        self.source = source

    def set_default_headers(self) -> None:
        self.set_header("Content-Security-Policy", POLICY)
        self.set_header("X-Content-Type-Options", "nosniff")
        self.set_header("Referrer-Policy", "no-referrer")
        self.set_header("Cache-Control", "no-store")
        self.clear_header("Server")

    def prepare(self) -> None:
        """Refuse a foreign name for this machine (another site's page asking in its own name), and a missing token."""
        name = self.request.host_name
        if is_loopback(self.source.host) and not is_loopback(name):
            raise HTTPError(403, reason="asked for under a name that is not this machine's")
        if not self.source.token:
            return
        given = self.get_query_argument("token", "")
        if given and hmac.compare_digest(given.encode(), self.source.token.encode()):
            self.set_cookie(COOKIE, self.source.token, httponly=True, samesite="Strict")
            return
        kept = self.get_cookie(COOKIE, "") or ""
        if not hmac.compare_digest(kept.encode(), self.source.token.encode()):
            raise HTTPError(403, reason="the token is missing or wrong")

    def head(self, *arguments: str) -> Any:
        """As GET; the server leaves the body out."""
        return self.get(*arguments)

    def get(self, *arguments: str) -> Any:
        """Answered by those below."""
        raise HTTPError(404)

    def answer(self, found: Any) -> None:
        """Answer with JSON; nothing that is no number stands in it."""
        self.set_header("Content-Type", "application/json; charset=utf-8")
        self.finish(json.dumps(found, allow_nan=False, ensure_ascii=False, separators=(",", ":")))

    def write_error(self, status_code: int, **more: Any) -> None:
        error = more.get("exc_info", (None, None, None))[1]
        text = error.message if isinstance(error, AhGatewayError) else self._reason
        self.answer({"error": text})

    def log_exception(self, kind: Any, error: Any, trace: Any) -> None:
        """What is told to the reader is not printed over somebody's screen."""
        if not isinstance(error, HTTPError | AhGatewayError):
            super().log_exception(kind, error, trace)

    def loop(self) -> str:
        """Name of the loop that is asked for."""
        name = self.get_query_argument("loop", "")
        if name not in self.source.board.watches:
            raise HTTPError(404, reason="there is no such loop")
        return name

    def number(self, name: str) -> float:
        """A finite number that is asked with."""
        try:
            found = float(self.get_query_argument(name))
        except ValueError:
            found = math.nan
        if not math.isfinite(found):
            raise HTTPError(400, reason=f"{name} is no number")
        return found


class File(Reading):
    """One file, always the same."""

    def initialize(self, source: Source, path: Path) -> None:  # type: ignore[override]
        self.source = source
        self._path = path

    def get(self, *arguments: str) -> None:
        self.set_header("Content-Type", f"{TYPES[self._path.suffix]}; charset=utf-8")
        self.finish(self._path.read_bytes())


class State(Reading):
    """Every loop in a row; each asking works out the health of the loop that has waited longest."""

    def get(self, *arguments: str) -> None:
        source = self.source
        source.board.health(source.board.oldest_health())
        self.answer(facts.state(source.board, source.history, source.station, source.player))


class Recent(Reading):
    """The newest samples of every loop."""

    def get(self, *arguments: str) -> None:
        self.answer(facts.recent(self.source.board, self.number("since")))


class Loop(Reading):
    """One loop's terms, operands and health."""

    def get(self, *arguments: str) -> None:
        self.answer(facts.loop_json(self.source.board, self.loop()))


class Chart(Reading):
    """What the trend of a loop is made of."""

    def get(self, *arguments: str) -> None:
        watch = self.source.board.watches[self.loop()]
        self.answer({"item": chart(watch.loop), "lanes": facts.lanes_json(watch), "legend": facts.legend()})


class Trend(Reading):
    """A stretch of a loop's time."""

    async def get(self, *arguments: str) -> None:
        since_s, until_s, slices = self.number("since"), self.number("until"), int(self.number("slices"))
        if not (since_s < until_s and 1 <= slices <= SLICES_MAX):
            raise HTTPError(400, reason=f"since must lie before until, slices within 1 to {SLICES_MAX}")
        self.answer(facts.stretch_json(await self.source.history.stretch(self.loop(), since_s, until_s, slices)))


class LinkPage(Reading):
    """The link's figures and last frames."""

    def get(self, *arguments: str) -> None:
        self.answer(facts.link_json(self.source.board, frame_lines(self.source.board, FRAMES_SHOWN)))


class Log(Reading):
    """What happened."""

    def get(self, *arguments: str) -> None:
        self.answer(facts.log_json(self.source.board, int(self.number("after"))))


FACTS: dict[str, type[Reading]] = {
    "state": State,
    "recent": Recent,
    "loop": Loop,
    "chart": Chart,
    "trend": Trend,
    "link": LinkPage,
    "log": Log,
}


def application(source: Source) -> Application:
    """Return the whole of what is served."""
    script = Path(settings.bokehjs_path()) / "js" / "bokeh.min.js"
    files = {
        "": STATIC / "index.html",
        "bokeh.min.js": script,
        **{path.name: path for path in sorted(STATIC.iterdir()) if path.suffix in {".css", ".js", ".svg"}},
    }
    routes: list[Any] = [(f"/{name}", File, {"source": source, "path": path}) for name, path in files.items()]
    routes += [(f"/{name}.json", handler, {"source": source}) for name, handler in FACTS.items()]
    return Application(
        routes,
        default_handler_class=Reading,
        default_handler_args={"source": source},
        log_function=lambda _: None,
        compress_response=True,
    )


@contextlib.asynccontextmanager
async def served(source: Source, port: int) -> AsyncIterator[int]:
    """Serve the page while the context lasts; yield the port.

    Args:
        source: What is served, where and to whom.
        port: TCP port; 0 takes a free one.

    Raises:
        StateError: The port is taken, the address is not this machine's, or it needs a token and has none.
    """
    if not is_loopback(source.host) and not source.token:
        raise StateError(f"the page is not served on {source.host} without a token")
    try:
        family = socket.AF_INET6 if ":" in source.host else socket.AF_INET
        listening = socket.create_server((source.host, port), family=family)
    except OSError as error:
        raise StateError(
            f"the page cannot be served on {source.host}:{port}: {error.strerror or error}",
            hint="give another --web-port, or 0 for a free one",
        ) from error
    server = HTTPServer(application(source), max_body_size=0)
    listening.setblocking(False)
    server.add_socket(listening)
    try:
        yield int(listening.getsockname()[1])
    finally:
        server.stop()
        await server.close_all_connections()
