"""The least time that an exchange can take on a serial line, whoever asks and however fast the PLC is.

Source: MANUAL Modbus over Serial Line V1.02, §2.5.1.1 and §2.5.2.1: RTU has 3.5 characters of silence behind the
request and behind the reply; ASCII has none.
"""

from __future__ import annotations

from ahgateway.codec.access import Request
from ahgateway.transports.ascii import AsciiReplies
from ahgateway.transports.line import Line
from ahgateway.transports.pdu import encode_request, reply_shape
from ahgateway.transports.rtu import RtuReplies


def floor_ns(request: Request, line: Line, *, is_rtu: bool) -> int:
    """Return the shortest legal time from the start of a request to the start of the next one."""
    pdu = encode_request(request)
    framing = RtuReplies() if is_rtu else AsciiReplies()
    size = framing.frame_size(len(pdu)) + framing.frame_size(reply_shape(request, pdu).size)
    return size * line.byte_ns + (2 * line.gap_ns if is_rtu else 0)


def round_trip_floor_ns(request: Request, line: Line, *, is_rtu: bool) -> int:
    """Return the shortest legal time from the first byte of a request to the last byte of its reply."""
    return floor_ns(request, line, is_rtu=is_rtu) - (line.gap_ns if is_rtu else 0)
