"""The axes of MELSEC PID on which the manual is silent (spec C.3, C.7), each value named."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple


class NumberFormat(IntEnum):
    """What the sum of the increments is, and what (d) shows of it (spec C.7/1)."""

    REAL = 0
    INTEGER_IO = 1
    INTEGER_SUM = 2


class AlarmInput(IntEnum):
    """Which process value the input variation alarm watches (spec C.7/2)."""

    FILTERED = 0
    RAW = 1


class Variation(IntEnum):
    """Which difference counts as an increase (spec C.7/3)."""

    NEW_MINUS_OLD = 0
    OLD_MINUS_NEW = 1


class DestinationWritten(IntEnum):
    """What becomes of a value that the program writes into (d) while running (spec C.7/4)."""

    IGNORED = 0
    TAKEN = 1


class ActionChange(IntEnum):
    """What a change of ACT.0 does to the history (spec C.7/5)."""

    LITERAL = 0
    NEGATED = 1


class FirstExecution(IntEnum):
    """What the history holds when the contact turns on (spec C.3)."""

    SEEDED = 0
    CLEARED = 1


class MelsecDialect(NamedTuple):
    """One way to read the chapter.

    Attributes:
        number_format: REAL sum shown as it is; REAL sum, (d) rounded half to even; the sum itself rounded.
        alarm_input: PV after or before the input filter.
        variation: Sign of a variation.
        destination_written: (d) written from outside while running.
        action_change: EV(n-1) and D(n-1) when the direction changes: as they are, or with the other sign.
        first_execution: History equal to the present values, or the cleared work area, all zeros.
    """

    number_format: NumberFormat = NumberFormat.REAL
    alarm_input: AlarmInput = AlarmInput.FILTERED
    variation: Variation = Variation.NEW_MINUS_OLD
    destination_written: DestinationWritten = DestinationWritten.IGNORED
    action_change: ActionChange = ActionChange.LITERAL
    first_execution: FirstExecution = FirstExecution.SEEDED


DEFAULT = MelsecDialect()

AXES: dict[str, type[IntEnum]] = {
    "number_format": NumberFormat,
    "alarm_input": AlarmInput,
    "variation": Variation,
    "destination_written": DestinationWritten,
    "action_change": ActionChange,
    "first_execution": FirstExecution,
}
"""Axis name in a profile to its enum; a value is written in lower case, `number_format = "integer_io"`."""
