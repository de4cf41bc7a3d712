"""The gateway's own objects as a node: REALs that the PLC's master sends by RPDO or writes by SDO."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from ahgateway.codec.can_eds import PDO_OFF, REAL_SIZE, RECEIVED_EVENT, NodeLayout, NodeValue
from ahgateway.codec.can_frame import CanFrame
from ahgateway.codec.can_sdo import NO_OBJECT, NO_SUB_INDEX, WRITE_OF_READ_ONLY, WRONG_SIZE
from ahgateway.errors import PlcRefusedError


class GatewayContent:
    """Objects of the layout; a `transports.can.node.Content`. Nothing leaves it: the PLC is only listened to.

    Args:
        layout: Values and RPDOs.
        node: Node-ID, for the identifiers of the connection set.
        on_value: Called with each value that came, its 4 bytes, low byte first.

    Attributes:
        held: The last bytes of each value.
        malformed: RPDOs of another length than the mapping.
    """

    def __init__(self, layout: NodeLayout, node: int, on_value: Callable[[NodeValue, bytes], None]) -> None:
        self.held = dict.fromkeys(layout.values, bytes(REAL_SIZE))
        self.malformed = 0
        self._layout = layout
        self._values = {(value.index, value.sub): value for value in layout.values}
        self._cob_ids = [layout.cob_id(number, node) for number in range(len(layout.rpdos))]
        self._on_value = on_value

    def read(self, index: int, sub: int) -> bytes:
        """Return an object's bytes."""
        if (index, sub) in self._values:
            return self.held[self._values[index, sub]]
        entries = self._entries(index)
        if not 0 <= sub < len(entries):
            raise PlcRefusedError("sub-index", code=NO_SUB_INDEX)
        return entries[sub]

    def write(self, index: int, sub: int, value: bytes) -> None:
        """Take a value, or the identifier of an RPDO."""
        if (index, sub) in self._values:
            if len(value) != REAL_SIZE:
                raise PlcRefusedError("size", code=WRONG_SIZE)
            self._take(self._values[index, sub], value)
            return
        self.read(index, sub)
        number = index - 0x1400
        if not 0 <= number < len(self._cob_ids) or sub != 1:
            raise PlcRefusedError("read-only", code=WRITE_OF_READ_ONLY)
        if len(value) != REAL_SIZE:
            raise PlcRefusedError("size", code=WRONG_SIZE)
        self._cob_ids[number] = int.from_bytes(value, "little")

    def on_sync(self, now_ns: int) -> Sequence[CanFrame]:
        """Return nothing: the gateway sends no PDO."""
        return ()

    def on_pdo(self, frame: CanFrame) -> None:
        """Take the values of an RPDO of ours."""
        for number, cob_id in enumerate(self._cob_ids):
            if cob_id & PDO_OFF or cob_id != frame.can_id:
                continue
            values = self._layout.rpdos[number]
            if len(frame.data) != REAL_SIZE * len(values):
                self.malformed += 1
                return
            for place, value in enumerate(values):
                self._take(value, frame.data[REAL_SIZE * place : REAL_SIZE * (place + 1)])

    def _take(self, value: NodeValue, packed: bytes) -> None:
        self.held[value] = packed
        self._on_value(value, packed)

    def _entries(self, index: int) -> list[bytes]:
        """Sub-indices of an object from 0 on; of a loop's values only the number, they are answered before."""
        count = len(self._cob_ids)
        if 0x1400 <= index < 0x1400 + count:
            return [bytes((2,)), self._cob_ids[index - 0x1400].to_bytes(4, "little"), bytes((RECEIVED_EVENT,))]
        if 0x1600 <= index < 0x1600 + count:
            entries = self._layout.mapping(index - 0x1600)
            return [bytes((len(entries),)), *(entry.to_bytes(4, "little") for entry in entries)]
        subs = [sub for held, sub in self._values if held == index]
        if not subs:
            raise PlcRefusedError("no object", code=NO_OBJECT)
        return [bytes((max(subs),))]
