"""Shipped maps against the table of spec ah500 §3.1, copied here by hand; and what a map file may not say."""

import pytest

from ahgateway.codec.access import Span, Table
from ahgateway.codec.devices import Address, parse_device
from ahgateway.errors import CodecError, ProfileError
from ahgateway.schema import device_map

ROW = """
name = "mine"
[[ranges]]
device = "D"
numbers = [0, 9]
table = "holding register"
address = 100
functions = [3]
confidence = "V"
writable = true
"""


@pytest.mark.parametrize("name", ["ah500", "as500"])
@pytest.mark.parametrize(
    ("text", "table", "address"),
    [
        ("M0", Table.COIL, 0),
        ("SM400", Table.COIL, 16384 + 400),
        ("S5", Table.COIL, 20480 + 5),
        ("X1.2", Table.DISCRETE, 24576 + 18),
        ("X1", Table.INPUT, 32768 + 1),
        ("Y1.0", Table.COIL, 40960 + 16),
        ("Y3", Table.HOLDING, 40960 + 3),
        ("SR6", Table.HOLDING, 49152 + 6),
        ("T0", Table.HOLDING, 57344),
        ("C1", Table.HOLDING, 61440 + 1),
        ("HC0", Table.HOLDING, 64512),
        ("E0", Table.HOLDING, 65024),
        ("D29999", Table.HOLDING, 0x752F),
    ],
)
def test_ah_and_as_have_the_bases_that_two_drivers_agree_on(name: str, text: str, table: Table, address: int) -> None:
    assert device_map.load(name).address(parse_device(text)) == Address(table, address)


def test_dvp_has_its_seams() -> None:
    dvp = device_map.load("dvp")
    assert dvp.address(parse_device("M1536")) == Address(Table.COIL, 0xB000)
    assert dvp.address(parse_device("D4096")) == Address(Table.HOLDING, 0x9000)
    assert not dvp.covers(Span(Table.HOLDING, 0x1FFF, 2))
    with pytest.raises(CodecError):
        dvp.address(parse_device("X8"))


def test_the_words_of_d_end_before_those_of_y() -> None:
    ah = device_map.load("ah500")
    assert ah.address(parse_device("D40959")) == Address(Table.HOLDING, 0x9FFF)
    with pytest.raises(CodecError, match="outside the device map `ah500`"):
        ah.address(parse_device("D40960"))


def test_every_row_of_the_ah_map_owns_up_to_being_unproven() -> None:
    assert {row.confidence for row in device_map.load("ah500").ranges} == {"I", "R"}


def test_a_map_of_ones_own_is_a_file(tmp_path) -> None:
    (tmp_path / "mine.toml").write_text(ROW, encoding="utf-8")
    mine = device_map.load("mine.toml", tmp_path)
    assert mine.address(parse_device("D3")) == Address(Table.HOLDING, 103)
    assert mine.ranges[0].functions == (3,)


def test_an_unknown_map_is_answered_with_those_that_exist() -> None:
    with pytest.raises(ProfileError) as caught:
        device_map.load("ah50")
    assert "shipped device maps: ah500, as500, dvp, melsec" in caught.value.message
    assert caught.value.hint == "did you mean `ah500`?"


@pytest.mark.parametrize(
    ("old", "new", "part"),
    [
        ('device = "D"', 'device = "Q"', 'ranges.0.device: unknown kind of device "Q"'),
        ("[0, 9]", "[9, 0]", "ranges.0.numbers: [9, 0] is no range"),
        ("address = 100", "address = 65530", "allowed is 0xffff"),
        ('"holding register"', '"input register"', "no Modbus function writes input registers"),
        ('"holding register"', '"register"', "allowed are coil, discrete input, holding register, input register"),
        ("writable = true", "writable = true\nbits = true", "ranges.0.bits"),
        ("writable = true", "writeable = true", "ranges.0.writable: is missing"),
        (ROW, ROW + ROW.split('"mine"')[1], "overlap in the holding registers from address 0x0064"),
    ],
)
def test_what_a_map_may_not_say(old: str, new: str, part: str) -> None:
    with pytest.raises(ProfileError) as caught:
        device_map.parse(ROW.replace(old, new), "mine.toml")
    assert "mine.toml" in caught.value.message
    assert part in caught.value.message
