"""REAL, the PLC's binary32: the one door between it and binary64.

Everything that a controller computes passes through `REAL`; one rounding per operation, to nearest even, no
fused multiply-add. NaNs are compared by class, never by payload (MEASURED: payload and sign depend on the machine).
"""

from __future__ import annotations

import struct

import numpy as np

REAL = np.float32
"""The PLC's REAL. `REAL(x)` rounds a binary64 to nearest even."""

quiet = np.errstate
"""Call as `quiet(all="ignore")` around a run of steps: overflow to infinity is legal in a PLC."""

ZERO = REAL(0)
NAN_BITS = 0x7FC00000


_AS_REAL = struct.Struct("<f").pack
_AS_WORD = struct.Struct("<I").unpack


def bits(value: REAL) -> int:
    """Return the 32 bits of `value` as an unsigned integer; every NaN becomes the canonical one, 0x7FC00000."""
    # Through binary64 and back: exact for every number, and a NaN becomes the canonical one anyway.
    pattern: int = _AS_WORD(_AS_REAL(value))[0]
    return NAN_BITS if (pattern & 0x7FFFFFFF) > 0x7F800000 else pattern


def from_bits(pattern: int) -> REAL:
    """Return the REAL with these 32 bits, payload kept."""
    value: REAL = np.frombuffer(struct.pack("<I", pattern), dtype="<f4")[0]
    return value


def order(value: REAL) -> int:
    """Map a REAL to an integer so that neighbours differ by one and -0.0 equals +0.0; not for NaN."""
    pattern = bits(value)
    return -(pattern & 0x7FFFFFFF) if pattern & 0x80000000 else pattern


def from_order(position: int) -> REAL:
    """Inverse of `order`; 0 gives +0.0."""
    return from_bits(position if position >= 0 else 0x80000000 | -position)


def ulp_distance(left: REAL, right: REAL) -> int | None:
    """Count the REALs between `left` and `right`; 0 for two NaNs, None for one NaN against a number."""
    left_nan, right_nan = bool(np.isnan(left)), bool(np.isnan(right))
    if left_nan or right_nan:
        return 0 if left_nan and right_nan else None
    return abs(order(left) - order(right))


def same_bits(left: REAL, right: REAL) -> bool:
    """Tell whether both have the same 32 bits, where all NaNs are one."""
    if left == right:
        # Only zeros are equal with other bits.
        return bool(left) or bits(left) == bits(right)
    return bool(left != left and right != right)
