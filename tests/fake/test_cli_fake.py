"""`ahgateway fake` as a process: it listens, says where, and ends cleanly."""

from __future__ import annotations

import asyncio
import signal
import subprocess
import sys

import pytest
from pymodbus.client import AsyncModbusTcpClient

COMMAND = (sys.executable, "-m", "ahgateway.cli.main", "fake", "demo", "--tcp", "0")
OWN_GROUP = getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0)
END = getattr(signal, "CTRL_BREAK_EVENT", signal.SIGTERM)
"""Windows knows no SIGTERM that a process could answer."""


@pytest.mark.slow
def test_the_command_serves_until_told_to_end_and_ends_with_0():
    command = [*COMMAND, "--fault", "TIC-101:windup"]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    with subprocess.Popen(command, creationflags=OWN_GROUP, **pipes) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        port = int(process.stdout.readline())
        said = process.stderr.readline() + process.stderr.readline()

        async def ask():
            client = AsyncModbusTcpClient("127.0.0.1", port=port)
            assert await client.connect()
            reply = await client.read_holding_registers(100, count=2, device_id=1)
            client.close()
            return reply.registers

        # SV 80.0 = 0x42A00000.
        assert asyncio.run(ask()) == [0x0000, 0x42A0]
        process.send_signal(END)
        _, rest = process.communicate(timeout=100)
    assert process.returncode == 0
    assert f"fake PLC Demo at modbus+tcp://127.0.0.1:{port}?unit=1 with TIC-101, LIC-201" in said
    assert "TIC-101 computes wrongly from now on: windup" in said
    assert rest.startswith("fake PLC Demo ended after")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fault", "said"),
    [
        ("TIC-101:wind-up", "hint: did you mean `windup`?"),
        ("TIC-999:windup", "has no loop `TIC-999`, it has TIC-101, LIC-201"),
        ("windup", "hint: write LOOP:NAME@SECONDS"),
    ],
)
def test_a_wrong_fault_is_a_usage_error_with_a_way_out(fault, said):
    done = subprocess.run([*COMMAND, "--fault", fault], capture_output=True, text=True, timeout=100, check=False)
    assert done.returncode == 2
    assert said in done.stderr
