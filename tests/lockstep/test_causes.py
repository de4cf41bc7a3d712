"""Causes after several executions: sizes with their interval, firmware changes, rounding, events that happen once."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from lockstep.bench_world import World
from lockstep.fault_catalogue import tried, warm
from lockstep.ways_world import STILL, ground

from ahgateway.clock import MILLISECOND
from ahgateway.codec.ways import Way
from ahgateway.codec.words import real_words
from ahgateway.core.dialect import DEFAULT, SumOrder, TsSource
from ahgateway.core.real import REAL
from ahgateway.core.repro import differences, load
from ahgateway.fake.faults import Fault
from ahgateway.lockstep.follow import Follower
from ahgateway.lockstep.repro import case_of
from ahgateway.lockstep.suspects import Suspect

PID: dict[str, Any] = {"Kc_Kp": 2.0, "Ti_Ki": 0.3, "Td_Kd": 0.4, "Tf": 0.5, "BIAS": 3.0}


def wrong(change: Any) -> Fault:
    """A PLC that computes with changed arguments of its step."""

    def wrap(step: Any) -> Any:
        return lambda inputs, state, dialect, ts: step(*change(inputs, state, dialect, ts))

    return Fault("test", "changed for a test", wrap, frozenset({"DPIDE"}))


async def gone_wrong(fault: Fault, *, polls: int = 120, seed: int = 5) -> World:
    """A loop that runs well, then computes wrongly through a step of SV."""
    ground = World("DPIDE", PID, seed=seed)
    await ground.follow(120)
    assert ground.follower.counts.diverged == 0
    ground.plc.items["L1"].fail(fault)
    ground.plc.write("L1", "SV", 58.0)
    await ground.follow(polls)
    assert ground.follower.counts.diverged > 1
    return ground


def first(world: World) -> Suspect:
    return world.follower.suspects[0]


async def test_the_real_gain_lies_in_its_interval_which_every_execution_narrows() -> None:
    real = REAL(0.31)
    fault = wrong(lambda inputs, *rest: (inputs._replace(ti_ki=real), *rest))
    early, late = await gone_wrong(fault, polls=12), await gone_wrong(fault, polls=200)

    widths = []
    for world in (early, late):
        suspect = first(world)
        assert ("gain", "Ti_Ki") == (suspect.cause, suspect.operand)
        estimate = suspect.estimate
        assert estimate is not None
        assert estimate.is_exact
        assert estimate.low <= float(real) <= estimate.high
        widths.append(estimate.high - estimate.low)
    assert widths[1] < widths[0]


async def test_the_real_cycle_is_estimated_with_its_interval() -> None:
    fault = wrong(lambda inputs, state, dialect, ts: (inputs, state, dialect, REAL(0.104)))
    suspect = first(await gone_wrong(fault))

    assert "cycle" == suspect.cause
    assert suspect.estimate is not None
    assert "s" == suspect.estimate.unit
    assert suspect.estimate.low <= float(REAL(0.104)) <= suspect.estimate.high


async def test_an_operand_that_the_instruction_does_not_see_acts_as_0() -> None:
    suspect = first(await gone_wrong(wrong(lambda inputs, *rest: (inputs._replace(bias=REAL(0)), *rest))))

    assert ("gain", "BIAS", 0.0) == (suspect.cause, suspect.operand, suspect.ratio)


async def test_a_dialect_that_was_right_for_long_was_changed_by_a_firmware() -> None:
    other = DEFAULT._replace(sum_order=SumOrder.PD_I)
    fault = wrong(lambda inputs, state, dialect, ts: (inputs, state, other, ts))
    suspect = first(await gone_wrong(fault))

    assert ("firmware-change", "sum_order = pd_i") == (suspect.cause, suspect.setting)


async def test_two_axes_changed_together_are_found() -> None:
    other = DEFAULT._replace(filter=1, integrator=1)
    fault = wrong(lambda inputs, state, dialect, ts: (inputs, state, other, ts))
    suspect = first(await gone_wrong(fault))

    assert ("firmware-change", "integrator = trapezoid, filter = forward") == (suspect.cause, suspect.setting)


async def test_a_dialect_that_was_never_right_is_no_change() -> None:
    ground = World("DPIDE", PID, seed=5, loop_changes={"dialect": DEFAULT._replace(sum_order=SumOrder.PD_I)})
    ground.follower = Follower(replace(ground.loop, dialect=DEFAULT))
    await ground.follow(200)

    assert ("dialect", "sum_order = pd_i") == (first(ground).cause, first(ground).setting)


async def test_last_bits_that_no_dialect_explains_are_rounding() -> None:
    ground = World("DPIDE", PID, seed=5)
    await ground.follow(120)
    ground.plc.fail("L1", "binary64-inside")
    ground.plc.write("L1", "SV", 58.0)
    await ground.follow(160)

    assert "rounding" == first(ground).cause


async def test_an_execution_too_many_is_told_from_an_integral_that_somebody_wrote() -> None:
    def twice(step: Any) -> Any:
        def wrapped(inputs: Any, state: Any, dialect: Any, ts: REAL) -> Any:
            once, _ = step(inputs, state, dialect, ts)
            return step(inputs, once, dialect, ts)

        return wrapped

    ground = await gone_wrong(Fault("twice", "executes twice", twice, frozenset({"DPIDE"})), polls=40)

    assert "missed-execution" == first(ground).cause


async def test_an_integral_written_once_is_no_gain() -> None:
    ground = World("DPIDE", PID, seed=4)
    await ground.follow(120)
    table = ground.station.devices.ranges[0].table
    place = ground.loop.bindings["I_MV"].index  # type: ignore[union-attr]
    due_ns = ground.plc.log("L1")[-1].time_ns + 100 * MILLISECOND
    ground.plc.at(due_ns - 4 * MILLISECOND, lambda plc: plc.memory.write(table, place, (0, 0x41C8)))
    await ground.follow(60)

    assert {"operand-written", "integral"} == {suspect.cause for suspect in ground.follower.suspects}
    assert "operand-written" == first(ground).cause


async def test_a_gain_that_fits_two_executions_stands_before_two_writes() -> None:
    ground = World("DPID", {"Kp": 1.7, "Ki": 0.35, "Kd": 0.35, "PID_MAN": True, "MOUT": 60.0, "SV": 60.0}, seed=3)
    await ground.follow(40)
    ground.plc.fail("L1", "ki-1-percent")
    ground.plc.write("L1", "PID_MAN", False)
    await ground.follow(11)  # a transfer and two executions
    ground.plc.write("L1", "PID_MAN", True)
    await ground.follow(20)

    assert 2 == ground.follower.counts.diverged
    assert ("gain", "Ki") == first(ground).key[:2]
    assert "operand-written" in {suspect.cause for suspect in ground.follower.suspects}


async def test_what_nothing_explains_is_unknown_and_says_for_how_many() -> None:
    fault = wrong(
        lambda inputs, state, dialect, ts: (
            inputs._replace(kc_kp=inputs.kc_kp + inputs.pv / inputs.sv, ti_ki=inputs.ti_ki * inputs.pv),
            state,
            dialect,
            ts,
        )
    )
    ground = await gone_wrong(fault, polls=40)

    assert "unknown" == first(ground).cause
    assert f"most of these {ground.follower.counts.diverged} divergences" in first(ground).evidence


async def test_an_interval_that_is_measured_is_named_for_the_whole_run_at_a_bounded_price() -> None:
    ground = World("DPIDE", PID, seed=5, scan_ms=7, loop_changes={"dialect": DEFAULT._replace(ts_source=TsSource.MS)})
    steps = 0

    def counting(*arguments: Any) -> Any:
        nonlocal steps
        steps += 1
        return ground.loop.controller.step(*arguments)

    counted = replace(ground.loop.controller, step=counting)
    ground.follower = Follower(replace(ground.loop, dialect=DEFAULT, controller=counted))
    ground.plc.write("L1", "SV", 58.0)
    await ground.follow(200)

    assert ground.follower.counts.diverged > 20
    assert ("dialect", "ts_source = ms") == (first(ground).cause, first(ground).setting)
    assert "identify" in first(ground).evidence
    # A step costs some 10 µs: more of them would keep the link waiting behind each divergence.
    assert steps < 2500 * ground.follower.counts.diverged


async def test_a_loop_of_which_nothing_ever_agreed_is_sent_to_identify() -> None:
    ground = World("DPIDE", PID, seed=5)
    ground.plc.items["L1"].fail(
        wrong(
            lambda inputs, *rest: (
                inputs._replace(kc_kp=inputs.kc_kp + inputs.pv / inputs.sv, ti_ki=inputs.ti_ki * inputs.pv),
                *rest,
            )
        )
    )
    await ground.follow(120)

    assert "unknown" == first(ground).cause
    assert "run `ahgateway identify PROFILE --save PROFILE`" in first(ground).evidence


async def test_a_loop_that_agreed_once_is_not_sent_to_identify() -> None:
    fault = wrong(
        lambda inputs, *rest: (
            inputs._replace(kc_kp=inputs.kc_kp + inputs.pv / inputs.sv, ti_ki=inputs.ti_ki * inputs.pv),
            *rest,
        )
    )
    ground = await gone_wrong(fault, polls=40)

    assert "unknown" == first(ground).cause
    assert "identify" not in first(ground).evidence


@pytest.mark.parametrize(
    ("fault", "cause", "operand"),
    [
        ("gain-1-percent", "gain", "Kc_Kp"),
        ("ki-1-percent", "gain", "Ti_Ki"),
        ("integral-late", "firmware-change", ""),
    ],
)
async def test_polling_slower_than_cycle_names_the_cause_too(fault: str, cause: str, operand: str) -> None:
    slow = ground(Way.COUNTED, "DPIDE", PID, seed=5)
    await slow.follow(30)
    assert slow.follower.counts.diverged == 0
    slow.plc.fail("L1", fault)
    slow.plc.write("L1", "SV", 58.0)
    await slow.follow(12)

    execution = next(event for _, event in slow.events if getattr(event, "blame", None) is not None)
    assert execution.count > 1
    assert (cause, operand) == (first(slow).cause, first(slow).operand)


async def test_several_executions_are_played_again_from_a_file() -> None:
    slow = ground(Way.COUNTED, "DPIDE", PID, seed=5)
    await slow.follow(30)
    slow.plc.fail("L1", "gain-1-percent")
    slow.plc.write("L1", "SV", 58.0)
    await slow.follow(4)
    picture, execution = next(
        (picture, event) for picture, event in slow.events if getattr(event, "blame", None) is not None
    )
    case = case_of(slow.loop, execution.blame, picture)

    assert case is not None
    assert execution.count == len(case.executions) > 1
    assert differences(load(case.text()))
    assert case.likeliest is not None
    assert [] == differences(load(case.text()), case.likeliest)


async def test_a_size_that_was_coarse_at_first_is_held_to_what_follows() -> None:
    """What the first, coarser size has left in D's filter is no reason to drop it."""
    dependent = {**PID, "PID_EQ": True, "Ti_Ki": 1.48, "Kc_Kp": 1.96}
    world = ground(Way.STEPPED, "DPIDE", dependent, seed=0)
    await world.follow(30)
    world.plc.fail("L1", "gain-1-percent")
    world.plc.write("L1", "SV", 55.0)
    await world.follow(14)

    assert world.follower.counts.diverged > 10
    assert ("gain", "Kc_Kp") == (first(world).cause, first(world).operand)


@pytest.mark.parametrize(("cycles_apart", "is_convicted"), [(1, True), (3, False)])
async def test_an_integral_alone_that_moves_at_each_execution_is_nobodys_hand(
    cycles_apart: int, is_convicted: bool
) -> None:
    still = ground(Way.POLLED, "DPIDE", {**PID, "PID_MAN": True, "MOUT": 40.0}, seed=4, plant=STILL)
    await still.follow(40)
    table = still.station.devices.ranges[0].table
    place = still.loop.bindings["I_MV"].index  # type: ignore[union-attr]
    for number in range(6):
        still.plc.memory.write(table, place, real_words(REAL(11.0 + number)))
        await still.follow(4 * cycles_apart)

    assert is_convicted == bool(still.follower.counts.diverged)


@pytest.mark.parametrize(
    ("name", "law", "dialect", "seed", "way"),
    [
        ("no-bumpless", "DPIDE", 10, 0, Way.RECORDED),  # the integral gives it away, whatever D holds
        ("no-bumpless", "DPID", 26, 0, Way.STEPPED),  # another moment of the write is the right reading
        ("filter-ignored", "DPIDE", 6, 0, Way.COUNTED),  # D stays known while PV stands still
        ("no-bumpless", "DPIDE", 6, 0, Way.COUNTED),  # an unseen transfer sets the integral from a D known to few bits
        ("no-bumpless", "DPIDE", 14, 1, Way.POLLED),  # a gain of some size explains one reading, the transfer another
        ("no-bumpless", "DPIDE", 27, 0, Way.POLLED),  # D has no part in the integral that a transfer sets
        ("no-bumpless", "DPIDE", 8, 0, Way.COUNTED),  # the transfer was not the last of several executions
        ("binary64-inside", "DPIDE", 11, 1, Way.COUNTED),  # two last bits that an order explains are rounding yet
        ("windup", "DPID", 15, 0, Way.COUNTED),  # only I_MV moves at the limit
        ("direction-reversed", "DPIDE", 1, 1, Way.COUNTED),  # D goes on while no word changes
        ("wrong-ts", "DPIDE", 18, 1, Way.RECORDED),  # a size that no REAL near it fits in both words at once
        ("truncation", "DPIDE", 10, 1, Way.RECORDED),  # D is a small difference of large numbers
        ("binary64-inside", "DPID", 22, 2, Way.RECORDED),  # another order of the sum explains most of it by chance
    ],
)
async def test_a_fault_is_convicted_of_its_cause(name: str, law: str, dialect: int, seed: int, way: Way) -> None:
    trial = await tried(name, law, dialect, seed, way)

    assert 0 == trial.false
    assert trial.convicted
    assert trial.is_right, trial.suspects[:3]


async def test_two_causes_that_leave_the_same_bits_all_through_a_run_both_stand() -> None:
    """D acts on a PV that stands still: Ki and Ts show as their product alone."""
    trial = await tried("ki-1-percent", "DPID", 9, 0, Way.COUNTED)

    assert trial.is_tied
    assert {("gain", "Ki"), ("cycle", "CYCLE")} == {suspect.key[:2] for suspect in trial.suspects[:2]}


async def test_no_limit_that_a_hidden_d_might_have_reached_holds_the_integral() -> None:
    world = await warm("DPIDE", 19, 1, Way.COUNTED)

    assert 0 == world.follower.counts.diverged
    assert world.follower.counts.proven > 10
