"""How many connections this machine may have to one host and port, whichever processes make them.

A PLC has few connections, and a second gateway on the same laptop must not take the one that the HMI needs. Each
connection holds one of `connections_max` numbered slots, a lock that ends with its process (`machine_lock`).
"""

from __future__ import annotations

import re
import tempfile
from pathlib import Path

from ahgateway.errors import LinkError
from ahgateway.transports.machine_lock import Holder, MachineLock, take

_FOLDER = "connections"


def take_slot(host: str, port: int, count_max: int, target: str) -> MachineLock:
    """Take the lowest free slot; give it back with `release(removes=True)`.

    Args:
        host: Name or address as the user gave it.
        port: TCP port.
        count_max: How many there are.
        target: How the error names the link.

    Raises:
        LinkError: All are taken, or no directory can hold the locks.
    """
    name = f"{re.sub(r'[^A-Za-z0-9.-]', '_', host)}-{port}"
    holders = []
    for number in range(1, count_max + 1):
        found = _take(f"{name}-{number}.lock", target)
        if isinstance(found, MachineLock):
            return found
        holders.append(found.pid)
    processes = ", ".join(str(pid) if pid else "unknown" for pid in sorted(set(holders)))
    plural = "" if count_max == 1 else "s"
    raise LinkError(
        f"{target}: {count_max} connection{plural} to it from this machine, as many as the pacing allows "
        f"(process {processes})",
        hint="close another, or raise connections_max in [station.pacing]",
    )


def _take(name: str, target: str) -> MachineLock | Holder:
    from platformdirs import user_state_path

    # A machine where nothing may be kept still has a place for what is over tomorrow.
    places = (user_state_path("ahgateway", appauthor=False), Path(tempfile.gettempdir()) / "ahgateway")
    errors = []
    for place in places:
        try:
            return take(place / _FOLDER / name)
        except OSError as error:
            errors.append(f"{place}: {error.strerror}")
    raise LinkError(
        f"{target}: connections cannot be counted: {'; '.join(errors)}",
        hint="give this user a directory to write to, such as TMPDIR or XDG_STATE_HOME",
    )
