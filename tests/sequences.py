"""Play: a law driven through written-out executions. Operands are sticky, MOUT is written back as in the PLC.

Expected numbers are worked out by hand; equality is exact. The sign of a zero is not tested (spec controllers §1).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ahgateway.core import flags as flag
from ahgateway.core.controllers import Controller
from ahgateway.core.dialect import DEFAULT, Dialect
from ahgateway.core.operands import Kind
from ahgateway.core.real import REAL

Row = tuple[dict[str, Any], dict[str, Any]]
"""What changes before an execution, and what it must leave; `flags` is a tuple of names, `ts` overrides Ts in s."""


def operands(controller: Controller, base: Any = None, **values: Any) -> Any:
    """Operands by attribute name, plain numbers becoming REALs where the operand is one."""
    kinds = {row.attr: row.kind for row in controller.operands}
    typed = {name: REAL(value) if kinds[name] is Kind.REAL else value for name, value in values.items()}
    return controller.inputs(**typed) if base is None else base._replace(**typed)


def play(
    controller: Controller, start: dict[str, Any], rows: list[Row], *, dialect: Dialect = DEFAULT, state: Any = None
) -> Any:
    """Execute once per row and hold every named output against the row; return the last state."""
    inputs = operands(controller, **start)
    state = controller.state() if state is None else state
    for number, (changes, expected) in enumerate(rows):
        ts = changes.get("ts")
        inputs = operands(controller, inputs, **{name: value for name, value in changes.items() if name != "ts"})
        state, terms = controller.step(
            inputs, state, dialect, controller.nominal_ts(inputs) if ts is None else REAL(ts)
        )
        inputs = inputs._replace(mout=terms.mout)
        for name, value in expected.items():
            found = getattr(state, name) if name in ("i", "mv", "pv1") else getattr(terms, name)
            if name == "flags":
                assert (number, name, value) == (number, name, flag.names(found))
            elif isinstance(value, bool):
                assert (number, name, value) == (number, name, bool(found))
            else:
                assert isinstance(found, np.float32), f"row {number}: {name} left the REALs: {type(found)}"
                assert (number, name, REAL(value)) == (number, name, found)
    return state
