"""The PLC's side of a connection without the connection: bytes in, answers out, in the order of the requests."""

from __future__ import annotations

from ahgateway.clock import Clock
from ahgateway.codec.access import Request
from ahgateway.errors import PlcRefusedError
from ahgateway.transports.base import Device, Frame, Tap
from ahgateway.transports.framing import Framing
from ahgateway.transports.pdu import decode_request, encode_exception, encode_reply


class Responder:
    """One connection or line as the server sees it; a tap needs a clock for its times."""

    def __init__(self, device: Device, framing: Framing, clock: Clock | None = None, tap: Tap | None = None) -> None:
        self._device = device
        self._framing = framing
        self._clock = clock
        self._tap = tap

    def feed(self, piece: bytes | memoryview) -> bytes:
        """Take the next bytes and return what goes back, empty for nothing.

        Raises:
            FrameError: The stream cannot be read on; close the connection.
        """
        self._show(">", piece)
        answers = []
        for adu in self._framing.feed(piece):
            answer = answer_pdu(self._device, adu.unit, adu.pdu)
            if answer is not None and (adu.unit != 0 or self._framing.identifies):
                answers.append(self._framing.wrap(adu.tag, adu.unit, answer))
        answer_bytes = b"".join(answers)
        self._show("<", answer_bytes)
        return answer_bytes

    def _show(self, direction: str, data: bytes | memoryview) -> None:
        if data and self._tap is not None and self._clock is not None:
            self._tap(Frame(direction, bytes(data), self._clock.now_ns(), self._clock.utc_ns()))


def answer_pdu(device: Device, unit: int, pdu: bytes) -> bytes | None:
    """Return the PDU that answers `pdu`, an exception included; None for silence."""
    try:
        request: Request = decode_request(unit, pdu)
        values = device.answer(request)
    except PlcRefusedError as refusal:
        return encode_exception(pdu[0], refusal.code)
    return None if values is None else encode_reply(request, pdu, values)
