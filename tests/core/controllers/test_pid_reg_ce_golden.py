"""PID_REG_CE against the vectors worked out by hand: bits, pulses, phases and run lengths."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from core.controllers.pulse_runner import run, segments

from ahgateway.core.controllers.pid_reg_ce import PHASES
from ahgateway.core.real import bits

GOLDEN = Path(__file__).parents[2] / "golden" / "pid_reg_ce.json"
VECTORS = json.loads(GOLDEN.read_text(encoding="utf-8"))


@pytest.mark.parametrize("vector", VECTORS, ids=[vector["id"] for vector in VECTORS])
def test_pid_reg_ce_is_bit_equal_to_the_golden_vector(vector: dict[str, Any]) -> None:
    ran = run(vector["params"], [step["in"] for step in vector["steps"]])
    for index, (step, terms) in enumerate(zip(vector["steps"], ran, strict=True)):
        expected = step["out"]
        assert {name: int(pattern, 16) for name, pattern in step["hex"].items()} == {
            "Y": bits(terms.y),
            "ERROR": bits(terms.error),
        }, index
        assert (expected["OPEN_OUT"], expected["CLOSE_OUT"]) == (terms.open_out, terms.close_out), index
        assert (expected["OSTANOV"], expected["PHASE"]) == (terms.ostanov, PHASES[terms.phase]), index
    assert vector["segments"] == segments(ran)
