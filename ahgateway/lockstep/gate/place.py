"""Where the papers of a PLC stand: what tells one loop, or one PLC, from all others, whatever people call them."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import NamedTuple

from ahgateway.codec import block
from ahgateway.codec.station import Loop, Station


class Folders(NamedTuple):
    """Journals stand where a person wants them, leases where every gateway of this machine finds them."""

    journals: Path
    leases: Path


Place = Path | Folders
"""A path alone is for both."""


def journal_path(place: Place, station: Station, loop: Loop) -> Path:
    """Return where a loop's journal stands: target, unit and the place of its memory name it."""
    return _folders(place).journals / f"{_loop_digest(station, loop)}.jsonl"


def lease_path(place: Place, station: Station, loop: Loop) -> Path:
    """Return where the lock of an armed loop stands."""
    return _folders(place).leases / f"{_loop_digest(station, loop)}.lease"


def bench_path(place: Place, target: str) -> Path:
    """Return where the lock of a whole PLC stands."""
    return _folders(place).leases / f"bench-{_digest(_base(target))}.lock"


def _folders(place: Place) -> Folders:
    return Folders(place, place) if isinstance(place, Path) else place


def _loop_digest(station: Station, loop: Loop) -> str:
    at = block.address(loop, station.devices, loop.controller.roles.place)
    return _digest(f"{_base(station.target)} {station.unit} {at.table.value} {at.address}")


def _base(target: str) -> str:
    """The target without options, and without the port that it would have anyway."""
    return target.partition("?")[0].rstrip("/").lower().removesuffix(":502")


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode("utf-8")).hexdigest()[:16]
