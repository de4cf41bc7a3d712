"""Records word by word: layouts of three programs, their words written out by hand."""

from __future__ import annotations

from ahgateway.codec.devices import parse_device
from ahgateway.codec.ways import Place, Recorder, record

D = parse_device
FIELDS = {"SV": Place(3), "PV": Place(5), "PID_RUN": Place(2, 0), "PID_MAN": Place(2, 4)}
LENGTHS = {"SV": 2, "PV": 2, "PID_RUN": 0, "PID_MAN": 0}
OURS = Recorder(
    D("D2000"), 8, 8, D("D1990"), FIELDS, sequence_end=7, time=1, time_words=1, time_range=30_000,
    time_unit_ns=10_000_000, first=Place(2, 15),
)  # fmt: skip


def test_a_record_of_ours() -> None:
    # Number 300; 12345 times 10 ms; flags PID_RUN and first; SV 50.0 = 0x42480000; PV 49.5 = 0x42460000; number.
    found = record(OURS, LENGTHS, (300, 12345, 0x8001, 0x0000, 0x4248, 0x0000, 0x4246, 300))

    assert (300, True, 123_450_000_000, True) == (found.sequence, found.is_whole, found.time_ns, found.is_first)
    assert (0x0000, 0x4248) == found.fields["SV"]
    assert (0x0000, 0x4246) == found.fields["PV"]
    assert ((1,), (0,)) == (found.fields["PID_RUN"], found.fields["PID_MAN"])


def test_a_record_whose_ends_differ_is_not_whole() -> None:
    assert not record(OURS, LENGTHS, (301, 12346, 0x0001, 0, 0x4248, 0, 0x4246, 300)).is_whole


def test_numbers_of_two_words_have_the_low_one_first() -> None:
    wide = Recorder(
        D("D10"), 4, 10, D("D9"), {"PV": Place(4)}, sequence=0, sequence_words=2, sequence_end=8, time=2, time_words=2,
        time_unit_ns=1000,
    )  # fmt: skip
    found = record(wide, {"PV": 2}, (0x0001, 0x0002, 0xFFFF, 0x0001, 0x1234, 0x4120, 0, 0, 0x0001, 0x0002))

    assert 0x0002_0001 == found.sequence
    assert 0x0001_FFFF * 1000 == found.time_ns
    assert (0x1234, 0x4120) == found.fields["PV"]
    assert found.is_whole
    assert not found.is_first


def test_a_switch_may_take_a_whole_word_and_time_may_be_missing() -> None:
    plain = Recorder(D("D10"), 4, 4, D("D9"), {"PID_RUN": Place(1), "PV": Place(2)})
    found = record(plain, {"PID_RUN": 0, "PV": 2}, (7, 0xFFFF, 1, 2))

    assert (7, None, True) == (found.sequence, found.time_ns, found.is_whole)
    assert (1,) == found.fields["PID_RUN"]


def test_slots_follow_each_other_and_begin_again() -> None:
    assert [0, 8, 56, 0, 56] == [OURS.slot(number) for number in (0, 1, 7, 8, -1)]
    assert (65_536, 30_000, 64) == (OURS.sequences, OURS.times, OURS.words)
