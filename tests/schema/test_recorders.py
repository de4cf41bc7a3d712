"""What a profile says of rings, triggers and tasks: the layout that follows, and the mistakes that are named."""

from __future__ import annotations

import pytest

from ahgateway.codec.ways import Each, Place, Way
from ahgateway.errors import ProfileError
from ahgateway.schema.profile import Profile, parse

STATION = """
[station]
name = "Line"
target = "modbus+tcp://192.0.2.10:502?unit=1"
kind = "bench"
"""
LOOP = """
[loops.A]
instruction = "DPID"
layout = "manual"
interval_ms = 200
"""
STANDARD = """
[loops.A.recorder]
ring = "D2000"
head = "D1990"
records = 8
each = "call"
"""
OWN = """
[loops.A.recorder]
ring = "D4000"
head = "D3990"
head_is = "last"
records = 50
length = 24
each = "scan"
sequence = 0
sequence_end = 23
time = 1
time_unit = "0.1 ms"
first = "3.15"
unrecorded = ["ERR_DBW", "MV_MAX", "MV_MIN", "MOUT_AUTO", "PID_DIR", "PID_MODE", "CYCLE"]
fields = { PID_RUN = "3.0", PID_MAN = "3.1", SV = 4, PV = 6, Kp = 8, Ki = 10, Kd = 12, MOUT = 14, I_MV = 16, "I_MV+1" = 18, MV = 20 }
"""  # noqa: E501
TRIGGER = """
[loops.A.trigger]
coil = "M60"
counter = "D890"
"""


def loaded(*parts: str) -> Profile:
    return parse("".join(parts), "line.toml")


def message(*parts: str) -> str:
    with pytest.raises(ProfileError) as caught:
        loaded(*parts)
    return f"{caught.value.message} | {caught.value.hint}"


def test_without_fields_the_ring_has_the_layout_of_our_snippet() -> None:
    loop = loaded(STATION, LOOP, STANDARD).station().loops[0]

    assert Way.RECORDED is loop.way
    assert 200 == loop.interval_ms
    made = loop.recorder
    assert made is not None
    assert Each.CALL is made.each
    # Number, time, flags; thirteen REALs and DINTs of the block and its two known REALs; number.
    assert 0 == made.sequence
    assert 1 == made.time
    assert [Place(2, 0), Place(2, 1), Place(2, 2), Place(2, 3), Place(2, 4)] == [
        *(made.fields[name] for name in ("PID_RUN", "PID_MAN", "MOUT_AUTO", "PID_DIR")),
        made.first,
    ]
    names = ("SV", "PV", "PID_MODE", "CYCLE", "Kp", "Ki", "Kd", "ERR_DBW", "MV_MAX", "MV_MIN", "MOUT", "I_MV", "I_MV+1")
    assert list(range(3, 29, 2)) == [made.fields[name].offset for name in names]
    assert Place(29) == made.fields["MV"]
    assert (31, 32) == (made.sequence_end, made.length)
    assert (30_000, 30_000, 10_000_000) == (made.sequence_range, made.time_range, made.time_unit_ns)


def test_a_ring_of_ones_own_is_read_as_it_is_described() -> None:
    made = loaded(STATION, LOOP, OWN).station().loops[0].recorder
    assert made is not None
    assert (50, 24, True) == (made.records, made.length, made.is_last)
    assert Place(3, 1) == made.fields["PID_MAN"]
    assert Place(18) == made.fields["I_MV+1"]
    assert (100_000, Place(3, 15)) == (made.time_unit_ns, made.first)
    assert {"ERR_DBW", "MV_MAX", "MV_MIN", "MOUT_AUTO", "PID_DIR", "PID_MODE", "CYCLE"} == made.unrecorded


def test_a_loop_can_be_polled_although_it_is_recorded() -> None:
    loop = loaded(STATION, LOOP + 'follow = "polled"\n', STANDARD).station().loops[0]
    assert Way.POLLED is loop.way
    assert loop.recorder is not None


def test_the_trigger_is_the_contact() -> None:
    loop = loaded(STATION, LOOP, TRIGGER).station().loops[0]
    assert "M60" == str(loop.en)
    assert Way.POLLED is loop.way


@pytest.mark.parametrize(
    ("parts", "wanted"),
    [
        ((LOOP, STANDARD.replace("D2000", "D90")), ("loops.A.recorder.ring", "overlaps", "SV of loop A", "move one")),
        ((LOOP, STANDARD.replace("D2000", "D29900")), ("loops.A.recorder.ring", "256 words", "outside the device map")),
        ((LOOP, STANDARD.replace("D1990", "D1999")), ("loops.A.recorder.head", "overlaps the ring of loop A")),
        ((LOOP, STANDARD.replace("D1990", "M1990")), ("loops.A.recorder.head", "no word that a program can write")),
        ((LOOP.replace("interval_ms = 200", ""), STANDARD), ("loops.A.recorder.each", "interval_ms")),
        ((LOOP.replace("200", "205"), STANDARD), ("loops.A.interval_ms", "is 205", "multiples of 10")),
        ((LOOP, STANDARD + "length = 40\n"), ("loops.A.recorder.length", "has no fields")),
        ((LOOP, OWN.replace("length = 24\n", "")), ("loops.A.recorder.length", "is missing")),
        ((LOOP, OWN.replace("MV = 20", "MV = 23")), ("loops.A.recorder.fields.MV", "word 23", "sequence_end")),
        ((LOOP, OWN.replace("MV = 20", "MV = 24")), ("loops.A.recorder.fields.MV", "ends at word 24", "has 24")),
        ((LOOP, OWN.replace("PV = 6", "PV = 5")), ("loops.A.recorder.fields.PV", "word 5", "holds SV already")),
        ((LOOP, OWN.replace('PID_MAN = "3.1"', 'PID_MAN = "3.0"')), ("word 3 of the record holds PID_RUN already",)),
        ((LOOP, OWN.replace('PID_MAN = "3.1"', 'PID_MAN = "3.16"')), ("fields.PID_MAN", '"3.16"', "no bit")),
        ((LOOP, OWN.replace("SV = 4", 'SV = "4.0"')), ("fields.SV", "SV takes words")),
        ((LOOP, OWN.replace("SV = 4", "SW = 4")), ("fields.SW", "did you mean `SV`?")),
        ((LOOP, OWN.replace("Kd = 12, ", "")), ("recorder.fields", "lacks Kd", "unrecorded")),
        ((LOOP, OWN.replace('"ERR_DBW", ', '"ERR_DBW", "PV", ')), ("unrecorded", "PV changes with every execution")),
        ((LOOP, OWN.replace('"ERR_DBW", ', '"ERR_DB", ')), ("unrecorded", "ERR_DB", "did you mean `ERR_DBW`?")),
        ((LOOP + 'follow = "recorded"\n',), ("loops.A.follow", "no recorder")),
        ((LOOP, TRIGGER.replace("M60", "D60.1")), ("loops.A.trigger.coil", "no coil")),
        ((LOOP, TRIGGER.replace("D890", "D100")), ("loops.A.trigger.counter", "overlaps SV of loop A")),
        ((LOOP + 'en = "M61"\n', TRIGGER), ("loops.A.en", "M61", "M60")),
    ],
)
def test_a_mistake_is_named_with_its_key_and_what_to_do(parts: tuple[str, ...], wanted: tuple[str, ...]) -> None:
    text = message(STATION, *parts)
    assert [] == [part for part in wanted if part not in text], text


def test_a_trigger_is_refused_on_a_plant() -> None:
    assert "Line is a plant" in message(STATION.replace('"bench"', '"plant"'), LOOP, TRIGGER)


def test_a_record_must_fit_into_a_request() -> None:
    short = STATION + "[station.pacing]\nwords_per_request_max = 30\n"
    assert "a request may hold 30" in message(short, LOOP, STANDARD)
