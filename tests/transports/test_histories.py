"""Random histories of client, faulty line and unit: never a foreign value, never beyond the deadline, always back."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from transports.faulty_line import WIRES, History, broken_laws, faults_of

from ahgateway.codec.access import Request
from ahgateway.transports.alignment import Alignment

BATCHES, BATCH = 12, 250
"""So many histories of each wire in every run; `tests/bench/fuzz_link.py` runs as many as one likes."""


@pytest.mark.slow
@pytest.mark.parametrize("wire", WIRES)
@pytest.mark.parametrize("batch", range(BATCHES))
def test_no_seeded_history_hands_out_a_value_that_was_not_there(wire: str, batch: int) -> None:
    assert [] == [said for seed in range(batch * BATCH, (batch + 1) * BATCH) for said in faults_of(seed, wire)]


@pytest.mark.parametrize("wire", WIRES)
@settings(max_examples=60)
@given(seed=st.integers(0, 2**32))
def test_no_history_hands_out_a_value_that_was_not_there(wire: str, seed: int) -> None:
    assert faults_of(seed, wire) == []


@pytest.mark.parametrize(("wire", "seed"), [("rtu", 1003772), ("rtu", 1006736), ("ascii", 1002408), ("ascii", 1005006)])
def test_a_late_reply_that_is_one_word_short_or_long_proves_nothing(wire: str, seed: int) -> None:
    """A probe whose count was next to that of an unanswered request was once answered by the miscounted late reply."""
    assert faults_of(seed, wire) == []


class Trusting(Alignment):
    """Believes every unit at all times, as clients without an alignment probe do."""

    def since_ns(self, unit: int) -> int | None:
        return 0

    def answered(self, request: Request) -> None:
        pass


@pytest.mark.parametrize("wire", ["rtu", "ascii"])
def test_a_link_that_does_not_align_is_convicted(wire: str) -> None:
    """The judge itself: without the probe, late replies are handed out, and the histories show it."""
    said = []
    for seed in range(40):
        history = History(seed, wire)
        history.engine._alignment = Trusting(50_000_000)
        said += broken_laws(history, history.run(12), seed)
    assert len(said) >= 3
