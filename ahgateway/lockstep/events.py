"""What a follower reports beside executions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, slots=True)
class Change:
    """An operand that somebody or something outside the instruction changed, raw words and values before and after."""

    operand: str
    old: Any
    new: Any


@dataclass(frozen=True, slots=True)
class Finding:
    """Something a person should look at that is no verdict; `name` is stable, `is_over` tells that it ended."""

    name: str
    text: str
    hint: str = ""
    is_over: bool = False


@dataclass(frozen=True, slots=True)
class Lost:
    """Executions of which nothing will ever be seen: records that were overwritten or torn, a gap in the ring.

    Attributes:
        executions: How many, as far as it can be told.
        records: Records lost; 0 where none was, but what the instruction remembers is not known any more.
        why: One sentence.
    """

    executions: float
    records: int
    why: str
