"""`check` on a PLC in real time: a process of its own behind a socket, and RTU on a pair of pseudo-terminals."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from conformance.peers import AHGATEWAY, plc_process, serial_pair

from ahgateway.apps.check.live import LiveBench, bench_lease
from ahgateway.apps.check.result import Verdict
from ahgateway.apps.check.suite import results
from ahgateway.clock import WallClock
from ahgateway.errors import StateError
from ahgateway.fake.plc import FakePlc
from ahgateway.fake.serve import until
from ahgateway.lockstep.gate.place import Folders
from ahgateway.schema.profile import load
from ahgateway.schema.scenario import parse
from ahgateway.transports.line import Line
from ahgateway.transports.serial_link import SerialLink
from ahgateway.transports.serial_server import serve_serial

pytestmark = pytest.mark.slow

STEP = """
title = "A step in real time"
instruction = "DPIDE"
duration = 7.0
plant = { kind = "fopdt", gain = 1.2, tau_s = 1.0, dead_time_s = 0.1, bias = 10.0, noise = 0.02, initial = 50.0 }
initial = { SV = 50.0, CYCLE = 1000, Kc_Kp = 0.4, Ti_Ki = 0.2 }

[[step]]
at = 3.0
set = { SV = 60.0 }

[expect]
clamps = true

[[expect.response]]
after = 3.0
direction = "up"
always = "PV < 80"
"""


def ahgateway(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([*AHGATEWAY, *arguments], capture_output=True, text=True, timeout=200.0, check=False)


AS_FOUND = ("33.0", "30.0", "500", "1.25")


def standing(target: str) -> tuple[str, ...]:
    """SV, PV, CYCLE and Kc_Kp as they stand in the PLC."""
    left = ahgateway("read", "live_bench", "--target", target, "--loop", "DPIDE")
    found = {line.split()[1]: line.split()[3] for line in left.stdout.splitlines() if len(line.split()) > 3}
    return tuple(found[name] for name in ("SV", "PV", "CYCLE", "Kc_Kp"))


@pytest.fixture
def bench_plc() -> Iterator[str]:
    """A PLC whose loops have no process, in a process of its own; gives its target."""
    with plc_process("live_bench") as target:
        yield target


def test_a_bench_behind_a_socket_is_driven_and_put_back(bench_plc: str, tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "step.toml").write_text(STEP)
    asked = ["--profile", "live_bench", "--target", bench_plc]
    done = ahgateway("check", str(tmp_path / "mine"), *asked, "--arm", "--directory", str(tmp_path), "--output", "json")

    told = [json.loads(line) for line in done.stdout.splitlines()]
    assert ["bench", "scenario", "run"] == [each["kind"] for each in told], done.stdout + done.stderr
    assert ("pass", 0, 0) == (told[1]["verdict"], told[2]["exit"], done.returncode), done.stdout + done.stderr
    assert 10 <= told[1]["pace"]["steps"] <= 15
    assert AS_FOUND == standing(bench_plc)


def test_a_run_killed_in_the_middle_is_put_back_by_the_journal(bench_plc: str, tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "step.toml").write_text(STEP)
    asked = ["live_bench", "--target", bench_plc]
    command = [*AHGATEWAY, "check", str(tmp_path / "mine"), "--profile", *asked, "--arm", "--directory", str(tmp_path)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    for _ in range(3000):
        journals = list(tmp_path.glob("*.jsonl"))
        if journals and '"check: begin"' in journals[0].read_text():
            break
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(timeout=0.05)
    assert process.poll() is None, process.communicate()
    place = Folders(tmp_path, Path(os.environ["XDG_STATE_HOME"]) / "ahgateway" / "leases")
    with pytest.raises(StateError, match="is taken by another run on this machine"):
        bench_lease(place, bench_plc, "a second run")
    process.kill()
    process.communicate(timeout=60)
    bench_lease(place, bench_plc, "the next run").release()

    assert AS_FOUND != standing(bench_plc)
    restored = ahgateway("write", *asked, "--arm", "DPIDE", "--restore", "--directory", str(tmp_path))
    assert (0, AS_FOUND) == (restored.returncode, standing(bench_plc)), restored.stdout + restored.stderr


async def test_a_bench_on_a_serial_line_is_driven_and_put_back(tmp_path: Path) -> None:
    profile, clock, stop = load("live_bench"), WallClock(), asyncio.Event()
    plc = FakePlc(profile.station(), profile.fake_setup())
    async with serial_pair() as (plc_end, our_end):
        server = await serve_serial(plc, Line(plc_end, 115200))
        scanning = asyncio.ensure_future(until(stop, plc, clock))
        link = SerialLink(Line(our_end, 115200), clock=clock)
        try:
            bench = LiveBench(profile.station(), link, clock, tmp_path)
            result = await anext(results([parse(STEP, "step.toml", "mine/step")], bench, clock))
        finally:
            stop.set()
            await scanning
            await link.close()
            await server.close()

    assert Verdict.PASS is result.verdict, result.reason
    assert ([33.0, 30.0, 500], 0) == (
        [plc.read("DPIDE", name) for name in ("SV", "PV", "CYCLE")],
        result.counts.diverged,
    )
