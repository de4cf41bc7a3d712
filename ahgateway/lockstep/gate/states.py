"""The write gate's states: one table, from which the gate runs and the picture in the documents is drawn.

This file alone decides what may follow what. It does not know what is written, nor why. Broken stays broken: the
only way out of BROKEN is a person who looked at the PLC (`CLEARED`).
"""

from __future__ import annotations

from enum import Enum

from ahgateway.errors import StateError


class State(Enum):
    """Where the gate stands; only in ARMED can a write begin."""

    DISARMED = "DISARMED"
    ARMED = "ARMED"
    WRITING = "WRITING"
    SETTLING = "SETTLING"
    RESTORING = "RESTORING"
    BROKEN = "BROKEN"


class Event(Enum):
    """What happens to the gate."""

    ARM = "armed for one loop, as-found on disk"
    PENDING = "an earlier run left something behind"
    SEND = "intent on disk, request sent"
    ACKNOWLEDGED = "the PLC took it"
    VERIFIED = "a fresh read shows it"
    ABORT = "refused, read back wrong, taken over, error, signal, time over"
    KEPT = "kept as it stands"
    RESTORED = "everything is as found"
    LEFT = "not ours any more, or out of reach"
    CLEARED = "a person looked and said so"


TRANSITIONS: dict[tuple[State, Event], State] = {
    (State.DISARMED, Event.ARM): State.ARMED,
    (State.DISARMED, Event.PENDING): State.BROKEN,
    (State.ARMED, Event.SEND): State.WRITING,
    (State.ARMED, Event.KEPT): State.DISARMED,
    (State.ARMED, Event.ABORT): State.RESTORING,
    (State.WRITING, Event.ACKNOWLEDGED): State.SETTLING,
    (State.WRITING, Event.ABORT): State.RESTORING,
    (State.SETTLING, Event.VERIFIED): State.ARMED,
    (State.SETTLING, Event.ABORT): State.RESTORING,
    (State.RESTORING, Event.ABORT): State.RESTORING,
    (State.RESTORING, Event.RESTORED): State.DISARMED,
    (State.RESTORING, Event.LEFT): State.BROKEN,
    (State.BROKEN, Event.ABORT): State.RESTORING,
    (State.BROKEN, Event.CLEARED): State.DISARMED,
}
"""State and event to the next state; what is not here is refused."""


def after(state: State, event: Event) -> State:
    """Return the state that follows.

    Raises:
        StateError: The table has no such step.
    """
    try:
        return TRANSITIONS[state, event]
    except KeyError:
        allowed = [known.name for known_state, known in TRANSITIONS if known_state is state]
        raise StateError(
            f"the write gate is {state.value}, which knows no {event.name}, only {', '.join(allowed)}",
            hint="look at the loop, then `ahgateway write PROFILE --arm LOOP --restore`, or --accept as it stands"
            if state is State.BROKEN
            else None,
        ) from None


def diagram() -> str:
    """Return the table as a Mermaid state diagram."""
    lines = ["stateDiagram-v2", "    [*] --> DISARMED"]
    lines += [f"    {state.value} --> {then.value}: {event.value}" for (state, event), then in TRANSITIONS.items()]
    return "\n".join(lines)
