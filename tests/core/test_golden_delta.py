"""DPID and DPIDE against hand-worked vectors, bit by bit; source: `golden/delta_*.json`, made by another hand."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from ahgateway.core import flags as flag
from ahgateway.core.controllers import CONTROLLERS, Controller
from ahgateway.core.dialect import DEFAULT
from ahgateway.core.operands import Kind
from ahgateway.core.real import REAL, bits

GOLDEN = Path(__file__).parent.parent / "golden"
SPOKEN = flag.FREEZE_HI | flag.FREEZE_LO | flag.BUMPLESS | flag.BAD_INPUT | flag.LIMITS_SWAPPED | flag.LOCKUP
"""Flags that the vectors speak of; the others say what the operands say anyway."""

VECTORS = [
    (name, vector)
    for name in ("DPID", "DPIDE")
    for vector in json.loads((GOLDEN / f"delta_{name.lower()}.json").read_text(encoding="utf-8"))
]


def typed(controller: Controller, values: dict[str, Any]) -> dict[str, Any]:
    """Operands of a vector as the law takes them, keyed in lower case."""
    made = {}
    for name, value in values.items():
        kind = controller.operand(name).kind
        made[name.lower()] = REAL(value) if kind is Kind.REAL else value
    return made


def outputs(state: Any, terms: Any) -> dict[str, Any]:
    return {
        "MV": state.mv,
        "I_MV": state.i,
        "MOUT": terms.mout,
        "D": terms.d,
        "CROSS": getattr(terms, "cross", None),
    }


@pytest.mark.parametrize(("name", "vector"), VECTORS, ids=[f"{name}-{vector['id']}" for name, vector in VECTORS])
def test_every_output_has_the_bits_of_the_vector(name: str, vector: dict[str, Any]) -> None:
    controller = CONTROLLERS[name]
    assert vector["init"] == {}
    operands = controller.inputs(**typed(controller, vector["params"]))
    state = controller.state()
    for number, row in enumerate(vector["steps"]):
        operands = operands._replace(**typed(controller, row["in"]))
        state, terms = controller.step(operands, state, DEFAULT, controller.nominal_ts(operands))
        operands = operands._replace(mout=terms.mout)
        found = outputs(state, terms)
        for output, pattern in row["hex"].items():
            assert (number, output, pattern) == (number, output, f"0x{bits(found[output]):08X}")
        if "CROSS" in row["out"]:
            assert row["out"]["CROSS"] == found["CROSS"]
        assert tuple(row["out"]["flags"]) == flag.names(terms.flags & SPOKEN)


def test_the_vectors_are_all_there() -> None:
    ids = [vector["id"] for _, vector in VECTORS]
    assert ids == ["A1", "A3", "A5a", "A7", "B1", "B3", "B5", "B7"]
