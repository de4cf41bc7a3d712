"""Bits, then ULP, then tolerance; every limit tested one ULP on each side."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from strategies import any_reals, bit_patterns

from ahgateway.core.compare import compare, weakest
from ahgateway.core.real import REAL, from_bits, same_bits, ulp_distance
from ahgateway.core.verdict import Proof

ONE = 0x3F800000
INF, NEG_INF, MAX = 0x7F800000, 0xFF800000, 0x7F7FFFFF
NAN, NEG_NAN, SIGNALLING = 0x7FC00000, 0xFFC00001, 0x7FA00001


def judge(plc: int, ref: int, ulp_max: int = 0, tolerance: float = 0.0) -> Proof | None:
    return compare(from_bits(plc), from_bits(ref), ulp_max, tolerance)


@pytest.mark.parametrize("pattern", [0, 1, 0x80000000, ONE, MAX, INF, NEG_INF, NAN, SIGNALLING])
def test_equal_bits_are_proof_whatever_the_limits(pattern: int) -> None:
    assert Proof.BITS is judge(pattern, pattern)
    assert Proof.BITS is judge(pattern, pattern, 5, 1.0)


def test_nans_are_one_class() -> None:
    assert Proof.BITS is judge(NAN, NEG_NAN)
    assert Proof.BITS is judge(SIGNALLING, NAN)
    assert judge(NAN, ONE, 2**31, 1e38) is None
    assert judge(INF, NAN, 2**31, 1e38) is None


def test_one_ulp_is_no_match_by_default() -> None:
    assert judge(ONE, ONE + 1) is None
    assert judge(ONE, ONE - 1) is None


def test_ulp_limit_includes_itself() -> None:
    assert Proof.ULP is judge(ONE, ONE + 4, 4)
    assert Proof.ULP is judge(ONE, ONE - 4, 4)
    assert judge(ONE, ONE + 5, 4) is None
    assert judge(ONE, ONE - 5, 4) is None


def test_ulp_counts_across_zero() -> None:
    assert Proof.ULP is judge(0x00000001, 0x80000001, 2)
    assert judge(0x00000001, 0x80000001, 1) is None


def test_the_sign_of_a_zero_convicts_nobody_and_proves_nothing() -> None:
    assert Proof.ULP is judge(0x00000000, 0x80000000)


def test_infinity_agrees_with_itself_only() -> None:
    assert judge(MAX, INF, 1, 1e38) is None
    assert judge(INF, NEG_INF, 2**32, 1e38) is None


def test_tolerance_includes_itself() -> None:
    # 1 + 2⁻²⁰ is 8 ULP above 1; one ULP more is 9 · 2⁻²³.
    assert Proof.TOLERANCE is judge(ONE + 8, ONE, 0, 2.0**-20)
    assert Proof.TOLERANCE is judge(ONE, ONE + 8, 0, 2.0**-20)
    assert judge(ONE + 9, ONE, 0, 2.0**-20) is None
    assert judge(ONE + 8, ONE, 0, math.nextafter(2.0**-20, 0.0)) is None


def test_the_strongest_proof_is_the_answer() -> None:
    assert Proof.BITS is judge(ONE, ONE, 1, 1.0)
    assert Proof.ULP is judge(ONE + 1, ONE, 1, 1.0)
    assert Proof.TOLERANCE is judge(ONE + 2, ONE, 1, 1.0)


def test_one_zero_tolerance_stays_off_for_unequal_numbers() -> None:
    assert judge(0x00000001, 0x00000000, 0, 0.0) is None


@pytest.mark.parametrize(("ulp_max", "tolerance"), [(-1, 0.0), (0, -0.1), (0, math.nan), (0, math.inf)])
def test_limits_that_make_no_sense_are_refused(ulp_max: int, tolerance: float) -> None:
    with pytest.raises(ValueError, match="finite and not negative"):
        compare(REAL(1), REAL(1), ulp_max, tolerance)


@given(any_reals, any_reals)
def test_compare_is_symmetric(left: REAL, right: REAL) -> None:
    assert compare(left, right, 3, 0.5) is compare(right, left, 3, 0.5)


@given(bit_patterns, bit_patterns)
def test_bits_match_if_and_only_if_the_bits_do(left: int, right: int) -> None:
    plc, ref = from_bits(left), from_bits(right)
    assert same_bits(plc, ref) == (compare(plc, ref) is Proof.BITS)
    if ulp_distance(plc, ref) not in (0, None):
        assert compare(plc, ref) is None


def test_values_agree_together_as_well_as_the_worst_of_them() -> None:
    assert Proof.BITS is weakest((Proof.BITS, Proof.BITS))
    assert Proof.ULP is weakest((Proof.BITS, Proof.ULP))
    assert Proof.TOLERANCE is weakest((Proof.TOLERANCE, Proof.ULP, Proof.BITS))
    assert weakest((Proof.BITS, None)) is None
    assert weakest(()) is None
