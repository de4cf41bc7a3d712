"""The scratch words as one more operand of a loop, so that a marker goes through the same gate as everything else."""

from __future__ import annotations

from dataclasses import replace

from ahgateway.codec.station import Loop, Station, WriteLimit
from ahgateway.codec.words import DINT_MAX, DINT_MIN
from ahgateway.core.operands import Access, Kind, Operand, Source

SCRATCH = "SCRATCH"
MARKER = 0x12345678
"""Its two words differ, and so do their bytes: any exchange of either shows."""

_ROW = Operand(
    SCRATCH, Kind.DINT, "", None, None, None, Access.IN, Source.ASSUMED, "two words that nothing in the PLC uses", 2
)


def with_scratch(loop: Loop, station: Station) -> Loop:
    """Return the loop with the station's scratch words as an operand that may hold anything; as it is without them."""
    if station.scratch is None or SCRATCH in loop.bindings:
        return loop
    return replace(
        loop,
        controller=replace(loop.controller, operands=(*loop.controller.operands, _ROW)),
        bindings={**loop.bindings, SCRATCH: station.scratch},
        writes={**loop.writes, SCRATCH: WriteLimit(DINT_MIN, DINT_MAX, float(DINT_MAX) - DINT_MIN, 0.0)},
    )
