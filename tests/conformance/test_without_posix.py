"""What runs on a system without POSIX modules: every import, and the commands a technician begins with, over TCP."""

from __future__ import annotations

import asyncio
import sys
from pathlib import Path

import pytest

from ahgateway.clock import WallClock
from ahgateway.fake.plc import FakePlc
from ahgateway.schema.profile import load
from ahgateway.transports.server import serve_tcp

pytestmark = pytest.mark.slow

RUNNER = Path(__file__).with_name("without_posix.py")


async def run(*arguments: str) -> tuple[int | None, str, str]:
    process = await asyncio.create_subprocess_exec(
        sys.executable, str(RUNNER), *arguments, stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.PIPE
    )
    out, said = await process.communicate()
    return process.returncode, out.decode(), said.decode()


@pytest.mark.parametrize("name", ["fcntl", "termios", "grp"])
async def test_the_stand_really_lacks_them(name: str) -> None:
    code, _, said = await run("--import", name)
    assert 1 == code
    assert f"ModuleNotFoundError: No module named '{name}'" in said


async def test_every_module_of_ours_can_be_imported() -> None:
    code, out, said = await run("--walk")
    assert (0, "") == (code, said)
    assert int(out.split()[0]) > 200


async def test_help_names_the_commands() -> None:
    code, out, said = await run("--help")
    assert (0, "") == (code, said)
    assert {"doctor", "read", "monitor"} <= set(out.split())


async def test_read_and_doctor_run_over_tcp() -> None:
    loaded = load("demo")
    server = await serve_tcp(FakePlc(loaded.station(), loaded.fake_setup(), clock=WallClock()))
    target = f"modbus+tcp://127.0.0.1:{server.port}?unit=1"
    try:
        code, out, said = await run("read", "demo", "--loop", "LIC-201", "--target", target)
        assert (0, "") == (code, said)
        assert "CYCLE" in out
        code, out, said = await run("doctor", "demo", "--target", target)
        assert (0, "") == (code, said)
        assert "LIC-201" in out
    finally:
        await server.close()


async def test_a_serial_port_that_is_not_there_is_named() -> None:
    code, _, said = await run("read", "demo", "D100", "--target", "modbus+rtu://COM3")
    assert 3 == code
    assert "error: modbus+rtu://COM3: no such port, before an answer to: read 2 holding registers from 0x0064" in said
    assert "hint: is the adapter plugged in? ports here: " in said
    assert "Traceback" not in said
