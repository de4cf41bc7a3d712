"""A state machine of client, faulty line and unit: Hypothesis chooses every fault and every pause, and shrinks."""

from __future__ import annotations

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, precondition, rule
from transports.faulty_line import TIMEOUT_NS, WIRES, History, Outcome, broken_laws

from ahgateway.clock import MILLISECOND
from ahgateway.transports.fault import DETECTABLE, Fault, Rule, Script

ANY = st.sampled_from(Fault)


class LineMachine(RuleBasedStateMachine):
    """One link on one line; `wire` is set by the test."""

    wire = "rtu"

    @initialize(seed=st.integers(0, 2**16))
    def open(self, seed: int) -> None:
        self.history = History(seed, self.wire)
        self.outcomes: list[Outcome] = []

    def _ask(self, faults: tuple[Fault, ...], late_ms: int | None = None) -> None:
        seed = len(self.outcomes)
        rules = (Rule(faults, late_ms=late_ms),) if faults else ()
        self.history.faulty.script = Script(rules, seed)
        outcome = self.history.exchange()
        self.outcomes.append(outcome)
        assert [] == broken_laws(self.history, [outcome], 0, is_end=False)

    @rule()
    def sound(self) -> None:
        self._ask(())

    @rule(fault=ANY)
    def spoiled(self, fault: Fault) -> None:
        self._ask((fault,) if fault in DETECTABLE[self.wire] else ())

    @rule(late_ms=st.sampled_from([30, 49, 50, 51, 99, 101, 149, 400]))
    def late(self, late_ms: int) -> None:
        self._ask((Fault.LATE,), late_ms)

    @rule(ms=st.integers(1, 300))
    def pause(self, ms: int) -> None:
        self.history.clock.advance_ns(ms * MILLISECOND)
        self.history._deliver()

    @precondition(lambda self: len(self.outcomes) > 2)
    @rule()
    def recover(self) -> None:
        self.history.faulty.script = Script(())
        for _ in range(100):
            outcome = self.history.exchange()
            if outcome.reply is not None:
                break
        assert outcome.reply is not None, "the line is sound and the link has not come back"
        assert outcome.ended_ns - outcome.asked_ns <= 6 * TIMEOUT_NS


@pytest.mark.slow
@pytest.mark.parametrize("wire", WIRES)
def test_the_machine(wire: str) -> None:
    machine = type(f"{wire}LineMachine", (LineMachine,), {"wire": wire})
    case = machine.TestCase
    case.settings = settings(max_examples=40, stateful_step_count=25, deadline=None)
    case("runTest").runTest()
