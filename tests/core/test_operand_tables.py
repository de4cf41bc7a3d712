"""The operand tables against the manual's order and sizes, and against the laws that read them."""

from __future__ import annotations

import pytest

from ahgateway.core import dialect, flags
from ahgateway.core.controllers import CONTROLLERS, DPID, DPIDE, Controller
from ahgateway.core.operands import Access, Kind
from ahgateway.core.real import REAL, same_bits

DPID_ORDER = (
    "PID_RUN SV PV PID_MODE PID_MAN MOUT_AUTO CYCLE Kp Ki Kd PID_DIR ERR_DBW MV_MAX MV_MIN MOUT I_MV MV".split()
)
DPIDE_ORDER = (
    "PID_RUN SV PV PID_MODE PID_MAN MOUT_AUTO CYCLE Kc_Kp Ti_Ki Td_Kd Tf PID_EQ PID_DE PID_DIR ERR_DBW "
    "MV_MAX MV_MIN MOUT BIAS I_MV MV"
).split()


@pytest.mark.parametrize(("controller", "names"), [(DPID, DPID_ORDER), (DPIDE, DPIDE_ORDER)], ids=["DPID", "DPIDE"])
def test_operands_stand_in_the_order_of_the_instruction(controller: Controller, names: list[str]) -> None:
    assert names == [row.name for row in controller.operands]


@pytest.mark.parametrize(("controller", "words", "steps"), [(DPID, 12, 35), (DPIDE, 20, 43)], ids=["DPID", "DPIDE"])
def test_sizes_agree_with_the_manual(controller: Controller, words: int, steps: int) -> None:
    assert words == controller.operand("I_MV").words
    assert steps == 1 + 2 * len(controller.operands)


@pytest.mark.parametrize(("name", "minimum", "maximum"), [("DPID", 1, 2000), ("DPIDE", 1, 40000)])
def test_cycle_has_the_documented_range(name: str, minimum: int, maximum: int) -> None:
    row = CONTROLLERS[name].operand("CYCLE")
    assert (minimum, maximum) == (row.minimum, row.maximum)


@pytest.mark.parametrize("controller", CONTROLLERS.values(), ids=CONTROLLERS)
def test_defaults_of_table_and_law_agree(controller: Controller) -> None:
    inputs = controller.inputs()
    read = [row for row in controller.operands if row.access not in (Access.OUT, Access.STATE)]
    assert {row.attr for row in read if row.access is Access.IN} <= set(controller.input_names)
    assert set(controller.input_names) <= {row.attr for row in read}
    for row in (row for row in read if row.attr in controller.input_names):
        found = getattr(inputs, row.attr)
        if row.kind is Kind.REAL:
            assert same_bits(REAL(row.default), found), row.name
        elif row.kind is Kind.INT:
            assert row.default == found, row.name
        else:
            assert (type(row.default), row.default) == (type(found), found), row.name


@pytest.mark.parametrize("controller", CONTROLLERS.values(), ids=CONTROLLERS)
def test_everything_seen_has_a_place_and_a_source(controller: Controller) -> None:
    for seen in controller.seen:
        row = controller.operand(seen.operand)
        length = {Kind.REAL: 2, Kind.DINT: 2, Kind.INT: 1, Kind.BOOL: 0}[seen.kind]
        assert 2 * seen.dword + length <= row.words
        assert row.kind in (seen.kind, Kind.BLOCK)
        assert hasattr(controller.state(), seen.attr) or seen.attr in controller.terms._fields


def test_an_unknown_operand_is_a_key_error() -> None:
    with pytest.raises(KeyError, match="Kx"):
        DPID.operand("Kx")


def test_flags_are_single_bits_with_names_in_order() -> None:
    assert [1 << place for place in range(10)] == list(flags.NAMES)
    assert flags.names(flags.LOCKUP | flags.FREEZE_HI) == ("FREEZE_HI", "LOCKUP")
    assert flags.names(0) == ()


def test_default_dialect_and_axes() -> None:
    assert set(dialect.AXES) >= {"freeze", "run_off", "first_call"}
    assert set(dialect.AXES) == set(dialect.Dialect._fields)
    assert (dialect.Freeze.ALWAYS, dialect.RunOff.KEEP, dialect.FirstCall.AT_ONCE) == dialect.DEFAULT[:3]
