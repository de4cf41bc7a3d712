"""SDO transfers frame by frame against published examples, in both roles.

The exchanges stand in the tests of the `canopen` library (test_sdo.py), which took most of them from the device
configuration examples of canopensolutions.com; data fields are copied from there by hand.
"""

from __future__ import annotations

import pytest
from canopen.sdo.exceptions import SdoAbortedError
from hypothesis import given
from hypothesis import strategies as st

from ahgateway.codec.can_sdo import ABORTS, SdoServer, Transfer, abort_frame
from ahgateway.errors import CodecError, FrameError, PlcRefusedError

NAME = b"Tiny Node - Mega Domains !"

READ_EXPEDITED = """
> 40 18 10 01 00 00 00 00    read 1018:01
< 43 18 10 01 04 00 00 00    4 bytes: 4
"""
READ_SEGMENTED = """
> 40 08 10 00 00 00 00 00    read 1008:00
< 41 08 10 00 1A 00 00 00    26 bytes follow
> 60 00 00 00 00 00 00 00
< 00 54 69 6E 79 20 4E 6F    Tiny No
> 70 00 00 00 00 00 00 00    toggled
< 10 64 65 20 2D 20 4D 65    de - Me
> 60 00 00 00 00 00 00 00
< 00 67 61 20 44 6F 6D 61    ga Doma
> 70 00 00 00 00 00 00 00
< 15 69 6E 73 20 21 00 00    ins !, 2 bytes unused, the last
"""
WRITE_EXPEDITED = """
> 2B 17 10 00 A0 0F 00 00    write 1017:00, 2 bytes: 4000
< 60 17 10 00 00 00 00 00
"""
WRITE_SEGMENTED = """
> 21 00 20 00 0D 00 00 00    write 2000:00, 13 bytes follow
< 60 00 20 00 00 00 00 00
> 00 41 20 6C 6F 6E 67 20    A long_
< 20 00 00 00 00 00 00 00
> 13 73 74 72 69 6E 67 00    string, 1 byte unused, the last
< 30 00 00 00 00 00 00 00
"""


def frames(script: str) -> list[tuple[str, bytes]]:
    lines = [line.split("    ")[0] for line in script.strip().splitlines()]
    return [(line[0], bytes.fromhex(line[1:])) for line in lines]


def play(script: str, index: int, sub: int, written: bytes | None = None) -> Transfer:
    """Run the client against the script; every request must be the script's."""
    transfer, said = Transfer(index, sub, written), []
    for direction, data in frames(script):
        if direction == ">":
            said.append(transfer.request)
            assert said[-1].hex(" ") == data.hex(" ")
        else:
            assert transfer.feed(data)
    assert transfer.is_done
    return transfer


def test_an_expedited_read_is_the_published_one() -> None:
    assert b"\x04\0\0\0" == play(READ_EXPEDITED, 0x1018, 1).value


def test_a_segmented_read_is_the_published_one() -> None:
    assert NAME == play(READ_SEGMENTED, 0x1008, 0).value


def test_an_expedited_write_is_the_published_one() -> None:
    play(WRITE_EXPEDITED, 0x1017, 0, (4000).to_bytes(2, "little"))


def test_a_segmented_write_is_the_published_one() -> None:
    play(WRITE_SEGMENTED, 0x2000, 0, b"A long string")


def test_a_reply_without_padding_and_one_without_size_are_understood() -> None:
    short = Transfer(0x1400, 2)
    assert short.feed(bytes.fromhex("4F 00 14 02 FE"))
    assert (b"\xfe", True) == (short.value, short.is_sized)
    unsized = Transfer(0x1400, 2)
    assert unsized.feed(bytes.fromhex("42 00 14 02 FE 00 00 00"))
    assert (b"\xfe\0\0\0", False) == (unsized.value, unsized.is_sized)


def test_an_abort_names_its_code_and_what_to_do() -> None:
    transfer = Transfer(0x1018, 1)
    with pytest.raises(PlcRefusedError, match="0x06090011, sub-index does not exist") as caught:
        transfer.feed(bytes.fromhex("80 18 10 01 11 00 09 06"))
    assert 0x0609_0011 == caught.value.code
    assert "EDS" in str(caught.value.hint)


@pytest.mark.parametrize(
    "foreign",
    [
        "43 18 10 02 04 00 00 00",  # another sub-index
        "43 00 10 01 04 00 00 00",  # another index
        "60 18 10 01 00 00 00 00",  # the confirmation of a write
        "00 54 69 6E 79 20 4E 6F",  # a segment of an earlier transfer
        "80 18 10 02 11 00 09 06",  # the abort of another object
        "",
    ],
)
def test_what_answers_something_else_is_not_taken(foreign: str) -> None:
    transfer = Transfer(0x1018, 1)
    assert not transfer.feed(bytes.fromhex(foreign))
    assert not transfer.is_done
    assert transfer.feed(bytes.fromhex("43 18 10 01 04 00 00 00"))


def test_a_lost_or_repeated_segment_breaks_the_transfer() -> None:
    transfer = Transfer(0x1008, 0)
    assert transfer.feed(bytes.fromhex("41 08 10 00 1A 00 00 00"))
    with pytest.raises(FrameError, match="0x1008:00: the toggle bit"):
        transfer.feed(bytes.fromhex("10 64 65 20 2D 20 4D 65"))


def test_a_transfer_that_holds_less_than_announced_is_refused() -> None:
    transfer = Transfer(0x1008, 0)
    assert transfer.feed(bytes.fromhex("41 08 10 00 1A 00 00 00"))
    with pytest.raises(FrameError, match="7 bytes came, 26 were announced"):
        transfer.feed(bytes.fromhex("01 54 69 6E 79 20 4E 6F"))


def test_nothing_and_too_much_cannot_be_written() -> None:
    for written in (b"", bytes(4097)):
        with pytest.raises(CodecError, match="allowed 1…4096"):
            Transfer(0x2000, 0, written)


class Objects:
    """An object dictionary of the examples."""

    def __init__(self) -> None:
        self.held = {(0x1018, 1): b"\x04\0\0\0", (0x1008, 0): NAME, (0x1017, 0): b"", (0x2000, 0): b""}

    def read(self, index: int, sub: int) -> bytes:
        if (index, sub) not in self.held:
            raise PlcRefusedError("none", code=0x0602_0000)
        return self.held[index, sub]

    def write(self, index: int, sub: int, value: bytes) -> None:
        self.read(index, sub)
        self.held[index, sub] = value


@pytest.mark.parametrize("script", [READ_EXPEDITED, READ_SEGMENTED, WRITE_EXPEDITED, WRITE_SEGMENTED])
def test_the_server_gives_the_published_answers(script: str) -> None:
    objects = Objects()
    server = SdoServer(objects.read, objects.write)
    answer: bytes | None = None
    for direction, data in frames(script):
        if direction == ">":
            answer = server.feed(data)
        else:
            assert answer is not None
            assert answer.hex(" ") == data.hex(" ")
    if script is WRITE_SEGMENTED:
        assert b"A long string" == objects.held[0x2000, 0]


@pytest.mark.parametrize(
    ("asked", "answered"),
    [
        ("40 00 30 07 00 00 00 00", "80 00 30 07 00 00 02 06"),  # no such object
        ("A4 08 10 00 7F 00 00 00", "80 08 10 00 01 00 04 05"),  # a block upload: not a command we know
        ("60 00 00 00 00 00 00 00", "80 00 00 00 01 00 04 05"),  # a segment of nothing
    ],
)
def test_the_server_refuses_with_the_code_of_the_standard(asked: str, answered: str) -> None:
    objects = Objects()
    answer = SdoServer(objects.read, objects.write).feed(bytes.fromhex(asked))
    assert bytes.fromhex(answered) == answer


def test_the_server_is_silent_on_aborts_and_short_frames_and_forgets_the_transfer() -> None:
    objects = Objects()
    server = SdoServer(objects.read, objects.write)
    server.feed(bytes.fromhex("40 08 10 00 00 00 00 00"))
    assert server.feed(abort_frame(0x1008, 0, 0x0504_0000)) is None
    assert server.feed(b"\x40") is None
    assert bytes.fromhex("80 08 10 00 01 00 04 05") == server.feed(bytes.fromhex("60 00 00 00 00 00 00 00"))


@given(st.binary(min_size=1, max_size=60))
def test_what_is_written_is_read_back_whatever_its_length(value: bytes) -> None:
    objects = Objects()
    server = SdoServer(objects.read, objects.write)
    for written in (value, None):
        transfer = Transfer(0x2000, 0, written)
        for _ in range(12):
            answer = server.feed(transfer.request)
            assert answer is not None
            assert transfer.feed(answer)
            if transfer.is_done:
                break
    assert value == transfer.value


@given(st.lists(st.binary(max_size=8), max_size=8))
def test_garbage_ends_in_an_error_of_ours_or_in_nothing(replies: list[bytes]) -> None:
    transfer = Transfer(0x1008, 0)
    try:
        for reply in replies:
            transfer.feed(reply)
    except (FrameError, PlcRefusedError):
        return
    assert len(transfer.value) <= 4096


def test_the_abort_codes_are_those_of_another_implementation_and_each_has_a_name() -> None:
    assert set(SdoAbortedError.CODES) == set(ABORTS)
    assert 31 == len({name for name, _ in ABORTS.values()} - {""})
