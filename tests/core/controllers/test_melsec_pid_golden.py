"""MELSEC PID against the vectors worked out by hand: every hex pattern and every other output."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from core.controllers.melsec_runner import run

from ahgateway.core.controllers import melsec_pid
from ahgateway.core.real import bits

GOLDEN = Path(__file__).parents[2] / "golden" / "melsec_pid.json"
VECTORS = json.loads(GOLDEN.read_text(encoding="utf-8"))
REAL_TERM = {"MV": "out", "dMV": "dmv", "EV": "ev", "PVf": "pvf", "D": "d"}


def named_error(terms: Any) -> str | None:
    if terms.error:
        return f"{terms.error:X}H"
    return "LIMITS_SWAPPED" if terms.warnings & melsec_pid.WARN_LIMITS else None


@pytest.mark.parametrize("vector", VECTORS, ids=[vector["id"] for vector in VECTORS])
def test_melsec_pid_is_bit_equal_to_the_golden_vector(vector: dict[str, Any]) -> None:
    params = {"MV" if name == "MV0" else name: value for name, value in vector["params"].items()}
    ran = run(params, [step["in"] for step in vector["steps"]])
    for index, (step, terms) in enumerate(zip(vector["steps"], ran, strict=True)):
        for name, pattern in step["hex"].items():
            assert int(pattern, 16) == bits(getattr(terms, REAL_TERM[name])), (index, name)
        assert step["out"]["ALARM"] == terms.alarm, index
        assert step["out"]["ERR"] == named_error(terms), index
