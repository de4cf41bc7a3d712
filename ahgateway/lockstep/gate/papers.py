"""The papers of one gate: its lock on this machine and its journal, held together from opening to closing."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Any

from ahgateway.clock import SECOND, Clock
from ahgateway.errors import StateError
from ahgateway.lockstep.gate.journal import Journal, Record, Told
from ahgateway.lockstep.gate.session import Session, last_session
from ahgateway.transports.machine_lock import MachineLock, hold

INTERVAL_MAX_NS = 3600 * SECOND
"""The longest that a profile may ask for between two writes of an operand."""


class Papers:
    """Lock and journal of one loop; what is appended needs them open.

    Args:
        path: The journal.
        lease: The lock.
        clock: Gives UTC.
        loop: The loop's tag, for messages.
        who: Who asks.
        told: Told of every record.

    Attributes:
        path: The journal.
    """

    def __init__(self, path: Path, lease: Path, clock: Clock, loop: str, who: str, told: Told | None) -> None:
        self.path = path
        self._lease = lease
        self._clock, self._loop, self._who, self._told = clock, loop, who, told
        self._journal: Journal | None = None
        self._lock: MachineLock | None = None

    @property
    def anchor(self) -> str:
        """Hash of the last record, empty before the first opening."""
        return self._journal.last if self._journal is not None else ""

    def open(self) -> Session | None:
        """Take the lock, check the whole journal, and return the last session it tells of; open twice is open once.

        Raises:
            StateError: Another gateway has the loop armed, or the journal cannot be trusted.
        """
        if self._lock is None:
            lock = hold(
                self._lease, f"loop {self._loop} is armed by another gateway on this machine",
                "end that one first; only one may write", who=self._who, loop=self._loop,
            )  # fmt: skip
            try:
                self._journal = Journal(self.path, self._clock, self._told)
            except BaseException:
                lock.release()
                raise
            self._lock = lock
        assert self._journal is not None
        return last_session(self._journal.records)

    def close(self) -> None:
        """Give the lock back; may be called twice."""
        if self._lock is not None:
            self._lock.release(removes=True)
            self._lock = None

    def append(self, kind: str, **facts: Any) -> Record:
        """Add a record and return it when it is on the disk.

        Raises:
            StateError: It could not be written.
        """
        assert self._journal is not None
        return self._journal.append(kind, **facts)

    def written_ns(self) -> dict[str, int]:
        """Return when each operand was written last, by an earlier run too, in the clock's monotonic time."""
        assert self._journal is not None
        now_ns, utc_ns = self._clock.now_ns(), self._clock.utc_ns()
        found: dict[str, int] = {}
        behind = ""
        for record in reversed(self._journal.records):
            age_ns = utc_ns - int(record["utc_ns"])
            if age_ns > INTERVAL_MAX_NS:
                break
            # A time in the future is one of a clock that was set back meanwhile, and tells nothing.
            if record["kind"] == "write" and behind != "refused" and age_ns >= 0:
                for item in record["items"]:
                    found.setdefault(item["operand"], now_ns - age_ns)
            behind = record["kind"]
        return found

    def note(self, kind: str, **facts: Any) -> None:
        """Add to the journal; what it tells has happened already and is not undone by a full disk."""
        with contextlib.suppress(StateError):
            self.append(kind, **facts)
