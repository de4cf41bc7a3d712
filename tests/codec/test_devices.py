"""Addresses are written out from the table of spec ah500 §3.1; the small map here repeats its rows by hand."""

import pytest

from ahgateway.codec.access import Span, Table
from ahgateway.codec.devices import Address, Device, DeviceMap, DeviceRange, parse_device
from ahgateway.errors import CodecError

AH = DeviceMap(
    "ah",
    "by hand",
    (
        DeviceRange("D", 0, 29999, Table.HOLDING, 0x0000),
        DeviceRange("M", 0, 8191, Table.COIL, 0x0000),
        DeviceRange("SM", 0, 4095, Table.COIL, 0x4000, writable=False),
        DeviceRange("X", 0, 511, Table.DISCRETE, 0x6000, stride=16, writable=False),
        DeviceRange("X", 0, 511, Table.INPUT, 0x8000, writable=False),
        DeviceRange("Y", 0, 511, Table.COIL, 0xA000, stride=16),
        DeviceRange("Y", 0, 511, Table.HOLDING, 0xA000),
        DeviceRange("SR", 0, 2047, Table.HOLDING, 0xC000),
        DeviceRange("T", 0, 511, Table.COIL, 0xE000),
        DeviceRange("T", 0, 511, Table.HOLDING, 0xE000),
        DeviceRange("HC", 0, 255, Table.HOLDING, 0xFC00, stride=2),
    ),
)
DVP = DeviceMap(
    "dvp",
    "by hand",
    (
        DeviceRange("X", 0, 0o377, Table.DISCRETE, 0x0400, octal=True),
        DeviceRange("M", 0, 1535, Table.COIL, 0x0800),
        DeviceRange("M", 1536, 4095, Table.COIL, 0xB000),
        DeviceRange("D", 0, 4095, Table.HOLDING, 0x1000),
        DeviceRange("D", 4096, 9999, Table.HOLDING, 0x9000),
    ),
)


@pytest.mark.parametrize(
    ("text", "device"),
    [
        ("D100", Device("D", 100)),
        ("m1", Device("M", 1)),
        ("X0.3", Device("X", 0, 3)),
        ("SM400", Device("SM", 400)),
        ("HC7", Device("HC", 7)),
        (" D100.15 ", Device("D", 100, 15)),
    ],
)
def test_delta_spelling_is_read(text: str, device: Device) -> None:
    assert parse_device(text) == device


@pytest.mark.parametrize("text", ["D100", "M1", "X0.3", "D100.15", "SR6"])
def test_a_device_prints_as_it_was_written(text: str) -> None:
    assert str(parse_device(text)) == text


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("", "no device name"),
        ("100", "no device name"),
        ("%MW100", "no device name"),
        ("D-1", "no device name"),
        ("D1.2.3", "no device name"),
        ("X0.16", "allowed 0…15"),
        ("Q3", "unknown kind of device `Q`"),
        ("PR3", "unknown kind of device `PR`"),
    ],
)
def test_what_is_no_device_is_refused(text: str, part: str) -> None:
    with pytest.raises(CodecError, match=part):
        parse_device(text)


def test_a_kind_that_is_nearly_right_is_suggested() -> None:
    with pytest.raises(CodecError) as caught:
        parse_device("SMM400")
    assert caught.value.hint == "did you mean `SM400`?"


@pytest.mark.parametrize(
    ("text", "address"),
    [
        ("D100", Address(Table.HOLDING, 0x0064)),
        ("D100.3", Address(Table.HOLDING, 0x0064, 3)),
        ("M1", Address(Table.COIL, 0x0001)),
        ("SM400", Address(Table.COIL, 0x4190)),
        ("X0.3", Address(Table.DISCRETE, 0x6003)),
        ("X511.15", Address(Table.DISCRETE, 0x7FFF)),
        ("X1", Address(Table.INPUT, 0x8001)),
        ("Y1.0", Address(Table.COIL, 0xA010)),
        ("Y2", Address(Table.HOLDING, 0xA002)),
        ("SR6", Address(Table.HOLDING, 0xC006)),
        ("T5", Address(Table.HOLDING, 0xE005)),
        ("HC1", Address(Table.HOLDING, 0xFC02)),
    ],
)
def test_ah_addresses(text: str, address: Address) -> None:
    assert AH.address(parse_device(text)) == address


@pytest.mark.parametrize(
    ("text", "table", "address"),
    [
        ("X17", Table.DISCRETE, 0x040F),
        ("M1072", Table.COIL, 0x0C30),
        ("M1535", Table.COIL, 0x0DFF),
        ("M1536", Table.COIL, 0xB000),
        ("D4095", Table.HOLDING, 0x1FFF),
        ("D4096", Table.HOLDING, 0x9000),
    ],
)
def test_dvp_addresses_change_at_their_seams_and_x_counts_in_octal(text: str, table: Table, address: int) -> None:
    assert DVP.address(parse_device(text)) == Address(table, address)
    assert DVP.device(table, address) == parse_device(text)


def test_a_contact_is_meant_where_bits_are_asked_for() -> None:
    assert AH.address(Device("T", 5), bits=True) == Address(Table.COIL, 0xE005)


@pytest.mark.parametrize("text", ["D100", "M8191", "SM0", "X3.15", "Y0.0", "X7", "SR2047", "HC255"])
def test_every_address_finds_its_device_again(text: str) -> None:
    place = AH.address(parse_device(text))
    assert AH.device(place.table, place.address) == parse_device(text)


def test_nothing_stands_where_the_map_is_silent() -> None:
    assert AH.device(Table.HOLDING, 30000) is None
    assert AH.device(Table.INPUT, 0) is None


def test_a_device_outside_names_the_range_and_the_nearest_end() -> None:
    with pytest.raises(CodecError) as caught:
        AH.address(Device("D", 30000))
    assert caught.value.message == "`D30000` is outside the device map `ah`, which has D0…D29999"
    assert caught.value.hint == "the nearest end is `D29999`"


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("M1.3", "`M1` is no 16-bit word"),
        ("HC0.1", "`HC0` is no 16-bit word"),
        ("S5", "has no S"),
    ],
)
def test_a_spelling_that_the_map_cannot_mean_is_refused(text: str, part: str) -> None:
    with pytest.raises(CodecError, match=part):
        AH.address(parse_device(text))


def test_octal_devices_have_no_8_and_no_9() -> None:
    with pytest.raises(CodecError, match=r"X0…X377 in octal"):
        DVP.address(Device("X", 18))


def test_a_span_is_covered_only_inside_one_range() -> None:
    assert DVP.covers(Span(Table.HOLDING, 0x1FFE, 2))
    assert not DVP.covers(Span(Table.HOLDING, 0x1FFF, 2))
    assert not DVP.covers(Span(Table.COIL, 0x0DFF, 2))
