"""Compiled laws kept between runs: used again for the same law alone, and never the reason why something fails."""

from __future__ import annotations

import types
from collections.abc import Iterator
from pathlib import Path

import pytest

from ahgateway.core import kept
from ahgateway.core.compiling import njit


def added(x: int) -> int:
    return x + 1


def made(constant: int) -> types.FunctionType:
    """The same function with another constant in it."""
    code = added.__code__.replace(co_consts=tuple(constant if each == 1 else each for each in added.__code__.co_consts))
    return types.FunctionType(code, {})


@pytest.fixture
def folder(tmp_path: Path) -> Iterator[Path]:
    before = kept._FOLDER[0]
    kept.keep_in(str(tmp_path))
    yield tmp_path
    kept.keep_in(before)


def compiled(constant: int) -> tuple[int, int]:
    """What the function gives of 41, and how often its compiled form was read instead of made."""
    function = made(constant)
    dispatcher = njit()(function)
    kept.keep(dispatcher, [function])
    return dispatcher(41), sum(dispatcher.stats.cache_hits.values())


def test_a_law_is_read_again_and_another_one_is_not_taken_for_it(folder: Path) -> None:
    assert (42, 0) == compiled(1)
    assert (42, 1) == compiled(1)
    assert (43, 0) == compiled(2)


def test_a_damaged_file_costs_time_alone(folder: Path) -> None:
    compiled(1)
    for each in folder.rglob("*.nbc"):
        each.write_bytes(each.read_bytes()[:100])
    assert (42, 0) == compiled(1)


def test_a_folder_that_cannot_be_made_keeps_nothing(folder: Path) -> None:
    blocked = folder / "file"
    blocked.write_text("in the way", encoding="utf-8")
    kept.keep_in(str(blocked))
    assert (42, 0) == compiled(1)
