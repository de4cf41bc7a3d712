"""Modbus RTU: unit, PDU, CRC; no start, no number, no length, only silence between frames.

Silence is not trusted here (adapters and converters tear it): a frame ends by its length and its CRC. The client
knows the reply it waits for and looks for exactly that, byte by byte, so that noise in front costs nothing; the
server looks for any request. Both keep less than two frames.

Source: MANUAL Modbus over Serial Line V1.02, §2.5.1; CRC from pymodbus.
"""

from __future__ import annotations

from pymodbus.framer.rtu import FramerRTU

from ahgateway.transports.framing import Adu, Rest
from ahgateway.transports.pdu import EXCEPTION_BIT

RTU_FRAME_SIZE_MAX = 256
_CRC_SIZE = 2
_EXCEPTION_FRAME_SIZE = 5
_REQUEST_SIZE_MIN = 8


def crc(data: bytes | bytearray | memoryview) -> bytes:
    """Return the two bytes that follow `data` on the wire, low byte first."""
    return FramerRTU.compute_CRC(bytes(data)).to_bytes(2, "big")


class _Rtu(Rest):
    def wrap(self, tag: int, unit: int, pdu: bytes) -> bytes:
        frame = bytes((unit,)) + pdu
        return frame + crc(frame)

    def frame_size(self, pdu_size: int) -> int:
        return 1 + pdu_size + _CRC_SIZE

    def _take(self, start: int, size: int) -> Adu:
        self._drop(start)
        frame = bytes(self._rest[:size])
        del self._rest[:size]
        return Adu(0, frame[0], frame[1:-_CRC_SIZE])

    def _is_whole(self, start: int, size: int) -> bool:
        end = start + size
        rest = self._rest
        return end <= len(rest) and crc(rest[start : end - _CRC_SIZE]) == rest[end - _CRC_SIZE : end]


class RtuReplies(_Rtu):
    """The client's side: sends requests, finds the reply it waits for."""

    def __init__(self) -> None:
        super().__init__()
        self._wanted: tuple[tuple[bytes, int], ...] = ()

    def expect(self, unit: int, head: bytes, size: int) -> None:
        self._wanted = (
            (bytes((unit,)) + head, self.frame_size(size)),
            (bytes((unit, head[0] | EXCEPTION_BIT)), _EXCEPTION_FRAME_SIZE),
        )

    @property
    def missing(self) -> int:
        for head, size in self._wanted:
            if self._rest.startswith(head):
                return max(1, size - len(self._rest))
        return 1

    def feed(self, piece: bytes | memoryview) -> list[Adu]:
        self._rest += piece
        place = self._find()
        if place is None:
            if len(self._rest) > 2 * RTU_FRAME_SIZE_MAX:
                self._drop(len(self._rest) - RTU_FRAME_SIZE_MAX)
            return []
        self._wanted = ()
        return [self._take(*place)]

    def drain(self) -> bytes:
        self._wanted = ()
        return super().drain()

    def _find(self) -> tuple[int, int] | None:
        places = []
        for head, size in self._wanted:
            start = self._rest.find(head)
            while start >= 0 and not self._is_whole(start, size):
                start = self._rest.find(head, start + 1)
            if start >= 0:
                places.append((start, size))
        return min(places, default=None)


class RtuRequests(_Rtu):
    """The server's side: finds requests to any unit, sends replies."""

    def expect(self, unit: int, head: bytes, size: int) -> None:
        """A server waits for nothing in particular."""

    def feed(self, piece: bytes | memoryview) -> list[Adu]:
        self._rest += piece
        found: list[Adu] = []
        start, keep_from = 0, -1
        while len(self._rest) - start >= _REQUEST_SIZE_MIN:
            size = self._request_size(start)
            if size and self._is_whole(start, size):
                found.append(self._take(start, size))
                start, keep_from = 0, -1
                continue
            if size and start + size > len(self._rest) and keep_from < 0:
                keep_from = start  # may yet become whole; what is whole behind it is not kept waiting
            start += 1
        self._drop(start if keep_from < 0 else keep_from)
        return found

    def _request_size(self, start: int) -> int:
        """Return how long a request that begins here would be, 0 when none begins here."""
        function = self._rest[start + 1]
        if 1 <= function <= 6:
            return _REQUEST_SIZE_MIN
        if function in (15, 16):
            size = 9 + self._rest[start + 6]
            return size if size <= RTU_FRAME_SIZE_MAX else 0
        return 0
