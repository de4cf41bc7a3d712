"""What is looked at before anything is written: is the PLC fit for it, is it too soon, has somebody else written."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from ahgateway.clock import SECOND
from ahgateway.codec.block import Raw
from ahgateway.codec.station import Loop
from ahgateway.errors import StateError
from ahgateway.lockstep.gate import change
from ahgateway.lockstep.gate.change import Step
from ahgateway.lockstep.gate.outcome import conflict_text
from ahgateway.lockstep.gate.session import Conflict, Session
from ahgateway.lockstep.picture import Picture


def fit(loop: Loop, picture: Picture) -> None:
    """Make sure that a write would be carried out, and that a loop stands there.

    Raises:
        StateError: The PLC is in STOP, EN is off, or the whole block is empty.
    """
    if picture.running is False:
        raise StateError(f"loop {loop.name}: the PLC is in STOP, nothing would carry a write out")
    if picture.enabled is False and loop.trigger is None:
        raise StateError(f"loop {loop.name}: EN is off, the instruction would not see a write")
    if not any(any(words) for words in picture.words.values()):
        raise StateError(
            f"loop {loop.name}: every operand reads 0, so that there may be no loop at these addresses",
            hint="compare SV and PV with ISPSoft before anything is written there",
        )


def rate(loop: Loop, steps: Sequence[Step], written_ns: Mapping[str, int], now_ns: int) -> None:
    """Make sure that the shortest time between two writes of an operand is over.

    Raises:
        StateError: It is not.
    """
    for item in (item for step in steps for item in step.items if item.old != item.new):
        last_ns = written_ns.get(item.operand)
        limit_s = loop.writes[item.operand].interval_s
        if last_ns is not None and now_ns - last_ns < limit_s * SECOND:
            raise StateError(
                f"loop {loop.name}: {item.operand} was written {(now_ns - last_ns) / SECOND:.3g} s ago, "
                f"allowed is one write in {limit_s:g} s",
                hint="wait as long; interval_s in the profile is that time",
            )


def left_ns(loop: Loop, names: Iterable[str], written_ns: Mapping[str, int], now_ns: int) -> int:
    """Return how long it takes until each of these operands may be written again, 0 when all may."""
    waits = (
        round(loop.writes[name].interval_s * SECOND) - (now_ns - written_ns[name])
        for name in names
        if name in written_ns
    )
    return max(0, *waits, 0)


def ours(loop: Loop, session: Session, picture: Picture) -> None:
    """Make sure that mode and everything that was written hold what we found or wrote.

    Raises:
        StateError: Somebody else has written.
    """
    roles, now = loop.controller.roles, picture.words
    names = list(dict.fromkeys([*roles.modes, *session.written]))
    if change.follows_mv(roles, now):
        names = [name for name in names if name != roles.mout]
    _refuse(loop, session, now, names)


def as_found(loop: Loop, session: Session, step: Step, picture: Picture) -> None:
    """Make sure that what is written for the first time stands as found; a manual value that follows MV need not.

    Raises:
        StateError: Somebody else has written.
    """
    roles, now = loop.controller.roles, picture.words
    follows = {roles.mout} if roles.follows and now[roles.follows][0] else set()
    names = [item.operand for item in step.items if item.operand not in session.written]
    _refuse(loop, session, now, [name for name in names if name not in follows])


def _refuse(loop: Loop, session: Session, now: Raw, names: Sequence[str]) -> None:
    taken = [name for name in names if name in now and not session.is_ours(name, now)]
    if taken:
        texts = [
            conflict_text(
                loop, Conflict(name, session.as_found[name], tuple(session.possible.get(name, ())), now[name])
            )
            for name in taken
        ]
        raise StateError(f"loop {loop.name}: somebody else writes too: {'; '.join(texts)}")
