"""The dialect of PID_Temp, PID_REG_CE and MELSEC PID is learned from pictures of a block that a person moves."""

from __future__ import annotations

import random
from typing import Any

import pytest
from lockstep.other_world import OtherWorld
from lockstep.test_other_lockstep import BLOCKS, MEDDLING, STEPS, begun_in

from ahgateway.core.controllers import CONTROLLERS
from ahgateway.core.controllers.block_axes import axes_of
from ahgateway.lockstep.identify import Identification
from ahgateway.lockstep.identify_calls import identify_calls
from ahgateway.lockstep.picture import Picture

DIALECTS = 24
FOREIGN = STEPS | {"PID_Temp": (25.0, 28.0)}


class Kept(OtherWorld):
    """A world that keeps its pictures; its block computes in a dialect of its own."""

    def __init__(self, name: str, values: dict[str, int], initial: dict[str, Any] | None = None, seed: int = 1) -> None:
        law = CONTROLLERS[name]
        dialect = law.dialect._replace(**{axis: law.axes[axis](value) for axis, value in values.items()})
        super().__init__(name, initial, counter=True, seed=seed, loop_changes={"dialect": dialect})
        self.pictures: list[Picture] = []

    async def poll(self) -> list[Any]:
        self.clock.advance_ns(self.poll_ns)
        self.pictures.extend(each for each in await self.sampler.pictures() if isinstance(each, Picture))
        return []

    async def moved(self, moves: list[tuple[str, Any]], polls: int = 12) -> None:
        """Write one operand after the other."""
        await begun_in(self, self.loop.controller.name)
        await self.follow(polls)
        for operand, value in moves:
            self.plc.write("L1", operand, value)
            await self.follow(polls)

    def learned(self) -> Identification:
        return identify_calls(self.loop, self.pictures)


def drawn(name: str, seed: int) -> dict[str, int]:
    """A dialect at random. MELSEC's (d) is a whole number here, which shows a REAL sum rounded."""
    rng = random.Random(seed)
    return {
        axis: int(rng.choice([value for value in values if axis != "number_format" or value]))
        for axis, values in CONTROLLERS[name].axes.items()
    }


@pytest.mark.parametrize("seed", range(DIALECTS))
@pytest.mark.parametrize("name", BLOCKS)
async def test_the_true_dialect_survives(name: str, seed: int) -> None:
    truth = drawn(name, seed)
    world = Kept(name, truth, seed=seed + 1)
    moves = list(MEDDLING[name])
    random.Random(seed).shuffle(moves)
    await world.moved(moves)

    found = world.learned()
    assert found.unexplained is None
    wrong = {axis: (value, found.values[axis]) for axis, value in truth.items() if value not in found.values[axis]}
    assert wrong == {}
    survivors = [each._asdict() for each in found.survivors]
    assert any(all(value in (0, truth[axis]) for axis, value in each.items() if axis in truth) for each in survivors)


ADVISED: list[tuple[str, str, dict[str, Any], list[tuple[str, Any]], int]] = [
    ("PID_Temp", "dead_zone", {}, [("Heat_DeadZone", 2.0), ("Setpoint", 35.0)], 24),
    ("PID_Temp", "zone_return", {}, [("Heat_ControlZone", 5.0), ("Setpoint", 90.0), ("Setpoint", 38.0)], 24),
    ("PID_Temp", "switching", {"ActivateCooling": True, "Setpoint": 10.0}, [], 24),
    ("PID_Temp", "resume", {}, [("Setpoint", float("nan")), ("Setpoint", 30.0)], 24),
    ("PID_Temp", "invalid_gain", {"Setpoint": 25.0}, [("Heat_Gain", 0.0), ("Heat_Gain", 2.0)], 24),
    ("PID_Temp", "sampling_time", {"Heat_Cycle": 0.15, "Setpoint": 25.0}, [], 24),
    (
        "PID_Temp", "disturbance_place",
        {"ActivateCooling": True, "AdvancedCooling": False, "CoolFactor": 2.0, "Setpoint": 15.0},
        [("Disturbance", 3.0)], 24,
    ),
    (
        "PID_Temp", "per_rounding",
        {"Heat_Select": 2, "Heat_PerUpperScaling": 100.0},
        [("ManualEnable", True), ("ManualValue", 12.5)], 24,
    ),
    ("PID_REG_CE", "error_sign", {}, [("ACTION", True)], 24),
    ("PID_REG_CE", "idle_y", {}, [("REG_AVT", False)], 24),
    ("PID_REG_CE", "stopped", {"SET_POINT": 43.0}, [("SET_POINT", 44.0), ("SET_POINT", 45.0)], 24),
    ("PID_REG_CE", "zone_pulse", {}, [("SET_POINT", 41.0), ("D_ZONE", 50.0), ("D_ZONE", 0.3)], 24),
    ("PID_REG_CE", "no_minimum_pulse", {}, [("PT_MIN_IMP", 0.0)], 24),
    ("MELSEC_PID", "number_format", {"KP": 37, "SV": 300}, [("SV", 310)], 24),
    ("MELSEC_PID", "destination_written", {"SV": 300}, [("MV", 300)], 24),
    ("MELSEC_PID", "action_change", {"SV": 300}, [("ACT", 32), ("ACT", 33)], 24),
    ("MELSEC_PID", "variation", {"ACT": 35, "S20": 1, "S21": 50, "SV": 300}, [("SV", 400), ("SV", 300)], 24),
    ("MELSEC_PID", "first_execution", {"ALPHA": 40, "SV": 300}, [], 24),
    (
        "PID_Temp", "zone_at_transfer",
        {"Heat_ControlZone": 5.0},
        [("ManualEnable", True), ("ManualEnable", False), ("Setpoint", 22.0)], 10,
    ),
    (
        "PID_Temp", "warning_edge",
        {"InputPerOn": True, "InputScaling_UpperPointIn": 100.0, "Input_PER": 30},
        [("InputUpperWarning", 30.0)], 24,
    ),
    (
        "PID_Temp", "warning_latch",
        {},
        [
            ("ModeActivate", False), ("Mode", 9), ("ModeActivate", True), ("ModeActivate", False), ("Mode", 3),
            ("ModeActivate", True),
        ], 8,
    ),
    (
        "PID_Temp", "pwm_inactive",
        {"Heat_Cycle": 1.0, "ManualValue": 50.0},
        [("Heat_Select", 0), ("Heat_Select", 1), ("ManualEnable", True), ("Reset", True), ("Reset", False)], 20,
    ),
    (
        "PID_Temp", "pwm_conflict",
        {"Heat_Cycle": 1.0, "Heat_MinimumOnTime": 0.7, "Heat_MinimumOffTime": 0.7, "ManualValue": 50.0},
        [("ManualEnable", True), ("Heat_Select", 0), ("Heat_Select", 1)], 12,
    ),
    ("PID_REG_CE", "integral_span", {"TN": 1.0, "KP": 1.0, "SET_POINT": 60.0}, [], 90),
    ("PID_REG_CE", "pause_from", {"TN": 2.0, "KP": 1.0, "SET_POINT": 52.0}, [], 200),
    ("PID_REG_CE", "short_pulse", {"KP": 1.0, "D_ZONE": 0.05, "TN": 0.0, "SET_POINT": 43.0}, [], 420),
    ("PID_REG_CE", "backlash_pause", {"SET_POINT": 50.0, "KP": 1.0}, [("SET_POINT", 35.0)], 150),
    ("PID_REG_CE", "series_end", {"KP": 1.0, "TN": 5.0}, [("D_ZONE", 50.0), ("D_ZONE", 0.3)], 24),
    ("MELSEC_PID", "alarm_input", {"ALPHA": 60, "ACT": 35, "S20": 8, "S21": 8}, [("SV", 300), ("SV", 700)], 24),
]  # fmt: skip


@pytest.mark.parametrize("value", [0, 1])
@pytest.mark.parametrize(("name", "axis", "initial", "moves", "polls"), ADVISED)
async def test_what_is_advised_closes_the_axis(
    name: str, axis: str, initial: dict[str, Any], moves: list[tuple[str, Any]], polls: int, value: int
) -> None:
    value += axis == "number_format"
    world = Kept(name, {axis: value}, initial)
    await world.moved(moves, polls=polls)

    assert world.learned().values[axis] == (value,)


def test_advice_is_followed_for_every_axis_but_one() -> None:
    every = {(name, axis) for name in BLOCKS for axis in CONTROLLERS[name].axes}
    assert {("PID_REG_CE", "first_backlash")} == every - {row[:2] for row in ADVISED}


@pytest.mark.parametrize("value", [0, 1])
async def test_whether_the_very_first_pulse_is_lengthened_no_picture_tells(value: int) -> None:
    """A first pulse with PT_LUFT is also one after a motion the other way; one without is also one after the same way.

    So both values stay, each with the last motion that makes it right.
    """
    world = Kept("PID_REG_CE", {"first_backlash": value})
    await world.moved([("SET_POINT", 60.0), ("SET_POINT", 35.0)], polls=60)
    assert world.learned().values["first_backlash"] == (0, 1)


@pytest.mark.parametrize("name", BLOCKS)
async def test_a_foreign_law_is_not_named_and_the_first_call_is_shown(name: str) -> None:
    world = Kept(name, {})
    world.plc.fail("L1", "kp-1-percent")
    await world.moved([(CONTROLLERS[name].roles.sv, value) for value in FOREIGN[name]])

    found = world.learned()
    assert not found.is_named
    assert found.unexplained is not None
    assert any(plc != ref for plc, ref in found.unexplained.words.values())


def test_every_axis_has_a_row_with_a_meaning_for_each_value() -> None:
    for name in BLOCKS:
        axes = CONTROLLERS[name].axes
        assert [row.name for row in axes_of(name)] == list(axes)
        for row in axes_of(name):
            assert len(row.values) == len(axes[row.name])
            assert row.excitation


async def test_too_little_names_nothing() -> None:
    world = Kept("PID_REG_CE", {})
    await world.follow(3)
    assert not world.learned().is_named
