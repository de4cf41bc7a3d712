"""What a controller is to the rest of the house: a table of operands, a pure step, what of its state can be seen.

This file knows no instruction; the list of them stands in `core.controllers`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from enum import IntEnum
from typing import Any

import numpy as np

from ahgateway.core import dialect as delta_dialect
from ahgateway.core.controllers import looks
from ahgateway.core.operands import Kind, Operand
from ahgateway.core.real import REAL


@dataclass(frozen=True, slots=True)
class Seen:
    """A value in the PLC's memory that the instruction writes.

    Attributes:
        name: What people call it: the operand, or the operand with its double word, `I_MV+1`.
        operand: Operand in whose words it stands.
        dword: Offset in double words from that operand's first word.
        attr: Attribute of the state, or of the terms for what is no state (`mout`).
        kind: How it is stored.
        place: Where in the state it lives, `core.i`, when the terms publish it; empty for nowhere; None: `attr` is
            looked up in the state first.
    """

    name: str
    operand: str
    dword: int
    attr: str
    kind: Kind = Kind.REAL
    place: str | None = None

    def value(self, state: Any, terms: Any) -> Any:
        """Return what an execution leaves there, before it is stored."""
        if self.place is None and hasattr(state, self.attr):
            return getattr(state, self.attr)
        return getattr(terms, self.attr)

    def stored(self, state: Any, terms: Any) -> Any:
        """Return it as its register holds it; whole numbers are rounded half to even (ASSUMED, spec C.7/1)."""
        value = self.value(state, terms)
        if self.kind is Kind.REAL:
            return value
        if self.kind is Kind.BOOL:
            return bool(value)
        return int(np.rint(value)) if isinstance(value, np.floating) else int(value)

    def path(self, state: Any) -> str:
        """Return where in the state it lives, dotted; empty for nowhere."""
        if self.place is None:
            return self.attr if hasattr(state, self.attr) else ""
        return self.place


def replaced(state: Any, path: str, value: Any) -> Any:
    """Return a state with one field replaced; the path is dotted, `core.i`."""
    head, _, rest = path.partition(".")
    if rest:
        return state._replace(**{head: replaced(getattr(state, head), rest, value)})
    return state._replace(**{head: value})


@dataclass(frozen=True, slots=True)
class Roles:
    """What a controller calls the things that every loop has.

    Attributes:
        sv: Operand with the target value.
        pvs: Operands that can hold the process value; the first is the usual one.
        mv: Seen value that people call its output.
        integral: Seen value that holds the integral; empty when none does.
        computed: Seen values that only the law changes: while they stand still, an execution proves little.
        writable: Seen values that people may write, so that a change of them alone need not be an execution.
        held: The block keeps its own copy of the process value, so that its operand is what the last execution read.
        published_pv: Seen value that shows the process value as the law took it; empty when none does.
        starts: When a block that is met running becomes known, for people; empty when that is always.
        modes: Operands by which an operator takes a loop over.
        manual: Operand that puts the loop in manual while it is `is_manual_when`; empty when there is none.
        is_manual_when: What `manual` holds in manual.
        mout: Operand with the manual value; empty when there is none.
        follows: Operand that lets `mout` follow the output in automatic while it is TRUE; empty when there is none.
        place: Operand whose place tells this block from all others: no two blocks can share it.
        gains: Gains and times that no sense is negative in.
        dead_band: Operand with the dead band; empty when there is none.
        signals: Operands beside `pvs` that the process itself writes.
        together: Operands of which several in one write must land in one request.
    """

    sv: str = "SV"
    pvs: tuple[str, ...] = ("PV",)
    mv: str = "MV"
    integral: str = "I_MV"
    computed: tuple[str, ...] = ("I_MV", "MV")
    writable: frozenset[str] = frozenset({"MOUT", "I_MV"})
    held: bool = False
    published_pv: str = ""
    starts: str = ""
    modes: tuple[str, ...] = ("PID_RUN", "PID_MODE", "PID_MAN")
    manual: str = "PID_MAN"
    is_manual_when: bool = True
    mout: str = "MOUT"
    follows: str = "MOUT_AUTO"
    place: str = "I_MV"
    gains: tuple[str, ...] = ("Kp", "Ki", "Kd", "Kc_Kp", "Ti_Ki", "Td_Kd", "Tf")
    dead_band: str = "ERR_DBW"
    signals: tuple[str, ...] = ()
    together: tuple[frozenset[str], ...] = (
        frozenset({"MV_MAX", "MV_MIN"}),
        frozenset({"Kp", "Ki", "Kd"}),
        frozenset({"Kc_Kp", "Ti_Ki", "Td_Kd", "Tf"}),
    )


def _delta_computes(inputs: Any) -> bool:
    return bool(inputs.pid_run and inputs.pid_mode != 1)


def _delta_tunes(inputs: Any, seen: Mapping[str, Any]) -> bool:
    return bool(inputs.pid_mode == 1)


def _nothing_veiled(state: Any) -> frozenset[str]:
    return frozenset()


def _not_veiled(before: Any, after: Any) -> Any:
    return after


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
        dialect: The default dialect; its type is the controller's own.
        axes: Axis name in a profile to its enum.
        numbers: Axes of the dialect that are numbers.
        roles: What this controller calls SV, PV, MV.
        computes: Tells from the inputs whether an execution computes the law.
        tunes: Tells from inputs and seen values whether a tuner, of which no law is known, is at work.
        begin: Bounds of the hidden state from inputs, seen values by `attr`, those before, and dialect, for a
            controller whose `recall` tells too little; () when nothing is known.
        used: Inputs with each process value that fits what the block published of it, from inputs and seen values by
            `attr`; None when the block publishes nothing of it.
        rejoin: Bounds of a state once it goes on from what is shown, by `attr`, where more is hidden than that.
        limits: Lower and upper limit of the output as operand and value, from the inputs; None where none is in force.
        rises: Tells from the inputs whether the output rises while the process value is below the setpoint.
        service: Why the law does not move the output, from inputs and seen values by name; () when it does.
        comes_back: Why the block would not be as found behind a manual time; empty when it would.
        veiled: Names of seen values that a state cannot predict, because what they come from is not known yet.
        veil: Keeps in the state after a step what was not known before it.
        pv_dword: Double word of I_MV in which the manual has the PV of the last execution; 0 for other controllers.
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

    dialect: Any = delta_dialect.DEFAULT
    axes: Mapping[str, type[IntEnum]] = field(default_factory=lambda: delta_dialect.AXES)
    numbers: tuple[str, ...] = ()
    roles: Roles = Roles()
    computes: Callable[[Any], bool] = _delta_computes
    tunes: Callable[[Any, Mapping[str, Any]], bool] = _delta_tunes
    begin: Callable[[Any, Mapping[str, Any], Mapping[str, Any] | None, Any], tuple[tuple[Any, Any], ...]] | None = None
    used: Callable[[Any, Mapping[str, Any]], tuple[Any, ...]] | None = None
    rejoin: Callable[[Any, Mapping[str, Any]], tuple[Any, Any]] | None = None
    limits: Callable[[Any], tuple[looks.Limit, looks.Limit] | None] = looks.delta_limits
    rises: Callable[[Any], bool] = looks.delta_rises
    service: Callable[[Any, Mapping[str, Any]], tuple[str, ...]] = looks.delta_service
    comes_back: Callable[[Any, Mapping[str, Any]], str] = looks.comes_back
    veiled: Callable[[Any], frozenset[str]] = _nothing_veiled
    veil: Callable[[Any, Any], Any] = _not_veiled
    pv_dword: int = 0

    def with_pv_word(self, dialect: Any) -> Controller:
        """Return this controller with the PV of the last execution where the dialect has it in I_MV."""
        # A dialect that is only asked, not given, leaves the words where they are.
        if not self.pv_dword or not isinstance(dialect, delta_dialect.Dialect):
            return self
        dword = int(dialect.pv_word) or self.pv_dword
        if any(each.attr == "pv1" and each.dword == dword for each in self.seen):
            return self
        found = [replace(each, name=f"I_MV+{dword}", dword=dword) if each.attr == "pv1" else each for each in self.seen]
        return replace(self, seen=tuple(found))

    def operand(self, name: str) -> Operand:
        """Return the row of the operand with the manual's name; KeyError for another name."""
        for row in self.operands:
            if row.name == name:
                return row
        raise KeyError(name)

    def operand_of(self, seen: str) -> str:
        """Return the operand in whose words a seen value stands; KeyError for another name."""
        return {word.name: word.operand for word in self.seen}[seen]

    def ts(self, inputs: Any, dialect: Any, ticks: int = 0) -> REAL:
        """Return Ts as `step` takes it in this dialect; `ticks` of the dialect's clock count where it measures."""
        return self.nominal_ts(inputs) if self.law_ts is None else self.law_ts(inputs, dialect, ticks)

    @property
    def input_names(self) -> tuple[str, ...]:
        """Attribute names of what a step reads, in order."""
        fields: tuple[str, ...] = self.inputs._fields  # type: ignore[attr-defined]
        return fields
