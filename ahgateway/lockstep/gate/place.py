"""Where the papers of a PLC stand: what tells one loop, or one PLC, from all others, whatever people call them."""

from __future__ import annotations

import hashlib
from pathlib import Path

from ahgateway.codec import block
from ahgateway.codec.station import Loop, Station


def journal_path(directory: Path, station: Station, loop: Loop) -> Path:
    """Return where a loop's journal stands: target, unit and the place of its memory name it."""
    place = block.address(loop, station.devices, loop.controller.roles.place)
    text = f"{_base(station.target)} {station.unit} {place.table.value} {place.address}"
    return directory / f"{_digest(text)}.jsonl"


def bench_path(directory: Path, target: str) -> Path:
    """Return where the lock of a whole PLC stands."""
    return directory / f"bench-{_digest(_base(target))}.lock"


def _base(target: str) -> str:
    return target.partition("?")[0].rstrip("/").lower()


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode("utf-8")).hexdigest()[:16]
