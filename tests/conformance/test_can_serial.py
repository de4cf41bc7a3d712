"""CAN over a serial adapter's protocol, through a pseudo-terminal: real bytes between two processes, and unplugging."""

from __future__ import annotations

import asyncio
import json
import os
import shutil
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from conformance.patience import PatientLoop
from conformance.peers import AHGATEWAY, followed, verdicts
from transports.can.can_bench import fake_plc, served, station

from ahgateway.clock import WallClock
from ahgateway.codec.access import Read, Table
from ahgateway.codec.can_frame import CanFrame
from ahgateway.codec.station import Pacing
from ahgateway.errors import LinkError, TransportError
from ahgateway.schema.profile import load
from ahgateway.transports.can.bus import bus_for
from ahgateway.transports.can.link import SdoLink
from ahgateway.transports.uri import open_link, parse_uri

LOOP = PatientLoop
SV = Read(1, Table.HOLDING, 100, 2)


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
    link = open_link(parse_uri(text), WallClock(), Pacing(reply_timeout_ms=2000), can=station(text).can)
    assert isinstance(link, SdoLink)
    async with served(cable.target(0), fake_plc()):
        assert (0x0000, 0x42A0) == (await link.exchange(SV)).values
        cable.cut()
        # A second in which this process runs; how long it is let wait besides says nothing of the link.
        for _ in range(200):
            if not link.bus.is_open:
                break
            await asyncio.sleep(0.005)
        assert not link.bus.is_open
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


@pytest.mark.slow
async def test_what_waited_in_the_driver_before_we_opened_it_is_not_taken_for_fresh(cable: Cable) -> None:
    """300 SYNCs of before, then a heartbeat: only the heartbeat is of now."""
    adapter = os.open(cable.ends[0], os.O_RDWR | os.O_NOCTTY)
    os.write(adapter, b"t0800\r" * 300)
    bus, got = bus_for(parse_uri(cable.target(1)), WallClock()), asyncio.Queue[CanFrame]()
    bus.subscribe(got.put_nowait)
    await bus.open()
    os.write(adapter, b"t703105\r")
    async with asyncio.timeout(10):
        assert 0x703 == (await got.get()).can_id
    await bus.close()
    os.close(adapter)


def run(*arguments: str) -> str:
    done = subprocess.run([*AHGATEWAY, *arguments], capture_output=True, text=True, timeout=200, check=False)
    assert 0 == done.returncode, done.stdout[-500:] + done.stderr
    return done.stdout


@pytest.fixture
def slow_loop(tmp_path: Path) -> str:
    """The shipped example with a CYCLE that leaves a busy machine time for whole pictures and for its scans."""
    text = load("can").text.replace("CYCLE = 200", "CYCLE = 2000")
    pacing = "[station.pacing]\npoll_ms = 40\nreply_timeout_ms = 5000\n\n[station.can]"
    text = text.replace("[station.can]", pacing, 1).replace(
        'instruction = "DPIDE"', 'instruction = "DPIDE"\nscan_ms_max = 500'
    )
    path = tmp_path / "slow.toml"
    path.write_text(text, encoding="utf-8")
    return str(path)


@pytest.fixture
def server(cable: Cable, slow_loop: str) -> Iterator[subprocess.Popen[str]]:
    """The fake PLC as a node, in a process of its own."""
    command = [*AHGATEWAY, "can", "serve", slow_loop, "--sync", "--target", cable.target(0)]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        try:
            assert process.stderr is not None
            assert "is node 3 at canopen://slcan" in process.stderr.readline()
            yield process
        finally:
            process.terminate()


@pytest.mark.slow
def test_a_loop_is_followed_between_two_processes_by_sdo_and_by_pdo(
    cable: Cable, server: subprocess.Popen[str], slow_loop: str, tmp_path: Path
) -> None:
    for options, seen in (
        ("", ("node 3 is asked for 0x2000:01", "node 3 holds 0x2000:01 = 42A00000")),
        ("&pdo=1", ("SYNC", "D104 0000 0000 07D0 0000")),
    ):
        tape, trace = tmp_path / f"run{options}.ahrec", tmp_path / f"run{options}.txt"
        kept = ("--record", str(tape), "--record-frames", "--trace", str(trace))
        target = cable.target(1, options)
        lines = followed(slow_loop, "--target", target, *kept, enough=lambda told: 2 == verdicts(told).count("MATCH"))
        assert [] == [line for line in lines if line.get("verdict") == "DIVERGED"]
        traced = trace.read_text(encoding="utf-8")
        frames = [json.loads(line) for line in run("can", "dump", f"replay://{tape}", "--output", "json").splitlines()]
        for text in seen:
            assert any(text in frame.get("text", "") for frame in frames)
            assert text in traced
        assert len(frames) - 1 == frames[-1]["recorded"]
        assert frames[-1]["recorded"] > 0.9 * len(traced.splitlines()), "a recording ends a little before its link"
    dumped = run("can", "dump", cable.target(1), "--profile", "can", "--count", "12")
    assert "080 [0]                           SYNC" in dumped
    assert "D104 0000 0000 07D0 0000" in dumped, "PID_MODE 0 and CYCLE 2000"
    server.terminate()
    assert 0 == server.wait(timeout=60)
