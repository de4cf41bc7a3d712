"""A divergence as a small file: the state before, what was read, what the PLC wrote; played by the law alone.

This file alone decides the form of that file. REALs stand in it as bits, so that it says the same on every machine.
Nothing but the core is needed to play it: no PLC, no fake, no profile.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ahgateway.core.controllers import CONTROLLERS
from ahgateway.core.controllers.controller import Controller, replaced
from ahgateway.core.real import REAL, bits, from_bits, quiet

FORM = 1
"""Version of the file's form; a file of another one is refused."""


@dataclass(frozen=True, slots=True)
class Change:
    """What is otherwise in the PLC than its registers and the dialect say.

    Attributes:
        operands: Operand, by attribute, to the value with which it acts.
        dialect: Axis to its value.
        ts: The interval with which it computes; None as the file has it.
        times: How often it is executed.
    """

    operands: Mapping[str, Any] = field(default_factory=dict)
    dialect: Mapping[str, Any] = field(default_factory=dict)
    ts: REAL | None = None
    times: int = 1


@dataclass(frozen=True, slots=True)
class Execution:
    """What one execution read, and the words it left that can be seen."""

    inputs: Any
    ts: REAL
    words: Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class Case:
    """One divergence.

    Attributes:
        controller: Whose law.
        dialect: Choices where the manual is silent.
        starts: State before the first execution; two when one REAL of it is known by its bounds only.
        executions: One after the other; the last one differs.
        likeliest: What the judge holds to be the cause, when that reproduces it; None otherwise.
        told: Where and when it was seen and what was said, for people.
    """

    controller: Controller
    dialect: Any
    starts: tuple[Any, ...]
    executions: tuple[Execution, ...]
    likeliest: Change | None = None
    told: Mapping[str, Any] = field(default_factory=dict)

    def text(self) -> str:
        """Return it as the text of its file."""
        found = {
            "form": FORM,
            **self.told,
            "controller": self.controller.name,
            "dialect": _dialect_text(self.controller, self.dialect),
            "starts": [_plain(state) for state in self.starts],
            "executions": [
                {"inputs": _plain(each.inputs), "ts": _plain(each.ts), "words": _plain(dict(each.words))}
                for each in self.executions
            ],
            "likeliest": None if self.likeliest is None else self._change_text(self.likeliest),
        }
        return json.dumps(found, indent=2, ensure_ascii=False) + "\n"

    def _change_text(self, change: Change) -> dict[str, Any]:
        axes = {axis: value.name.lower() for axis, value in change.dialect.items()}
        ts = None if change.ts is None else _plain(change.ts)
        return {"operands": _plain(dict(change.operands)), "dialect": axes, "ts": ts, "times": change.times}


def load(text: str) -> Case:
    """Return the case that a file's text holds.

    Raises:
        ValueError: It is none, or of another form.
    """
    found = json.loads(text)
    if found.get("form") != FORM:
        raise ValueError(f"this is no divergence in form {FORM}: {found.get('form')}")
    controller = CONTROLLERS[found["controller"]]
    told = {name: value for name, value in found.items() if name not in _OWN}
    state, inputs = controller.state(), controller.inputs()
    executions = tuple(
        Execution(_typed(each["inputs"], inputs), from_bits(int(each["ts"], 16)), _values(each["words"]))
        for each in found["executions"]
    )
    change = found["likeliest"]
    return Case(
        controller,
        _dialect(controller, found["dialect"]),
        tuple(_typed(each, state) for each in found["starts"]),
        executions,
        None if change is None else _change(controller, change),
        told,
    )


_OWN = frozenset({"form", "controller", "dialect", "starts", "executions", "likeliest"})


def differences(case: Case, change: Change | None = None) -> list[str]:
    """Play a case by the law and return every word that the PLC wrote otherwise, one sentence each; [] when none.

    Args:
        case: The divergence.
        change: What to compute otherwise; None plays it as the registers and the dialect say.
    """
    found = [_played(case, start, change or Change()) for start in case.starts]
    return [] if any(not each for each in found) else found[0]


def without_what_does_not_matter(case: Case) -> Case:
    """Return the case with every field of its start at the default where that changes no word; deterministic."""
    fresh = case.controller.state()
    if len(case.starts) > 1 or (case.likeliest is not None and differences(case, case.likeliest)):
        return case
    for path, value in _flat(fresh):
        start = replaced(case.starts[0], path, value)
        smaller = replace(case, starts=(start,))
        same = [_left(smaller, start, Change()), _left(case, case.starts[0], Change())]
        explained = case.likeliest is None or not differences(smaller, case.likeliest)
        if _plain(same[0]) == _plain(same[1]) and explained:
            case = smaller
    return case


def _left(case: Case, state: Any, change: Change) -> list[dict[str, Any]]:
    """The words that each execution leaves."""
    dialect = case.dialect._replace(**change.dialect)
    found = []
    for each in case.executions:
        ts = each.ts if change.ts is None else change.ts
        if change.dialect:
            ts = case.controller.ts(each.inputs, dialect)
        inputs = each.inputs._replace(**change.operands)
        with quiet(all="ignore"):
            for _ in range(change.times):
                state, terms = case.controller.step(inputs, state, dialect, ts)
        found.append({word.name: word.stored(state, terms) for word in case.controller.seen})
    return found


def _played(case: Case, state: Any, change: Change) -> list[str]:
    found = []
    for number, (each, ref) in enumerate(zip(case.executions, _left(case, state, change), strict=True), 1):
        for name, plc in each.words.items():
            if _plain(plc) != _plain(ref[name]):
                said = f"plc {_shown(plc)}, ref {_shown(ref[name])}"
                found.append(f"execution {number}: {name} {said}")
    return found


def _shown(value: Any) -> str:
    return f"{float(value):.9g} ({_plain(value)})" if isinstance(value, np.floating) else str(_plain(value))


def _plain(value: Any) -> Any:
    """A value as JSON holds it: a REAL as its bits, a tuple with names as an object."""
    if isinstance(value, np.floating):
        return f"{bits(value):#010x}"
    if hasattr(value, "_asdict"):
        return {name: _plain(each) for name, each in value._asdict().items()}
    if isinstance(value, Mapping):
        return {name: _plain(each) for name, each in value.items()}
    if isinstance(value, list):
        return [_plain(each) for each in value]
    return bool(value) if isinstance(value, bool | np.bool_) else int(value)


def _typed(found: Mapping[str, Any], sample: Any) -> Any:
    """A tuple with names from an object; what is not in it is as in the sample."""
    values = {
        name: _typed(found[name], getattr(sample, name)) if isinstance(found[name], Mapping) else _value(found[name])
        for name in sample._fields
        if name in found
    }
    return sample._replace(**values)


def _values(found: Mapping[str, Any]) -> dict[str, Any]:
    return {name: _value(value) for name, value in found.items()}


def _value(value: Any) -> Any:
    return from_bits(int(value, 16)) if isinstance(value, str) else value


def _flat(state: Any, prefix: str = "") -> list[tuple[str, Any]]:
    found: list[tuple[str, Any]] = []
    for name, value in state._asdict().items():
        found.extend(_flat(value, f"{prefix}{name}.") if hasattr(value, "_asdict") else [(prefix + name, value)])
    return found


def _dialect_text(controller: Controller, dialect: Any) -> dict[str, Any]:
    """The axes that are not as by default."""
    named = {axis: getattr(dialect, axis) for axis in controller.axes}
    found: dict[str, Any] = {
        axis: controller.axes[axis](value).name.lower()
        for axis, value in named.items()
        if value != getattr(controller.dialect, axis)
    }
    return found | {axis: float(getattr(dialect, axis)) for axis in controller.numbers}


def _dialect(controller: Controller, found: Mapping[str, Any]) -> Any:
    chosen: dict[str, Any] = {
        axis: controller.axes[axis][value.upper()]
        if axis in controller.axes
        else type(getattr(controller.dialect, axis))(value)
        for axis, value in found.items()
    }
    return controller.dialect._replace(**chosen)


def _change(controller: Controller, found: Mapping[str, Any]) -> Change:
    axes = {axis: controller.axes[axis][value.upper()] for axis, value in found["dialect"].items()}
    ts = None if found["ts"] is None else from_bits(int(found["ts"], 16))
    return Change(_values(found["operands"]), axes, ts, found["times"])
