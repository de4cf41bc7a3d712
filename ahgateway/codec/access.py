"""What is asked of a PLC: tables, spans of addresses, read and write requests. No bytes, no I/O."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum


class Table(Enum):
    """The four address spaces of Modbus, named as the standard names them."""

    COIL = "coil"
    DISCRETE = "discrete input"
    HOLDING = "holding register"
    INPUT = "input register"

    @property
    def is_bits(self) -> bool:
        """True for the tables of single bits, False for the tables of 16-bit words."""
        return self in (Table.COIL, Table.DISCRETE)


@dataclass(frozen=True, slots=True)
class Span:
    """Consecutive addresses of one table that belong together and are never split; `count` in bits or words."""

    table: Table
    address: int
    count: int

    @property
    def end(self) -> int:
        """First address behind the span."""
        return self.address + self.count


@dataclass(frozen=True, slots=True)
class Read:
    """Read `count` bits or words of `table` from the 0-based PDU address `address` of station `unit`.

    `is_command` says that it belongs to a write, before or behind it, and goes before polls as the write does.
    """

    unit: int
    table: Table
    address: int
    count: int
    is_command: bool = field(default=False, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Write:
    """Write `values` (0/1 for COIL, 0…65535 for HOLDING) from the 0-based PDU address `address` of station `unit`.

    One value goes out as function 5 or 6, several as 15 or 16, all in one request.
    """

    unit: int
    table: Table
    address: int
    values: tuple[int, ...]


Request = Read | Write
