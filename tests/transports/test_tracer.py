from __future__ import annotations

import pytest

from ahgateway.transports.ascii import AsciiReplies, AsciiRequests
from ahgateway.transports.base import Frame
from ahgateway.transports.framing import Mbap
from ahgateway.transports.rtu import RtuReplies, RtuRequests
from ahgateway.transports.tracer import Tracer, line_maker

NOON = 1_767_268_800 * 10**9 + 123_456


def out(text: str) -> Frame:
    return Frame(">", bytes.fromhex(text), 0, NOON)


def back(text: str) -> Frame:
    return Frame("<", bytes.fromhex(text), 0, NOON)


def test_a_read_and_its_answer_are_two_lines() -> None:
    tracer = Tracer(Mbap)
    asked, answered = "00 01 00 00 00 06 01 03 00 6b 00 03", "00 01 00 00 00 09 01 03 06 02 2b 00 00 00 64"
    assert f"12:00:00.000123 > {asked}  read 3 holding registers from 0x006B of unit 1" == tracer.line(out(asked))
    assert f"12:00:00.000123 < {answered}  unit 1: 022B 0000 0064" == tracer.line(back(answered))


@pytest.mark.parametrize(
    ("frame", "meaning"),
    [
        (out("00 02 00 00 00 06 01 05 00 ac ff 00"), "write 1 coil to 0x00AC of unit 1: 1"),
        (out("00 02 00 00 00 02 01 2b"), "request refused: function 43: exception 01, illegal function"),
        (back("00 07 00 00 00 03 01 83 02"), "unit 1: answer to nothing that was asked"),
        (back("48 54 54 50 2f 31 2e 31"), "no frame: bytes 48 54 54 50"),
        (back("00 07 00"), "3 bytes of no frame"),
    ],
)
def test_single_frames(frame: Frame, meaning: str) -> None:
    assert f"  {meaning}" in Tracer(Mbap).line(frame)


def test_an_exception_is_named() -> None:
    tracer = Tracer(Mbap)
    tracer.line(out("00 01 00 00 00 06 01 03 00 6b 00 03"))
    assert tracer.line(back("00 01 00 00 00 03 01 83 02")).endswith("  unit 1: exception 02, illegal data address")


def test_serial_frames_are_read_too_and_noise_is_counted() -> None:
    tracer = Tracer(RtuRequests, RtuReplies)
    assert tracer.line(out("01 02 05 00 00 10 79 0a")).endswith("  read 16 discrete inputs from 0x0500 of unit 1")
    line = tracer.line(back("01 02 02 34 12 2f 75 ff ff"))
    assert line.endswith("  unit 1: 0 0 1 0 1 1 0 0 … (16 values); 2 bytes of no frame")
    tracer = Tracer(AsciiRequests, AsciiReplies)
    assert "write 10" not in tracer.line(Frame(">", b":010F0500001002341293\r\n", 0, NOON))
    assert tracer.line(Frame("<", b":010F05000010DB\r\n", 0, NOON)).endswith("  unit 1: done")


def test_the_scheme_says_how_frames_are_read() -> None:
    assert line_maker("modbus+rtu")(out("01 02 05 00 00 10 79 0a")).endswith("0x0500 of unit 1")
    assert line_maker("modbus+ascii+tcp")(Frame(">", b":010300640002%02X\r\n" % 0x96, 0, NOON)).endswith("of unit 1")
    assert line_maker("fake")(out("00 01 00 00 00 06 01 03 00 64 00 02")).endswith("0x0064 of unit 1")
    assert line_maker("canopen")(back("00 00 00 80")) == "12:00:00.000123 < 080 [0]  SYNC"
