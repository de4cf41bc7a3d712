"""Make a sieve: `sift` with the law of one controller, compiled or interpreted, from that one source.

This file alone knows how a law's tuples stand in rows of numbers, and under which name its copies are kept.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from typing import Any

from ahgateway.core.compiling import Maker, keep
from ahgateway.core.controllers import Controller
from ahgateway.core.operands import Kind
from ahgateway.core.real import REAL
from ahgateway.core.sift import sift

ACCESS = """
def taken(stack, depth):
    return {taken}

def read(rows, v):
    return Inputs({inputs})

def unpacked(rows, e):
    return State({from_rows})

def pack(state, rows, e):
    {to_rows}

def with_content(state, x):
    return State({with_content})

def content(state):
    return {content}

def words(state, terms):
    return {words}
"""
"""Small functions that know a law's tuples; names are filled in."""


def _access(controller: Controller, compiled: bool) -> dict[str, Any]:
    """Make the functions that name the fields of this law's tuples; interpreted, a list is read quicker than a row."""
    fields: tuple[str, ...] = controller.state._fields  # type: ignore[attr-defined]
    start = controller.state()
    kinds = {row.attr: row.kind for row in controller.operands}
    names = controller.input_names
    as_field = {bool: "rows[e, {0}] != 0.0", int: "int(rows[e, {0}])"}
    from_rows = [as_field.get(type(value), "REAL(rows[e, {0}])").format(place) for place, value in enumerate(start)]
    as_input = {Kind.BOOL: "rows[v, {0}] != 0.0", Kind.REAL: "REAL(rows[v, {0}])"}
    known = {word.attr: word for word in controller.seen}
    shown = [f"{'state' if attr in fields else 'terms'}.{attr}" for attr in ("pv1", "i", "mv", "mout") if attr in known]
    source = ACCESS.format(
        taken="stack[depth]" if compiled else "stack[depth].tolist()",
        inputs=", ".join(
            as_input.get(kinds[name], "int(rows[v, {0}])").format(place) for place, name in enumerate(names)
        ),
        from_rows=", ".join(from_rows),
        to_rows="; ".join(f"rows[e, {place}] = state.{name}" for place, name in enumerate(fields)),
        with_content=", ".join("x" if name == "d" else f"state.{name}" for name in fields),
        content="state.d" if "d" in fields else "REAL(0)",
        words=", ".join(shown),
    )
    scope: dict[str, Any] = {"Inputs": controller.inputs, "State": controller.state, "REAL": REAL}
    exec(compile(source, "<made from a law's tuples>", "exec"), scope)
    made = {name: scope[name] for name in ("taken", "read", "unpacked", "pack", "with_content", "content", "words")}
    at = {f"{name}_at": fields.index(field) if field in fields else -1 for name, field in PLACES.items()}
    return {**made, **at, "extended": "d" in fields}


PLACES = {"content": "d", "cross": "cross", "i": "i", "pv1": "pv1"}


_SIEVES: dict[Any, Callable[..., Any]] = {}


def sieve(controller: Controller, compiled: bool) -> Callable[..., Any]:
    """Return `sift` for the law of one controller, compiled or interpreted; made once."""
    key = (controller.name, controller.step, compiled)
    if key not in _SIEVES:
        maker = maker_for(controller, compiled)
        _SIEVES[key] = made = maker.function(sift, is_inner=False)
        if compiled:
            keep(made, maker.made)
    return _SIEVES[key]


def maker_for(controller: Controller, compiled: bool) -> Maker:
    """Return what makes a function of the search one for the law of a controller."""
    code = controller.step.__code__
    plain = [each for each in code.co_consts if isinstance(each, int | float | str)]
    digest = hashlib.sha256(code.co_code + repr((code.co_names, plain)).encode()).hexdigest()[:8]
    maker = Maker(compiled=compiled, asking=True, label=f"_{controller.name}_{digest}")
    for name, made in _access(controller, compiled).items():
        (maker.give_made if callable(made) else maker.give)(name, made)
    laws = {"step": controller.step, "law_ts": controller.law_ts, "nominal_ts": controller.nominal_ts}
    for name, law in laws.items():
        maker.give(name, maker.function(law))
    return maker
