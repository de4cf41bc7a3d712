"""The controllers, each as one `Controller`: a table of operands, a pure step, and what of its state can be seen."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ahgateway.core.controllers import dpid, dpide
from ahgateway.core.operands import Operand
from ahgateway.core.real import REAL


@dataclass(frozen=True, slots=True)
class Seen:
    """A REAL in the PLC's memory that the instruction writes.

    Attributes:
        name: What people call it: the operand, or the operand with its double word, `I_MV+1`.
        operand: Operand in whose words it stands.
        dword: Offset in double words from that operand's first word.
        attr: Attribute of the state, or of the terms for what is no state (`mout`).
    """

    name: str
    operand: str
    dword: int
    attr: str


@dataclass(frozen=True, slots=True)
class Controller:
    """One instruction.

    Attributes:
        name: The manual's name, as profiles write it.
        operands: Every operand in the instruction's order.
        seen: What the instruction leaves in memory, in the order in which a difference is blamed.
        inputs: NamedTuple of what a step reads; attributes are operand names in lower case.
        state: NamedTuple of what a step leaves; its defaults are a cold start.
        terms: NamedTuple type of what a step publishes.
        step: `step(inputs, state, dialect, ts)` to the next state and terms; pure.
        nominal_ts: Configured sampling time in s, from the inputs.
        recall: Bounds of the hidden state after an execution of which inputs, block and dialect are known.
        law_ts: Ts as the law takes it, from inputs, dialect and, where that measures, ticks of its clock; None: as
            configured.
    """

    name: str
    operands: tuple[Operand, ...]
    seen: tuple[Seen, ...]
    inputs: Callable[..., Any]
    state: Callable[..., Any]
    terms: Callable[..., Any]
    step: Callable[[Any, Any, Any, REAL], tuple[Any, Any]]
    nominal_ts: Callable[[Any], REAL]
    recall: Callable[..., tuple[tuple[Any, Any], ...]]
    law_ts: Callable[[Any, Any, int], REAL] | None = None

    def operand(self, name: str) -> Operand:
        """Return the row of the operand with the manual's name; KeyError for another name."""
        for row in self.operands:
            if row.name == name:
                return row
        raise KeyError(name)

    def ts(self, inputs: Any, dialect: Any, ticks: int = 0) -> REAL:
        """Return Ts as `step` takes it in this dialect; `ticks` of the dialect's clock count where it measures."""
        return self.nominal_ts(inputs) if self.law_ts is None else self.law_ts(inputs, dialect, ticks)

    @property
    def input_names(self) -> tuple[str, ...]:
        """Attribute names of what a step reads, in order."""
        fields: tuple[str, ...] = self.inputs._fields  # type: ignore[attr-defined]
        return fields


DPID = Controller(
    "DPID",
    dpid.OPERANDS,
    (
        Seen("I_MV+1", "I_MV", 1, "pv1"),
        Seen("I_MV", "I_MV", 0, "i"),
        Seen("MV", "MV", 0, "mv"),
        Seen("MOUT", "MOUT", 0, "mout"),
    ),
    dpid.Operands,
    dpid.State,
    dpid.Terms,
    dpid.step,
    dpid.nominal_ts,
    dpid.recall,
    dpid.law_ts,
)

DPIDE = Controller(
    "DPIDE",
    dpide.OPERANDS,
    (
        Seen("I_MV+6", "I_MV", 6, "pv1"),
        Seen("I_MV", "I_MV", 0, "i"),
        Seen("MV", "MV", 0, "mv"),
        Seen("MOUT", "MOUT", 0, "mout"),
    ),
    dpide.Operands,
    dpide.State,
    dpide.Terms,
    dpide.step,
    dpide.nominal_ts,
    dpide.recall,
    dpide.law_ts,
)

CONTROLLERS: dict[str, Controller] = {controller.name: controller for controller in (DPID, DPIDE)}
