"""The door to binary32: every bit passes, neighbours are one apart, NaNs are one class."""

from __future__ import annotations

import struct

import numpy as np
import pytest
from hypothesis import given
from strategies import bit_patterns

from ahgateway.core.real import REAL, bits, from_bits, from_order, order, same_bits, ulp_distance


@pytest.mark.parametrize(
    ("value", "pattern"),
    [
        (0.0, 0x00000000),
        (-0.0, 0x80000000),
        (1.0, 0x3F800000),
        (-2.0, 0xC0000000),
        (12.34, 0x414570A4),
        (0.1, 0x3DCCCCCD),  # rounded up
        (1.0 + 2.0**-24, 0x3F800000),  # a tie goes to even
        (1.0 + 3 * 2.0**-24, 0x3F800002),
        (2.0**-149, 0x00000001),
        (2.0**-150, 0x00000000),
        (float("inf"), 0x7F800000),
    ],
)
def test_rounding_is_to_nearest_even(value: float, pattern: int) -> None:
    assert pattern == bits(REAL(value))


@given(bit_patterns)
def test_bits_come_back_and_nans_become_one(pattern: int) -> None:
    value = from_bits(pattern)
    is_nan = (pattern & 0x7FFFFFFF) > 0x7F800000
    assert bits(value) == (0x7FC00000 if is_nan else pattern)
    assert struct.unpack("<I", value.tobytes()) == (pattern,)
    assert same_bits(value, from_bits(pattern))


@given(bit_patterns)
def test_neighbours_are_one_apart(pattern: int) -> None:
    value = from_bits(pattern)
    if not np.isfinite(value):
        return
    place = order(value)
    assert value == from_order(place)
    assert (1, 1) == (ulp_distance(value, from_order(place + 1)), ulp_distance(from_order(place - 1), value))


def test_ulp_distance_of_known_pairs() -> None:
    assert ulp_distance(REAL(1), from_bits(0x3F800001)) == 1
    assert ulp_distance(REAL(1), REAL(2)) == 0x00800000
    assert ulp_distance(REAL(-0.0), REAL(0.0)) == 0
    assert ulp_distance(from_bits(0x80000001), from_bits(1)) == 2
    assert ulp_distance(from_bits(0x7F7FFFFF), REAL("inf")) == 1
    assert ulp_distance(REAL("nan"), REAL("nan")) == 0
    assert ulp_distance(REAL("nan"), REAL(0)) is None
