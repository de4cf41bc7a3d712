"""The lease's block and its snippet: where every word stands, worked out by hand, and what the text may use."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest

from ahgateway.codec import lease, lease_text
from ahgateway.codec.lease import HEAD, Layout, layout
from ahgateway.core.operands import Kind
from ahgateway.errors import ProfileError
from ahgateway.schema.profile import load, parse

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "plc-code.md"
PROFILE = """
[station]
name = "S"
target = "fake://s"
{scratch}
[loops.A]
instruction = "DPID"
layout = "manual"
[loops.A.write]
SV = {{ min = 0.0, max = 1.0, step_max = 1.0 }}
PID_MAN = {{}}
[loops.A.lease]
data = "{data}"
timeout_ms = {timeout}
task_ms = 50
"""


def block(data: str = "D700", timeout: int = 1010, scratch: str = "") -> Layout:
    text = PROFILE.format(data=data, timeout=timeout, scratch=scratch)
    return layout(parse(text, "s.toml").station().loops[0])


def test_every_slot_stands_where_it_was_worked_out_by_hand() -> None:
    """Ten words of head; PID_RUN and PID_MAN 1 + 3, SV and PID_MODE 1 + 6, in the instruction's order."""
    made = block()
    assert [
        ("PID_RUN", Kind.BOOL, "M1", 10, False),
        ("SV", Kind.REAL, "D100", 14, True),
        ("PID_MODE", Kind.DINT, "D104", 21, False),
        ("PID_MAN", Kind.BOOL, "M2", 28, True),
    ] == [(slot.operand, slot.kind, str(slot.device), slot.at, slot.is_restored) for slot in made.slots]
    assert (32, "D731", 21) == (made.length, str(made.device(31)), made.calls_max)
    assert (1, 7, 8, 5, 6, 3, 4) == made.slots[1].words((7, 8), (5, 6), (3, 4))


def test_the_snippet_of_one_flag_and_one_real_is_what_a_person_would_write() -> None:
    station = parse(PROFILE.format(data="D700", timeout=1010, scratch=""), "s.toml").station()
    text = lease_text.heartbeat(station, station.loops[0])
    for line in (
        "IF (D703 = 0) AND (D700 <> 0) THEN",
        "IF (D701 = D703) AND (D702 = 0) THEN D703 := 0; END_IF;",
        "IF (D703 <> 0) AND (D705 >= 21) THEN",
        "IF (D710 = 1) AND NOT ((M1 = (D712 = 1)) OR (M1 = (D713 = 1))) THEN D707 := 2; END_IF;  (* PID_RUN *)",
        "IF (D714 = 1) AND (((D100 = D717) AND (D101 = D718)) OR ((D100 = D719) AND (D101 = D720))) "
        "THEN D100 := D715; D101 := D716; END_IF;  (* SV *)",
        "IF (D728 = 1) AND ((M2 = (D730 = 1)) OR (M2 = (D731 = 1))) THEN M2 := (D729 = 1); END_IF;  (* PID_MAN *)",
        "never compiled by Delta's tool",
    ):
        assert line in text
    assert "D732" not in text


def test_the_text_uses_nothing_but_words_flags_and_equality() -> None:
    station = load("demo").station()
    code = re.sub(r"\(\*.*?\*\)", "", lease_text.heartbeat(station, station.loops[0]), flags=re.DOTALL)
    words = set(re.findall(r"[A-Za-z_]+", re.sub(r"\b[DM]\d+\b", "", code)))
    assert {"IF", "THEN", "ELSE", "END_IF", "AND", "OR", "NOT", "TRUE"} == words


def test_the_number_of_a_layout_follows_from_devices_times_and_operands() -> None:
    loop = load("demo").station().loops[0]
    assert loop.lease is not None
    others = [
        loop,
        replace(loop, lease=replace(loop.lease, timeout_ms=3000)),
        replace(loop, lease=replace(loop.lease, task_ms=50)),
        replace(loop, writes={name: limit for name, limit in loop.writes.items() if name != "SV"}),
    ]
    numbers = [lease_text.number(each, layout(each)) for each in others]
    assert 4 == len(set(numbers))
    assert all(1 <= number <= 30_000 for number in numbers)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"data": "M700"}, "loops.A.lease.data: the block takes 32 words in a row from `M700`"),
        ({"data": "D40940"}, "loops.A.lease.data: the block takes 32 words"),
        ({"data": "D90"}, "takes 32 words, D90…D121, and there stands SV of loop A"),
        ({"scratch": 'scratch = "D710"'}, "takes 32 words, D700…D731, and there stands the station's scratch"),
        ({"timeout": 199}, "loops.A.lease.timeout_ms"),
        ({"data": "Q1"}, "loops.A.lease.data: `Q1`"),
    ],
)
def test_a_lease_that_cannot_be_is_named(changes: dict[str, str], said: str) -> None:
    with pytest.raises(ProfileError) as caught:
        block(**changes)
    assert said in str(caught.value)


def test_a_lease_without_anything_to_guard_is_refused() -> None:
    text = PROFILE.format(data="D700", timeout=1000, scratch="").replace("[loops.A.write]", "[loops.A.fake.initial]")
    text = re.sub(r"SV = .*\nPID_MAN = .*\n", "", text)
    with pytest.raises(ProfileError, match="guards what may be written, and nothing may"):
        parse(text, "s.toml")


def test_the_page_names_every_word_of_the_head() -> None:
    page = PAGE.read_text("utf-8")
    for offset, (name, who, meaning) in enumerate(HEAD):
        assert f"| {offset} | `{name}` | {who} | {meaning} |" in page
    assert lease.HEAD_WORDS == len(HEAD)
