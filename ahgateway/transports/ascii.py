"""Modbus ASCII: a colon, two hexadecimal digits a byte, a checksum, CR LF. Delta's factory setting.

Source: MANUAL Modbus over Serial Line V1.02, §2.5.2; LRC from pymodbus.
"""

from __future__ import annotations

from binascii import Error as HexError
from binascii import unhexlify

from pymodbus.framer.ascii import FramerAscii

from ahgateway.transports.framing import Adu, Rest
from ahgateway.transports.pdu import EXCEPTION_BIT

ASCII_FRAME_SIZE_MAX = 513
_START, _END = b":", b"\r\n"


def lrc(data: bytes) -> int:
    """Return the checksum byte of unit and PDU."""
    return FramerAscii.compute_LRC(data)


class _Ascii(Rest):
    def wrap(self, tag: int, unit: int, pdu: bytes) -> bytes:
        body = bytes((unit,)) + pdu
        return _START + (body + bytes((lrc(body),))).hex().upper().encode() + _END

    def frame_size(self, pdu_size: int) -> int:
        return len(_START) + 2 * (1 + pdu_size + 1) + len(_END)

    def _bound(self) -> None:
        if len(self._rest) > 2 * ASCII_FRAME_SIZE_MAX:
            self._drop(len(self._rest) - ASCII_FRAME_SIZE_MAX)

    def _next(self, start: int) -> tuple[int, int, bytes] | None:
        """Return start, end and bytes of the first sound frame from `start` on."""
        rest = self._rest
        while (end := rest.find(_END, start)) >= 0:
            begin = rest.rfind(_START, start, end)  # a colon inside a frame begins a new one
            body = _decode(rest[begin + 1 : end]) if begin >= 0 else None
            if body is not None:
                return begin, end + len(_END), body
            start = end + len(_END)
        return None


def _decode(digits: bytearray) -> bytes | None:
    try:
        body = unhexlify(digits)
    except (HexError, ValueError):
        return None
    return body[:-1] if len(body) >= 3 and lrc(body[:-1]) == body[-1] else None


class AsciiReplies(_Ascii):
    """The client's side: sends requests, finds the reply it waits for."""

    def __init__(self) -> None:
        super().__init__()
        self._wanted: tuple[tuple[bytes, int], ...] = ()

    def expect(self, unit: int, head: bytes, size: int) -> None:
        self._wanted = ((bytes((unit,)) + head, 1 + size), (bytes((unit, head[0] | EXCEPTION_BIT)), 3))

    def feed(self, piece: bytes | memoryview) -> list[Adu]:
        self._rest += piece
        start = 0
        while self._wanted and (found := self._next(start)) is not None:
            begin, end, body = found
            if any(body.startswith(head) and len(body) == size for head, size in self._wanted):
                self._drop(begin)
                del self._rest[: end - begin]
                self._wanted = ()
                return [Adu(0, body[0], body[1:])]
            start = end
        self._bound()
        return []

    def drain(self) -> bytes:
        self._wanted = ()
        return super().drain()


class AsciiRequests(_Ascii):
    """The server's side: finds requests to any unit, sends replies."""

    def expect(self, unit: int, head: bytes, size: int) -> None:
        """A server waits for nothing in particular."""

    def feed(self, piece: bytes | memoryview) -> list[Adu]:
        self._rest += piece
        found = []
        while (frame := self._next(0)) is not None:
            begin, end, body = frame
            self._drop(begin)
            del self._rest[: end - begin]
            found.append(Adu(0, body[0], body[1:]))
        self._bound()
        return found
