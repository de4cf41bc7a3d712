"""SDO transfers without a bus: data fields in, data fields out, for the client and for the server.

This file alone decides which reply answers which request. Initiate and abort replies echo index and sub-index and are
checked against them; segment replies carry only a toggle bit, so that a caller must prove the channel empty after any
doubt (`transports.can.link`). Block transfers are refused, as the standard allows. Sizes are in bytes.

Source:
    MANUAL CiA 301 v4.2 §7.2.4.3: SDO protocols, abort codes; the examples of the tests are published ones.
"""

from __future__ import annotations

import struct
from collections.abc import Callable

from ahgateway.errors import CodecError, FrameError, PlcRefusedError

OBJECT_SIZE_MAX = 4096
"""Largest object that a transfer may carry here; the standard knows no limit, a buffer needs one."""
SEGMENT_SIZE = 7
_HEAD = struct.Struct("<BHB")
_ABORT = struct.Struct("<BHBI")
_TOGGLE = 0x10

ABORTED = 0x80
TIMED_OUT = 0x0504_0000
BAD_COMMAND = 0x0504_0001
BAD_TOGGLE = 0x0503_0000
NO_MEMORY = 0x0504_0005
NO_ACCESS, READ_OF_WRITE_ONLY, WRITE_OF_READ_ONLY = 0x0601_0000, 0x0601_0001, 0x0601_0002
NO_OBJECT, NO_SUB_INDEX = 0x0602_0000, 0x0609_0011
WRONG_SIZE, TOO_LONG, TOO_SHORT = 0x0607_0010, 0x0607_0012, 0x0607_0013
GENERAL, NOT_STORED, NOT_IN_THIS_STATE = 0x0800_0000, 0x0800_0020, 0x0800_0022

ABORTS: dict[int, tuple[str, str]] = {
    BAD_TOGGLE: ("toggle bit not alternated", "another SDO client speaks to this node, or a frame was lost"),
    TIMED_OUT: ("SDO protocol timed out", ""),
    BAD_COMMAND: ("command specifier not valid or unknown", "the node knows no transfer of this kind"),
    0x0504_0002: ("block size not valid", ""),
    0x0504_0003: ("sequence number not valid", ""),
    0x0504_0004: ("CRC error", ""),
    NO_MEMORY: ("out of memory", ""),
    NO_ACCESS: ("unsupported access to an object", ""),
    READ_OF_WRITE_ONLY: ("attempt to read a write-only object", "see its access in the EDS"),
    WRITE_OF_READ_ONLY: ("attempt to write a read-only object", "see its access in the EDS"),
    NO_OBJECT: ("object does not exist", "compare `index` in the profile with the EDS of the module"),
    0x0604_0041: ("object cannot be mapped to the PDO", ""),
    0x0604_0042: ("PDO length exceeded", ""),
    0x0604_0043: ("general parameter incompatibility", ""),
    0x0604_0047: ("general internal incompatibility in the device", ""),
    0x0606_0000: ("access failed due to a hardware error", ""),
    WRONG_SIZE: ("length of the parameter does not match", "compare `words` in the profile with the EDS"),
    TOO_LONG: ("length of the parameter too high", "compare `words` in the profile with the EDS"),
    TOO_SHORT: ("length of the parameter too low", "compare `words` in the profile with the EDS"),
    NO_SUB_INDEX: ("sub-index does not exist", "compare `sub` and `count` in the profile with the EDS of the module"),
    0x0609_0030: ("value range exceeded", ""),
    0x0609_0031: ("value too high", ""),
    0x0609_0032: ("value too low", ""),
    0x0609_0036: ("maximum is below minimum", ""),
    0x060A_0023: ("resource not available", "the SDO connection is taken; try again"),
    GENERAL: ("general error", ""),
    NOT_STORED: ("data cannot be transferred or stored", ""),
    0x0800_0021: ("data cannot be stored because of local control", "the device is in local operation"),
    NOT_IN_THIS_STATE: ("data cannot be stored in the present device state", "is the PLC in RUN?"),
    0x0800_0023: ("object dictionary not present", ""),
    0x0800_0024: ("no data available", ""),
}
"""Abort code to its name and, where we have one, what to do."""


def abort_frame(index: int, sub: int, code: int) -> bytes:
    """Return the data field that ends a transfer, from either side."""
    return _ABORT.pack(ABORTED, index, sub, code)


def refusal(where: str, code: int) -> PlcRefusedError:
    """Return the error for an abort; `where` names what was asked of whom."""
    name, hint = ABORTS.get(code, ("unknown code", ""))
    return PlcRefusedError(f"{where}: SDO abort {code:#010x}, {name}", code=code, hint=hint or None)


class Transfer:
    """The client's side of one transfer; `request` starts it, `feed` takes each reply.

    Args:
        index: Object index.
        sub: Sub-index.
        written: What to write; None reads.

    Attributes:
        request: Data field to send now.
        is_done: The last reply has been taken.
        value: What was read, in the PLC's byte order; empty for a write.
        segments: Replies taken behind the first one.
        is_sized: The server said how long the value is; else `value` has 4 bytes of which it may need fewer.
    """

    def __init__(self, index: int, sub: int, written: bytes | None = None) -> None:
        self.index = index
        self.sub = sub
        self.is_done = False
        self.value = b""
        self.segments = 0
        self.is_sized = True
        self._written = written
        self._size: int | None = None
        self._toggle = 0
        self._sent = 0
        self._is_begun = False
        if written is None:
            self.request = _HEAD.pack(0x40, index, sub) + bytes(4)
        else:
            self.request = _initiate_download(index, sub, written)
            self._sent = len(written) if len(written) <= 4 else 0

    def feed(self, reply: bytes) -> bool:
        """Take a data field from the server; True when it belonged here, False when it answers something else.

        When it is True and `is_done` is not, `request` holds what to send next.

        Raises:
            PlcRefusedError: The server aborted this transfer.
            FrameError: It belongs to this transfer and breaks the protocol; the caller sends `abort_frame`.
        """
        if not reply:
            return False
        specifier = reply[0] & 0xE0
        if reply[0] == ABORTED:
            return self._aborted(reply)
        if not self._is_begun:
            return self._begin(specifier, reply)
        if self._written is None:
            return self._segment_up(specifier, reply)
        return self._segment_down(specifier, reply)

    def _echoes(self, reply: bytes) -> bool:
        return len(reply) >= _HEAD.size and _HEAD.unpack_from(reply)[1:] == (self.index, self.sub)

    def _aborted(self, reply: bytes) -> bool:
        if not self._echoes(reply):
            return False
        code = _ABORT.unpack(reply.ljust(8, b"\0"))[3]
        raise refusal(f"object {self.index:#06x}:{self.sub:02x}", code)

    def _begin(self, specifier: int, reply: bytes) -> bool:
        wanted = 0x40 if self._written is None else 0x60
        if specifier != wanted or not self._echoes(reply):
            return False
        self._is_begun = True
        if self._written is not None:
            return self._next_down()
        is_expedited, has_size = reply[0] & 2, reply[0] & 1
        if is_expedited:
            size = 4 - (reply[0] >> 2 & 3) if has_size else 4
            if len(reply) < 4 + size:
                raise self._broken(f"an expedited reply of {len(reply)} bytes says it holds {size}")
            self.value = reply[4 : 4 + size]
            self.is_sized = bool(has_size)
            self.is_done = True
            return True
        if has_size:
            self._size = int.from_bytes(reply[4:8], "little")
            if not 1 <= self._size <= OBJECT_SIZE_MAX:
                raise self._broken(f"its size is {self._size} bytes, allowed 1…{OBJECT_SIZE_MAX}")
        self.request = bytes((0x60, 0, 0, 0, 0, 0, 0, 0))
        return True

    def _segment_up(self, specifier: int, reply: bytes) -> bool:
        if specifier != 0x00:
            return False
        if reply[0] & _TOGGLE != self._toggle:
            raise self._broken("the toggle bit of a segment did not alternate")
        size = SEGMENT_SIZE - (reply[0] >> 1 & 7)
        if len(reply) < 1 + size:
            raise self._broken(f"a segment of {len(reply)} bytes says it holds {size}")
        self.value += reply[1 : 1 + size]
        self.segments += 1
        if reply[0] & 1:
            if self._size is not None and self._size != len(self.value):
                raise self._broken(f"{len(self.value)} bytes came, {self._size} were announced")
            self.is_done = True
        elif len(self.value) > (self._size or OBJECT_SIZE_MAX):
            raise self._broken(f"more than the {self._size or OBJECT_SIZE_MAX} bytes announced or allowed came")
        self._toggle ^= _TOGGLE
        self.request = bytes((0x60 | self._toggle, 0, 0, 0, 0, 0, 0, 0))
        return True

    def _segment_down(self, specifier: int, reply: bytes) -> bool:
        if specifier != 0x20:
            return False
        if reply[0] & _TOGGLE != self._toggle:
            raise self._broken("the toggle bit of a segment's confirmation did not alternate")
        self._toggle ^= _TOGGLE
        self.segments += 1
        return self._next_down()

    def _next_down(self) -> bool:
        assert self._written is not None
        rest = self._written[self._sent : self._sent + SEGMENT_SIZE]
        if not rest:
            self.is_done = True
            return True
        self._sent += len(rest)
        is_last = self._sent == len(self._written)
        head = self._toggle | (SEGMENT_SIZE - len(rest)) << 1 | is_last
        self.request = bytes((head,)) + rest.ljust(SEGMENT_SIZE, b"\0")
        return True

    def _broken(self, what: str) -> FrameError:
        return FrameError(f"object {self.index:#06x}:{self.sub:02x}: {what}")


def _initiate_download(index: int, sub: int, written: bytes) -> bytes:
    size = len(written)
    if not 1 <= size <= OBJECT_SIZE_MAX:
        raise CodecError(f"object {index:#06x}:{sub:02x}: {size} bytes to write, allowed 1…{OBJECT_SIZE_MAX}")
    if size <= 4:
        return _HEAD.pack(0x23 | (4 - size) << 2, index, sub) + written.ljust(4, b"\0")
    return _HEAD.pack(0x21, index, sub) + size.to_bytes(4, "little")


ReadObject = Callable[[int, int], bytes]
WriteObject = Callable[[int, int, bytes], None]


class SdoServer:
    """The server's side of one SDO channel.

    Args:
        read: Returns an object's bytes; raises PlcRefusedError with an abort code.
        write: Takes an object's bytes; raises PlcRefusedError with an abort code.
    """

    def __init__(self, read: ReadObject, write: WriteObject) -> None:
        self._read = read
        self._write = write
        self._object = (0, 0)
        self._rest: bytes | None = None
        self._taken: bytearray | None = None
        self._size: int | None = None
        self._toggle = 0

    def feed(self, request: bytes) -> bytes | None:
        """Take a data field from a client and return the answer; None where the standard asks for silence."""
        if len(request) != 8 or request[0] == ABORTED:
            self._forget()
            return None
        try:
            return self._answer(request[0] & 0xE0, request)
        except PlcRefusedError as error:
            self._forget()
            return abort_frame(*self._object, error.code)

    def _answer(self, specifier: int, request: bytes) -> bytes:
        if specifier == 0x40:
            return self._upload(request)
        if specifier == 0x20:
            return self._download(request)
        if specifier == 0x60 and self._rest is not None:
            return self._segment_up(request[0])
        if specifier == 0x00 and self._taken is not None:
            return self._segment_down(request)
        if specifier in (0xA0, 0xC0):
            self._object = _HEAD.unpack_from(request)[1:]
        raise PlcRefusedError("no such command", code=BAD_COMMAND)

    def _forget(self) -> None:
        self._rest, self._taken, self._size, self._toggle = None, None, None, 0

    def _upload(self, request: bytes) -> bytes:
        self._forget()
        self._object = index, sub = _HEAD.unpack_from(request)[1:]
        value = self._read(index, sub)
        if len(value) <= 4:
            return _HEAD.pack(0x43 | (4 - len(value)) << 2, index, sub) + value.ljust(4, b"\0")
        self._rest = value
        return _HEAD.pack(0x41, index, sub) + len(value).to_bytes(4, "little")

    def _segment_up(self, command: int) -> bytes:
        assert self._rest is not None
        if command & _TOGGLE != self._toggle:
            raise PlcRefusedError("toggle", code=BAD_TOGGLE)
        piece, self._rest = self._rest[:SEGMENT_SIZE], self._rest[SEGMENT_SIZE:]
        head = self._toggle | (SEGMENT_SIZE - len(piece)) << 1 | (not self._rest)
        self._toggle ^= _TOGGLE
        if not self._rest:
            self._forget()
        return bytes((head,)) + piece.ljust(SEGMENT_SIZE, b"\0")

    def _download(self, request: bytes) -> bytes:
        self._forget()
        self._object = index, sub = _HEAD.unpack_from(request)[1:]
        if request[0] & 2:
            size = 4 - (request[0] >> 2 & 3) if request[0] & 1 else 4
            self._write(index, sub, request[4 : 4 + size])
        else:
            self._size = int.from_bytes(request[4:8], "little") if request[0] & 1 else None
            if (self._size or 0) > OBJECT_SIZE_MAX:
                raise PlcRefusedError("too long", code=TOO_LONG)
            self._taken = bytearray()
        return _HEAD.pack(0x60, index, sub) + bytes(4)

    def _segment_down(self, request: bytes) -> bytes:
        assert self._taken is not None
        if request[0] & _TOGGLE != self._toggle:
            raise PlcRefusedError("toggle", code=BAD_TOGGLE)
        self._taken += request[1 : 8 - (request[0] >> 1 & 7)]
        if len(self._taken) > OBJECT_SIZE_MAX:
            raise PlcRefusedError("too long", code=TOO_LONG)
        answer = bytes((0x20 | self._toggle,)) + bytes(7)
        self._toggle ^= _TOGGLE
        if request[0] & 1:
            if self._size is not None and self._size != len(self._taken):
                raise PlcRefusedError("size", code=WRONG_SIZE)
            taken = bytes(self._taken)
            self._forget()
            self._write(*self._object, taken)
        return answer
