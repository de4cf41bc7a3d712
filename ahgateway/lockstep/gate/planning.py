"""What a write would do, from what is wanted and one picture: steps in order, every limit checked. No I/O."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ahgateway.codec.block import Raw
from ahgateway.codec.station import Loop, Station
from ahgateway.errors import StateError
from ahgateway.lockstep.gate import change
from ahgateway.lockstep.gate.change import Step
from ahgateway.lockstep.gate.outcome import Plan
from ahgateway.lockstep.gate.stepping import TRIGGER
from ahgateway.lockstep.picture import Picture


def plan(loop: Loop, station: Station, values: Mapping[str, Any], picture: Picture) -> Plan:
    """Return every step that a write of these values would take now.

    Raises:
        StateError: Something may not be written, or a limit forbids it.
        CodecError: A kind cannot hold its value.
    """
    found: list[Step] = []
    roles = loop.controller.roles
    # A later stage starts from what the earlier ones leave.
    words = dict(picture.words)
    for stage in change.stages(loop, values, picture.words):
        is_takeover = stage == {roles.mout: None}
        if is_takeover and change.follows_mv(roles, words):
            words[roles.mout] = words[roles.mv]
            continue
        wanted = {roles.mout: picture.seen[roles.mv]} if is_takeover else stage
        for step in _steps(loop, station, wanted, words, picture):
            found.append(step)
            words.update({item.operand: item.new for item in step.items})
    changed = {item.operand for step in found for item in step.items}
    return Plan(loop.name, tuple(found), tuple(name for name in values if name not in changed))


def steps(loop: Loop, station: Station, stage: Mapping[str, Any], picture: Picture) -> tuple[Step, ...]:
    """Return the steps of one stage, from what stands in the picture; raises as `plan`."""
    return _steps(loop, station, stage, dict(picture.words), picture)


def streamed(loop: Loop, station: Station, operand: str, value: Any, now: Raw) -> Step:
    """Return the request that writes the process value of a bench, or its trigger, once more.

    Raises:
        StateError: It is no bench or neither of the two, it may not be written, or a limit forbids it.
    """
    if not station.bench or operand not in (*loop.controller.roles.pvs, TRIGGER):
        raise StateError(
            f"loop {loop.name}: {operand} is not streamed, only the process value of a bench and its trigger are",
            hint='kind = "bench" in [station] says that nothing but our simulation hangs on the PLC',
        )
    return change.single(station, change.item(loop, station, operand, value, now))


def _steps(loop: Loop, station: Station, stage: Mapping[str, Any], words: Raw, picture: Picture) -> tuple[Step, ...]:
    items = []
    roles = loop.controller.roles
    for name, value in stage.items():
        stuck = loop.controller.comes_back(picture.inputs, picture.seen) if name == roles.manual else ""
        if stuck:
            raise StateError(
                f"loop {loop.name}: behind a manual time it would not be as found: {stuck}",
                hint="set the mode with the PLC's own tools first",
            )
        in_automatic = name == roles.mout and not change.in_manual(roles, words)
        if in_automatic and change.follows_mv(roles, words):
            raise StateError(
                f"loop {loop.name}: {name} follows {roles.mv} while {roles.follows} is TRUE, in automatic",
                hint=f"write {roles.manual}=TRUE with it",
            )
        # In automatic MOUT moves nothing: what counts is how far MV would jump at the transfer.
        reference = picture.seen[roles.mv] if in_automatic else None
        items.append(change.item(loop, station, name, value, words, reference=reference))
    return change.steps(loop, station, items)
