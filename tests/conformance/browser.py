"""A headless Chromium driven over its DevTools protocol: opens a page, asks it, remembers what it fetched and said."""

from __future__ import annotations

import asyncio
import base64
import json
import shutil
from pathlib import Path
from typing import Any

from tornado.httpclient import AsyncHTTPClient
from tornado.websocket import websocket_connect

PATIENCE_S = 120.0
STEP_S = 0.05


class Browser:
    """One browser with one page.

    Attributes:
        urls: Every address that was asked for.
        complaints: What the page wrote to its console as a warning or an error, and what it did not catch.
    """

    def __init__(self, home: Path, *, patience_s: float = PATIENCE_S) -> None:
        self.urls: list[str] = []
        self.complaints: list[str] = []
        self._home = home
        self._patience_s = patience_s
        self._waiting: dict[int, asyncio.Future[Any]] = {}
        self._number = 0

    async def start(self, *, width: int = 1500, height: int = 950) -> None:
        """Start Chromium and attach to its page."""
        found = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
        assert found, "the page is tested in Chromium: apt-get install chromium"
        self._process = await asyncio.create_subprocess_exec(
                found, "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--no-first-run",
                "--disable-background-networking", "--disable-component-update", "--disable-sync", "--mute-audio",
                "--disable-features=Translate,OptimizationHints,MediaRouter", "--hide-scrollbars",
                "--remote-debugging-port=0", f"--user-data-dir={self._home}", f"--window-size={width},{height}",
                "about:blank",
            stdout=asyncio.subprocess.DEVNULL,
            stderr=asyncio.subprocess.DEVNULL,
        )  # fmt: skip
        place = self._home / "DevToolsActivePort"
        await until(lambda: place.is_file() and place.read_text().count("\n") >= 1, "Chromium says its port")
        port = place.read_text().splitlines()[0]
        page = await self._page(f"http://127.0.0.1:{port}/json/list")
        self._socket = await websocket_connect(page["webSocketDebuggerUrl"], max_message_size=1 << 28)
        self._reader = asyncio.ensure_future(self._read())
        for domain in ("Page", "Network", "Runtime", "Log"):
            await self.do(f"{domain}.enable")
        await self.size(width, height)

    @staticmethod
    async def _page(url: str) -> Any:
        """Return what the browser says of its page; the port is open a little before there is one."""
        for _ in range(round(PATIENCE_S / STEP_S)):
            reply = await AsyncHTTPClient().fetch(url, request_timeout=PATIENCE_S)
            for each in json.loads(reply.body):
                if each["type"] == "page":
                    return each
            await asyncio.sleep(STEP_S)
        raise AssertionError("Chromium has no page")

    async def close(self) -> None:
        """End the browser and wait for it."""
        self._reader.cancel()
        self._socket.close()
        self._process.terminate()
        await asyncio.wait_for(self._process.wait(), self._patience_s)

    async def do(self, method: str, **arguments: Any) -> Any:
        """Send one command of the protocol and return its answer."""
        self._number += 1
        answer = asyncio.get_running_loop().create_future()
        self._waiting[self._number] = answer
        # The answer may be there, and no longer waited for, before the writing returns.
        await self._socket.write_message(json.dumps({"id": self._number, "method": method, "params": arguments}))
        return await asyncio.wait_for(answer, self._patience_s)

    async def size(self, width: int, height: int) -> None:
        await self.do(
            "Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False
        )

    async def prefer(self, scheme: str) -> None:
        """Prefer `dark` or `light`, as the user's desktop does."""
        await self.do("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])

    async def open(self, url: str) -> None:
        """Load a page."""
        await self.do("Page.navigate", url=url)

    async def ask(self, expression: str) -> Any:
        """Return what an expression of the page's own language is worth, promises awaited."""
        found = await self.do("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in found, found["exceptionDetails"]
        return found["result"].get("value")

    async def until(self, expression: str) -> Any:
        """Wait until an expression is worth something and return it."""
        for _ in range(round(self._patience_s / STEP_S)):
            found = await self.ask(expression)
            if found:
                return found
            await asyncio.sleep(STEP_S)
        raise AssertionError(f"the page never came to: {expression}; it said {self.complaints}")

    async def picture(self) -> bytes:
        """Return what is seen as a PNG."""
        found = await self.do("Page.captureScreenshot", format="png")
        return base64.b64decode(found["data"])

    async def _read(self) -> None:
        while (text := await self._socket.read_message()) is not None:
            found = json.loads(text)
            method, more = found.get("method"), found.get("params", {})
            if "id" in found:
                self._waiting.pop(found["id"]).set_result(found.get("result", found.get("error")))
            elif method == "Network.requestWillBeSent":
                self.urls.append(more["request"]["url"])
            elif method == "Runtime.exceptionThrown":
                self.complaints.append(json.dumps(more["exceptionDetails"])[:2000])
            elif method == "Log.entryAdded" and more["entry"]["level"] in ("error", "warning"):
                self.complaints.append(f"{more['entry']['text']} {more['entry'].get('url', '')}")
            elif method == "Runtime.consoleAPICalled" and more["type"] in ("error", "warning", "assert"):
                self.complaints.append(str([each.get("value", each.get("description")) for each in more["args"]]))


async def until(holds: Any, what: str) -> None:
    """Wait until something holds."""
    for _ in range(round(PATIENCE_S / STEP_S)):
        if holds():
            return
        await asyncio.sleep(STEP_S)
    raise AssertionError(f"never: {what}")
