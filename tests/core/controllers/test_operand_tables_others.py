"""The tables of MELSEC PID, PID_REG_CE and PID_Temp say what their laws read, with the same defaults."""

from __future__ import annotations

from types import ModuleType

import pytest

from ahgateway.core.controllers import (
    melsec_dialect,
    melsec_pid,
    pid_reg_ce,
    pid_reg_ce_dialect,
    pid_temp,
    pid_temp_dialect,
)
from ahgateway.core.operands import Access, Kind
from ahgateway.core.real import REAL

LAWS = [melsec_pid, pid_reg_ce, pid_temp]
DIALECTS = [melsec_dialect, pid_reg_ce_dialect, pid_temp_dialect]


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.__name__.rsplit(".", 1)[-1])
def test_every_input_has_a_row_with_its_default(law: ModuleType) -> None:
    rows = {row.attr: row for row in law.OPERANDS}
    assert len(rows) == len(law.OPERANDS)
    for name, value in law.Operands()._asdict().items():
        row = rows[name]
        assert row.access in (Access.IN, Access.IN_OUT), name
        assert (REAL(row.default) if row.kind is Kind.REAL else row.default) == value, name
    read = {name for name, row in rows.items() if row.access is Access.IN}
    assert read <= set(law.Operands._fields)


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.__name__.rsplit(".", 1)[-1])
def test_defaults_lie_within_the_documented_ranges(law: ModuleType) -> None:
    for row in law.OPERANDS:
        if row.default is not None:
            assert row.minimum is None or row.minimum <= row.default, row.name
            assert row.maximum is None or row.default <= row.maximum, row.name


@pytest.mark.parametrize("module", DIALECTS, ids=lambda module: module.__name__.rsplit(".", 1)[-1])
def test_every_axis_of_a_dialect_is_named_and_its_default_is_the_first_value(module: ModuleType) -> None:
    ratios = set(getattr(module, "RATIO_AXES", ()))
    assert set(module.DEFAULT._fields) == set(module.AXES) | ratios
    assert all(0 == getattr(module.DEFAULT, name) for name in module.DEFAULT._fields)
    assert all(isinstance(getattr(module.DEFAULT, name), axis) for name, axis in module.AXES.items())
