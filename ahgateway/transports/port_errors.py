"""Why a serial port cannot be had, in words that a technician can act on.

Linux tells by `errno`. On Windows pyserial puts the system's error into the text of its own, and that text is in the
user's language: only the number at its end can be read.

Source: MANUAL Microsoft, System Error Codes; MANUAL pyserial 3.5, serialwin32.
"""

from __future__ import annotations

import errno
import os
import re
from pathlib import Path
from typing import TYPE_CHECKING

from serial.tools import list_ports

if TYPE_CHECKING:
    from ahgateway.transports.line import Line

_WINDOWS_CODE = re.compile(r"Error\(.*, (\d+)\)")
"""`PermissionError(13, 'Zugriff verweigert', None, 5)`: the last number is Windows' own."""

FILE_NOT_FOUND, PATH_NOT_FOUND, ACCESS_DENIED, INVALID_NAME = 2, 3, 5, 123
BAD_COMMAND, GEN_FAILURE, SHARING_VIOLATION, INVALID_PARAMETER = 22, 31, 32, 87
SEM_TIMEOUT, OPERATION_ABORTED, NOT_CONNECTED, NO_SUCH_DEVICE = 121, 995, 1167, 433

_MISSING = (FILE_NOT_FOUND, PATH_NOT_FOUND, INVALID_NAME, NO_SUCH_DEVICE)
_TAKEN = (ACCESS_DENIED, SHARING_VIOLATION)
_GONE = (BAD_COMMAND, GEN_FAILURE, ACCESS_DENIED, OPERATION_ABORTED, NOT_CONNECTED, NO_SUCH_DEVICE)
_STUCK = "the port answers too slowly or not at all"
_STUCK_HINT = (
    "often a Bluetooth port with nothing at its other end, or a hung driver: unplug the adapter and plug it in"
)


def windows_code(error: Exception) -> int:
    """Return the Windows error number that an error carries or quotes, 0 when there is none."""
    own = getattr(error, "winerror", None)
    if isinstance(own, int):
        return own
    quoted = _WINDOWS_CODE.search(str(error))
    return int(quoted[1]) if quoted else 0


def why_not(line: Line, error: Exception) -> tuple[str, str]:
    """Return why opening `line` failed, and what to do."""
    code, text, windows = getattr(error, "errno", None), str(error), windows_code(error)
    if not isinstance(error, OSError | ValueError) or windows == INVALID_PARAMETER:
        settings = f"{line.baud} {line.bits}{line.parity}{line.stop}"
        return f"the adapter refuses {settings}", "try another baud rate or parity, or another adapter"
    if code == errno.ENOENT or windows in _MISSING:
        there = ", ".join(sorted(port.device for port in list_ports.comports())) or "none"
        return "no such port", f"is the adapter plugged in? ports here: {there}"
    if code in (errno.EAGAIN, errno.EBUSY) or windows in _TAKEN:
        return f"port is busy{_holder(line.port)}", "another program has it open; close that first"
    if windows in (SEM_TIMEOUT, GEN_FAILURE):
        return _STUCK, _STUCK_HINT
    if code == errno.EACCES:
        group = _group(line.port)
        return "no permission", (
            f"the port belongs to group {group}: sudo usermod -aG {group} $USER, then log in again"
            if group
            else "run as a user who may open this port"
        )
    return f"cannot be opened ({text})", "check the settings that this adapter supports"


def why_gone(error: Exception) -> str:
    """Return why a port that was open cannot be spoken to any more."""
    windows = windows_code(error)
    if windows == SEM_TIMEOUT:
        return _STUCK
    return "the port went away" + (f" (Windows error {windows})" if windows in _GONE else f" ({error})")


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
    """Say which programs have a port open, as far as this system tells (Linux, processes of this user)."""
    found: dict[str, str] = {}
    try:
        wanted = os.path.realpath(port)
        for entry in Path("/proc").glob("[0-9]*/fd/*"):
            number = entry.parts[2]
            if number != str(os.getpid()) and number not in found and _points_to(entry, wanted):
                name = Path("/proc", number, "comm").read_text().strip()
                found[number] = f"{name}, process {number}"
    except OSError:  # a process ended while we looked
        pass
    return f" (held by {'; '.join(found.values())})" if found else ""


def _points_to(entry: Path, wanted: str) -> bool:
    try:
        return str(entry.readlink()) == wanted
    except OSError:
        return False
