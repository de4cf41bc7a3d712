"""Hypothesis strategies: REALs as bit patterns with all that is odd about them, operands of the laws, word lists."""

from __future__ import annotations

from typing import Any

from hypothesis import strategies as st

from ahgateway.core.controllers import dpid, dpide
from ahgateway.core.real import REAL, from_bits

ODD_BITS = (
    0x00000000,  # +0
    0x80000000,  # -0
    0x00000001,  # smallest subnormal
    0x807FFFFF,  # largest negative subnormal
    0x00800000,  # smallest normal
    0x3F800000,  # 1
    0x3F7FFFFF,  # the REAL below 1
    0x3F800001,  # the REAL above 1
    0x7F7FFFFF,  # largest number
    0xFF7FFFFF,  # its negative
    0x7F800000,  # +infinity
    0xFF800000,  # -infinity
    0x7FC00000,  # quiet NaN
    0x7FA00001,  # signalling NaN with payload
    0xFFFFFFFF,  # negative NaN, all bits set
)

bit_patterns = st.one_of(st.sampled_from(ODD_BITS), st.integers(min_value=0, max_value=0xFFFFFFFF))
"""Any 32 bits, the odd ones often."""

any_reals = bit_patterns.map(from_bits)
"""Any REAL, NaNs with payload included."""

words = st.integers(min_value=0, max_value=0xFFFF)
word_lists = st.lists(words, min_size=1, max_size=125)
"""As many 16-bit words as one Modbus read can carry."""


def reals(low: float, high: float) -> st.SearchStrategy[REAL]:
    """REALs within low…high, both of which must be REALs."""
    return st.floats(min_value=low, max_value=high, width=32).map(REAL)


plant_reals = reals(-128.0, 128.0)
"""What stands in a plant: values whose sums and products round."""

gains = st.one_of(st.just(REAL(0)), reals(-1.0, 16.0))
huge_or_odd = st.one_of(any_reals, plant_reals)

_LIMITS = st.tuples(st.sampled_from([-128.0, -16.0, 0.0, 8.0]), st.sampled_from([-64.0, 0.0, 32.0, 100.0]))


@st.composite
def dpid_operands(draw: st.DrawFn, values: st.SearchStrategy[REAL] = plant_reals) -> dpid.Operands:
    """Operands of DPID; `values` makes SV, PV, MOUT, dead band and gains, limits stay finite, either way round."""
    mv_min, mv_max = draw(_LIMITS)
    drawn: dict[str, Any] = {
        "sv": draw(values),
        "pv": draw(values),
        "pid_mode": draw(st.sampled_from([0, 0, 0, 1, 2, 3, -1])),
        "pid_man": draw(st.booleans()),
        "mout_auto": draw(st.booleans()),
        "cycle": draw(st.sampled_from([-5, 0, 1, 7, 100, 2000, 2001])),
        "pid_run": draw(st.sampled_from([True, True, True, False])),
        "kp": draw(st.one_of(gains, values)),
        "ki": draw(st.one_of(gains, values)),
        "kd": draw(st.one_of(gains, values)),
        "pid_dir": draw(st.booleans()),
        "err_dbw": draw(st.one_of(st.just(REAL(0)), reals(-8.0, 8.0), values)),
        "mv_max": REAL(mv_max),
        "mv_min": REAL(mv_min),
        "mout": draw(values),
    }
    return dpid.Operands(**drawn)


@st.composite
def dpide_operands(draw: st.DrawFn, values: st.SearchStrategy[REAL] = plant_reals) -> dpide.Operands:
    """Operands of DPIDE, made as those of DPID."""
    common = draw(dpid_operands(values))._asdict()
    drawn: dict[str, Any] = {
        "kc_kp": common.pop("kp"),
        "ti_ki": common.pop("ki"),
        "td_kd": common.pop("kd"),
        "tf": draw(st.one_of(gains, values)),
        "pid_eq": draw(st.booleans()),
        "pid_de": draw(st.booleans()),
        "bias": draw(st.one_of(st.just(REAL(0)), values)),
    }
    common["cycle"] = draw(st.sampled_from([-5, 0, 1, 70, 1000, 40000, 40001]))
    return dpide.Operands(**common, **drawn)
