"""Faults on purpose: what each makes of a frame, when a script lets it happen, and that a seed repeats it."""

from __future__ import annotations

import pytest

from ahgateway.clock import MILLISECOND
from ahgateway.errors import ProfileError
from ahgateway.transports.ascii import AsciiReplies
from ahgateway.transports.fault import Fault, FaultyWire, Piece, Rule, Script, opened, parse_script
from ahgateway.transports.framing import Adu
from ahgateway.transports.rtu import crc

ASKED = bytes.fromhex("0103006b0003 7417")
ANSWER = bytes.fromhex("0103 06 022b 0000 0064 05 7a")
OLDER = bytes.fromhex("0103 02 0007 f986")


def wire(fault: Fault, late_ms: int | None = None, name: str = "rtu") -> FaultyWire:
    faulty = FaultyWire(name, Script((Rule((fault,), first=2, late_ms=late_ms),), seed=1))
    faulty.request(ASKED)
    assert [Piece(0, OLDER)] == faulty.reply(OLDER)
    assert faulty.request(ASKED)[0] in (ASKED, b"")
    return faulty


def joined(pieces: list[Piece]) -> bytes:
    return b"".join(piece.data for piece in pieces)


def test_without_a_rule_nothing_changes() -> None:
    faulty = FaultyWire("rtu", Script(()))
    assert (ASKED, []) == faulty.request(ASKED)
    assert [Piece(0, ANSWER)] == faulty.reply(ANSWER)


@pytest.mark.parametrize(
    ("fault", "came"),
    [
        (Fault.LOST, b""),
        (Fault.DUPLICATED, ANSWER + ANSWER),
        (Fault.STRAY, ANSWER + OLDER),
        (Fault.SPLIT, ANSWER),
        (Fault.LATE, ANSWER),
    ],
)
def test_what_comes_of_an_answer(fault: Fault, came: bytes) -> None:
    assert came == joined(wire(fault).reply(ANSWER))


def test_late_is_as_late_as_the_script_says() -> None:
    assert [Piece(300 * MILLISECOND, ANSWER)] == wire(Fault.LATE, 300).reply(ANSWER)


def test_a_split_answer_comes_in_two_pieces() -> None:
    assert 2 == len(wire(Fault.SPLIT).reply(ANSWER))


def test_truncated_corrupted_and_noisy_answers_fail_their_checksum() -> None:
    cut = joined(wire(Fault.TRUNCATED).reply(ANSWER))
    assert (True, True) == (ANSWER.startswith(cut), 0 < len(cut) < len(ANSWER))
    bent = joined(wire(Fault.CORRUPTED).reply(ANSWER))
    assert 1 == sum((a ^ b).bit_count() for a, b in zip(ANSWER, bent, strict=True))
    assert joined(wire(Fault.NOISE_BEFORE).reply(ANSWER)).endswith(ANSWER)
    assert joined(wire(Fault.NOISE_AFTER).reply(ANSWER)).startswith(ANSWER)
    inside = joined(wire(Fault.NOISE_INSIDE).reply(ANSWER))
    assert (True, True) == (len(inside) > len(ANSWER), inside[0] == 1)
    assert crc(inside[: len(ANSWER) - 2]) != inside[len(ANSWER) - 2 : len(ANSWER)]


def test_lies_have_a_sound_checksum() -> None:
    for fault, part in ((Fault.WRONG_UNIT, 0), (Fault.WRONG_FUNCTION, 1), (Fault.WRONG_COUNT, 2)):
        lie = joined(wire(fault).reply(ANSWER))
        assert crc(lie[:-2]) == lie[-2:]
        assert [part] == [index for index in range(3) if lie[index] != ANSWER[index]]
        assert fault is not Fault.WRONG_COUNT or lie[2] == len(lie) - 5


def test_the_echo_of_a_write_can_lie_too() -> None:
    echo = bytes.fromhex("0106 0064 002a")
    lie = joined(wire(Fault.WRONG_COUNT).reply(echo + crc(echo)))
    assert bytes.fromhex("0106 0064 002b") == lie[:-2]


@pytest.mark.parametrize(("fault", "code"), [(Fault.EXCEPTION, 4), (Fault.BUSY, 6)])
def test_a_refusal_comes_in_the_units_place_and_the_unit_sees_nothing(fault: Fault, code: int) -> None:
    faulty = FaultyWire("rtu", Script((Rule((fault,)),)))
    forwarded, back = faulty.request(ASKED)
    assert b"" == forwarded
    assert Adu(0, 1, bytes((0x83, code))) == opened("rtu", joined(back))


def test_a_lost_request_never_arrives() -> None:
    assert (b"", []) == FaultyWire("rtu", Script((Rule((Fault.REQUEST_LOST,)),))).request(ASKED)


def test_a_merged_answer_comes_in_front_of_the_next_one() -> None:
    faulty = FaultyWire("rtu", Script((Rule((Fault.MERGED,), last=1),)))
    faulty.request(ASKED)
    assert [] == faulty.reply(OLDER)
    faulty.request(ASKED)
    assert [Piece(0, OLDER + ANSWER)] == faulty.reply(ANSWER)


def test_frames_are_opened_on_every_wire() -> None:
    assert Adu(7, 1, b"\x03\x02\x00\x2a") == opened("tcp", bytes.fromhex("0007 0000 0005 01 03 02 002a"))
    frame = AsciiReplies().wrap(0, 1, b"\x03\x02\x00\x2a")
    assert b":01030200 2AD0\r\n".replace(b" ", b"") == frame
    assert Adu(0, 1, b"\x03\x02\x00\x2a") == opened("ascii", frame)


def test_a_script_says_when() -> None:
    script = parse_script("# a bad morning\n2 lost\n4-5 late 300\nevery 3 split,merged\n", "bad.txt")
    happened = [script.next() for _ in range(9)]
    assert [None, Fault.LOST, "3", Fault.LATE, Fault.LATE, "3", None, None, "3"] == [
        "3" if fault in (Fault.SPLIT, Fault.MERGED) else fault for fault, _ in happened
    ]
    assert [300, 300] == [late_ms for _, late_ms in happened if late_ms is not None]


def test_equal_seeds_give_equal_faults() -> None:
    def run(seed: int) -> list[object]:
        script = parse_script("rate 0.3 lost,late,corrupted,noise-inside", "x", seed)
        return [script.next() for _ in range(60)]

    assert run(5) == run(5)
    assert run(5) != run(6)
    assert 8 <= sum(fault is not None for fault, _ in run(5)) <= 30


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("5 lots", "`lots` is no fault, known are request-lost, late, lost"),
        ("0 lost", "`0` is no whole number above 0"),
        ("rate 2 lost", "rate 2, allowed above 0 up to 1"),
        ("lost", "`lost` is no whole number above 0"),
        ("7", "`7` is no fault"),
    ],
)
def test_what_is_no_script_is_named_with_its_line(line: str, said: str) -> None:
    with pytest.raises(ProfileError, match=f"bad.txt: line 2: {said}"):
        parse_script(f"# x\n{line}\n", "bad.txt")
