"""Real signals to a real process over a real socket: whatever ends it, the loop is as found; nothing else was written.

The wall clock is allowed here; waiting is for the PLC to be in manual, not for time.
"""

from __future__ import annotations

import asyncio
import contextlib
import signal
import sys
from pathlib import Path

import pytest

from ahgateway.clock import MILLISECOND, SECOND, WallClock
from ahgateway.codec.access import Table
from ahgateway.fake.plc import FakePlc
from ahgateway.fake.serve import scan_in_time
from ahgateway.lockstep.gate.journal import verify
from ahgateway.schema.profile import parse
from ahgateway.transports.server import serve_tcp

PROFILE = """
[station]
name = "Bench"
target = "modbus+tcp://127.0.0.1:{port}"
kind = "bench"
running = "SM400"
[loops.L]
instruction = "DPIDE"
layout = "manual"
ranges = {{ pv = [0.0, 200.0], mv = [0.0, 100.0] }}
[loops.L.write]
SV = {{ min = 0.0, max = 200.0, step_max = 50.0, interval_s = 0.1 }}
MOUT = {{ min = 0.0, max = 100.0, step_max = 5.0, interval_s = 0.1 }}
PID_MAN = {{ interval_s = 0.1 }}
[loops.L.fake]
plant = {{ kind = "fopdt", gain = 1.2, tau_s = 2.0, dead_time_s = 0.1, bias = 10.0, noise = 0.02, initial = 58.0 }}
[loops.L.fake.initial]
SV = 58.0
CYCLE = 100
Kc_Kp = 0.8
Ti_Ki = 0.4
{lease}
"""
LEASE = '[loops.L.lease]\ndata = "D700"\ntimeout_ms = 2000\ntask_ms = 50\n'
FRONT = "from ahgateway.cli.main import main; main()"
NAMES = ("SV", "PID_MAN", "MOUT", "MV_MAX", "MV_MIN")
ALLOWED = {(Table.HOLDING, 122), (Table.COIL, 2)}
"""MOUT at D122 and PID_MAN at M2."""
STOPS = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]


@contextlib.asynccontextmanager
async def commissioning(folder: Path, lease: str = ""):
    """A served fake in real time, and a process that commissions it; entered when it has put the loop in manual."""
    wall = WallClock()
    loaded = parse(PROFILE.format(port=1, lease=lease), "bench.toml")
    plc = FakePlc(loaded.station(), loaded.fake_setup(), scan_ns=10 * MILLISECOND, seed=3)
    plc.advance(20 * SECOND)
    server = await serve_tcp(plc, "127.0.0.1", 0, clock=wall)
    scanning = asyncio.ensure_future(scan_in_time(plc, wall))
    profile = folder / "bench.toml"
    profile.write_text(PROFILE.format(port=server.port, lease=lease), encoding="utf-8")
    arguments = [
        "commission", str(profile), "--arm", "L", "--auto", "--idle", "0", "--executions", "5", "--coverage", "0",
        "--answer", "30", "--directory", str(folder / "gates"), "--state", str(folder / "state.json"),
        "--sheet", str(folder / "sheet.html"),
    ]  # fmt: skip
    child = await asyncio.create_subprocess_exec(
        sys.executable, "-c", FRONT, *arguments, stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.PIPE
    )
    try:
        for _ in range(5000):
            if plc.read("L", "PID_MAN"):
                break
            assert child.returncode is None, (await child.communicate())[1].decode()
            await asyncio.sleep(0.02)
        yield plc, child
    finally:
        with contextlib.suppress(ProcessLookupError):
            child.kill()
        await child.wait()
        scanning.cancel()
        await asyncio.gather(scanning, return_exceptions=True)
        await server.close()


def touched(plc: FakePlc) -> set[tuple[Table, int]]:
    return {(each.table, each.address) for each in plc.writes if each.address < 700}


@pytest.mark.slow
@pytest.mark.parametrize("number", STOPS, ids=[number.name for number in STOPS])
async def test_a_signal_in_step_5_puts_the_loop_back_and_says_so(tmp_path, number: signal.Signals) -> None:
    async with commissioning(tmp_path) as (plc, child):
        child.send_signal(number)
        _, said = await child.communicate()
        assert 2 == child.returncode, said.decode()
        assert "error: stopped; what was written has been put back" in said.decode()
        assert [58.0, False, 0.0, 100.0, 0.0] == [float(plc.read("L", name)) for name in NAMES]
        assert touched(plc) <= ALLOWED
        (journal,) = (tmp_path / "gates").glob("*.jsonl")
        assert ("", "restored") == (verify(journal).fault, verify(journal).records[-1]["how"])


@pytest.mark.slow
async def test_kill_minus_9_in_step_5_and_the_plc_itself_puts_the_loop_back(tmp_path) -> None:
    async with commissioning(tmp_path, LEASE) as (plc, child):
        child.kill()
        await child.communicate()
        assert plc.read("L", "PID_MAN")
        for _ in range(500):
            if not plc.read("L", "PID_MAN"):
                break
            await asyncio.sleep(0.02)
        assert [58.0, False, 0.0, 100.0, 0.0] == [float(plc.read("L", name)) for name in NAMES]
        assert touched(plc) <= ALLOWED
