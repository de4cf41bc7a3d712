"""The subset of Structured Text that the fake PLC runs: worked out by hand, and what it refuses."""

from __future__ import annotations

import pytest

from ahgateway.clock import MILLISECOND
from ahgateway.codec.access import Table
from ahgateway.errors import StateError
from ahgateway.fake.memory import Memory
from ahgateway.fake.structured_text import Snippet, program
from ahgateway.schema import device_map


@pytest.fixture
def memory() -> Memory:
    return Memory(device_map.load("ah500"))


def after(memory: Memory, text: str, words: tuple[int, ...] = (), flags: tuple[int, ...] = ()) -> list[int]:
    """D0…D3 behind one call that found these words and flags."""
    memory.write(Table.HOLDING, 0, (words + (0,) * 4)[:4])
    memory.write(Table.COIL, 0, (flags + (0,) * 4)[:4])
    program(text, memory)()
    return list(memory.read(Table.HOLDING, 0, 4))


@pytest.mark.parametrize(
    ("text", "words", "flags", "left"),
    [
        ("D0 := 7;", (), (), [7, 0, 0, 0]),
        ("D0 := 16#FF; D1 := D0 + 1;", (), (), [255, 256, 0, 0]),
        ("D0 := D0 + 1;", (65535,), (), [0, 0, 0, 0]),
        ("IF D0 = 3 THEN D1 := 1; ELSE D1 := 2; END_IF;", (3,), (), [3, 1, 0, 0]),
        ("IF D0 = 3 THEN D1 := 1; ELSE D1 := 2; END_IF;", (4,), (), [4, 2, 0, 0]),
        ("IF D0 < 3 THEN D1 := 1; ELSIF D0 >= 5 THEN D1 := 2; ELSE D1 := 3; END_IF;", (4,), (), [4, 3, 0, 0]),
        ("IF D0 < 3 THEN D1 := 1; ELSIF D0 >= 5 THEN D1 := 2; ELSE D1 := 3; END_IF;", (5,), (), [5, 2, 0, 0]),
        ("IF (D0 <> 0) AND NOT (M0 OR M1) THEN D1 := 1; END_IF;", (1,), (0, 0), [1, 1, 0, 0]),
        ("IF (D0 <> 0) AND NOT (M0 OR M1) THEN D1 := 1; END_IF;", (1,), (0, 1), [1, 0, 0, 0]),
        ("IF M0 = (D0 = 1) THEN D1 := 9; END_IF;", (0,), (0,), [0, 9, 0, 0]),
        ("IF M0 = (D0 = 1) THEN D1 := 9; END_IF;", (1,), (0,), [1, 0, 0, 0]),
        ("M3 := (D0 = 1); IF M3 = TRUE THEN D1 := 5; END_IF; (* said *)", (1,), (), [1, 5, 0, 0]),
        ("D2.3 := TRUE;", (), (), [0, 0, 8, 0]),
        ("IF D0 > 1 THEN IF D0 <= 3 THEN D1 := 1; END_IF; D2 := 2; END_IF;", (3,), (), [3, 1, 2, 0]),
    ],
)
def test_what_one_call_leaves(memory: Memory, text: str, words, flags, left: list[int]) -> None:
    assert left == after(memory, text, words, flags)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("D0 := 1", "`;` belongs"),
        ("IF D0 THEN D1 := 1;", "`END_IF` belongs"),
        ("D0 = 1;", "`:=` belongs"),
        ("D0 := ;", "`;`: unknown|no device name"),
        ("FOR D0 := 1;", "`FOR` is no device name"),
        ("D0 := D1 * 2;", r"`\* 2;` is not understood"),
        ("D99999 := 1;", "outside the device map"),
        ("D0 := 1; END_IF;", "`END_IF` stands where a statement belongs"),
    ],
)
def test_what_it_does_not_know_is_refused_when_it_is_read(memory: Memory, text: str, said: str) -> None:
    with pytest.raises(StateError, match=said):
        program(text, memory)


def test_a_task_is_called_once_in_each_period_and_the_rest_of_the_time_is_kept(memory: Memory) -> None:
    task = Snippet("D0 := D0 + 1;", memory, 100 * MILLISECOND)
    counts = []
    for elapsed_ms in (60, 60, 60, 60, 250):
        task.scan(elapsed_ms * MILLISECOND)
        counts.append(memory.read(Table.HOLDING, 0, 1)[0])
    assert [0, 1, 1, 2, 4] == counts
