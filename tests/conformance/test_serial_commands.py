"""The commands over a serial line, between two processes: real bytes of RTU and ASCII through a real port."""

from __future__ import annotations

import asyncio
import contextlib
import json
import sys
from collections.abc import AsyncIterator
from pathlib import Path

import pytest
from conformance.peers import serial_pair

from ahgateway.clock import WallClock
from ahgateway.codec.access import Read, Table
from ahgateway.errors import LinkError
from ahgateway.transports.line import Line
from ahgateway.transports.serial_link import SerialLink

pytestmark = pytest.mark.slow

AHGATEWAY = (sys.executable, "-m", "ahgateway.cli.main")
HOLDER = (
    "import serial, sys; port = serial.Serial(sys.argv[1], exclusive=True); print('held', flush=True); sys.stdin.read()"
)


async def run(*arguments: str) -> tuple[int | None, str, str]:
    process = await asyncio.create_subprocess_exec(
        *AHGATEWAY, *arguments, stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.PIPE
    )
    out, said = await process.communicate()
    return process.returncode, out.decode(), said.decode()


@contextlib.asynccontextmanager
async def served(wire: str) -> AsyncIterator[str]:
    """The demo's PLC on one end of a line, in a process of its own; gives the target of the other end."""
    async with serial_pair() as (plc_end, our_end):
        settings = "?baud=115200&parity=N&bits=8&unit=1"  # a pseudo-terminal knows no parity and no 7 bits
        process = await asyncio.create_subprocess_exec(
            *AHGATEWAY, "fake", "demo", "--at", f"modbus+{wire}://{plc_end}{settings}", stderr=asyncio.subprocess.PIPE
        )
        assert process.stderr is not None
        assert f"at modbus+{wire}://" in (await process.stderr.readline()).decode()
        try:
            yield f"modbus+{wire}://{our_end}{settings}"
        finally:
            process.terminate()
            await process.communicate()


@pytest.mark.parametrize("wire", ["rtu", "ascii"])
async def test_read_scan_and_doctor_work_over_a_line_and_every_frame_is_traced(wire: str, tmp_path: Path) -> None:
    trace = tmp_path / "frames.txt"
    async with served(wire) as target:
        code, out, said = await run(
            "read", "demo", "--loop", "LIC-201", "--target", target, "--trace", str(trace), "--output", "json"
        )
        assert (0, "") == (code, said)
        values = {row["name"]: row for row in json.loads(out)["values"]}
        assert [20, 0] == values["CYCLE"]["words"]
        traced = trace.read_text(encoding="utf-8")
        assert "of unit 1: " not in traced, "nothing was written"
        assert traced.count(" > ") == traced.count(" < ") >= 3
        assert "  read " in traced
        assert "bytes of no frame" not in traced

        code, out, _ = await run("scan", target, "--units", "1-2", "--timeout-ms", "2000", "--output", "json")
        assert 0 == code
        assert [(1, True), (2, False)] == [(row["unit"], row["proven"]) for row in map(json.loads, out.splitlines())]

        code, out, _ = await run("doctor", "demo", "--target", target, "--output", "json")
        found = json.loads(out)
        assert {"clock", "port", "adapter"} <= {check["name"] for check in found["checks"]}
        requests = [request for loop in found["loops"] for request in loop["requests"]]
        assert all(0 < request["floor_ms"] for request in requests)
        assert all(0 < loop["floor_ms"] and 0 < loop["picture_ms"] for loop in found["loops"])


async def test_a_busy_port_is_named_with_the_program_that_holds_it() -> None:
    async with serial_pair() as (_, our_end):
        holder = await asyncio.create_subprocess_exec(
            sys.executable, "-c", HOLDER, our_end, stdin=asyncio.subprocess.PIPE, stdout=asyncio.subprocess.PIPE
        )
        assert holder.stdout is not None
        assert b"held\n" == await holder.stdout.readline()
        link = SerialLink(Line(our_end), clock=WallClock())
        with pytest.raises(LinkError, match=rf"port is busy \(held by .*python\S*, process {holder.pid}"):
            await link.exchange(Read(1, Table.HOLDING, 0, 1))
        await link.close()
        holder.terminate()
        await holder.wait()
