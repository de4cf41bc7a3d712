"""Wrong controllers by changing one line of a right one, and the comparison that must convict them."""

from __future__ import annotations

import inspect
from collections.abc import Sequence
from types import ModuleType
from typing import Any

import numpy as np

from ahgateway.core.real import REAL, bits


def mutant(module: ModuleType, old: str, new: str) -> ModuleType:
    """Return a copy of `module` in which the one occurrence of `old` reads `new`; ValueError unless it is just one."""
    source = inspect.getsource(module)
    if source.count(old) != 1:
        raise ValueError(f"{module.__name__} holds {source.count(old)} times {old!r}, a mutant needs 1")
    copy = ModuleType(module.__name__)
    exec(compile(source.replace(old, new), f"<mutant of {module.__name__}>", "exec"), copy.__dict__)
    return copy


def pattern(value: Any) -> Any:
    """REALs as their bits, so that the comparison sees every one."""
    return bits(REAL(value)) if isinstance(value, (float, np.floating)) else value


def first_difference(left: Sequence[Any], right: Sequence[Any]) -> tuple[int, str] | None:
    """Return step and name of the first term that differs in its bits, None when all agree."""
    for index, (ours, theirs) in enumerate(zip(left, right, strict=True)):
        for name, mine, other in zip(ours._fields, ours, theirs, strict=True):
            if pattern(mine) != pattern(other):
                return index, name
    return None
