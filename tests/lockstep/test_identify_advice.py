"""The advice for an open axis, taken on the fake PLC; every axis and value is walked by `bench/bench_advice.py`."""

from __future__ import annotations

import pytest
from lockstep.advice import NOT_IN_PICTURES, Advice, every, walked

from ahgateway.core.dialect import AXES
from ahgateway.core.dialect_axes import value_name

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
