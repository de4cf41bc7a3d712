"""The fake PLC as the content of a CANopen node: its memory as objects, its PDOs on SYNC.

The layout is the profile's, not any product's (spec ah500 §4). Refusals of the memory become SDO aborts.
"""

from __future__ import annotations

from collections.abc import Sequence

from ahgateway.codec.access import Read, Request, Span, Write
from ahgateway.codec.can_frame import CanFrame
from ahgateway.codec.can_objects import CanMap, CanObject, span_bytes, span_values
from ahgateway.codec.can_sdo import (
    GENERAL,
    NO_ACCESS,
    NO_OBJECT,
    NO_SUB_INDEX,
    TOO_LONG,
    TOO_SHORT,
    WRITE_OF_READ_ONLY,
)
from ahgateway.errors import PlcRefusedError
from ahgateway.fake.memory import BUSY, ILLEGAL_ADDRESS, ILLEGAL_COUNT, ILLEGAL_FUNCTION
from ahgateway.fake.plc import FakePlc

RESOURCE_TAKEN = 0x060A_0023
_ABORTS = {
    ILLEGAL_FUNCTION: WRITE_OF_READ_ONLY,
    ILLEGAL_ADDRESS: NO_OBJECT,
    ILLEGAL_COUNT: NO_ACCESS,
    BUSY: RESOURCE_TAKEN,
}


class CanPlc:
    """Objects and PDOs of a fake PLC; a `transports.can.node.Content`.

    Args:
        plc: The fake PLC.
        objects: Which object holds which devices.
        unit: Station number of the PLC.
    """

    def __init__(self, plc: FakePlc, objects: CanMap, unit: int = 1) -> None:
        self._plc = plc
        self._objects = objects
        self._unit = unit

    def read(self, index: int, sub: int) -> bytes:
        """Return an object's bytes; sub-index 0 of an array tells its highest sub-index."""
        held = self._objects.at(index, sub)
        if held is None and sub == 0 and self._objects.subs(index):
            return bytes((self._objects.subs(index),))
        held = self._held(held, index)
        return span_bytes(held.span, self._carry_out([self._read(held.span)])[0])

    def write(self, index: int, sub: int, value: bytes) -> None:
        """Take an object's bytes."""
        held = self._held(self._objects.at(index, sub), index)
        if len(value) != held.size:
            raise PlcRefusedError("size", code=TOO_LONG if len(value) > held.size else TOO_SHORT)
        self._carry_out([Write(self._unit, held.span.table, held.span.address, span_values(held.span, value))])

    def on_sync(self, now_ns: int) -> Sequence[CanFrame]:
        """Return every PDO, all taken between the same two scans."""
        pdos = self._objects.pdos
        values = iter(self._carry_out([self._read(span) for pdo in pdos for span in pdo.spans]))
        return [CanFrame(pdo.cob_id, pdo.encoded([next(values) for _ in pdo.spans])) for pdo in pdos]

    def on_pdo(self, frame: CanFrame) -> None:
        """Take what the profile says that this PLC takes, at once (ASSUMED: event-driven); ignore all else."""
        for pdo in self._objects.takes:
            if pdo.cob_id == frame.can_id and len(frame.data) == pdo.size:
                for span, values in pdo.decoded(frame.data):
                    self._carry_out([Write(self._unit, span.table, span.address, values)])

    def _held(self, held: CanObject | None, index: int) -> CanObject:
        if held is not None:
            return held
        raise PlcRefusedError("no object", code=NO_SUB_INDEX if self._objects.subs(index) else NO_OBJECT)

    def _read(self, span: Span) -> Read:
        return Read(self._unit, span.table, span.address, span.count)

    def _carry_out(self, requests: Sequence[Request]) -> list[tuple[int, ...]]:
        try:
            found = self._plc.answer_all(requests)
        except PlcRefusedError as error:
            raise PlcRefusedError(error.message, code=_ABORTS.get(error.code, GENERAL)) from error
        values = [each for each in found if each is not None]
        if len(values) != len(found):
            raise PlcRefusedError("no such station", code=GENERAL)
        return values
