"""What a command sees and writes without a monitor, on its way into a recording: pictures, requests, journal.

Commissioning, experiments and single writes take pictures where they need them, each count from 0. Here they become
one history: numbered anew in the order of time and judged by a follower of their own, as `replay` does it again.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from ahgateway.apps.monitor import Report, Sample
from ahgateway.apps.record import Tape
from ahgateway.codec.station import Loop
from ahgateway.lockstep.follow import Follower
from ahgateway.lockstep.picture import Picture

OUTCOMES = ("verified", "refused", "mismatch")
"""What ends a request in the journal; `doubt` before them says that nobody answered, and a fresh read decided."""

OPEN = "open"
"""Outcome of a request whose end is not in the journal: nobody knows what stands there."""

INTENTS = ("write", "restore")


class Witness:
    """Keeps one loop's pictures and writes; does nothing without a tape.

    Args:
        loop: The loop, as it stands in the recording.
        tape: Where everything goes.
    """

    def __init__(self, loop: Loop, tape: Tape | None) -> None:
        self._loop = loop
        self._tape = tape
        self._follower = Follower(loop)
        self._tick = 0
        self._intent: Mapping[str, Any] | None = None
        self._doubt = ""

    def see(self, picture: Picture) -> None:
        """Keep a picture and what follows from it; hand this to whoever takes pictures."""
        if self._tape is None:
            return
        picture, self._tick = replace(picture, tick=self._tick), self._tick + 1
        for event in [*self._follower.see(picture), Sample(picture)]:
            self._tape.take(Report(picture.utc_ns, self._loop.name, picture.tick, event))

    def told(self, path: Path, record: Mapping[str, Any]) -> None:
        """Keep a record of the gate's journal, and each write with its outcome; hand this to a gate."""
        if self._tape is None:
            return
        utc_ns, kind = int(record["utc_ns"]), str(record["kind"])
        found = {"kind": "journal", "loop": self._loop.name, "file": str(path), "record": dict(record)}
        self._tape.recorder.event(utc_ns, self._loop.name, max(0, self._tick - 1), "journal", found)
        if kind == "doubt":
            self._doubt = str(record["text"])
            return
        if self._intent is not None:
            self._keep(self._intent, record, kind if kind in OUTCOMES else OPEN)
        self._intent, self._doubt = record if kind in INTENTS else None, ""

    def _keep(self, intent: Mapping[str, Any], record: Mapping[str, Any], outcome: str) -> None:
        assert self._tape is not None
        for item in intent["items"]:
            found = {
                **{key: item[key] for key in ("device", "old", "new", "old_value", "new_value")},
                "kind": intent["kind"],
                "outcome": outcome,
                "text": "" if outcome == OPEN else record.get("text", ""),
                "doubt": self._doubt,
                "who": intent["who"],
                "why": intent["why"],
                "journal": record["hash"],
            }
            self._tape.recorder.write(int(record["utc_ns"]), self._loop.name, item["operand"], found)
