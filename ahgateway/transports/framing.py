"""What a wire wraps around a PDU: the contract of a framing, and Modbus TCP's own, the MBAP header.

A framing turns bytes into ADUs and back; it knows no requests, no time, no sockets. Two kinds exist: those that
number their transactions (MBAP) and those that do not (RTU, ASCII), where a reply can only be known by its shape.

Source: MANUAL Modbus Messaging on TCP/IP Implementation Guide V1.0b, §3.1.3 (header), §4.2 (port 502).
"""

from __future__ import annotations

import struct
from typing import NamedTuple, Protocol

from ahgateway.errors import FrameError
from ahgateway.transports.pdu import PDU_SIZE_MAX

_HEADER = struct.Struct(">HHHB")
_HEADER_SIZE = 7
_LENGTH_MAX = PDU_SIZE_MAX + 1
MBAP_FRAME_SIZE_MAX = 6 + _LENGTH_MAX


class Adu(NamedTuple):
    """One frame without its wrapping; `tag` is the transaction number, 0 where the wire has none."""

    tag: int
    unit: int
    pdu: bytes


_new_adu = tuple.__new__
"""Makes an Adu without the detour through its constructor's Python code; only in the hot path."""


class Framing(Protocol):
    """One direction of one connection: it keeps the bytes of a frame that has not come to its end.

    Attributes:
        identifies: True when every frame carries the number of its transaction.
        garbage_bytes: Bytes dropped since it was made, because they belong to no frame.
    """

    identifies: bool
    garbage_bytes: int

    @property
    def kept(self) -> int:
        """Bytes of a frame that has not come to its end, or of no frame at all; bounded."""

    @property
    def missing(self) -> int:
        """Bytes that the frame under way still needs, as far as its beginning tells; 1 when that is not known."""

    def wrap(self, tag: int, unit: int, pdu: bytes) -> bytes:
        """Return the frame that carries `pdu`."""

    def frame_size(self, pdu_size: int) -> int:
        """Return how many bytes a frame has that carries a PDU of this size."""

    def expect(self, unit: int, head: bytes, size: int) -> None:
        """Say which reply is waited for, until it is there or `drain`: unit, first bytes and size of its PDU."""

    def feed(self, piece: bytes | memoryview) -> list[Adu]:
        """Take the next bytes and return the frames that end in them.

        Raises:
            FrameError: The stream cannot be read on; the connection must be closed.
        """

    def drain(self) -> bytes:
        """Drop what is kept and return it."""


class Rest:
    """What every framing keeps: bytes that belong to no frame yet, and how many belonged to none."""

    identifies = False

    def __init__(self) -> None:
        self.garbage_bytes = 0
        self._rest = bytearray()

    @property
    def kept(self) -> int:
        return len(self._rest)

    @property
    def missing(self) -> int:
        return 1

    def drain(self) -> bytes:
        dropped = bytes(self._rest)
        self._drop(len(dropped))
        return dropped

    def _drop(self, size: int) -> None:
        del self._rest[:size]
        self.garbage_bytes += size


class Mbap(Rest):
    """Modbus TCP. The header has no checksum: a wrong protocol or length means that the stream is lost."""

    identifies = True

    def wrap(self, tag: int, unit: int, pdu: bytes) -> bytes:
        return _HEADER.pack(tag, 0, len(pdu) + 1, unit) + pdu

    def frame_size(self, pdu_size: int) -> int:
        return _HEADER_SIZE + pdu_size

    def expect(self, unit: int, head: bytes, size: int) -> None:
        """Nothing to prepare: the transaction number tells the replies apart."""

    def feed(self, piece: bytes | memoryview) -> list[Adu]:
        size = len(piece)
        if not self._rest and size > _HEADER_SIZE:
            # Nearly always one piece is one frame; then nothing is copied but the PDU itself.
            tag, protocol, length, unit = _HEADER.unpack_from(piece)
            if size == length + 6 and protocol == 0 and length <= _LENGTH_MAX:
                return [_new_adu(Adu, (tag, unit, bytes(piece[_HEADER_SIZE:])))]
        self._rest += piece
        return self._split()

    def _split(self) -> list[Adu]:
        rest, found, start = self._rest, [], 0
        while len(rest) - start > 6:
            tag, protocol, length, unit = _HEADER.unpack_from(rest, start)
            if protocol != 0 or not 2 <= length <= _LENGTH_MAX:
                self.garbage_bytes += len(rest) - start
                raise FrameError(
                    f"bytes {rest[start : start + 8].hex(' ')} are no Modbus TCP header: "
                    f"protocol {protocol}, length {length}, legal are protocol 0 and length 2…{_LENGTH_MAX}",
                    hint="is this really a Modbus TCP port, or a converter that passes RTU or ASCII through?",
                )
            end = start + 6 + length
            if len(rest) < end:
                break
            found.append(Adu(tag, unit, bytes(rest[start + _HEADER_SIZE : end])))
            start = end
        del rest[:start]
        return found
