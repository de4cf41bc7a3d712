"""What an operand of a PID instruction is. The tables themselves stand with their controllers."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum


class Kind(Enum):
    """How an operand is stored in the PLC."""

    BOOL = "BOOL"
    REAL = "REAL"
    DINT = "DINT"
    INT = "INT"
    BLOCK = "BLOCK"


class Access(Enum):
    """Who writes it: the program or a person (IN), the instruction (OUT), both (IN_OUT), the instruction's memory."""

    IN = "in"
    OUT = "out"
    IN_OUT = "in/out"
    STATE = "state"


class Source(Enum):
    """How a fact is known."""

    MANUAL = "MANUAL"
    MEASURED = "MEASURED"
    ASSUMED = "ASSUMED"


@dataclass(frozen=True, slots=True)
class Operand:
    """One operand in the manual's spelling.

    Attributes:
        name: The manual's name, `Ti_Ki`; its lower case is the attribute name in the law.
        kind: Storage; REAL and DINT take two words, low word first.
        unit: Engineering unit, `PV` for the loop's process unit, `MV` for its output unit, `` for none.
        default: What an unconnected operand holds (ASSUMED, spec A.1 and B.1); None where there is none.
        minimum: Smallest documented value, None for no limit.
        maximum: Largest documented value, None for no limit.
        access: Who writes it.
        source: Where range and meaning come from.
        text: What it does, one sentence without a full stop.
        words: Length in words; BOOL has 0.
        attr: Name in the law's tuples: the manual's name in lower case.
    """

    name: str
    kind: Kind
    unit: str
    default: float | int | bool | None
    minimum: float | None
    maximum: float | None
    access: Access
    source: Source
    text: str
    words: int
    attr: str = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "attr", self.name.lower())
