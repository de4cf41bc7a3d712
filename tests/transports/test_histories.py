"""Random histories of client, faulty line and unit: never a foreign value, never beyond the deadline, always back."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from transports.faulty_line import WIRES, faults_of


@pytest.mark.parametrize("wire", WIRES)
@settings(max_examples=60)
@given(seed=st.integers(0, 2**32))
def test_no_history_hands_out_a_value_that_was_not_there(wire: str, seed: int) -> None:
    assert faults_of(seed, wire) == []
