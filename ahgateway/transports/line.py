"""A serial line's settings, and opening its port with an error that a technician can act on.

Source: MANUAL Modbus over Serial Line V1.02, §2.5.1.1: 3.5 characters of silence, 1.75 ms fixed above 19200 baud;
MANUAL spec ah500 §3.4: Delta's factory setting is ASCII 9600 7E1, RTU needs 8 data bits.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import Any

import serial

from ahgateway.clock import SECOND
from ahgateway.errors import LinkError
from ahgateway.transports.port_errors import why_not

_REFUSED: tuple[type[Exception], ...] = (OSError, ValueError)
if sys.platform != "win32":
    import termios

    _REFUSED = (*_REFUSED, termios.error)  # a driver that refuses a setting; no OSError

FIXED_GAP_ABOVE_BAUD = 19200
FIXED_GAP_NS = 1_750_000
READ_TIMEOUT_S = 0.01
WRITE_TIMEOUT_S = 5.0


@dataclass(frozen=True, slots=True)
class Line:
    """One serial port and how it is set.

    Attributes:
        port: `/dev/ttyUSB0`, `COM3`, `\\\\.\\COM10`, or a pyserial URL such as `rfc2217://192.0.2.30:7000`.
        baud: Bits a second.
        parity: `N`, `E` or `O`.
        bits: Data bits, 8 or 7.
        stop: Stop bits, 1 or 2.
    """

    port: str
    baud: int = 9600
    parity: str = "E"
    bits: int = 8
    stop: int = 1

    @property
    def byte_ns(self) -> int:
        """Time of one character on the wire, start, parity and stop bits counted."""
        return (1 + self.bits + (self.parity != "N") + self.stop) * SECOND // self.baud

    @property
    def gap_ns(self) -> int:
        """Silence that RTU demands between two frames."""
        return FIXED_GAP_NS if self.baud > FIXED_GAP_ABOVE_BAUD else 7 * self.byte_ns // 2

    def __str__(self) -> str:
        return f"{self.port} {self.baud} {self.bits}{self.parity}{self.stop}"


def open_port(line: Line) -> serial.Serial:
    """Open the port for us alone.

    Raises:
        LinkError: With the cause, and what to do about it: no such port, no permission, taken by another program.
    """
    local: dict[str, Any] = {}
    if "://" not in line.port:  # ports behind a URL know neither
        local["write_timeout"] = WRITE_TIMEOUT_S
        if sys.platform != "win32":
            local["exclusive"] = True
    try:
        return serial.serial_for_url(
            line.port,
            baudrate=line.baud,
            bytesize=line.bits,
            parity=line.parity,
            stopbits=line.stop,
            timeout=READ_TIMEOUT_S,
            **local,
        )
    except _REFUSED as error:
        what, hint = why_not(line, error)
        raise LinkError(f"{line.port}: {what}", hint=hint) from error
