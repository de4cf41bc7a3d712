"""Run PID_REG_CE over calls; inputs are sticky, `dt` is the call period."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import groupby
from types import ModuleType
from typing import Any

from ahgateway.core.controllers import pid_reg_ce
from ahgateway.core.controllers.pid_reg_ce_dialect import DEFAULT, PulseDialect
from ahgateway.core.real import REAL, quiet


def typed(values: dict[str, Any]) -> dict[str, Any]:
    """Manual's names to the law's, numbers to REAL."""
    return {name.lower(): value if isinstance(value, bool) else REAL(value) for name, value in values.items()}


def run(
    params: dict[str, Any],
    steps: Iterable[dict[str, Any]],
    dialect: PulseDialect = DEFAULT,
    law: ModuleType = pid_reg_ce,
) -> list[Any]:
    """Return the terms of every call."""
    sticky = typed(params)
    state = law.State()
    out = []
    with quiet(all="ignore"):
        for given in steps:
            sticky.update(typed(given))
            operands = law.Operands(**sticky)
            state, terms = law.step(operands, state, dialect, law.nominal_ts(operands))
            out.append(terms)
    return out


def segments(ran: list[Any]) -> list[list[Any]]:
    """Run lengths of OPEN, CLOSE and -."""
    names = ["OPEN" if terms.open_out else "CLOSE" if terms.close_out else "-" for terms in ran]
    return [[name, len(list(group))] for name, group in groupby(names)]
