"""What each frame says, one line for people."""

from __future__ import annotations

import pytest

from ahgateway.codec.can_frame import CanFrame
from ahgateway.codec.can_text import meaning
from ahgateway.schema.profile import load

STATION = load("can").station()


@pytest.mark.parametrize(
    ("can_id", "data", "said"),
    [
        (0x000, "01 03", "NMT start: node 3"),
        (0x000, "80 00", "NMT enter pre-operational: all nodes"),
        (0x080, "", "SYNC"),
        (0x080, "07", "SYNC 7"),
        (0x083, "30 81 11 00 00 00 00 00", "EMCY of node 3: code 0x8130, register 0x11"),
        (0x083, "00 00 00 00 00 00 00 00", "EMCY of node 3: error reset, register 0x00"),
        (0x703, "05", "node 3 operational"),
        (0x703, "00", "node 3 boot-up"),
        (0x603, "40 18 10 01 00 00 00 00", "node 3 is asked for 0x1018:01"),
        (0x583, "43 18 10 01 04 00 00 00", "node 3 holds 0x1018:01 = 00000004"),
        (0x583, "41 08 10 00 1A 00 00 00", "node 3 holds 0x1008:00, 26 bytes follow"),
        (0x603, "2B 17 10 00 A0 0F 00 00", "node 3 is to take 0x1017:00 = 0FA0"),
        (0x583, "60 17 10 00 00 00 00 00", "node 3 has taken 0x1017:00"),
        (0x583, "80 18 10 01 11 00 09 06", "node 3 SDO abort of 0x1018:01: 0x06090011, sub-index does not exist"),
        (0x583, "15 69 6E 73 20 21 00 00", "node 3 SDO reply, segment, the last"),
        (0x187, "01", "TPDO1 of node 7"),
        (0x484, "FA 06 A0 41 00 00 C8 42", "D138 06FA 41A0; D200 0000 42C8"),
        (0x185, "31 01", "M1 100011; SM400 1"),
        (0x185, "31", "PDO 185 has 1 bytes, the profile maps 2"),
        (0x7E5, "04", ""),
    ],
)
def test_a_frame_says(can_id: int, data: str, said: str) -> None:
    assert said == meaning(CanFrame(can_id, bytes.fromhex(data)), STATION.can, STATION.devices)


def test_an_error_frame_and_a_long_identifier_are_named() -> None:
    assert "adapter reports: bus-off" == meaning(CanFrame(0x40, bytes(8), is_error=True))
    assert "29-bit identifier, no CANopen" == meaning(CanFrame(0x12345, b"", is_extended=True))
    assert "heartbeat of node 1 is asked for" == meaning(CanFrame(0x701, b"", is_remote=True))


def test_any_frame_has_a_line() -> None:
    for can_id in range(0, 0x800, 7):
        for size in range(9):
            meaning(CanFrame(can_id, b"\x80" * size), STATION.can, STATION.devices)
