"""Values of the PLC as 16-bit words. This file alone decides word order and the width of each kind.

A 32-bit value takes two words, the low word at the lower address; bytes inside a word are the wire's business. A REAL
passes bit for bit, also as a signalling NaN: it never goes through Python's float, which would quieten it (MEASURED).

Source:
    MANUAL AH500 programming manual p. 27 (spec ah500 §1.2, §3.3): low word first.
    MEASURED by node-eip on an AS300: 0x12345678 written to D200 gave D200 = 5678, D201 = 1234.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import Any, cast

import numpy as np

from ahgateway.core.operands import Kind
from ahgateway.core.real import REAL
from ahgateway.errors import CodecError

Value = Any
"""What a kind holds: BOOL bool, INT and DINT int, REAL numpy float32, BLOCK its words."""

WORD_MAX = 0xFFFF
INT_MIN, INT_MAX = -0x8000, 0x7FFF
DINT_MIN, DINT_MAX = -0x8000_0000, 0x7FFF_FFFF
_REAL_DTYPE = np.dtype("<f4")
_PAIR = struct.Struct("<HH")


def real_words(value: REAL) -> tuple[int, int]:
    """Split a REAL into its words, low word first, all 32 bits kept."""
    low, high = _PAIR.unpack(value.astype(_REAL_DTYPE).tobytes())
    return low, high


def words_real(low: int, high: int) -> REAL:
    """Join two words into the REAL with these 32 bits."""
    value: REAL = np.frombuffer(_PAIR.pack(low, high), _REAL_DTYPE)[0]
    return value


def dint_words(value: int) -> tuple[int, int]:
    """Split a signed 32-bit integer into its words, low word first."""
    if not DINT_MIN <= value <= DINT_MAX:
        raise CodecError(f"{value} is no DINT, allowed {DINT_MIN}…{DINT_MAX}")
    return value & WORD_MAX, (value >> 16) & WORD_MAX


def words_dint(low: int, high: int) -> int:
    """Join two words into a signed 32-bit integer."""
    pattern = high << 16 | low
    return pattern - 0x1_0000_0000 if pattern & 0x8000_0000 else pattern


def int_word(value: int) -> int:
    """Return the word of a signed 16-bit integer."""
    if not INT_MIN <= value <= INT_MAX:
        raise CodecError(f"{value} is no INT, allowed {INT_MIN}…{INT_MAX}")
    return value & WORD_MAX


def word_int(word: int) -> int:
    """Return the signed 16-bit integer of a word."""
    return word - 0x1_0000 if word & 0x8000 else word


def encode(kind: Kind, value: Value) -> tuple[int, ...]:
    """Return the words of a value; a BOOL is one number, 0 or 1.

    Raises:
        CodecError: The kind cannot hold the value.
    """
    if kind is Kind.REAL:
        return real_words(_real(value))
    if kind is Kind.BOOL:
        if value not in (0, 1):
            raise CodecError(f"{value!r} is no BOOL, allowed 0 and 1")
        return (int(value),)
    if kind is Kind.BLOCK:
        return tuple(value)
    if isinstance(value, bool) or int(value) != value:
        raise CodecError(f"{value!r} is no whole number, as {kind.value} needs")
    return dint_words(int(value)) if kind is Kind.DINT else (int_word(int(value)),)


def decode(kind: Kind, words: Sequence[int]) -> Value:
    """Return the value in these words: bool, int, REAL with its bits kept, or the words of a BLOCK themselves."""
    if kind is Kind.REAL:
        return words_real(words[0], words[1])
    if kind is Kind.BOOL:
        return words[0] != 0
    if kind is Kind.DINT:
        return words_dint(words[0], words[1])
    if kind is Kind.INT:
        return word_int(words[0])
    return tuple(words)


def _real(value: Value) -> REAL:
    if isinstance(value, np.generic) and value.dtype == _REAL_DTYPE:
        return cast(REAL, value)
    with np.errstate(over="ignore"):
        rounded = REAL(value)
    if np.isinf(rounded) and not np.isinf(value):
        raise CodecError(f"{value!r} is too large for a REAL, whose largest value is 3.4028235e+38")
    return rounded
