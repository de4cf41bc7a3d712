"""One frame, many roads: whole, byte by byte, with noise before and after, and back to bytes.

Golden RTU and ASCII frames are Delta's own: DVP-ES2 manual pp. 464 and 474, DVP15MC11T manual p. 536.
"""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ahgateway.errors import FrameError
from ahgateway.transports.ascii import AsciiReplies, AsciiRequests
from ahgateway.transports.framing import Adu, Framing, Mbap
from ahgateway.transports.rtu import RtuReplies, RtuRequests

MBAP_READ = bytes.fromhex("0001 0000 0006 01 03 006B 0003")
RTU_READ = bytes.fromhex("01 02 05 00 00 10 79 0A")
RTU_READ_ANSWER = bytes.fromhex("01 02 02 34 12 2F 75")
RTU_FORCE_ON = bytes.fromhex("01 05 05 00 FF 00 8C F6")
ASCII_FORCE = b":010F0500001002341293\r\n"
ASCII_FORCE_ANSWER = b":010F05000010DB\r\n"
ASCII_READ = b":010300000002FA\r\n"

REQUESTS = [
    (Mbap, MBAP_READ, Adu(1, 1, bytes.fromhex("03 006B 0003"))),
    (RtuRequests, RTU_READ, Adu(0, 1, bytes.fromhex("02 0500 0010"))),
    (RtuRequests, RTU_FORCE_ON, Adu(0, 1, bytes.fromhex("05 0500 FF00"))),
    (AsciiRequests, ASCII_FORCE, Adu(0, 1, bytes.fromhex("0F 0500 0010 02 3412"))),
    (AsciiRequests, ASCII_READ, Adu(0, 1, bytes.fromhex("03 0000 0002"))),
]
REPLIES = [
    (RtuReplies, RTU_READ_ANSWER, Adu(0, 1, bytes.fromhex("02 02 3412")), b"\x02\x02", 4),
    (RtuReplies, RTU_FORCE_ON, Adu(0, 1, bytes.fromhex("05 0500 FF00")), bytes.fromhex("05 0500 FF00"), 5),
    (AsciiReplies, ASCII_FORCE_ANSWER, Adu(0, 1, bytes.fromhex("0F 0500 0010")), bytes.fromhex("0F 0500 0010"), 5),
]


@pytest.mark.parametrize(("framing", "frame", "adu"), REQUESTS)
def test_golden_requests_are_built_and_found(framing: type[Framing], frame: bytes, adu: Adu) -> None:
    assert frame == framing().wrap(adu.tag, adu.unit, adu.pdu)
    assert [adu] == framing().feed(frame)
    side = framing()
    assert [adu] == [found for byte in frame for found in side.feed(bytes((byte,)))]
    assert [adu, adu] == framing().feed(frame + frame)


@pytest.mark.parametrize(("framing", "frame", "adu"), REQUESTS)
def test_the_size_of_a_frame_is_known_from_that_of_its_pdu(framing: type[Framing], frame: bytes, adu: Adu) -> None:
    assert len(frame) == framing().frame_size(len(adu.pdu))


@pytest.mark.parametrize(("framing", "frame", "adu", "head", "size"), REPLIES)
def test_golden_replies_are_built_and_found(
    framing: type[Framing], frame: bytes, adu: Adu, head: bytes, size: int
) -> None:
    assert frame == framing().wrap(adu.tag, adu.unit, adu.pdu)
    for pieces in (
        [frame],
        [bytes((byte,)) for byte in frame],
        [b"\x00\xff:\x01" + frame],
        [b":01", frame[:3], frame[3:]],
    ):
        side = framing()
        side.expect(1, head, size)
        assert [adu] == [found for piece in pieces for found in side.feed(piece)]
        assert side.kept == 0


@pytest.mark.parametrize(("framing", "frame", "adu", "head", "size"), REPLIES)
def test_a_reply_nobody_waits_for_is_kept_as_stray_bytes(
    framing: type[Framing], frame: bytes, adu: Adu, head: bytes, size: int
) -> None:
    side = framing()
    assert side.feed(frame) == []
    assert side.kept == len(frame)
    assert frame == side.drain()
    side.expect(2, head, size)  # another unit
    assert side.feed(frame) == []
    side.drain()
    side.expect(1, head, size)
    assert [adu] == side.feed(frame + frame)
    assert len(frame) == side.kept, "the second one answers nothing"


@pytest.mark.parametrize("framing", [RtuReplies, AsciiReplies])
def test_an_exception_is_found_beside_the_expected_reply(framing: type[Framing]) -> None:
    side = framing()
    side.expect(1, b"\x03\x50", 82)
    assert side.feed(framing().wrap(0, 1, b"\x83\x02")) == [Adu(0, 1, b"\x83\x02")]


@pytest.mark.parametrize("frame", [RTU_READ, RTU_FORCE_ON])
def test_rtu_request_behind_noise_that_promises_a_long_frame_is_found_at_once(frame: bytes) -> None:
    promises_long_write = bytes.fromhex("01 10 00 00 00 7B F6")
    side = RtuRequests()
    assert len(side.feed(promises_long_write + frame)) == 1
    assert side.kept == 0


@pytest.mark.parametrize("flip", range(64))
def test_no_single_flipped_bit_gets_through_rtu(flip: int) -> None:
    wrong = bytearray(RTU_READ)
    wrong[flip // 8] ^= 1 << flip % 8
    assert RtuRequests().feed(wrong) == []


def test_a_colon_inside_an_ascii_frame_begins_a_new_one() -> None:
    assert len(AsciiRequests().feed(b":0103000" + ASCII_READ)) == 1


@pytest.mark.parametrize(
    "garbage", [b"HTTP/1.1 400 Bad Request\r\n", bytes.fromhex("0001 0000 0001 01"), bytes.fromhex("0001 0000 00FF 01")]
)
def test_mbap_cannot_be_read_on_after_a_wrong_header(garbage: bytes) -> None:
    with pytest.raises(FrameError, match="no Modbus TCP header"):
        Mbap().feed(garbage)


@pytest.mark.parametrize("framing", [RtuReplies, RtuRequests, AsciiReplies, AsciiRequests])
@given(pieces=st.lists(st.binary(max_size=600), max_size=6))
def test_garbage_is_dropped_and_the_buffer_stays_small(framing: type[Framing], pieces: list[bytes]) -> None:
    side = framing()
    side.expect(1, b"\x03\x50", 82)
    for piece in pieces:
        side.feed(piece)
        assert side.kept <= 1026
    side.drain()
    found = [adu for adu in side.feed(b"") if adu]
    assert found == []
    assert side.kept == 0


@given(pieces=st.lists(st.binary(max_size=300), max_size=6))
def test_mbap_garbage_is_a_frame_error_or_nothing(pieces: list[bytes]) -> None:
    side = Mbap()
    for piece in pieces:
        try:
            side.feed(piece)
        except FrameError:
            side.drain()
        assert side.kept < 260


def test_rtu_says_what_the_reply_under_way_still_needs() -> None:
    """02h asked of unit 1 for 16 bits: 01 02 02 … has 7 bytes with its CRC, an exception 5."""
    framing = RtuReplies()
    assert 1 == framing.missing, "nothing is waited for"
    framing.expect(1, b"\x02\x02", 4)
    for piece, missing in ((b"", 1), (b"\x01", 1), (b"\x02", 1), (b"\x02", 4), (b"\x34\x12\x2f", 1)):
        framing.feed(piece)
        assert missing == framing.missing
    assert 1 == len(framing.feed(b"\x75"))
    framing.expect(1, b"\x02\x02", 4)
    framing.feed(b"\x01\x82")
    assert 3 == framing.missing
    framing.drain()
    framing.expect(1, b"\x02\x02", 4)
    framing.feed(b"\xff\x01")
    assert 1 == framing.missing, "noise in front: nobody knows"
