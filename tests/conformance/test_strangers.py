"""Somebody else's Modbus as the witness: pymodbus' client against our server, our client against pymodbus' server."""

from __future__ import annotations

import asyncio
import shutil
import socket

import pytest
from conformance.peers import CLIENT, SERVER, TinyPlc
from pymodbus import FramerType
from pymodbus.client import AsyncModbusTcpClient
from pymodbus.server import ModbusTcpServer
from pymodbus.simulator import DataType, SimData, SimDevice

from ahgateway.clock import MILLISECOND, WallClock
from ahgateway.codec.access import Read, Table, Write
from ahgateway.errors import PlcRefusedError
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


async def test_mbpoll_reads_our_server() -> None:
    program = shutil.which("mbpoll")
    if program is None:
        return  # Debian's mbpoll is a witness where it is installed, not a dependency
    server = await serve_tcp(TinyPlc())
    arguments = [
        "-m",
        "tcp",
        "-a",
        "1",
        "-t",
        "3",
        "-0",
        "-r",
        "2",
        "-c",
        "3",
        "-1",
        "-p",
        str(server.port),
        "127.0.0.1",
    ]
    process = await asyncio.create_subprocess_exec(program, *arguments, stdout=asyncio.subprocess.PIPE)
    output, _ = await process.communicate()
    assert [line.split() for line in output.decode().splitlines() if line.startswith("[")] == [
        ["[2]:", "14"],
        ["[3]:", "21"],
        ["[4]:", "28"],
    ]
    await server.close()
