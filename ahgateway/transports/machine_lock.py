"""What only one process on this machine may hold at a time. The only module that touches file locks.

A lock of the operating system on a file: it ends with the process that holds it, however that ends, so nothing outlives
a kill and nothing has to be guessed stale. The file's text says who holds it, for messages.
"""

from __future__ import annotations

import contextlib
import json
import os
import sys
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

from ahgateway.errors import StateError

LOCKED_AT = 1 << 30
"""Where the byte stands that Windows locks: far behind the text, which others may read."""
TRIES_MAX = 100
"""A file that is removed while it is being locked is made anew; so often in a row it does not happen."""

if sys.platform == "win32":
    import msvcrt

    def _lock(descriptor: int) -> None:
        os.lseek(descriptor, LOCKED_AT, os.SEEK_SET)
        msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)

    def _is_there(descriptor: int, path: Path) -> bool:
        return True  # a file that somebody has open is not removed here

else:
    import fcntl

    def _lock(descriptor: int) -> None:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)

    def _is_there(descriptor: int, path: Path) -> bool:
        try:
            return os.path.samestat(os.fstat(descriptor), path.stat())
        except FileNotFoundError:
            return False


class Holder(NamedTuple):
    """Who holds what we wanted, as far as the file says: process number (0 not known) and name."""

    pid: int = 0
    who: str = ""


class MachineLock:
    """Something that is ours until `release` or the end of the process; made by `take`."""

    def __init__(self, path: Path, file: BinaryIO) -> None:
        self.path = path
        self._file = file

    def release(self, *, removes: bool = False) -> None:
        """Give it back, with `removes` together with its file; may be called twice."""
        if self._file.closed:
            return
        if removes and sys.platform != "win32":
            with contextlib.suppress(OSError):
                self.path.unlink()  # while it is still ours: nobody else can have locked this very file
        self._file.close()


def take(path: Path, **facts: Any) -> MachineLock | Holder:
    """Take the lock on `path`, writing `facts` into it, or say who has it.

    Raises:
        OSError: The file can be neither made nor opened.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    for _ in range(TRIES_MAX):
        file = path.open("a+b")
        try:
            _lock(file.fileno())
        except OSError:
            with file:
                return _holder(file)
        if _is_there(file.fileno(), path):
            break
        file.close()
    file.seek(0)
    file.truncate()
    file.write(json.dumps({"pid": os.getpid(), **facts}, ensure_ascii=False).encode("utf-8"))
    file.flush()
    return MachineLock(path, file)


def hold(path: Path, taken: str, hint: str, **facts: Any) -> MachineLock:
    """Take the lock on `path`, or say in one sentence who has it.

    Args:
        path: Where it stands.
        taken: What is said when somebody has it; who that is follows.
        hint: What to do then.
        facts: What others are told of us.

    Raises:
        StateError: Somebody has it, or it cannot be opened.
    """
    try:
        found = take(path, **facts)
    except OSError as error:
        raise StateError(
            f"lock {path}: cannot be opened: {error.strerror}",
            hint="is there room, and may you write there?",
        ) from error
    if isinstance(found, MachineLock):
        return found
    holder = f" (process {found.pid}, {found.who or 'nobody named'})" if found.pid else ""
    raise StateError(f"{taken}{holder}", hint=hint)


def _holder(file: BinaryIO) -> Holder:
    try:
        file.seek(0)
        facts = json.loads(file.read(4096))
        return Holder(int(facts["pid"]), str(facts.get("who") or ""))
    except (OSError, ValueError, KeyError, TypeError):
        return Holder()
