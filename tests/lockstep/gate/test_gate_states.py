"""The table of the gate: nothing moves that it does not name, and broken stays broken."""

from __future__ import annotations

from itertools import product
from pathlib import Path

import pytest

from ahgateway.errors import StateError
from ahgateway.lockstep.gate.states import TRANSITIONS, Event, State, after, diagram

PAGE = Path(__file__).parents[3] / "docs" / "reference" / "write-gate.md"


def test_a_write_begins_only_in_armed() -> None:
    assert {State.ARMED} == {state for state, event in TRANSITIONS if event is Event.SEND}


def test_broken_is_left_only_by_a_person() -> None:
    assert {Event.ABORT: State.RESTORING, Event.CLEARED: State.DISARMED} == {
        event: then for (state, event), then in TRANSITIONS.items() if state is State.BROKEN
    }


def test_from_everywhere_where_a_write_can_stand_one_step_leads_to_putting_back() -> None:
    for state in (State.ARMED, State.WRITING, State.SETTLING, State.RESTORING):
        assert State.RESTORING is after(state, Event.ABORT)


@pytest.mark.parametrize(("state", "event"), list(product(State, Event)))
def test_what_the_table_does_not_name_is_refused(state: State, event: Event) -> None:
    if (state, event) in TRANSITIONS:
        assert after(state, event) is TRANSITIONS[state, event]
        return
    with pytest.raises(StateError, match=f"the write gate is {state.value}, which knows no {event.name}"):
        after(state, event)


def test_the_picture_in_the_documents_is_drawn_from_the_table() -> None:
    assert f"```mermaid\n{diagram()}\n```" in PAGE.read_text("utf-8")
