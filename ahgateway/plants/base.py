"""What a plant is: a pure function of its state, its input and the time that passes. binary64, no clock, no chance."""

from __future__ import annotations

from typing import NamedTuple, Protocol, TypeVar

State = TypeVar("State")


class Plant(Protocol[State]):
    """Something that a loop's MV acts on and whose answer is the loop's PV."""

    def rest(self) -> State:
        """Return the state before the first step: at the plant's initial output, nothing under way."""

    def output(self, state: State) -> float:
        """Return PV at this state, in the plant's unit."""

    def step(self, state: State, u: float, dt_s: float) -> tuple[State, float]:
        """Hold the input at `u` for `dt_s` seconds; return the state and PV at the end.

        Raises:
            ValueError: `dt_s` is negative or `u` is not a number.
        """


class DelayLine(NamedTuple):
    """An input on its way through dead time.

    Attributes:
        time_s: Time since rest.
        acting: What arrives at the far end now.
        entered: What went in last.
        pending: Changes under way, each with the time at which it arrives, earliest first.
    """

    time_s: float = 0.0
    acting: float = 0.0
    entered: float = 0.0
    pending: tuple[tuple[float, float], ...] = ()


def delayed(
    line: DelayLine, u: float, dt_s: float, dead_time_s: float
) -> tuple[DelayLine, tuple[tuple[float, float], ...]]:
    """Push `u` in for `dt_s`; return the line, and what came out as pairs of duration in s and value, in order.

    Only changes are kept, with their times: dead time need be no multiple of the step, and a long line is cheap.
    """
    if dt_s < 0.0 or u != u:
        raise ValueError(f"a plant steps forward on a number: u = {u}, dt_s = {dt_s}")
    if dead_time_s <= 0.0:
        return DelayLine(line.time_s + dt_s, u, u), ((dt_s, u),)
    pending = line.pending
    if u != line.entered:
        pending = (*pending, (line.time_s + dead_time_s, u))
    now, end, acting = line.time_s, line.time_s + dt_s, line.acting
    if not pending or pending[0][0] >= end:
        return DelayLine(end, acting, u, pending), ((dt_s, acting),)
    pieces: list[tuple[float, float]] = []
    arrived = 0
    for arrives_s, value in pending:
        if arrives_s >= end:
            break
        if arrives_s > now:
            pieces.append((arrives_s - now, acting))
            now = arrives_s
        acting = value
        arrived += 1
    pieces.append((end - now, acting))
    return DelayLine(end, acting, u, pending[arrived:]), tuple(pieces)
