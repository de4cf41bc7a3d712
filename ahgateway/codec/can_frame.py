"""One CAN frame as a value, its bytes in a recording, and what CANopen's COB-IDs mean.

Source:
    MANUAL CiA 301 v4.2 §7.3.5: the pre-defined connection set.
    MANUAL Linux `include/uapi/linux/can.h`: the flag bits above the identifier, as candump logs them.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

from ahgateway.errors import FrameError

STANDARD_ID_MAX = 0x7FF
EXTENDED_ID_MAX = 0x1FFF_FFFF
DATA_SIZE_MAX = 8
NODE_MAX = 127

NMT, SYNC, TIME = 0x000, 0x080, 0x100
EMCY = 0x080
SDO_REPLY, SDO_REQUEST, HEARTBEAT = 0x580, 0x600, 0x700

_EXTENDED, _REMOTE, _ERROR = 0x8000_0000, 0x4000_0000, 0x2000_0000
_HEAD = struct.Struct(">I")

_PDOS = {0x180: "TPDO1", 0x200: "RPDO1", 0x280: "TPDO2", 0x300: "RPDO2", 0x380: "TPDO3", 0x400: "RPDO3"} | {
    0x480: "TPDO4",
    0x500: "RPDO4",
}


@dataclass(frozen=True, slots=True)
class CanFrame:
    """One frame of classic CAN.

    Attributes:
        can_id: 11 bits, 29 when `is_extended`; of an error frame the error classes.
        data: 0…8 bytes.
        is_extended: The identifier has 29 bits.
        is_remote: A request for the frame with this identifier.
        is_error: Not from the wire: the adapter tells about trouble.
        now_ns: Monotonic time when it was taken from the adapter; 0 for a frame to be sent.
    """

    can_id: int
    data: bytes
    is_extended: bool = False
    is_remote: bool = False
    is_error: bool = False
    now_ns: int = 0

    def __str__(self) -> str:
        width = 8 if self.is_extended or self.is_error else 3
        return f"{self.can_id:0{width}X} [{len(self.data)}] {self.data.hex(' ').upper()}".rstrip()


def pack(frame: CanFrame) -> bytes:
    """Return the frame as recordings keep it: 4 bytes identifier with flags, big-endian, then the data."""
    flags = (_EXTENDED if frame.is_extended else 0) | (_REMOTE if frame.is_remote else 0)
    return _HEAD.pack(frame.can_id | flags | (_ERROR if frame.is_error else 0)) + frame.data


def unpack(packed: bytes, now_ns: int = 0) -> CanFrame:
    """Return the frame in what `pack` made.

    Raises:
        FrameError: Too few or too many bytes, or an identifier that does not fit its flags.
    """
    if not _HEAD.size <= len(packed) <= _HEAD.size + DATA_SIZE_MAX:
        raise FrameError(f"{len(packed)} bytes are no packed CAN frame, which has 4…12")
    head = _HEAD.unpack_from(packed)[0]
    can_id, is_extended, is_error = head & EXTENDED_ID_MAX, bool(head & _EXTENDED), bool(head & _ERROR)
    if can_id > STANDARD_ID_MAX and not (is_extended or is_error):
        raise FrameError(f"identifier {can_id:#x} does not fit into 11 bits")
    return CanFrame(can_id, packed[_HEAD.size :], is_extended, bool(head & _REMOTE), is_error, now_ns)


def service(can_id: int) -> tuple[str, int]:
    """Name the CANopen service of an 11-bit identifier and its node, 0 where there is none: `("TPDO1", 3)`."""
    if can_id in (NMT, SYNC, TIME):
        return {NMT: "NMT", SYNC: "SYNC", TIME: "TIME"}[can_id], 0
    base, node = can_id & 0x780, can_id & 0x7F
    if node == 0:
        return "", 0
    if base in _PDOS:
        return _PDOS[base], node
    names = {EMCY: "EMCY", SDO_REPLY: "SDO reply", SDO_REQUEST: "SDO request", HEARTBEAT: "heartbeat"}
    return names.get(base, ""), node if base in names else 0
