"""A CANopen node of ours without a bus: SDO server, NMT state, heartbeat, PDOs on SYNC. Frames in, frames out.

Source:
    MANUAL CiA 301 v4.2 §7.2.8: NMT states and what works in each; §7.2.8.2.2 heartbeat and boot-up.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum
from typing import Protocol

from ahgateway.clock import MILLISECOND
from ahgateway.codec.can_frame import HEARTBEAT, NMT, SDO_REPLY, SDO_REQUEST, CanFrame
from ahgateway.codec.can_sdo import NO_OBJECT, NO_SUB_INDEX, WRITE_OF_READ_ONLY, SdoServer
from ahgateway.errors import PlcRefusedError

MICROSECOND = 1000
TICK_NS = 20 * MILLISECOND


class State(IntEnum):
    """NMT states as a heartbeat carries them."""

    BOOT_UP = 0x00
    STOPPED = 0x04
    OPERATIONAL = 0x05
    PRE_OPERATIONAL = 0x7F


_COMMANDS = {0x01: State.OPERATIONAL, 0x02: State.STOPPED, 0x80: State.PRE_OPERATIONAL}
_RESETS = (0x81, 0x82)


class Content(Protocol):
    """What a node is made of, beside the objects that every node has."""

    def read(self, index: int, sub: int) -> bytes:
        """Return an object's bytes; PlcRefusedError with an SDO abort code when it cannot be had."""

    def write(self, index: int, sub: int, value: bytes) -> None:
        """Take an object's bytes; PlcRefusedError with an SDO abort code when they are refused."""

    def on_sync(self, now_ns: int) -> Sequence[CanFrame]:
        """Return the PDOs that follow a SYNC at this time."""

    def on_pdo(self, frame: CanFrame) -> None:
        """Take a frame that is no service of this node: it may be a PDO for it."""


class CanNode:
    """One node; whoever owns the bus hands frames and times in and sends what comes back.

    Args:
        node: Node-ID 1…127.
        content: Its objects and PDOs.
        sync_cob_id: Identifier of SYNC.
        sync_period_us: Send SYNC ourselves so often, 0 never: somebody else does.
        heartbeat_ms: Period of the heartbeat, 0 for none.
        starts_operational: Go on after boot-up without waiting for an NMT master.
        identity: Vendor-ID, product code, revision, serial number of object 1018h.
    """

    def __init__(
        self,
        node: int,
        content: Content,
        *,
        sync_cob_id: int = 0x80,
        sync_period_us: int = 0,
        heartbeat_ms: int = 1000,
        starts_operational: bool = True,
        identity: tuple[int, int, int, int] = (0, 0, 0, 0),
    ) -> None:
        self.node = node
        self.state = State.BOOT_UP
        self.heartbeat_ms = heartbeat_ms
        self._content = content
        self._sync_cob_id = sync_cob_id
        self.sync_period_us = sync_period_us
        self._sync_due_ns = 0
        self._starts_operational = starts_operational
        self._identity = identity
        self._sdo = SdoServer(self._read, self._write)
        self._beat_ns = 0

    def boot(self, now_ns: int) -> list[CanFrame]:
        """Return the boot-up message and enter the state behind it."""
        frame = CanFrame(HEARTBEAT + self.node, bytes((State.BOOT_UP,)))
        self.state = State.OPERATIONAL if self._starts_operational else State.PRE_OPERATIONAL
        self._beat_ns = now_ns
        return [frame]

    def tick(self, now_ns: int) -> list[CanFrame]:
        """Return what is due: the heartbeat, and SYNC with our own PDOs behind it when we send it."""
        due: list[CanFrame] = []
        if self.sync_period_us and self.state is State.OPERATIONAL and now_ns >= self._sync_due_ns:
            period_ns = self.sync_period_us * MICROSECOND
            late = self._sync_due_ns and now_ns - self._sync_due_ns < period_ns
            self._sync_due_ns = (self._sync_due_ns if late else now_ns) + period_ns
            due += [CanFrame(self._sync_cob_id, b""), *self._content.on_sync(now_ns)]
        if self.heartbeat_ms and now_ns - self._beat_ns >= self.heartbeat_ms * MILLISECOND:
            self._beat_ns = now_ns
            due.append(CanFrame(HEARTBEAT + self.node, bytes((self.state,))))
        return due

    def wait_ns(self, now_ns: int) -> int:
        """Return how long until `tick` may have something to send, at most `TICK_NS`."""
        if not self.sync_period_us:
            return TICK_NS
        return min(TICK_NS, max(0, self._sync_due_ns - now_ns))

    def feed(self, frame: CanFrame, now_ns: int) -> list[CanFrame]:
        """Take a frame from the bus and return the answers."""
        if frame.is_extended or frame.is_remote or frame.is_error:
            return []
        if frame.can_id == NMT:
            return self._nmt(frame.data, now_ns)
        if self.state is State.STOPPED:
            return []
        if frame.can_id == SDO_REQUEST + self.node:
            answer = self._sdo.feed(frame.data)
            return [] if answer is None else [CanFrame(SDO_REPLY + self.node, answer)]
        if self.state is State.OPERATIONAL:
            if frame.can_id == self._sync_cob_id:
                return list(self._content.on_sync(now_ns))
            self._content.on_pdo(frame)
        return []

    def _nmt(self, data: bytes, now_ns: int) -> list[CanFrame]:
        if len(data) < 2 or data[1] not in (0, self.node):
            return []
        if data[0] in _RESETS:
            return self.boot(now_ns)
        self.state = _COMMANDS.get(data[0], self.state)
        return []

    def _read(self, index: int, sub: int) -> bytes:
        if index == 0x1000:
            return _only(sub, bytes(4))
        if index == 0x1001:
            return _only(sub, bytes(1))
        if index == 0x1017:
            return _only(sub, self.heartbeat_ms.to_bytes(2, "little"))
        if index == 0x1018:
            if sub == 0:
                return bytes((len(self._identity),))
            if sub > len(self._identity):
                raise PlcRefusedError("identity", code=NO_SUB_INDEX)
            return self._identity[sub - 1].to_bytes(4, "little")
        return self._content.read(index, sub)

    def _write(self, index: int, sub: int, value: bytes) -> None:
        if index == 0x1017 and sub == 0 and len(value) == 2:
            self.heartbeat_ms = int.from_bytes(value, "little")
        elif index in (0x1000, 0x1001, 0x1018):
            raise PlcRefusedError("read-only", code=WRITE_OF_READ_ONLY)
        else:
            self._content.write(index, sub, value)


def _only(sub: int, value: bytes) -> bytes:
    if sub:
        raise PlcRefusedError("sub-index", code=NO_SUB_INDEX)
    return value


class Nothing:
    """A node without objects of its own."""

    def read(self, index: int, sub: int) -> bytes:
        raise PlcRefusedError("no object", code=NO_OBJECT)

    def write(self, index: int, sub: int, value: bytes) -> None:
        raise PlcRefusedError("no object", code=NO_OBJECT)

    def on_sync(self, now_ns: int) -> Sequence[CanFrame]:
        return ()

    def on_pdo(self, frame: CanFrame) -> None:
        return None
