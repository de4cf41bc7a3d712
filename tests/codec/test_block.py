"""The manual's example registers of DPID and a reply to `read D100…D133`, its words written out by hand."""

import pytest

from ahgateway.codec import block
from ahgateway.codec.access import Read, Span, Table
from ahgateway.codec.devices import Address, Device, DeviceMap, DeviceRange, parse_device
from ahgateway.codec.station import Binding, Const, Loop
from ahgateway.core.controllers import DPID, DPIDE
from ahgateway.core.real import REAL, bits
from ahgateway.errors import CodecError

AH = DeviceMap(
    "ah",
    "by hand",
    (DeviceRange("D", 0, 29999, Table.HOLDING, 0), DeviceRange("M", 0, 8191, Table.COIL, 0)),
)
BINDINGS: dict[str, Binding] = {
    name: parse_device(text)
    for name, text in {
        "PID_RUN": "M1",
        "SV": "D100",
        "PV": "D102",
        "PID_MODE": "D104",
        "PID_MAN": "M2",
        "MOUT_AUTO": "M3",
        "CYCLE": "D106",
        "Kp": "D108",
        "Ki": "D110",
        "Kd": "D112",
        "PID_DIR": "M4",
        "ERR_DBW": "D114",
        "MV_MAX": "D116",
        "MV_MIN": "D118",
        "MOUT": "D120",
        "I_MV": "D122",
        "MV": "D200",
    }.items()
}
LOOP = Loop("TIC-101", DPID, BINDINGS, en=Device("M", 10))

# The PDU of a reply to function 3, D100…D133: count, then the words big-endian, low word of each pair first.
BLOCK_REPLY = bytes.fromhex(
    "0344"
    "0000 4248"  # SV 50.0 = 0x42480000
    "70A4 4145"  # PV 12.34 = 0x414570A4
    "0000 0000"  # PID_MODE 0
    "0014 0000"  # CYCLE 20
    "0000 4000"  # Kp 2.0 = 0x40000000
    "CCCD 3DCC"  # Ki 0.1 = 0x3DCCCCCD
    "0000 0000"  # Kd 0.0
    "0000 0000"  # ERR_DBW 0.0
    "0000 42C8"  # MV_MAX 100.0 = 0x42C80000
    "0000 0000"  # MV_MIN 0.0
    "0000 41A0"  # MOUT 20.0 = 0x41A00000
    "0000 3F80"  # I_MV: 1.0
    "70A4 4145"  # I_MV+1: PV of the last execution, 12.34
    "0001 0002 0003 0004 0005 0006 0007 0008"  # system words
)
WORDS = tuple(BLOCK_REPLY[2 + i] << 8 | BLOCK_REPLY[3 + i] for i in range(0, BLOCK_REPLY[1], 2))


def picture() -> block.Image:
    image = block.Image()
    image.put(Read(1, Table.HOLDING, 100, 34), WORDS)
    image.put(Read(1, Table.HOLDING, 200, 2), (0x0001, 0x7FA0))
    image.put(Read(1, Table.COIL, 1, 4), (1, 0, 0, 1))
    image.put(Read(1, Table.COIL, 10, 1), (1,))
    return image


def test_spans_are_as_long_as_their_operands() -> None:
    spans = block.spans(LOOP, AH)
    assert spans["SV"] == Span(Table.HOLDING, 100, 2)
    assert spans["I_MV"] == Span(Table.HOLDING, 122, 12)
    assert spans["PID_DIR"] == Span(Table.COIL, 4, 1)
    assert spans["EN"] == Span(Table.COIL, 10, 1)
    assert len(spans) == 18


def test_the_block_is_typed_bit_for_bit() -> None:
    inputs = block.inputs(LOOP, block.Layout(LOOP, AH).raw(picture()))
    assert bits(inputs.sv) == 0x42480000
    assert bits(inputs.pv) == 0x414570A4
    assert bits(inputs.ki) == 0x3DCCCCCD
    assert inputs.cycle == 20
    assert inputs.pid_mode == 0
    assert (inputs.pid_run, inputs.pid_man, inputs.mout_auto, inputs.pid_dir) == (True, False, False, True)
    assert type(inputs.kp) is REAL


def test_seen_values_stand_at_their_double_words() -> None:
    raw = block.Layout(LOOP, AH).raw(picture())
    seen = block.seen(LOOP, raw)
    assert bits(seen["I_MV"]) == 0x3F800000
    assert bits(seen["I_MV+1"]) == 0x414570A4
    assert seen["MOUT"] == 20.0
    assert seen["MV"].tobytes() == bytes.fromhex("0100A07F")
    assert raw["I_MV"][4:] == (1, 2, 3, 4, 5, 6, 7, 8)
    assert raw["EN"] == (1,)


def test_a_constant_is_encoded_and_never_read_nor_seen() -> None:
    loop = Loop("x", DPID, {**BINDINGS, "Kd": Const(0.1), "PID_RUN": Const(True), "MOUT": Const(0.0)})
    raw = block.Layout(loop, AH).raw(picture())
    assert raw["Kd"] == (0xCCCD, 0x3DCC)
    assert raw["PID_RUN"] == (1,)
    assert "EN" not in raw
    assert not {"Kd", "PID_RUN", "MOUT", "EN"} & set(block.spans(loop, AH))
    assert "MOUT" not in block.seen(loop, raw)


def test_a_flag_may_be_a_bit_inside_a_word() -> None:
    loop = Loop("x", DPID, {**BINDINGS, "PID_MAN": parse_device("D104.1"), "PID_DIR": parse_device("D106.2")})
    raw = block.Layout(loop, AH).raw(picture())
    assert block.address(loop, AH, "PID_MAN") == Address(Table.HOLDING, 104, 1)
    assert raw["PID_MAN"] == (0,)
    assert raw["PID_DIR"] == (1,)  # CYCLE is 20 = 0b10100


def test_a_later_reply_counts() -> None:
    image = picture()
    image.put(Read(1, Table.HOLDING, 102, 2), (0x0000, 0x3F80))
    assert block.inputs(LOOP, block.Layout(LOOP, AH).raw(image)).pv == 1.0


def test_words_that_were_never_read_are_not_invented() -> None:
    image = block.Image()
    image.put(Read(1, Table.HOLDING, 100, 1), (1,))
    with pytest.raises(CodecError, match=r"holding register 0x0065 was not read"):
        image.words(Span(Table.HOLDING, 100, 2))


def test_a_reply_of_another_length_is_refused() -> None:
    with pytest.raises(CodecError, match="1 values came, 2 were asked for"):
        block.Image().put(Read(1, Table.HOLDING, 100, 2), (1,))


def test_an_unknown_operand_gets_the_near_name() -> None:
    with pytest.raises(CodecError) as caught:
        block.address(LOOP, AH, "MVMAX")
    assert caught.value.hint == "did you mean `MV_MAX`?"


def test_a_constant_has_no_address() -> None:
    with pytest.raises(CodecError, match=r"Kd is the constant 0\.1"):
        block.address(Loop("x", DPID, {**BINDINGS, "Kd": Const(0.1)}), AH, "Kd")


@pytest.mark.parametrize(("controller", "words"), [(DPID, 12), (DPIDE, 20)])
def test_a_block_nobody_wrote_holds_the_defaults(controller, words) -> None:
    raw = block.defaults(controller)
    assert raw["I_MV"] == (0,) * words
    assert raw["MV_MAX"] == (0x0000, 0x42C8)
    assert raw["PID_RUN"] == (1,)
    assert list(raw) == [row.name for row in controller.operands]
    assert block.inputs(Loop("x", controller, {}), raw) == controller.inputs()
