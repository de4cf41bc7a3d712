"""One REAL of the PLC against one of the reference: bits first, then ULP, then the engineering tolerance.

This file alone decides when two values agree and how well that is known. It does not know what the value is, nor
what follows for the execution (`verdict`).

Theory of operation: the strongest proof that holds is the answer. A NaN agrees with a NaN and with nothing else; an
infinity agrees with itself only, since the largest number is one ULP away from it and yet another output. Zeros of
either sign are 0 ULP apart: the sign of a zero convicts nobody (spec controllers §1), but it is no proof by bits.
"""

from __future__ import annotations

import math

from ahgateway.core.real import REAL, same_bits, ulp_distance
from ahgateway.core.verdict import Proof


def compare(plc: REAL, ref: REAL, ulp_max: int = 0, tolerance: float = 0.0) -> Proof | None:
    """Return the strongest proof that both agree, None when they differ.

    Args:
        plc: As read from the PLC.
        ref: As computed beside it.
        ulp_max: Largest count of ULPs, itself included, that is still MATCH by ULP; 0 leaves the two zeros only.
        tolerance: Largest absolute difference, itself included, in the value's engineering unit, that is still
            MATCH by tolerance; 0 switches it off.

    Raises:
        ValueError: `ulp_max` is negative, or `tolerance` is negative, infinite or NaN.
    """
    if ulp_max < 0 or not 0.0 <= tolerance < math.inf:
        raise ValueError(f"limits must be finite and not negative: ulp_max {ulp_max}, tolerance {tolerance}")
    if same_bits(plc, ref):
        return Proof.BITS
    # Exact where it matters: both are binary32, and their difference rounds once in binary64.
    left, right = float(plc), float(ref)
    if not (math.isfinite(left) and math.isfinite(right)):
        return None
    distance = ulp_distance(plc, ref)
    if distance is not None and distance <= ulp_max:
        return Proof.ULP
    if tolerance > 0.0 and abs(left - right) <= tolerance:
        return Proof.TOLERANCE
    return None


def weakest(proofs: tuple[Proof | None, ...]) -> Proof | None:
    """Return how well several values of one execution agree together: as well as the worst of them."""
    if not proofs or None in proofs:
        return None
    for proof in (Proof.TOLERANCE, Proof.ULP):
        if proof in proofs:
            return proof
    return Proof.BITS
