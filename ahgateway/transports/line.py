"""A serial line's settings, and opening its port with an error that a technician can act on.

Source: MANUAL Modbus over Serial Line V1.02, §2.5.1.1: 3.5 characters of silence, 1.75 ms fixed above 19200 baud;
MANUAL spec ah500 §3.4: Delta's factory setting is ASCII 9600 7E1, RTU needs 8 data bits.
"""

from __future__ import annotations

import errno
import os
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import serial
from serial.tools import list_ports

from ahgateway.clock import SECOND
from ahgateway.errors import LinkError

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
        port: `/dev/ttyUSB0`, `COM3`, or a pyserial URL such as `rfc2217://192.0.2.30:7000`.
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
        what, hint = _why_not(line, error)
        raise LinkError(f"{line.port}: {what}", hint=hint) from error


def _why_not(line: Line, error: Exception) -> tuple[str, str]:
    code, text = getattr(error, "errno", None), str(error)
    if not isinstance(error, OSError | ValueError):
        settings = f"{line.baud} {line.bits}{line.parity}{line.stop}"
        return f"the adapter refuses {settings}", "try another baud rate or parity, or another adapter"
    if code == errno.ENOENT or "FileNotFoundError" in text:
        there = ", ".join(sorted(port.device for port in list_ports.comports())) or "none"
        return "no such port", f"is the adapter plugged in? ports here: {there}"
    if code in (errno.EAGAIN, errno.EBUSY) or (sys.platform == "win32" and "PermissionError" in text):
        holder = _holder(line.port)
        return f"port is busy{holder}", "another program has it open; close that first"
    if code == errno.EACCES:
        group = _group(line.port)
        return "no permission", (
            f"the port belongs to group {group}: sudo usermod -aG {group} $USER, then log in again"
            if group
            else "run as a user who may open this port"
        )
    return f"cannot be opened ({text})", "check the settings that this adapter supports"


def _group(port: str) -> str:
    """Name the group that owns a port, empty where groups do not exist."""
    try:
        import grp
    except ImportError:  # Windows
        return ""
    try:
        return grp.getgrgid(os.stat(port).st_gid).gr_name
    except (OSError, KeyError):
        return ""


def _holder(port: str) -> str:
    """Say which program has a port open, as far as this system tells (Linux, own processes)."""
    try:
        wanted = os.path.realpath(port)
        for entry in Path("/proc").glob("[0-9]*/fd/*"):
            if _points_to(entry, wanted) and entry.parts[2] != str(os.getpid()):
                name = Path("/proc", entry.parts[2], "comm").read_text().strip()
                return f" (held by {name}, process {entry.parts[2]})"
    except OSError:
        pass
    return ""


def _points_to(entry: Path, wanted: str) -> bool:
    try:
        return str(entry.readlink()) == wanted
    except OSError:
        return False
