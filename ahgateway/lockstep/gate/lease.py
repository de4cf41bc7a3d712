"""The lease: at most one gateway on this machine has one loop armed. The only module that touches file locks.

A lock of the operating system on a file that stays: it ends with the process that holds it, however that ends, so no
lease outlives a kill and none has to be guessed stale. The file's text says who holds it, for the message.
"""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import Any

from ahgateway.errors import StateError

LOCKED_AT = 1 << 30
"""Where the byte stands that Windows locks: far behind the text, which others may read."""

if sys.platform == "win32":
    import msvcrt

    def _lock(descriptor: int) -> None:
        os.lseek(descriptor, LOCKED_AT, os.SEEK_SET)
        msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)

else:
    import fcntl

    def _lock(descriptor: int) -> None:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)


class Lease:
    """The right to arm one loop; held until `release` or the end of the process.

    Args:
        path: The file.
        what: Names the loop in the message.
        facts: Who holds it, for others to read.

    Raises:
        StateError: Somebody else holds it.
    """

    def __init__(self, path: Path, what: str, **facts: Any) -> None:
        self.path = path
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file = path.open("a+b")
        except OSError as error:
            raise StateError(f"lease {path}: cannot be opened: {error.strerror}") from error
        try:
            _lock(self._file.fileno())
        except OSError as error:
            holder = self._holder()
            self._file.close()
            raise StateError(
                f"{what} is armed by another gateway on this machine{holder}",
                hint="end that one first; only one may write",
            ) from error
        self._file.seek(0)
        self._file.truncate()
        self._file.write(json.dumps({"pid": os.getpid(), **facts}, ensure_ascii=False).encode("utf-8"))
        self._file.flush()

    def release(self) -> None:
        """Give it back; may be called twice."""
        if not self._file.closed:
            self._file.close()

    def _holder(self) -> str:
        try:
            self._file.seek(0)
            facts = json.loads(self._file.read(4096))
            return f" (process {facts['pid']}, {facts.get('who') or 'nobody named'})"
        except (OSError, ValueError, KeyError, TypeError):
            return ""
