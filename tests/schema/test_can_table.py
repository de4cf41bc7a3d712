"""Mistakes in `[station.can]` are named before anything is sent."""

from __future__ import annotations

import pytest

from ahgateway.codec.access import Span, Table
from ahgateway.errors import ProfileError
from ahgateway.schema.files import shipped
from ahgateway.schema.profile import load, parse

TEXT = (shipped() / "examples" / "can.toml").read_text("utf-8")


def wrong(old: str, new: str) -> str:
    assert old in TEXT
    with pytest.raises(ProfileError) as caught:
        parse(TEXT.replace(old, new, 1), "can.toml")
    return caught.value.message


def test_the_example_puts_every_operand_into_an_object() -> None:
    can = load("can").station().can
    assert can is not None
    sv = can.at(0x2000, 1)
    assert sv is not None
    assert (Span(Table.HOLDING, 100, 2), 4) == (sv.span, sv.size)
    assert 23 == can.subs(0x2000)
    assert ["0x2000:01", "0x2000:02"] == [str(each) for each in can.holding(Span(Table.HOLDING, 101, 2))]
    assert (20_000, 10_000) == (can.sync.period_us, can.sync.window_us)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("count = 23", "count = 22", "I_MV: holding register 0x0090 stands in no CANopen object of the profile"),
        ("length = 2\ncount = 23", "length = 1\ncount = 46", "SV stands half in object 0x2000:01 and 0x2000:02"),
        ('device = "D200"\nindex = 0x2001', 'device = "D144"\nindex = 0x2001', "`D144` stands in object"),
        ("index = 0x2001", "index = 0x2000\nsub = 3", "object 0x2000:03 stands already in station.can.objects.0"),
        ("sub = 1", "sub = 250", "sub-index 250 and 22 more end behind 254"),
        ("cob_id = 0x283", "cob_id = 0x183", "station.can.pdos.1.cob_id: 0x183 is taken by station.can.pdos.0"),
        ("cob_id = 0x283", "cob_id = 0x583", "0x583 is taken by CiA 301"),
        ('{ device = "D104", length = 4 }', '{ device = "D104", length = 5 }', "maps 10 bytes, a PDO carries 8"),
        ('device = "D100"\nlength', 'device = "D100.3"\nlength', "`D100.3` is a bit inside a word"),
        ('device = "D100"\nlength', 'device = "Q100"\nlength', "unknown kind of device `Q`"),
        ("window_ms = 10.0", "window_ms = 20.0", "is 20, not below the period of 20"),
        ('running = "SM400"', 'running = "SM401"', "`SM401` stands in no CANopen object"),
        ("index = 0x2001", "index = 0x1001", "4097"),
        (
            'device = "D102"',
            'device = "D104"',
            "`D104` is no loop's process value, those that may be sent: PV of TIC-101",
        ),
        ('device = "D102"', 'device = "D102"\nlength = 1', "`D102` is no loop's process value"),
        ("cob_id = 0x203", "cob_id = 0x283", "station.can.takes.0.cob_id: 0x283 is taken by station.can.pdos.1"),
        ('kind = "bench"', 'kind = "plant"', "station.can.takes.0: is for benches only: nobody answers a PDO"),
    ],
)
def test_a_mistake_is_named(old: str, new: str, said: str) -> None:
    assert said in wrong(old, new)


def test_a_canopen_target_needs_the_table() -> None:
    text = (shipped() / "examples" / "single.toml").read_text("utf-8")
    with pytest.raises(ProfileError, match=r"station\.can: is missing, a canopen target needs it"):
        parse(text.replace("modbus+tcp://192.0.2.10", "canopen://socketcan/can0?node=3"), "single.toml")
