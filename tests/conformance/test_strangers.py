"""Somebody else's Modbus as the witness: pymodbus, mbpoll and libmodbus, as clients and as servers."""

from __future__ import annotations

import asyncio
import contextlib
import shutil
import socket
import subprocess
from collections.abc import AsyncIterator
from pathlib import Path

import pytest
from conformance.peers import CLIENT, SERVER, TinyPlc, serial_pair
from pymodbus import FramerType
from pymodbus.client import AsyncModbusTcpClient
from pymodbus.server import ModbusTcpServer
from pymodbus.simulator import DataType, SimData, SimDevice

from ahgateway.clock import MILLISECOND, WallClock
from ahgateway.codec.access import Read, Table, Write
from ahgateway.errors import PlcRefusedError
from ahgateway.transports.base import Link
from ahgateway.transports.line import Line
from ahgateway.transports.serial_link import SerialLink
from ahgateway.transports.serial_server import serve_serial
from ahgateway.transports.server import serve_tcp
from ahgateway.transports.tcp import TcpLink

FRAMERS = {"tcp": FramerType.SOCKET, "rtu": FramerType.RTU, "ascii": FramerType.ASCII}
all_wires = pytest.mark.parametrize("wire", ["tcp", "rtu", "ascii"])


@all_wires
async def test_pymodbus_client_reads_and_writes_our_server(wire: str) -> None:
    plc = TinyPlc()
    server = await serve_tcp(plc, framing=SERVER[wire])
    client = AsyncModbusTcpClient("127.0.0.1", port=server.port, framer=FRAMERS[wire], reconnect_delay=0)
    assert await client.connect()
    assert not (await client.write_registers(10, [1, 2, 0xFFFF], device_id=1)).isError()
    assert not (await client.write_register(13, 4, device_id=1)).isError()
    assert [1, 2, 0xFFFF, 4] == (await client.read_holding_registers(10, count=4, device_id=1)).registers
    assert [7, 14] == (await client.read_input_registers(1, count=2, device_id=1)).registers
    assert not (await client.write_coils(5, [True, False, True], device_id=1)).isError()
    assert not (await client.write_coil(8, True, device_id=1)).isError()
    assert [True, False, True, True] == (await client.read_coils(5, count=4, device_id=1)).bits[:4]
    assert [True, False, False] == (await client.read_discrete_inputs(3, count=3, device_id=1)).bits[:3]
    assert (await client.read_holding_registers(950, count=2, device_id=1)).exception_code == 2
    client.close()
    await server.close()


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@all_wires
async def test_our_client_reads_and_writes_pymodbus_server(wire: str) -> None:
    memory = [SimData(0, values=[100 + index for index in range(50)], datatype=DataType.REGISTERS)]
    port = free_port()
    server = ModbusTcpServer(SimDevice(1, simdata=memory), framer=FRAMERS[wire], address=("127.0.0.1", port))
    await server.listen()
    link = TcpLink("127.0.0.1", port, clock=WallClock(), framing=CLIENT[wire], quiet_ns=2 * MILLISECOND)
    assert (103, 104, 105) == (await link.exchange(Read(1, Table.HOLDING, 3, 3))).values
    await link.exchange(Write(1, Table.HOLDING, 4, (0xABCD, 0x1234)))
    await link.exchange(Write(1, Table.HOLDING, 6, (9,)))
    assert (103, 0xABCD, 0x1234, 9, 107) == (await link.exchange(Read(1, Table.HOLDING, 3, 5))).values
    with pytest.raises(PlcRefusedError):
        await link.exchange(Read(1, Table.HOLDING, 60, 2))
    await link.close()
    await server.shutdown()


def tool(name: str) -> str:
    """Where a stranger's program stands; without it these tests fail, `.ci/run` installs what they need."""
    program = shutil.which(name)
    assert program is not None, f"{name} is not installed; .ci/run installs it"
    return program


async def said(*command: str) -> str:
    process = await asyncio.create_subprocess_exec(
        *command, stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.STDOUT
    )
    output, _ = await asyncio.wait_for(process.communicate(), 100)
    return output.decode()


def registers(output: str) -> list[list[str]]:
    return [line.split() for line in output.splitlines() if line.startswith("[")]


async def test_mbpoll_reads_and_writes_our_server_over_tcp() -> None:
    plc = TinyPlc()
    server = await serve_tcp(plc)
    line = ["-m", "tcp", "-a", "1", "-0", "-1", "-p", str(server.port)]
    output = await said(tool("mbpoll"), *line, "-t", "3", "-r", "2", "-c", "3", "127.0.0.1")
    assert [["[2]:", "14"], ["[3]:", "21"], ["[4]:", "28"]] == registers(output)
    await said(tool("mbpoll"), *line, "-t", "4", "-r", "40", "127.0.0.1", "513", "7")
    assert [513, 7] == plc.memory[Table.HOLDING][40:42]
    await server.close()


async def test_mbpoll_reads_and_writes_our_server_over_rtu() -> None:
    plc = TinyPlc()
    async with serial_pair() as (plc_end, our_end):
        server = await serve_serial(plc, Line(plc_end, 19200, "N"))
        line = ["-m", "rtu", "-a", "1", "-0", "-1", "-b", "19200", "-P", "none"]
        output = await said(tool("mbpoll"), *line, "-t", "3", "-r", "2", "-c", "3", our_end)
        assert [["[2]:", "14"], ["[3]:", "21"], ["[4]:", "28"]] == registers(output), output
        await server.close()


@pytest.fixture(scope="module")
def libmodbus(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """libmodbus' TCP and serial servers, compiled here."""
    folder = tmp_path_factory.mktemp("libmodbus")
    flags = subprocess.run(
        [tool("pkg-config"), "--cflags", "--libs", "libmodbus"], capture_output=True, text=True, check=True
    )
    for name in ("link_peer", "serial_peer"):
        source = Path(__file__).parents[1] / "bench" / f"{name}.c"
        subprocess.run([tool("gcc"), "-o", str(folder / name), str(source), *flags.stdout.split()], check=True)
    return folder


@contextlib.asynccontextmanager
async def running(*command: str) -> AsyncIterator[None]:
    process = await asyncio.create_subprocess_exec(*command, stdout=asyncio.subprocess.PIPE)
    assert process.stdout is not None
    assert b"ready\n" == await asyncio.wait_for(process.stdout.readline(), 100)
    try:
        yield
    finally:
        process.terminate()
        await process.wait()


async def exchanged(link: Link) -> None:
    await link.exchange(Write(1, Table.HOLDING, 21, (0xABCD, 0x1234)))
    await link.exchange(Write(1, Table.COIL, 3, (1,)))
    assert (0xABCD, 0x1234) == (await link.exchange(Read(1, Table.HOLDING, 21, 2))).values
    assert (0, 1, 0) == (await link.exchange(Read(1, Table.COIL, 2, 3))).values
    with pytest.raises(PlcRefusedError, match="exception 02"):
        await link.exchange(Read(1, Table.HOLDING, 5000, 2))
    assert 40 == len((await link.exchange(Read(1, Table.HOLDING, 0, 40))).values)
    await link.close()


@pytest.mark.slow
async def test_our_client_speaks_with_a_libmodbus_server_over_tcp(libmodbus: Path) -> None:
    port = free_port()
    async with running(str(libmodbus / "link_peer"), "server", str(port)):
        await exchanged(TcpLink("127.0.0.1", port, clock=WallClock()))


@pytest.mark.slow
async def test_our_client_speaks_with_a_libmodbus_server_over_rtu(libmodbus: Path) -> None:
    async with (
        serial_pair() as (plc_end, our_end),
        running(str(libmodbus / "serial_peer"), "server", plc_end, "19200"),
    ):
        await exchanged(SerialLink(Line(our_end, 19200, "N"), clock=WallClock()))
