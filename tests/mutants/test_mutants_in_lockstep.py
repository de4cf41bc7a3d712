"""A PLC with one changed line in its law is convicted on the wire, at the first call whose words come out otherwise."""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType
from typing import Any

import pytest
from lockstep.other_world import OtherWorld
from lockstep.test_other_lockstep import MEDDLING, begun
from mutants import test_mutants_melsec_pid as melsec
from mutants import test_mutants_pid_reg_ce as pulses
from mutants import test_mutants_pid_temp as temp
from mutants.mutate import mutant, pattern

from ahgateway.core.controllers import CONTROLLERS, melsec_pid, pid_reg_ce
from ahgateway.core.verdict import Verdict
from ahgateway.lockstep.judge import Execution

START: dict[str, dict[str, Any]] = {
    "PID_Temp": {
        "Setpoint": 25.0, "Heat_Td": 0.5, "Heat_PWeighting": 0.6, "Heat_DWeighting": 0.3, "Heat_DeadZone": 0.05,
        "Heat_Cycle": 0.2,
    },
    "PID_REG_CE": {"TN": 7.0},
    "MELSEC_PID": {"ALPHA": 30, "TD": 20, "KD": 30, "KP": 137, "SV": 300},
}  # fmt: skip
CHANGED: dict[str, tuple[str, ...]] = {
    "PID_Temp": (
        "P on the bare error", "P in another order", "D on the bare error", "filter forgotten", "sum in another order",
        "integral never stopped", "dead zone jumps", "dead zone ignored", "set switched with a bump",
        "transfer with a bump", "disturbance forgotten", "start mode ignored", "law every call", "carry forgotten",
    ),
    "PID_REG_CE": (
        "error reversed", "durations cut", "derivative not divided", "no backlash", "backlash forgets manual",
        "one call too long", "series survives a change of sign", "limit of Y ignored", "stopped in a pause",
    ),
    "MELSEC_PID": (
        "P from the error alone", "direction reversed", "KD as a derivative gain", "derivative of PV unfiltered",
        "alpha the other way round", "KP in tenths", "TI in tenths of its unit", "second difference from two values",
        "output limits ignored",
    ),
}  # fmt: skip
MORE = {
    "KP in tenths": ("dmv = (REAL(operands.kp) / HUNDRED)", "dmv = (REAL(operands.kp) / TEN)"),
    "TI in tenths of its unit": ("(REAL(operands.ti) / TEN)", "(REAL(operands.ti) / HUNDRED)"),
    "second difference from two values": ("- seen) - before.pvf2", "- seen) - before.pvf1"),
    "output limits ignored": ("mv = limit(low, mv, high)", "mv = raw"),
}
"""A (d) of whole numbers hides last bits, so that MELSEC's mutants on the wire are coarser."""


def law_of(block: str, name: str) -> ModuleType:
    if block == "PID_Temp":
        return temp.assembled(*temp.MUTANTS[name])
    module, rows = (pid_reg_ce, pulses.MUTANTS) if block == "PID_REG_CE" else (melsec_pid, melsec.MUTANTS | MORE)
    return mutant(module, *rows[name])


class Planted:
    """The wrong step, with the right one beside it; remembers the first call that left other words."""

    def __init__(self, ground: OtherWorld, wrong: Callable[..., Any]) -> None:
        self.item = ground.plc._item("L1")
        self.right, self.wrong = CONTROLLERS[ground.loop.controller.name], wrong
        self.state = self.item._state
        self.first: int | None = None
        self.item._step = self.step

    def step(self, inputs: Any, before: Any, dialect: Any, ts: Any) -> tuple[Any, Any]:
        if not getattr(before, "valid", True):
            self.state = before
        self.state, terms = self.right.step(inputs, self.state, dialect, ts)
        after, wrong = self.wrong(inputs, before, dialect, ts)
        for word in self.right.seen:
            if pattern(word.stored(self.state, terms)) != pattern(word.stored(after, wrong)) and self.first is None:
                self.first = self.item.executed + 1
        return after, wrong


@pytest.mark.parametrize(("block", "name"), [(block, name) for block, names in CHANGED.items() for name in names])
async def test_a_changed_line_is_convicted_at_the_first_call_that_shows_it(block: str, name: str) -> None:
    ground = await begun(block, START[block], counter=True)
    await ground.follow(12)
    planted = Planted(ground, law_of(block, name).step)
    for operand, value in [("", None), *MEDDLING[block]]:
        if operand:
            ground.plc.write("L1", operand, value)
        await ground.follow(16)
        if planted.first is not None:
            break

    convicted = [
        picture.count
        for picture, event in ground.events
        if isinstance(event, Execution) and event.verdict is Verdict.DIVERGED
    ]
    assert planted.first is not None
    assert convicted[:1] == [planted.first]
