"""A rolled run read as one: the parts that follow on from the one that was named, by name, number and run.

This file alone knows how parts are named and what makes two files parts of one run. Between two parts of a run nothing
is missing: what waited for the disk goes into the next one, and what was dropped stands in an event of its own.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from ahgateway.errors import StateError
from ahgateway.recording.packing import Block
from ahgateway.recording.reader import Damage, Event, Recording, Row

SAME = ("run", "station", "command", "target", "ahgateway")
"""Facts that all parts of a run share; `run` is missing in files of before it was written."""

_NUMBERED = re.compile(r"(?P<stem>.*)-(?P<number>\d{4,})", re.DOTALL)


def part_path(path: Path, number: int) -> Path:
    """Return the name of a part of `run.ahrec`: `run-0001.ahrec` is the first."""
    return path.with_name(f"{path.stem}-{number:04d}{path.suffix}")


def opened(path: str | Path, *, is_alone: bool = False) -> Recording:
    """Open a recording, with the parts that follow on from it unless it is to be read alone.

    Raises:
        StateError: As `Recording`.
    """
    first = Recording(path)
    rest = [] if is_alone else _behind(first)
    if not rest:
        return first
    first.close()
    return Parts(path, rest)


class Parts(Recording):
    """A recording and the parts behind it, read as one; facts and station are those of the first.

    Args:
        path: The first part.
        rest: The parts behind it, open, in order; they are closed with it.
    """

    def __init__(self, path: str | Path, rest: list[Recording]) -> None:
        super().__init__(path)
        self.rest = rest

    def close(self) -> None:
        super().close()
        for each in self.rest:
            each.close()

    @property
    def is_closed(self) -> bool:
        return self.rest[-1].is_closed

    def totals(self) -> tuple[int, int | None, int | None]:
        each = [super().totals(), *(part.totals() for part in self.rest)]
        first = [start for _, start, _ in each if start is not None]
        last = [end for _, _, end in each if end is not None]
        return sum(count for count, _, _ in each), min(first, default=None), max(last, default=None)

    def rows(self, loops: set[str] | None = None, since_ns: int | None = None) -> Iterator[Row]:
        yield from super().rows(loops, since_ns)
        for part in self.rest:
            yield from part.rows(loops, since_ns)

    def blocks(self, loop: str, since_ns: int | None = None, until_ns: int | None = None) -> Iterator[Block]:
        yield from super().blocks(loop, since_ns, until_ns)
        for part in self.rest:
            yield from part.blocks(loop, since_ns, until_ns)

    def verdicts(
        self, since_ns: int | None = None, until_ns: int | None = None
    ) -> Iterator[tuple[str, int, dict[str, Any]]]:
        yield from super().verdicts(since_ns, until_ns)
        for part in self.rest:
            yield from part.verdicts(since_ns, until_ns)

    def events(self, kind: str | None = None) -> Iterator[Event]:
        yield from super().events(kind)
        for part in self.rest:
            yield from part.events(kind)

    def writes(self) -> Iterator[tuple[int, str, str, dict[str, Any]]]:
        yield from super().writes()
        for part in self.rest:
            yield from part.writes()

    def notes(self) -> list[tuple[int, str]]:
        return [*super().notes(), *(note for part in self.rest for note in part.notes())]

    def frames(self, since_ns: int | None = None) -> Iterator[tuple[int, int, str, bytes]]:
        yield from super().frames(since_ns)
        for part in self.rest:
            yield from part.frames(since_ns)

    def check(self) -> Damage:
        found = [super().check(), *(part.check() for part in self.rest)]
        return Damage(sum(each.seconds for each in found), [text for each in found for text in each.texts])


def _behind(first: Recording) -> list[Recording]:
    """Open the parts behind one, as long as the next number is there and of the same run."""
    named = _NUMBERED.fullmatch(first.path.stem)
    found: list[Recording] = []
    if named is None:
        return found
    base = first.path.with_name(named["stem"] + first.path.suffix)
    before, number = first, int(named["number"])
    while True:
        number += 1
        try:
            after = Recording(part_path(base, number))
        except StateError:
            return found
        if not _follows(before, after):
            after.close()
            return found
        found.append(after)
        before = after


def _follows(before: Recording, after: Recording) -> bool:
    numbers = [int(each.meta.get("part", "1")) for each in (before, after)]
    return numbers[1] == numbers[0] + 1 and all(before.meta.get(name) == after.meta.get(name) for name in SAME)
