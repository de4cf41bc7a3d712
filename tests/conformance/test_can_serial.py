"""CAN over a serial adapter's protocol, through a pseudo-terminal: real bytes between two processes, and unplugging."""

from __future__ import annotations

import asyncio
import json
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from transports.can.can_bench import fake_plc, served, station

from ahgateway.clock import WallClock
from ahgateway.codec.access import Read, Table
from ahgateway.codec.station import Pacing
from ahgateway.errors import LinkError, TransportError
from ahgateway.transports.can.link import SdoLink
from ahgateway.transports.uri import open_link, parse_uri

SV = Read(1, Table.HOLDING, 100, 2)
AHGATEWAY = (sys.executable, "-m", "ahgateway.cli.main")


class Cable:
    """Two pseudo-terminals joined by socat; `cut` pulls the plug of both, `plug` joins them again."""

    def __init__(self, folder: Path) -> None:
        self.ends = (folder / "a", folder / "b")
        self._socat: subprocess.Popen[bytes] | None = None

    def plug(self) -> None:
        socat = shutil.which("socat")
        assert socat is not None
        self._socat = subprocess.Popen([socat, *(f"pty,raw,echo=0,link={end}" for end in self.ends)])
        deadline_s = time.monotonic() + 10.0
        while not all(end.exists() for end in self.ends):
            assert time.monotonic() < deadline_s, "socat made no pseudo-terminals within 10 s"
            time.sleep(0.005)

    def cut(self) -> None:
        if self._socat is not None:
            self._socat.terminate()
            self._socat.wait()
            self._socat = None

    def target(self, end: int, options: str = "") -> str:
        return f"canopen://slcan{self.ends[end]}?node=3&settle_ms=0{options}"


@pytest.fixture
def cable(tmp_path: Path) -> Iterator[Cable]:
    made = Cable(tmp_path)
    made.plug()
    yield made
    made.cut()


@pytest.mark.slow
async def test_the_link_works_is_unplugged_within_a_second_and_comes_back(cable: Cable) -> None:
    text = cable.target(1)
    link = open_link(parse_uri(text), WallClock(), Pacing(reply_timeout_ms=300), can=station(text).can)
    assert isinstance(link, SdoLink)
    async with served(cable.target(0), fake_plc()):
        assert (0x0000, 0x42A0) == (await link.exchange(SV)).values
        cable.cut()
        start = time.monotonic()
        for _ in range(200):
            if not link.bus.is_open:
                break
            await asyncio.sleep(0.005)
        assert time.monotonic() - start < 1.0
        with pytest.raises(LinkError):
            await link.exchange(SV)
        cable.plug()
        for _ in range(60):
            try:
                assert (0x0000, 0x42A0) == (await link.exchange(SV)).values
                break
            except TransportError:
                await asyncio.sleep(0.05)
        assert link.bus.figures.losses >= 1
        assert link.figures.reconnects >= 1
        assert link.figures.first_cause
        await link.close()


def run(*arguments: str) -> str:
    done = subprocess.run([*AHGATEWAY, *arguments], capture_output=True, text=True, timeout=30, check=False)
    assert 0 == done.returncode, done.stdout[-500:] + done.stderr
    return done.stdout


@pytest.fixture
def server(cable: Cable) -> Iterator[subprocess.Popen[str]]:
    """The fake PLC as a node, in a process of its own."""
    command = [*AHGATEWAY, "can", "serve", "can", "--sync", "--target", cable.target(0)]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        try:
            assert process.stderr is not None
            assert "is node 3 at canopen://slcan" in process.stderr.readline()
            yield process
        finally:
            process.terminate()


@pytest.mark.slow
def test_a_loop_is_followed_between_two_processes_by_sdo_and_by_pdo(
    cable: Cable, server: subprocess.Popen[str], tmp_path: Path
) -> None:
    for options, seconds, seen in (
        ("", "3", ("node 3 is asked for 0x2000:01", "> 603 [8] 40 00 20 01")),
        ("&pdo=1", "2", ("080 [0]", "D104 0000 0000 00C8 0000")),
    ):
        target, tape, trace = cable.target(1, options), tmp_path / f"{seconds}.ahrec", tmp_path / f"{seconds}.txt"
        kept = ("--record", str(tape), "--record-frames", "--trace", str(trace))
        said = run("monitor", "can", "--target", target, "--duration", seconds, "--output", "json", *kept)
        recorded, traced = run("can", "dump", f"replay://{tape}"), trace.read_text(encoding="utf-8")
        for text in seen:
            assert text in recorded
            assert text in traced
        frames = [json.loads(line) for line in run("can", "dump", f"replay://{tape}", "--output", "json").splitlines()]
        assert len(frames) - 1 == frames[-1]["recorded"]
        assert frames[-1]["recorded"] > 0.9 * len(traced.splitlines()), "a recording ends a little before its link"
        summary = json.loads(said.splitlines()[-1])
        assert summary["counts"]["match"] >= 3
        assert 0 == summary["counts"]["diverged"]
    dumped = run("can", "dump", cable.target(1), "--profile", "can", "--count", "12")
    assert "080 [0]                           SYNC" in dumped
    assert "D104 0000 0000 00C8 0000" in dumped, "PID_MODE 0 and CYCLE 200"
    server.terminate()
    assert 0 == server.wait(timeout=10)
