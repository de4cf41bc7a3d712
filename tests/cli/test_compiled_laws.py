"""Compiled laws kept between runs: used again for the same law alone, and never the reason why something fails."""

from __future__ import annotations

import types
from pathlib import Path
from typing import Any

from ahgateway.cli.compiled_laws import keep
from ahgateway.core.compiling import njit
from ahgateway.core.controllers import CONTROLLERS
from ahgateway.core.sieve import sieve


def added(x: int) -> int:
    return x + 1


def made(constant: int) -> types.FunctionType:
    """The same function with another constant in it."""
    code = added.__code__.replace(co_consts=tuple(constant if each == 1 else each for each in added.__code__.co_consts))
    # What is read again looks for the module by its name.
    return types.FunctionType(code, {"__name__": keep.__module__})


def compiled(folder: Path, constant: int) -> tuple[int, int]:
    """What the function gives of 41, and how often its compiled form was read instead of made."""
    function = made(constant)
    dispatcher = njit()(function)
    keep(folder, dispatcher, [function])
    return dispatcher(41), sum(dispatcher.stats.cache_hits.values())


def test_a_law_is_read_again_and_another_one_is_not_taken_for_it(tmp_path: Path) -> None:
    assert (42, 0) == compiled(tmp_path, 1)
    assert (42, 1) == compiled(tmp_path, 1)
    assert (43, 0) == compiled(tmp_path, 2)


def names(dispatcher: Any, found: dict[Any, str]) -> set[str]:
    """Names of a compiled function and of all that it calls by a name of its own."""
    function = getattr(dispatcher, "py_func", None)
    if function is not None and function not in found:
        found[function] = function.__qualname__
        for name in function.__code__.co_names:
            names(function.__globals__.get(name), found)
    return set(found.values())


def test_no_function_of_one_law_has_the_name_of_one_of_another() -> None:
    """Kept forms of both are linked by these names: of two that are the same, one would be called for the other."""
    dpid, dpide = (names(sieve(CONTROLLERS[name], True), {}) for name in ("DPID", "DPIDE"))

    assert len(dpid) > 30
    assert len(dpide) > 30
    assert set() == dpid & dpide


def test_a_damaged_file_costs_time_alone(tmp_path: Path) -> None:
    compiled(tmp_path, 1)
    for each in tmp_path.rglob("*.nbc"):
        each.write_bytes(each.read_bytes()[:100])
    assert (42, 0) == compiled(tmp_path, 1)


def test_a_folder_that_cannot_be_written_to_keeps_nothing_anywhere(tmp_path: Path) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("in the way", encoding="utf-8")
    assert (42, 0) == compiled(blocked, 1)
    assert (42, 0) == compiled(blocked, 1)
