"""Golden PDUs are the worked examples of the Modbus Application Protocol Specification V1.1b3, §6.1 to §6.12."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ahgateway.codec.access import Read, Request, Table, Write
from ahgateway.errors import CodecError, FrameError, PlcRefusedError
from ahgateway.transports import pdu


def _bits(text: str) -> tuple[int, ...]:
    return tuple(int(digit) for digit in text.replace(" ", ""))


GOLDEN: list[tuple[Request, str, str, tuple[int, ...]]] = [
    # §6.1 coils 20-38: CD 6B 05, the first coil in the lowest bit
    (Read(1, Table.COIL, 0x13, 19), "01 0013 0013", "01 03 CD6B05", _bits("10110011 11010110 101")),
    # §6.2 discrete inputs 197-218
    (Read(1, Table.DISCRETE, 0xC4, 22), "02 00C4 0016", "02 03 ACDB35", _bits("00110101 11011011 101011")),
    # §6.3 holding registers 108-110
    (Read(1, Table.HOLDING, 0x6B, 3), "03 006B 0003", "03 06 022B 0000 0064", (0x022B, 0x0000, 0x0064)),
    # §6.4 input register 9
    (Read(1, Table.INPUT, 0x08, 1), "04 0008 0001", "04 02 000A", (0x000A,)),
    # §6.5 coil 173 on
    (Write(1, Table.COIL, 0xAC, (1,)), "05 00AC FF00", "05 00AC FF00", ()),
    # §6.6 register 2 to 3
    (Write(1, Table.HOLDING, 0x01, (3,)), "06 0001 0003", "06 0001 0003", ()),
    # §6.11 ten coils from 20
    (Write(1, Table.COIL, 0x13, _bits("10110011 10")), "0F 0013 000A 02 CD01", "0F 0013 000A", ()),
    # §6.12 two registers from 2
    (Write(1, Table.HOLDING, 0x01, (0x000A, 0x0102)), "10 0001 0002 04 000A 0102", "10 0001 0002", ()),
]


@pytest.mark.parametrize(("request_", "asked", "answered", "values"), GOLDEN)
def test_golden_pdus_both_ways(request_: Request, asked: str, answered: str, values: tuple[int, ...]) -> None:
    asked_pdu, answered_pdu = bytes.fromhex(asked), bytes.fromhex(answered)
    assert asked_pdu == pdu.encode_request(request_)
    assert request_ == pdu.decode_request(1, asked_pdu)
    assert values == pdu.decode_reply(request_, pdu.reply_shape(request_, asked_pdu), answered_pdu)
    assert answered_pdu == pdu.encode_reply(request_, asked_pdu, values)


@pytest.mark.parametrize(("request_", "asked", "answered", "values"), GOLDEN)
def test_a_reply_that_is_cut_or_longer_or_of_another_function_is_no_answer(
    request_: Request, asked: str, answered: str, values: tuple[int, ...]
) -> None:
    sound = bytes.fromhex(answered)
    shape = pdu.reply_shape(request_, bytes.fromhex(asked))
    other_function = bytes((sound[0] ^ 7,)) + sound[1:]
    other_second_byte = sound[:1] + bytes((sound[1] ^ 1,)) + sound[2:]
    for wrong in (sound[:-1], sound + b"\0", other_function, other_second_byte, b"", sound[:1]):
        with pytest.raises(FrameError):
            pdu.decode_reply(request_, shape, wrong)


def test_a_write_is_proven_by_its_echo() -> None:
    request = Write(1, Table.HOLDING, 0x01, (3,))
    shape = pdu.reply_shape(request, bytes.fromhex("0600010003"))
    with pytest.raises(FrameError, match="write 1 holding register to 0x0001 of unit 1"):
        pdu.decode_reply(request, shape, bytes.fromhex("0600010004"))


@pytest.mark.parametrize(
    ("code", "name", "hint"),
    [
        (1, "illegal function", "function"),
        (2, "illegal data address", "outside this PLC's map"),
        (3, "illegal data value", "fewer words"),
        (4, "device failure", "error log"),
        (6, "device busy", "poll more slowly"),
        (11, "gateway target did not respond", "unit"),
        (99, "not a code of the standard", "manual"),
    ],
)
def test_an_exception_carries_code_name_and_hint(code: int, name: str, hint: str) -> None:
    request = Read(1, Table.COIL, 0x04A1, 1)
    shape = pdu.reply_shape(request, bytes.fromhex("01 04A1 0001"))
    with pytest.raises(PlcRefusedError, match=f"read 1 coil from 0x04A1 of unit 1: exception .*, {name}") as caught:
        pdu.decode_reply(request, shape, bytes((0x81, code)))
    assert code == caught.value.code
    assert hint in (caught.value.hint or "")
    assert bytes((0x81, code)) == pdu.encode_exception(1, code)


@pytest.mark.parametrize(
    ("asked", "code"),
    [
        ("2B 0E 01 00", 1),
        ("17 0000 0001 0000 0001 02 0000", 1),
        ("03 0000 0000", 3),
        ("03 0000 007E", 3),
        ("01 0000 07D1", 3),
        ("03 0000", 3),
        ("03 FFFF 0002", 2),
        ("05 0000 1234", 3),
        ("06 0000", 3),
        ("10 0000 0002 04 0001", 3),
        ("10 0000 0002 02 0001", 3),
        ("10 0000 0000 00", 3),
        ("0F 0000 0009 01 FF", 3),
        ("10 FFFF 0002 04 0001 0002", 2),
        ("10", 3),
    ],
)
def test_a_malformed_request_is_refused_with_the_standards_code(asked: str, code: int) -> None:
    with pytest.raises(PlcRefusedError) as caught:
        pdu.decode_request(1, bytes.fromhex(asked))
    assert code == caught.value.code


@pytest.mark.parametrize(
    "request_",
    [
        Read(1, Table.HOLDING, 0, 126),
        Read(1, Table.HOLDING, 0, 0),
        Read(1, Table.COIL, 0, 2001),
        Read(1, Table.HOLDING, 0xFFFF, 2),
        Read(1, Table.HOLDING, -1, 2),
        Read(256, Table.HOLDING, 0, 1),
        Write(1, Table.INPUT, 0, (1,)),
        Write(1, Table.DISCRETE, 0, (1,)),
        Write(1, Table.HOLDING, 0, ()),
        Write(1, Table.HOLDING, 0, (0,) * 124),
        Write(1, Table.HOLDING, 0, (0x10000,)),
        Write(1, Table.COIL, 0, (2,)),
        Write(1, Table.COIL, 0, (1,) * 1969),
    ],
)
def test_what_no_pdu_can_hold_is_refused_before_it_is_sent(request_: Request) -> None:
    with pytest.raises(CodecError):
        pdu.encode_request(request_)


def test_the_largest_pdus_fit() -> None:
    assert len(pdu.encode_request(Write(1, Table.HOLDING, 0, (7,) * 123))) == 252
    assert len(pdu.encode_request(Write(1, Table.COIL, 0, (1,) * 1968))) == 252


def test_a_device_that_answers_the_wrong_number_of_values_is_a_bug() -> None:
    with pytest.raises(ValueError, match="a device answered 1 values"):
        pdu.encode_reply(Read(1, Table.HOLDING, 0, 2), bytes.fromhex("0300000002"), (1,))


@given(st.binary(min_size=1, max_size=260))
def test_garbage_is_refused_as_a_request_or_says_what_it_asks(garbage: bytes) -> None:
    code, request = 0, None
    try:
        request = pdu.decode_request(1, garbage)
    except PlcRefusedError as refusal:
        code = refusal.code
    assert code in (0, 1, 2, 3)
    assert request is None or pdu.decode_request(1, pdu.encode_request(request)) == request


@given(st.lists(st.integers(0, 0xFFFF), min_size=1, max_size=125))
def test_words_come_back_as_they_were_sent(words: list[int]) -> None:
    request = Read(9, Table.INPUT, 0, len(words))
    asked = pdu.encode_request(request)
    answer = pdu.encode_reply(request, asked, words)
    assert tuple(words) == pdu.decode_reply(request, pdu.reply_shape(request, asked), answer)


@given(st.lists(st.integers(0, 1), min_size=1, max_size=300))
def test_bits_come_back_as_they_were_sent(bits: list[int]) -> None:
    request = Read(9, Table.DISCRETE, 0, len(bits))
    asked = pdu.encode_request(request)
    answer = pdu.encode_reply(request, asked, bits)
    assert tuple(bits) == pdu.decode_reply(request, pdu.reply_shape(request, asked), answer)
