"""The gateway as a node: its EDS read by another implementation, which then speaks to the node it describes."""

from __future__ import annotations

import asyncio
import configparser
import io
import itertools
import re

import canopen
import pytest
from canopen.objectdictionary import datatypes
from canopen.objectdictionary.eds import import_eds

from ahgateway.clock import WallClock
from ahgateway.codec.can_eds import NodeValue, eds, node_layout
from ahgateway.codec.can_frame import CanFrame
from ahgateway.schema.profile import load
from ahgateway.transports.can.bus import bus_for
from ahgateway.transports.can.gateway import GatewayContent
from ahgateway.transports.can.node import CanNode, State
from ahgateway.transports.can.server import serve_node
from ahgateway.transports.uri import parse_uri

NODE = 5
LAYOUT = node_layout(load("demo").station())
_numbers = itertools.count(1)


def dictionary() -> canopen.ObjectDictionary:
    file = io.StringIO(eds(LAYOUT, version="9.9.9"))
    file.name = "gateway.eds"
    return import_eds(file, NODE)


def test_another_implementation_reads_every_object_of_the_eds() -> None:
    """The demo's DPIDE and DPID: SV, PV, MV, the integral and the previous PV of each."""
    found = dictionary()
    assert [0x1000, 0x1001, 0x1017, 0x1018] == [index for index in found if index < 0x1400]
    assert [0x2000, 0x2001] == [index for index in found if index >= 0x2000]
    assert ["SV", "PV", "MV", "I_MV", "I_MV+6"] == [found[0x2000][sub].name for sub in range(1, 6)]
    assert ["SV", "PV", "MV", "I_MV", "I_MV+1"] == [found[0x2001][sub].name for sub in range(1, 6)]
    assert {datatypes.REAL32} == {found[0x2000][sub].data_type for sub in range(1, 6)}
    assert "TIC-101" == found[0x2000].name
    assert 1000 == found[0x1017].default
    assert found[0x2000][1].pdo_mappable


def test_the_eds_maps_two_reals_an_rpdo_with_the_predefined_identifiers() -> None:
    found = dictionary()
    # $NODEID+0x200…0x500, and beyond the fourth off until the master gives it an identifier.
    assert [0x205, 0x305, 0x405, 0x505, 0x8000_0000, 0x8000_0000] == [found[0x1400 + n][1].default for n in range(6)]
    assert (0x2000_0120, 0x2000_0220) == (found[0x1600][1].default, found[0x1600][2].default)
    assert (0x2000_0320, 0x2000_0420) == (found[0x1601][1].default, found[0x1601][2].default)
    assert 6 == found.device_information.nr_of_RXPDO


def test_the_head_of_the_eds_has_every_key_that_the_standard_asks_for() -> None:
    """CiA 306-1 §4.5.2; tools such as eds-utils refuse a file without its dates."""
    parser = configparser.ConfigParser()
    parser.read_string(eds(LAYOUT, version="9.9.9"))
    wanted = "FileName FileVersion FileRevision EDSVersion Description CreationTime CreationDate CreatedBy"
    wanted += " ModificationTime ModificationDate ModifiedBy"
    assert [] == [key for key in wanted.split() if not parser["FileInfo"].get(key)]
    for key in ("CreationDate", "ModificationDate"):
        assert re.fullmatch(r"(0[1-9]|1[0-2])-\d\d-\d{4}", parser["FileInfo"][key])


def test_equal_profiles_give_equal_text() -> None:
    assert eds(LAYOUT, version="1") == eds(LAYOUT, version="1")


def node() -> tuple[CanNode, list[tuple[str, str, bytes]]]:
    came: list[tuple[str, str, bytes]] = []

    def on_value(value: NodeValue, packed: bytes) -> None:
        came.append((value.loop, value.name, packed))

    made = CanNode(NODE, GatewayContent(LAYOUT, NODE, on_value), starts_operational=False)
    made.boot(0)
    return made, came


def test_rpdos_count_only_in_operational_and_only_whole() -> None:
    made, came = node()
    frame = CanFrame(0x205, bytes.fromhex("0000A042 00002042"))
    made.feed(frame, 0)
    assert [] == came, "pre-operational"
    made.feed(CanFrame(0, bytes((1, NODE))), 0)
    assert State.OPERATIONAL is made.state
    made.feed(CanFrame(0x205, bytes(7)), 0)
    made.feed(CanFrame(0x505, bytes(8)), 0)
    made.feed(frame, 0)
    assert [("LIC-201", "SV", bytes(4)), ("LIC-201", "PV", bytes(4))] == came[:2]
    assert [("TIC-101", "SV", b"\0\0\xa0\x42"), ("TIC-101", "PV", b"\0\0\x20\x42")] == came[2:]


def test_the_heart_beats_with_the_state_and_the_master_may_change_its_period() -> None:
    made, _ = node()
    assert [] == made.tick(999_000_000)
    assert [CanFrame(0x705, b"\x7f")] == made.tick(1_000_000_000)
    made.feed(CanFrame(0x605, bytes.fromhex("2B 17 10 00 64 00 00 00")), 0)
    assert [CanFrame(0x705, b"\x7f")] == made.tick(1_100_000_000)
    assert [CanFrame(0x705, b"\x00")] == made.feed(CanFrame(0, bytes((0x81, NODE))), 0), "reset: boot-up"


@pytest.mark.slow
async def test_another_implementation_is_master_of_the_node_that_the_eds_describes() -> None:
    text = f"canopen://virtual/eds-{next(_numbers)}?node={NODE}"
    made, came = node()
    server = await serve_node(made, bus_for(parse_uri(text), WallClock()), WallClock())
    network = canopen.Network()
    network.connect(interface="virtual", channel=parse_uri(text).path)
    try:
        remote = network.add_node(NODE, dictionary())
        assert 4 == await asyncio.to_thread(lambda: remote.sdo[0x1018][0].raw)
        await asyncio.to_thread(lambda: setattr(remote.sdo[0x2000][1], "raw", 80.0))
        assert 80.0 == await asyncio.to_thread(lambda: remote.sdo[0x2000][1].raw)
        assert ("TIC-101", "SV", b"\0\0\xa0\x42") == came[-1]
        await asyncio.to_thread(lambda: setattr(remote.sdo[0x1017], "raw", 20))
        await asyncio.to_thread(remote.rpdo.read)
        remote.nmt.state = "OPERATIONAL"
        remote.rpdo[2]["TIC-101.MV"].raw = 40.0
        remote.rpdo[2]["TIC-101.I_MV"].raw = 2.5
        remote.rpdo[2].transmit()
        async with asyncio.timeout(60):
            while came[-1][1] != "I_MV":
                await asyncio.to_thread(remote.nmt.wait_for_heartbeat, 5)
        assert [("TIC-101", "MV", b"\0\0\x20\x42"), ("TIC-101", "I_MV", b"\0\0\x20\x40")] == came[-2:]
    finally:
        network.disconnect()
        await server.close()
