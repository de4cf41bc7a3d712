"""Random histories of client, faulty line and unit: never a foreign value, never beyond the deadline, always back.

A hundred thousand seeded ones in every run, those that Hypothesis thinks of besides, and links with one rule taken out,
each of which some hundreds of histories must convict.
"""

from __future__ import annotations

import gc
import types
from collections.abc import Callable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from transports.faulty_line import FEW_EXCHANGES, TIMEOUT_NS, WIRES, History, broken_laws, faults_of

from ahgateway.codec.access import Request
from ahgateway.transports import alignment
from ahgateway.transports.alignment import Alignment
from ahgateway.transports.engine import Engine
from ahgateway.transports.framing import Adu, Mbap
from ahgateway.transports.rtu import RtuReplies

BATCHES, BATCH = 34, 1000
"""So many short histories of each wire in every run; `tests/bench/fuzz_link.py` runs as many long ones as one likes."""


@pytest.mark.slow
@pytest.mark.parametrize("wire", WIRES)
@pytest.mark.parametrize("batch", range(BATCHES))
def test_no_seeded_history_hands_out_a_value_that_was_not_there(wire: str, batch: int) -> None:
    seeds = range(batch * BATCH, (batch + 1) * BATCH)
    assert [] == [said for seed in seeds for said in faults_of(seed, wire, FEW_EXCHANGES)]


@pytest.mark.parametrize("wire", WIRES)
@settings(max_examples=60)
@given(seed=st.integers(0, 2**32))
def test_no_history_hands_out_a_value_that_was_not_there(wire: str, seed: int) -> None:
    assert faults_of(seed, wire) == []


NEAR = [("rtu", 1013076), ("rtu", 1019770), ("ascii", 1006709), ("ascii", 1013076)]


@pytest.mark.parametrize(("wire", "seed"), NEAR)
def test_a_late_reply_that_is_one_word_short_or_long_proves_nothing(wire: str, seed: int) -> None:
    """A probe whose count was next to that of an unanswered request was once answered by the miscounted late reply."""
    assert faults_of(seed, wire) == []


@pytest.mark.parametrize(("wire", "seed"), NEAR)
def test_a_probe_next_to_an_unanswered_count_is_convicted(
    wire: str, seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(alignment, "NEAR_SIZE", 0)
    assert [] != faults_of(seed, wire)


class Trusting(Alignment):
    """Believes every unit at all times, as clients without an alignment probe do: late replies are handed out."""

    def since_ns(self, unit: int) -> int | None:
        return 0

    def answered(self, request: Request) -> None:
        pass


class Stubborn(Alignment):
    """Takes no probe for a proof: a line in doubt stays in doubt."""

    def proven(self, unit: int, now_ns: int) -> None:
        pass

    def refusal_proves(self, unit: int, function: int) -> bool:
        return False


class Numberless(Mbap):
    """Takes whatever comes for the answer to what was asked last, whatever its number."""

    def __init__(self) -> None:
        super().__init__()
        self._last = 0

    def wrap(self, tag: int, unit: int, pdu: bytes) -> bytes:
        self._last = tag
        return super().wrap(tag, unit, pdu)

    def feed(self, piece: bytes | memoryview) -> list[Adu]:
        return [adu._replace(tag=self._last) for adu in super().feed(piece)]


class Credulous(RtuReplies):
    """Looks at the length of a frame and not at its CRC."""

    def _is_whole(self, start: int, size: int) -> bool:
        return start + size <= len(self._rest)


class Patient(Engine):
    """Never gives a request up."""

    def tick(self, now_ns: int) -> None:
        pass


def _without_alignment(history: History) -> None:
    history.engine._alignment = Trusting(TIMEOUT_NS)


def _without_proof(history: History) -> None:
    history.engine._alignment = Stubborn(TIMEOUT_NS)


def _without_numbers(history: History) -> None:
    history.engine.framing = Numberless()


def _without_checksum(history: History) -> None:
    history.engine.framing = Credulous()


def _without_deadline(history: History) -> None:
    history.engine.__class__ = Patient


@pytest.mark.parametrize(
    ("spoil", "wire", "said"),
    [
        (_without_alignment, "rtu", " got Reply("),
        (_without_alignment, "ascii", " got Reply("),
        (_without_numbers, "tcp", " got Reply("),
        (_without_checksum, "rtu", " got Reply("),
        (_without_proof, "rtu", "the link has not come back"),
        (_without_proof, "ascii", "the link has not come back"),
        (_without_deadline, "tcp", "the exchange never ends"),
        (_without_deadline, "rtu", "the exchange never ends"),
    ],
)
def test_a_link_with_one_rule_taken_out_is_convicted(spoil: Callable[[History], None], wire: str, said: str) -> None:
    """The judge itself: three hundred histories are enough to see each fault more than once."""
    found: list[str] = []
    for seed in range(300):
        history = History(seed, wire)
        spoil(history)
        found += broken_laws(history, history.run(), seed)
        if sum(said in each for each in found) >= 3:
            return
    pytest.fail(f"{len(found)} faults, fewer than three of them `{said}`")


def reachable(start: object) -> int:
    """Return how many objects hang on `start`; classes, modules and functions do not count."""
    seen, todo = {id(start)}, [start]
    while todo:
        for found in gc.get_referents(todo.pop()):
            if id(found) not in seen and not isinstance(found, type | types.ModuleType | types.FunctionType):
                seen.add(id(found))
                todo.append(found)
    return len(seen)


@pytest.mark.slow
@pytest.mark.parametrize("wire", WIRES)
def test_a_link_on_a_bad_line_keeps_nothing(wire: str) -> None:
    """Ghosts, numbers of late replies, bytes of no frame: all of it is bounded. What a run keeps is forgotten first."""
    history, sizes = History(1, wire), []
    for _ in range(3):
        for _ in range(2500):
            history.exchange()
        history.engine._figures.round_trips_ns.clear()
        sizes.append(reachable(history.engine))
        assert history.engine.framing.kept <= 600
    assert max(sizes) < 2000, "two requests in five are spoiled: one object kept of each would be 3000"
