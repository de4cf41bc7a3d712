"""Turn tapped frames into lines for people: time, direction, bytes, meaning."""

from __future__ import annotations

from collections.abc import Callable

from ahgateway.clock import utc_text
from ahgateway.codec.access import Read, Request
from ahgateway.codec.can_frame import unpack
from ahgateway.codec.can_objects import CanMap
from ahgateway.codec.can_text import meaning
from ahgateway.codec.devices import DeviceMap
from ahgateway.errors import AhGatewayError, FrameError, PlcRefusedError
from ahgateway.transports.base import Frame
from ahgateway.transports.framing import Adu, Framing, Mbap
from ahgateway.transports.pdu import EXCEPTIONS, decode_reply, decode_request, describe, reply_shape

VALUES_SHOWN_MAX = 8


class Tracer:
    """Decodes the frames of one link; replies are read with the request that they answer.

    Args:
        asked: Makes a framing like the link's for requests.
        answered: The same for replies; as for requests unless given.
    """

    def __init__(self, asked: Callable[[], Framing], answered: Callable[[], Framing] | None = None) -> None:
        self._out = asked()
        self._in = (answered or asked)()
        self._asked: dict[int, tuple[Request, bytes]] = {}

    def line(self, frame: Frame) -> str:
        """Return one line: `12:00:00.000123 > 00 01 …  read 40 holding registers from 0x0000 of unit 1`."""
        return f"{utc_text(frame.utc_ns)} {frame.direction} {frame.data.hex(' ')}  {self._meaning(frame)}"

    def _meaning(self, frame: Frame) -> str:
        framing = self._out if frame.direction == ">" else self._in
        try:
            adus = framing.feed(frame.data)
        except FrameError as error:
            framing.drain()
            return f"no frame: {error.message}"
        rest = len(framing.drain())
        said = [self._request(adu) if frame.direction == ">" else self._reply(adu) for adu in adus]
        if rest:
            said.append(f"{rest} bytes of no frame")
        return "; ".join(said)

    def _request(self, adu: Adu) -> str:
        try:
            request = decode_request(adu.unit, adu.pdu)
        except PlcRefusedError as error:
            return error.message
        self._asked[adu.tag] = (request, adu.pdu)
        shape = reply_shape(request, adu.pdu)
        self._in.expect(adu.unit, shape.head, shape.size)
        values = "" if isinstance(request, Read) else f": {_values(request, request.values)}"
        return describe(request) + values

    def _reply(self, adu: Adu) -> str:
        if adu.tag not in self._asked:
            return f"unit {adu.unit}: answer to nothing that was asked"
        request, pdu = self._asked.pop(adu.tag)
        try:
            values = decode_reply(request, reply_shape(request, pdu), adu.pdu)
        except PlcRefusedError as error:
            return f"unit {adu.unit}: exception {error.code:02d}, {EXCEPTIONS.get(error.code, ('unknown',))[0]}"
        except AhGatewayError as error:
            return error.message
        return f"unit {adu.unit}: {_values(request, values)}" if values else f"unit {adu.unit}: done"


def _values(request: Request, values: tuple[int, ...]) -> str:
    shown = " ".join(str(v) if request.table.is_bits else f"{v:04X}" for v in values[:VALUES_SHOWN_MAX])
    return shown if len(values) <= VALUES_SHOWN_MAX else f"{shown} … ({len(values)} values)"


def line_maker(scheme: str, can: CanMap | None = None, devices: DeviceMap | None = None) -> Callable[[Frame], str]:
    """Return what turns the tapped frames of a target of this scheme into lines.

    Args:
        scheme: As in its URI; memory and fake links show their frames as Modbus TCP.
        can: The profile's objects and PDOs, for canopen.
        devices: The device map, to name what a PDO carries.
    """
    if scheme == "canopen":
        return lambda frame: _can_line(frame, can, devices)
    return Tracer(*framings(scheme)).line


def framings(scheme: str) -> tuple[Callable[[], Framing], Callable[[], Framing]]:
    """Return what makes the framing of requests, and of replies, on a Modbus target of this scheme."""
    if scheme.startswith("modbus+rtu"):
        from ahgateway.transports.rtu import RtuReplies, RtuRequests

        return RtuRequests, RtuReplies
    if scheme.startswith("modbus+ascii"):
        from ahgateway.transports.ascii import AsciiReplies, AsciiRequests

        return AsciiRequests, AsciiReplies
    return Mbap, Mbap


def _can_line(frame: Frame, can: CanMap | None, devices: DeviceMap | None) -> str:
    found = unpack(frame.data)
    return f"{utc_text(frame.utc_ns)} {frame.direction} {found}  {meaning(found, can, devices)}".rstrip()
