"""Words written out by hand from IEEE 754 and spec ah500 §3.3; no line here was printed by the codec."""

import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ahgateway.codec.words import decode, dint_words, encode, real_words, word_int, words_dint, words_real
from ahgateway.core.operands import Kind
from ahgateway.core.real import REAL
from ahgateway.errors import CodecError


@pytest.mark.parametrize(
    ("value", "low", "high"),
    [
        (12.34, 0x70A4, 0x4145),
        (1.0, 0x0000, 0x3F80),
        (-2.0, 0x0000, 0xC000),
        (0.1, 0xCCCD, 0x3DCC),
        (-0.0, 0x0000, 0x8000),
        (1e-45, 0x0001, 0x0000),
        (float("inf"), 0x0000, 0x7F80),
    ],
)
def test_a_real_has_its_low_word_first(value: float, low: int, high: int) -> None:
    assert real_words(REAL(value)) == (low, high)
    assert words_real(low, high).tobytes() == struct.pack("<f", value)


def test_a_dint_has_its_low_word_first_as_the_live_plc_showed() -> None:
    assert dint_words(0x12345678) == (0x5678, 0x1234)
    assert words_dint(0x5678, 0x1234) == 0x12345678


@pytest.mark.parametrize(
    ("value", "words"),
    [(-1, (0xFFFF, 0xFFFF)), (-0x80000000, (0x0000, 0x8000)), (0x7FFFFFFF, (0xFFFF, 0x7FFF)), (200, (200, 0))],
)
def test_a_dint_is_signed(value: int, words: tuple[int, int]) -> None:
    assert encode(Kind.DINT, value) == words
    assert decode(Kind.DINT, words) == value


@pytest.mark.parametrize(("value", "word"), [(-1, 0xFFFF), (-32768, 0x8000), (32767, 0x7FFF), (5, 5)])
def test_an_int_is_signed(value: int, word: int) -> None:
    assert encode(Kind.INT, value) == (word,)
    assert word_int(word) == value


@pytest.mark.parametrize("pattern", [0x7FA00001, 0xFFA00001, 0x7FC00000, 0x7F800001, 0xFFFFFFFF])
def test_a_nan_keeps_its_payload_and_stays_signalling(pattern: int) -> None:
    value = words_real(pattern & 0xFFFF, pattern >> 16)
    assert np.isnan(value)
    assert real_words(value) == (pattern & 0xFFFF, pattern >> 16)
    assert encode(Kind.REAL, decode(Kind.REAL, (pattern & 0xFFFF, pattern >> 16))) == (pattern & 0xFFFF, pattern >> 16)


@settings(max_examples=200)
@given(st.integers(0, 0xFFFF), st.integers(0, 0xFFFF))
def test_any_two_words_survive_as_real_and_as_dint(low: int, high: int) -> None:
    assert real_words(words_real(low, high)) == (low, high)
    assert dint_words(words_dint(low, high)) == (low, high)


def test_a_bool_is_one_number() -> None:
    assert encode(Kind.BOOL, True) == (1,)
    assert decode(Kind.BOOL, (0,)) is False


def test_a_block_is_its_own_words() -> None:
    assert encode(Kind.BLOCK, (1, 2, 3)) == (1, 2, 3)
    assert decode(Kind.BLOCK, [1, 2, 3]) == (1, 2, 3)


@pytest.mark.parametrize(
    ("kind", "value"),
    [
        (Kind.DINT, 0x80000000),
        (Kind.DINT, -0x80000001),
        (Kind.INT, 32768),
        (Kind.INT, 1.5),
        (Kind.DINT, True),
        (Kind.BOOL, 2),
        (Kind.REAL, 1e39),
    ],
)
def test_what_a_kind_cannot_hold_is_refused(kind: Kind, value: object) -> None:
    with pytest.raises(CodecError):
        encode(kind, value)
