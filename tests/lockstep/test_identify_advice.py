"""The advice for an open axis, taken on the fake PLC; every axis and value is walked by `bench/bench_advice.py`."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from typing import Any

import pytest
from lockstep.advice import NOT_IN_PICTURES, PLAIN, Advice, every, walked

from ahgateway.core.controllers import CONTROLLERS
from ahgateway.core.dialect import AXES
from ahgateway.core.dialect_axes import BY_NAME, value_name

SOME = {
    "freeze": (1,),
    "manual_refresh": (0, 1),
    "run_off_scan": (0, 1),
    "run_off_mout": (1,),
    "run_on": (2,),
    "limits": (1, 2),
    "clamped": (1,),
    "en_on_history": (1,),
    "schedule": (1,),
    "ts_source": (0,),
    "stop_history": (1,),
    "run_off_manual": (2,),
    "preset_mv": (1,),
    "cross_scan": (0, 1),
    "cross_band": (1,),
}
"""One or two values of axes of every kind, of DPID where it has them."""

SAMPLE = [
    (name, advice, value)
    for name, advice, value in every()
    if value in SOME.get(advice.axis, ()) and (name == "DPID" or advice.axis.startswith("cross"))
]


@pytest.mark.parametrize(
    ("name", "advice", "value"),
    SAMPLE,
    ids=[f"{each.axis}-{value_name(each.axis, value)}" for _, each, value in SAMPLE],
)
async def test_what_is_advised_closes_the_axis(name: str, advice: Advice, value: int) -> None:
    learned = await walked(name, advice, value)

    assert learned.found.unexplained is None
    assert value_name(advice.axis, value) == learned.decided().get(advice.axis)


@pytest.mark.slow
async def test_without_the_advice_the_axis_stays_open() -> None:
    name, advice, value = next(each for each in SAMPLE if each[1].axis == "limits")
    learned = await walked(name, advice, value, is_taken=False)

    assert "limits" in [one.axis for one in learned.open()]


def test_every_axis_has_its_walk() -> None:
    walks = {advice.axis for _, advice, _ in every()}
    assert set(AXES) - walks - {"pv_word"} == set(NOT_IN_PICTURES)


SAID_AS = {
    "K": r"P gain|the P and|a gain|gains|Kc_Kp|P,",
    "I": r"I gain|gains|Ti_Ki|integration",
    "D": r"D gain|gains|Td_Kd|D alone",
    **dict.fromkeys(("near", "once", "flick"), "PV"),
}
"""How the advice calls what a walk moves, where not by its name."""

BY_THE_WAY = {
    "manual_integral": {"MOUT": "it ends with the transfer that other axes ask for"},
    "tf_unit": {"SV": "so that PV moves", "I": "in the unit that PID_EQ asks for"},
    "dependent_sum": {"I": "in the unit that PID_EQ asks for"},
}
"""What a walk moves though the axis does not ask for it, and why."""


def moved(moves: Iterable[Any]) -> Iterator[str]:
    for move in moves:
        if isinstance(move[0], tuple):
            yield from moved(move)
        elif move[0] not in ("wait", "execution"):
            yield move[0]


def printed(axis: str) -> str:
    """All that a person is told to do about an axis: what the axes say on which it waits, too."""
    return " ".join((BY_NAME[axis].excitation, *map(printed, BY_NAME[axis].after)))


def test_what_a_walk_moves_is_what_the_advice_says() -> None:
    for name, advice, _ in every():
        for operand in set(moved(advice.moves)) - BY_THE_WAY.get(advice.axis, {}).keys():
            said_as = SAID_AS.get(operand, rf"\b{operand}\b")
            assert re.search(said_as, printed(advice.axis)), (name, advice.axis, operand)


def test_what_an_axis_asks_to_write_is_what_its_walk_moves() -> None:
    gains = {"Kp": "K", "Kc_Kp": "K", "Ki": "I", "Ti_Ki": "I", "Kd": "D", "Td_Kd": "D"}
    for name, advice, _ in every():
        operands = {row.name for row in CONTROLLERS[name].operands} - {"PV", "MV", "I_MV", "CYCLE"}
        # What shall be off or 0 is so from the start; MOUT that shall not be 0 goes along with MV.
        asked = operands & set(re.findall(r"\b(\w+)\b(?! off| 0| not 0)", BY_NAME[advice.axis].excitation))
        walked_through = {*moved(advice.moves), *advice.before, *PLAIN}
        assert {gains.get(operand, operand) for operand in asked} <= walked_through, (name, advice.axis)
