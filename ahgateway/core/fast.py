"""The laws, stepped along a whole trace: compiled by numba where that is installed (extra `fast`), else interpreted.

There is one source of each law, and `compiling` makes a second executable of it; here the loop over the trace is
compiled with it. Both roads give equal bits (property test, MEASURED). It does not know where a trace comes from.

Theory of operation: numba knows NamedTuples of numbers, so operands, state and terms pass as they are. Enums become
plain integers, both in the dialect that is handed in and where a law names one. The loop is compiled, not the step: a
call into compiled code costs as much as fifty steps inside it (MEASURED, spec speed).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from importlib.util import find_spec
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ahgateway.core.compiling import Maker, njit, plain_type
from ahgateway.core.controllers import Controller
from ahgateway.core.operands import Kind
from ahgateway.core.real import REAL, quiet

Column = NDArray[Any]
_COMPILER = Maker(compiled=True)
_DTYPES = {Kind.BOOL: np.bool_, Kind.REAL: np.float32, Kind.DINT: np.int64, Kind.INT: np.int64}


@dataclass(frozen=True, slots=True)
class Trace:
    """What a walk along a trace left, one row per execution.

    Attributes:
        state: Field of the state to its column, as each execution left it.
        terms: Field of the terms to its column.
        is_compiled: Which road it was.
    """

    state: Mapping[str, Column]
    terms: Mapping[str, Column]
    is_compiled: bool


def why_interpreted() -> str:
    """Return why laws would be interpreted, as one sentence; empty when they will be compiled."""
    if find_spec("numba") is None:
        return "numba is not installed, the law is interpreted; `pip install ahgateway[fast]` makes it far quicker"
    return ""


def column_types(controller: Controller) -> dict[str, Any]:
    """Return the numpy type of the column of every input."""
    kinds = {row.attr: row.kind for row in controller.operands}
    return {name: _DTYPES[kinds[name]] for name in controller.input_names}


def walk(
    controller: Controller,
    inputs: Mapping[str, Column],
    start: Any,
    dialect: Any,
    ts: Column,
    *,
    seen: Mapping[str, Column] | None = None,
    compiled: bool = True,
) -> Trace:
    """Step a law along a trace; equal arguments give equal bits on both roads.

    Args:
        controller: Whose law.
        inputs: Input to its column of `length` values; types as `column_types` says.
        start: State before the first execution.
        dialect: Choices where the manual is silent.
        ts: Sampling time of each execution as the law takes it, `length` REALs.
        seen: Fields of the state that are taken from here before each execution, as the PLC showed them: columns of
            `length`; what is not here is carried from execution to execution.
        compiled: False interprets even where it could be compiled.

    Raises:
        ValueError: A column is missing, or has another length.
    """
    length = len(ts)
    shown = dict(seen or {})
    wrong = [name for name in controller.input_names if name not in inputs or len(inputs[name]) != length]
    wrong += [name for name, column in shown.items() if len(column) != length]
    if wrong:
        raise ValueError(f"these columns are missing or do not have {length} values: {', '.join(wrong)}")
    kinds = column_types(controller)
    columns = [np.ascontiguousarray(inputs[name], kinds[name]) for name in controller.input_names]
    columns += [np.ascontiguousarray(shown[name]) for name in sorted(shown)]
    state_out, terms_out = _room(start, length), _room_for_terms(controller, start, dialect, length)
    is_compiled = compiled and not why_interpreted()
    run = _loop(
        _Law(controller.inputs, controller.state, controller.terms, controller.step), tuple(sorted(shown)), is_compiled
    )
    law_dialect = _plain(dialect) if is_compiled else dialect
    with quiet(all="ignore"):
        run(
            length,
            tuple(columns),
            np.ascontiguousarray(ts, np.float32),
            _typed(start),
            law_dialect,
            tuple(state_out.values()),
            tuple(terms_out.values()),
        )
    return Trace(state_out, terms_out, is_compiled)


def _room(sample: Any, length: int) -> dict[str, Column]:
    """An empty column for every field of a state or of terms, by the types of a sample; of a tuple in it `core.i`."""
    return {path: np.empty(length, _dtype(value)) for path, value in _flat(sample)}


def _flat(sample: Any, prefix: str = "") -> list[tuple[str, Any]]:
    found: list[tuple[str, Any]] = []
    for name, value in zip(sample._fields, sample, strict=True):
        found += _flat(value, f"{prefix}{name}.") if hasattr(value, "_fields") else [(prefix + name, value)]
    return found


def _room_for_terms(controller: Controller, start: Any, dialect: Any, length: int) -> dict[str, Column]:
    with quiet(all="ignore"):
        _, terms = controller.step(controller.inputs(), controller.state(), dialect, REAL(1))
    return _room(terms, length)


def _dtype(value: Any) -> Any:
    if isinstance(value, bool | np.bool_):
        return np.bool_
    return np.float32 if isinstance(value, np.floating) else np.int64


def _typed(state: Any) -> Any:
    """The state with Python's own bools and ints, so that the compiler sees one type."""
    return type(state)(*[_typed(value) if hasattr(value, "_fields") else _plain_number(value) for value in state])


def _plain_number(value: Any) -> Any:
    kind = _dtype(value)
    return value if kind == np.float32 else kind(value).item()


def _plain(dialect: Any) -> Any:
    """The dialect with integers for enums; a REAL stays one."""
    shape = plain_type(type(dialect).__name__, dialect._fields)
    return shape(*[value if isinstance(value, np.floating) else int(value) for value in dialect])


class _Law(NamedTuple):
    """The tuples and the function of a controller."""

    inputs: Any
    state: Any
    terms: Any
    step: Any


LOOP = """
def run(length, columns, ts, state, dialect, state_out, terms_out):
    {columns} = columns
    {states} = state_out
    {terms} = terms_out
    for k in range(length):
        operands = Operands({operands})
        {forward}
        state, published = step(operands, state, dialect, ts[k])
        {store}
"""
"""The loop over a trace, written once for any law; names are filled in from its tuples."""


@lru_cache(maxsize=32)
def _loop(law: _Law, shown: tuple[str, ...], is_compiled: bool) -> Callable[..., Any]:
    """Make the loop for one law, with or without fields of the state that are forwarded."""
    operands, fields, terms = (each._fields for each in (law.inputs, law.state, law.terms))
    forward = ""
    if shown:
        values = ", ".join(f"seen_{field}[k]" if field in shown else f"state.{field}" for field in fields)
        forward = f"state = State({values})"
    stores = [f"state_{path.replace('.', '_')}[k] = state.{path}" for path, _ in _flat(law.state())]
    stores += [f"terms_{term}[k] = published.{term}" for term in terms]
    names = [f"in_{name}" for name in operands] + [f"seen_{name}" for name in shown]
    source = LOOP.format(
        columns=_unpacked(names),
        states=_unpacked([f"state_{path.replace('.', '_')}" for path, _ in _flat(law.state())]),
        terms=_unpacked([f"terms_{term}" for term in terms]),
        operands=", ".join(f"in_{name}[k]" for name in operands),
        forward=forward,
        store="\n        ".join(stores),
    )
    scope: dict[str, Any] = {"Operands": law.inputs, "State": law.state, "step": law.step}
    if is_compiled:
        scope["step"] = _COMPILER.function(law.step)
    exec(compile(source, "<loop over a trace>", "exec"), scope)
    run: Callable[..., Any] = scope["run"]
    return njit()(run) if is_compiled else run


def _unpacked(names: list[str]) -> str:
    return ", ".join(names) + ","
