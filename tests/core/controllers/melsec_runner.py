"""Run MELSEC PID over steps of inputs; (d) is fed back as the instruction would find it."""

from __future__ import annotations

from collections.abc import Iterable
from types import ModuleType
from typing import Any

from ahgateway.core.controllers import melsec_pid
from ahgateway.core.controllers.melsec_dialect import DEFAULT, MelsecDialect
from ahgateway.core.real import REAL, quiet

REALS = frozenset({"sv", "pv", "mv"})


def typed(values: dict[str, Any]) -> dict[str, Any]:
    """Manual's names to the law's, numbers to their types."""
    return {
        name.lower(): REAL(value) if name.lower() in REALS and not isinstance(value, bool) else value
        for name, value in values.items()
    }


def run(
    params: dict[str, Any],
    steps: Iterable[dict[str, Any]],
    dialect: MelsecDialect = DEFAULT,
    law: ModuleType = melsec_pid,
) -> list[Any]:
    """Return the terms of every step; `params` may give the content of (d) before the first one as MV."""
    sticky = typed(params)
    state = law.State()
    out = []
    with quiet(all="ignore"):
        for given in steps:
            sticky.update(typed(given))
            operands = law.Operands(**sticky)
            state, terms = law.step(operands, state, dialect, law.nominal_ts(operands))
            sticky["mv"] = terms.out
            out.append(terms)
    return out
