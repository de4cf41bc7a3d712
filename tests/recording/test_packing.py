"""Blobs: every bit that goes in comes out again, and damage is said."""

from __future__ import annotations

import struct
import zlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ahgateway.errors import CodecError
from ahgateway.recording.packing import (
    Entry,
    concatenated,
    pack,
    pack_frames,
    pack_verdicts,
    unpack,
    unpack_frames,
    unpack_verdicts,
)

times = st.integers(min_value=0, max_value=2**61)


@st.composite
def entries(draw: st.DrawFn) -> list[Entry]:
    """Rows of up to three loops, two of which have blocks of the same length."""
    widths = {0: 3, 1: 3, 2: 5}
    found = []
    for tick in range(draw(st.integers(0, 8))):
        loop = draw(st.sampled_from(sorted(widths)))
        words = draw(st.binary(min_size=2 * widths[loop], max_size=2 * widths[loop]))
        found.append(
            Entry(loop, tick, draw(times), draw(times), draw(times), draw(times), draw(st.integers(0, 255)), words)
        )
    return found


@given(entries())
def test_unpacking_gives_back_every_row_of_every_loop_in_its_order(rows: list[Entry]) -> None:
    found = []
    for block in unpack(pack(rows)) if rows else ():
        for at, tick in enumerate(block.ticks.tolist()):
            columns = (block.sent_ns, block.last_ns, block.utc_ns, block.aligned_since_ns, block.quality)
            found.append(Entry(block.loop, tick, *(int(each[at]) for each in columns), block.words[at].tobytes()))
    assert sorted(rows) == sorted(found)
    for loop in (0, 1, 2):
        assert [row.tick for row in rows if row.loop == loop] == [row.tick for row in found if row.loop == loop]


def test_a_row_stands_in_the_blob_as_the_page_says() -> None:
    raw = zlib.decompress(pack([Entry(1, 2, 3, 4, 5, 6, 7, b"\x34\x12\xff\x00")]))
    section = struct.pack("<HI", 2, 1) + struct.pack("<H", 1)
    numbers = b"".join(struct.pack("<q", 2 * value) for value in (2, 3, 1, 1, 6))
    assert section + numbers + b"\x07" + b"\x34\x12\xff\x00" == raw


def test_a_signalling_nan_and_a_negative_zero_keep_their_bits() -> None:
    words = struct.pack("<II", 0x7FA00001, 0x80000000)
    (block,) = unpack(pack([Entry(0, 0, 0, 0, 0, 0, 0, words)] * 2))
    assert [words, words] == [row.tobytes() for row in block.words]


def test_nothing_makes_an_empty_blob() -> None:
    assert (b"", b"", b"") == (pack([]), pack_verdicts([]), pack_frames([]))
    assert ([], []) == (unpack_verdicts(b""), list(unpack_frames(b"")))
    assert concatenated([]) is None


@given(st.lists(st.tuples(st.integers(0, 200), times, st.integers(0, 9)), max_size=9))
def test_verdicts_come_back_loop_by_loop(verdicts: list[tuple[int, int, int]]) -> None:
    assert sorted(verdicts, key=lambda each: each[0]) == unpack_verdicts(pack_verdicts(verdicts))


@given(st.lists(st.tuples(times, times, st.sampled_from("<>"), st.binary(max_size=20)), max_size=9))
def test_frames_come_back_in_their_order(frames: list[tuple[int, int, str, bytes]]) -> None:
    assert frames == list(unpack_frames(pack_frames(frames)))


@pytest.mark.parametrize("cut", [0, 1, 10, 30])
def test_a_cut_blob_is_refused(cut: int) -> None:
    blob = pack([Entry(0, 0, 1, 2, 3, 4, 5, bytes(96))])
    with pytest.raises(CodecError, match="does not unpack"):
        list(unpack(blob[: len(blob) - 1 - cut]))


def test_a_blob_that_promises_more_rows_than_it_holds_is_refused() -> None:
    with pytest.raises(CodecError, match="a block of 9 rows needs 441 bytes, 3 are left"):
        list(unpack(zlib.compress(struct.pack("<HI", 3, 9) + b"abc")))


def test_rows_of_a_block_are_columns_of_numbers() -> None:
    rows = [Entry(4, tick, 10 * tick, 10 * tick + 3, 1000 + tick, 0, 2, struct.pack("<HH", tick, 9)) for tick in (5, 6)]
    (block,) = unpack(pack(rows))
    assert (4, [5, 6], [50, 60], [53, 63]) == (
        block.loop,
        block.ticks.tolist(),
        block.sent_ns.tolist(),
        block.last_ns.tolist(),
    )
    assert [[5, 9], [6, 9]] == block.words.tolist()
    joined = concatenated([block, block])
    assert joined is not None
    assert [5, 6, 5, 6] == joined.ticks.tolist()
    assert np.uint16 == joined.words.dtype
