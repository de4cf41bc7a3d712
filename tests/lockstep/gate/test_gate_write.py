"""The gate on a fake PLC: armed or silent, limits, order, read-back, and everything back where it was."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import pytest
from lockstep.gate.gate_world import WRITES, FailingLink, GateWorld, is_write

from ahgateway.clock import SECOND, VirtualClock
from ahgateway.codec.access import Read, Request
from ahgateway.codec.devices import parse_device
from ahgateway.codec.station import WriteLimit
from ahgateway.errors import AhGatewayError, LinkError, PlcRefusedError, ReplyTimeoutError, StateError, TransportError
from ahgateway.lockstep.gate.change import line
from ahgateway.lockstep.gate.gate import Gate
from ahgateway.lockstep.gate.journal import verify
from ahgateway.lockstep.gate.place import Folders
from ahgateway.lockstep.gate.states import State

SV, MV_MAX, MOUT, PID_MAN = 100, 118, 122, 2
"""Addresses in this world: D100, D118, D122 and M2."""


@pytest.fixture
def world(tmp_path) -> GateWorld:
    return GateWorld(tmp_path)


def kinds(world: GateWorld) -> list[str]:
    return [record["kind"] for record in verify(world.gate().path).records]


async def test_disarmed_it_writes_nothing(world: GateWorld) -> None:
    with pytest.raises(StateError, match="loop L1 is DISARMED, nothing is written"):
        await world.gate().write({"SV": 51.0})
    assert [] == world.sent()


async def test_a_write_lands_is_read_back_and_kept(world: GateWorld) -> None:
    gate = world.gate()
    async with gate.armed("test", keep=True):
        assert gate.state is State.ARMED
        plan = await gate.write({"SV": 52.5})
    # 52.5 = 0x42520000, 50.0 = 0x42480000; the low word stands first.
    assert ["SV D100: 50.0 -> 52.5  [0000 4248 -> 0000 4252]"] == [line(plan.steps[0].items[0])] == plan.lines
    assert [("HOLDING", SV, (0x0000, 0x4252))] == world.sent()
    assert State.DISARMED is gate.state
    assert ["armed", "write", "verified", "ended"] == kinds(world)


async def test_all_that_the_gate_asks_goes_before_the_polls_of_the_line(world: GateWorld) -> None:
    """Its pictures and read-backs too: a poll before a proof would only delay what may have to go back."""
    asked: list[Request] = []

    def note(when: str, request: Request) -> None:
        if when == "before":
            asked.append(request)

    async with world.gate(FailingLink(world.link, note)).armed("test", keep=True) as gate:
        await gate.write({"SV": 52.5})
    reads = [request for request in asked if isinstance(request, Read)]
    assert len(reads) >= 3, "as found, before the write, behind it"
    assert {True} == {request.is_command for request in reads}


async def test_a_dry_run_says_what_would_be_sent_and_sends_nothing(world: GateWorld) -> None:
    plan = await world.gate().preview({"SV": 52.5, "CYCLE": 200})
    assert [
        "SV D100: 50.0 -> 52.5  [0000 4248 -> 0000 4252]",
        "CYCLE D106: 100 -> 200  [0064 0000 -> 00C8 0000]",
    ] == plan.lines
    assert [] == world.sent()
    assert not world.gate().path.exists()


async def test_without_keep_everything_goes_back(world: GateWorld) -> None:
    async with world.gate().armed("test") as gate:
        await gate.write({"SV": 52.5})
        await gate.write({"Kc_Kp": 2.0})
    assert [0x42480000, 0x3FC00000] == world.holds("SV", "Kc_Kp")


async def test_an_error_in_between_puts_everything_back(world: GateWorld) -> None:
    with pytest.raises(ZeroDivisionError):
        async with world.gate().armed("test", keep=True) as gate:
            await gate.write({"SV": 52.5})
            raise ZeroDivisionError
    assert [0x42480000] == world.holds("SV")
    assert State.DISARMED is gate.state


async def test_an_equal_value_is_not_written(world: GateWorld) -> None:
    async with world.gate().armed("test", keep=True) as gate:
        plan = await gate.write({"SV": 50.0})
    assert ((), ("SV",)) == (plan.steps, plan.unchanged)
    assert [] == world.sent()


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"SV": 121.0}, "SV = 121.0 is outside 20…120"),
        ({"SV": 56.0}, "SV: 50.0 -> 56.0 is a step of 6, allowed is 5 at once"),
        ({"SV": math.nan}, "SV = nan is no finite number"),
        ({"SV": 1e39}, "loop L1: SV: 1e+39 is too large for a REAL"),
        ({"BIAS": 1.0}, "BIAS is not on the list of what may be written"),
        ({"MV": 1.0}, "MV is not on the list"),
        ({"I_MV": 1.0}, "I_MV is not on the list"),
        ({"SP": 1.0}, "has no operand `SP`"),
        ({"CYCLE": 1001}, "CYCLE = 1001 is outside 10…1000"),
        ({"SV": 50.5, "Td_Kd": 11.0}, "Td_Kd = 11.0 is outside 0…10"),
    ],
)
async def test_what_is_not_allowed_is_refused_before_anything_is_sent(world: GateWorld, values, said: str) -> None:
    with pytest.raises(AhGatewayError) as caught:
        async with world.gate().armed("test") as gate:
            await gate.write(values)
    assert said in str(caught.value)
    assert [] == world.sent()


async def test_limits_count_after_rounding_to_binary32(world: GateWorld) -> None:
    """120.000001 is 120.0 as a REAL; 120.000005 is its neighbour, 120.00000763."""
    world.plc.write("L1", "SV", 119.0)
    assert 0x42F00000 == _bits(await world.gate().preview({"SV": 120.000001}))
    with pytest.raises(StateError, match=r"SV = 120\.00001 is outside"):
        await world.gate().preview({"SV": 120.000005})


def _bits(plan) -> int:
    low, high = plan.steps[0].items[0].new
    return high << 16 | low


async def test_a_step_of_exactly_the_largest_step_passes(world: GateWorld) -> None:
    world.plc.write("L1", "SV", 40.1)
    plan = await world.gate().preview({"SV": 45.1})
    assert 1 == len(plan.steps)
    with pytest.raises(StateError, match="is a step of"):
        await world.gate().preview({"SV": 45.11})


async def test_one_write_in_its_interval(world: GateWorld) -> None:
    async with world.gate().armed("test") as gate:
        await gate.write({"SV": 51.0})
        with pytest.raises(StateError, match=r"SV was written .* s ago, allowed is one write in 2 s"):
            await gate.write({"SV": 52.0})
        world.clock.advance_ns(2 * SECOND)
        await gate.write({"SV": 52.0})


async def test_the_interval_holds_over_the_end_of_a_run(world: GateWorld) -> None:
    """Else a loop in a shell would be a way around it; what was refused has not been written."""
    async with world.gate().armed("first", keep=True) as gate:
        await gate.write({"SV": 51.0})
    world.clock.advance_ns(SECOND)
    with pytest.raises(StateError, match=r"SV was written 1\.\d* s ago, allowed is one write in 2 s"):
        async with world.gate().armed("second") as gate:
            await gate.write({"SV": 52.0})
    world.clock.advance_ns(SECOND)

    def refuse(when: str, request) -> None:
        if when == "before" and is_write(request):
            raise PlcRefusedError("no", code=4)

    with pytest.raises(PlcRefusedError):
        async with world.gate(FailingLink(world.link, refuse)).armed("refused") as gate:
            await gate.write({"SV": 52.0})
    async with world.gate().armed("third", keep=True) as gate:
        await gate.write({"SV": 52.0})
    assert [(0x0000, 0x424C), (0x0000, 0x4250)] == [words for _, _, words in world.sent()]


async def test_a_clock_that_was_set_back_does_not_lock_an_operand(world: GateWorld) -> None:
    world.clock.advance_ns(3600 * SECOND)
    async with world.gate().armed("first", keep=True) as gate:
        await gate.write({"SV": 51.0})
    world.clock = VirtualClock(utc_start_ns=world.clock.utc_ns() - 86_400 * SECOND)
    async with world.gate().armed("second", keep=True) as gate:
        await gate.write({"SV": 52.0})
    assert 2 == len(world.sent())


async def test_a_sequence_waits_until_its_operand_may_be_written_again(tmp_path) -> None:
    """Into manual MOUT is written twice: where MV stands, then where it is wanted."""
    world = GateWorld(tmp_path, writes={**WRITES, "MOUT": WriteLimit(0.0, 100.0, 5.0, 3.0)})
    mv = float(world.plc.read("L1", "MV"))
    times: list[int] = []

    def note(when: str, request) -> None:
        if when == "before" and is_write(request) and request.address == MOUT:
            times.append(world.clock.now_ns())

    async with world.gate(FailingLink(world.link, note)).armed("test", keep=True) as gate:
        await gate.write({"PID_MAN": True, "MOUT": mv + 3.0})
    assert 2 == len(times)
    assert 3 * SECOND <= times[1] - times[0] < 4 * SECOND


async def test_registers_that_belong_together_go_out_in_one_request(world: GateWorld) -> None:
    async with world.gate().armed("test", keep=True) as gate:
        await gate.write({"MV_MIN": 10.0, "MV_MAX": 60.0})
        await gate.write({"Kc_Kp": 2.0, "Ti_Ki": 0.25})
    # 60.0 = 0x42700000 at D118, 10.0 = 0x41200000 at D120; 2.0 and 0.25 from D108 on.
    assert [
        ("HOLDING", MV_MAX, (0x0000, 0x4270, 0x0000, 0x4120)),
        ("HOLDING", 108, (0x0000, 0x4000, 0x0000, 0x3E80)),
    ] == world.sent()


async def test_registers_that_belong_together_but_stand_apart_are_refused(world: GateWorld) -> None:
    with pytest.raises(StateError, match="Kc_Kp, Td_Kd must land together, but one request cannot hold them"):
        await world.gate().preview({"Kc_Kp": 2.0, "Td_Kd": 1.0})
    plan = await world.gate().preview({"Kc_Kp": 2.0, "Ti_Ki": 0.2, "Td_Kd": 1.0})
    assert [6] == [len(step.request.values) for step in plan.steps]


async def test_into_manual_mout_takes_over_mv_first(world: GateWorld) -> None:
    mv = world.plc.read("L1", "MV")
    async with world.gate().armed("test", keep=True) as gate:
        await gate.write({"PID_MAN": True})
    tables = [(table, address) for table, address, _ in world.sent()]
    assert [("HOLDING", MOUT), ("COIL", PID_MAN)] == tables
    assert abs(float(world.plc.read("L1", "MV")) - float(mv)) < 5.0
    assert [True] == world.holds("PID_MAN")


async def test_into_manual_with_mout_auto_needs_no_write_of_mout(tmp_path) -> None:
    world = GateWorld(tmp_path, {"MOUT_AUTO": True})
    async with world.gate().armed("test", keep=True) as gate:
        await gate.write({"PID_MAN": True})
        with pytest.raises(StateError, match="is a step of"):
            await gate.preview({"MOUT": float(world.plc.read("L1", "MOUT")) + 6.0})
    assert [("COIL", PID_MAN, (1,))] == world.sent()


async def test_mout_that_follows_mv_cannot_be_written_alone(tmp_path) -> None:
    world = GateWorld(tmp_path, {"MOUT_AUTO": True})
    with pytest.raises(StateError, match="MOUT follows MV while MOUT_AUTO is TRUE"):
        await world.gate().preview({"MOUT": 40.0})


async def test_back_from_manual_mout_is_put_back_only_behind_the_transfer(world: GateWorld) -> None:
    async with world.gate().armed("test") as gate:
        await gate.write({"PID_MAN": True})
        held = float(world.plc.read("L1", "MOUT"))
        await gate.write({"MOUT": held + 3.0})
    places = [(table, address) for table, address, _ in world.sent()]
    assert [("HOLDING", MOUT), ("COIL", PID_MAN), ("HOLDING", MOUT), ("COIL", PID_MAN), ("HOLDING", MOUT)] == places
    assert [False, 0] == world.holds("PID_MAN", "MOUT")


async def test_an_operator_who_takes_over_is_not_overwritten(world: GateWorld) -> None:
    async with world.gate().armed("test", keep=True) as gate:
        await gate.write({"PID_MAN": True})
        world.plc.write("L1", "MOUT", 33.0, who="operator")
        count = len(world.sent())
        with pytest.raises(StateError) as caught:
            await gate.write({"MOUT": 34.0})
        assert "somebody else writes too: MOUT holds 33.0" in str(caught.value)
        assert "an operator has taken over, nothing was touched" in str(caught.value)
    assert State.BROKEN is gate.state
    assert count == len(world.sent())
    assert [0x42040000, True] == world.holds("MOUT", "PID_MAN")


async def test_back_in_automatic_by_the_operator_is_a_takeover_too(world: GateWorld) -> None:
    with pytest.raises(StateError, match="PID_MAN holds FALSE, as found FALSE, ours TRUE"):
        async with world.gate().armed("test") as gate:
            await gate.write({"PID_MAN": True})
            world.plc.write("L1", "PID_MAN", False, who="operator")


async def test_what_somebody_changed_is_left_and_the_rest_goes_back(world: GateWorld) -> None:
    gate = world.gate()
    with pytest.raises(StateError, match=r"Kc_Kp put back; SV holds 60\.0, as found 50\.0, ours 52\.5"):
        async with gate.armed("test"):
            await gate.write({"SV": 52.5})
            await gate.write({"Kc_Kp": 2.0})
            world.plc.write("L1", "SV", 60.0, who="operator")
    assert [0x42700000, 0x3FC00000] == world.holds("SV", "Kc_Kp")
    assert State.BROKEN is gate.state


async def test_broken_stays_broken_until_a_person_says_so(world: GateWorld) -> None:
    with pytest.raises(StateError):
        async with world.gate().armed("test") as gate:
            await gate.write({"SV": 52.5})
            world.plc.write("L1", "SV", 60.0, who="operator")
    with pytest.raises(StateError, match="an earlier run ended without putting back SV"):
        await world.gate().arm("again")
    assert world.gate().accept("60 is right")
    assert not world.gate().accept("60 is right")
    async with world.gate().armed("again"):
        assert [0x42700000] == world.holds("SV")


async def test_a_program_that_overwrites_is_named(world: GateWorld) -> None:
    def overwrite(plc) -> None:
        plc.write("L1", "SV", 50.0)
        plc.at(plc.now_ns + 1, overwrite)

    world.plc.at(0, overwrite)
    with pytest.raises(StateError, match=r"SV D100 holds 50\.0 again, not 52\.5") as caught:
        async with world.gate().armed("test") as gate:
            await gate.write({"SV": 52.5})
    assert "PLC program or another master" in str(caught.value.hint)
    assert State.DISARMED is gate.state


async def test_a_busy_plc_is_asked_again(world: GateWorld) -> None:
    async with world.gate().armed("test", keep=True) as gate:
        world.plc.busy = 3
        await gate.write({"SV": 52.5})
    assert [("HOLDING", SV, (0x0000, 0x4252))] == world.sent()


async def test_a_refused_write_puts_the_earlier_ones_back(world: GateWorld) -> None:
    def refuse(when: str, request) -> None:
        if when == "before" and is_write(request) and request.address == 108:
            raise PlcRefusedError("no", code=4)

    async with world.gate(FailingLink(world.link, refuse)).armed("test", keep=True) as gate:
        await gate.write({"SV": 52.5})
        with pytest.raises(PlcRefusedError) as caught:
            await gate.write({"Kc_Kp": 2.0})
    assert (
        caught.value.message
        == str(caught.value)
        == ("loop L1: Kc_Kp D108: 1.5 -> 2.0  [0000 3FC0 -> 0000 4000]: no; SV put back")
    )
    assert [0x42480000, 0x3FC00000] == world.holds("SV", "Kc_Kp")
    assert State.DISARMED is gate.state


async def test_a_write_without_an_answer_is_read_not_repeated(world: GateWorld) -> None:
    lost = []

    def lose(when: str, request) -> None:
        if when == "behind" and is_write(request) and not lost:
            lost.append(request)
            raise ReplyTimeoutError("no reply")

    async with world.gate(FailingLink(world.link, lose)).armed("test", keep=True) as gate:
        await gate.write({"SV": 52.5})
    assert [("HOLDING", SV, (0x0000, 0x4252))] == world.sent()
    assert ["armed", "write", "doubt", "verified", "ended"] == kinds(world)


async def test_a_write_that_never_arrived_is_not_repeated_either(world: GateWorld) -> None:
    def lose(when: str, request) -> None:
        if when == "before" and is_write(request):
            raise LinkError("gone")

    with pytest.raises(StateError, match=r"SV D100 holds 50\.0 again, not 52\.5"):
        async with world.gate(FailingLink(world.link, lose)).armed("test") as gate:
            await gate.write({"SV": 52.5})
    assert [] == world.sent()
    assert State.DISARMED is gate.state


async def test_a_line_too_slow_for_a_picture_is_the_link_s_fault_and_nobody_else_s(world: GateWorld) -> None:
    def slow(when: str, request) -> None:
        world.clock.advance_ns(SECOND // 10)

    with pytest.raises(TransportError, match="no picture without an execution inside it, 16 were taken") as caught:
        await world.gate(FailingLink(world.link, slow)).arm("test")
    assert "too slow for this CYCLE" in str(caught.value.hint)
    assert [] == world.sent()


async def test_a_link_lost_behind_a_write_says_which_and_what_came_of_it(world: GateWorld) -> None:
    gone: list[int] = []

    def lose(when: str, request) -> None:
        if is_write(request) and when == "behind" and not gone:
            gone.append(world.clock.now_ns() + 3 * SECOND)
        if gone and world.clock.now_ns() < gone[0]:
            raise LinkError("unplugged")

    with pytest.raises(LinkError) as caught:
        async with world.gate(FailingLink(world.link, lose)).armed("test") as gate:
            await gate.write({"SV": 52.5})
    said = "SV D100: 50.0 -> 52.5  [0000 4248 -> 0000 4252]: nobody knows whether it arrived: unplugged; SV put back"
    assert f"loop L1: {said}" == str(caught.value)


async def test_a_link_that_comes_back_lets_everything_go_back(world: GateWorld) -> None:
    async with world.gate().armed("test") as gate:
        await gate.write({"SV": 52.5})
        gone_ns = world.clock.now_ns() + 5 * SECOND

        def gone(when: str, request) -> None:
            if world.clock.now_ns() < gone_ns:
                raise LinkError("unplugged")

        gate._wire.link._link = FailingLink(world.link, gone)
    assert [0x42480000] == world.holds("SV")


async def test_a_link_that_stays_away_leaves_it_to_the_next_start(world: GateWorld) -> None:
    gate = world.gate()
    with pytest.raises(StateError, match="could not be put back"):
        async with gate.armed("test"):
            await gate.write({"SV": 52.5})
            world.link.is_down = True
    assert State.BROKEN is gate.state
    world.link.is_down = False
    async with world.gate().armed("next start") as after:
        assert ("SV",) == after.recovered.operands
    assert [0x42480000] == world.holds("SV")


async def test_the_time_is_over(world: GateWorld) -> None:
    async with world.gate().armed("test", duration_ns=10 * SECOND, keep=True) as gate:
        await gate.write({"SV": 52.5})
        world.clock.advance_ns(10 * SECOND)
        with pytest.raises(StateError, match="the time for which it was armed is over"):
            await gate.check()
    assert [0x42480000] == world.holds("SV")


async def test_a_second_gateway_is_refused_while_the_first_is_armed(world: GateWorld) -> None:
    async with world.gate(who="first").armed("test"):
        with pytest.raises(
            StateError, match=r"loop L1 is armed by another gateway on this machine \(process \d+, first\)"
        ):
            await world.gate(who="second").arm("test")
    async with world.gate(who="second").armed("test") as gate:
        assert State.ARMED is gate.state


async def test_another_directory_for_the_journal_is_no_way_around_the_lease(world: GateWorld) -> None:
    def gate(journals: str, target: str) -> Gate:
        station = replace(world.station, target=target)
        place = Folders(world.folder / journals, world.folder / "leases")
        return Gate(station, world.loop, world.link, world.clock, place, who=journals)

    async with gate("one", "modbus+tcp://192.0.2.10").armed("test"):
        with pytest.raises(StateError, match=r"armed by another gateway on this machine \(process \d+, one\)"):
            await gate("two", "modbus+tcp://192.0.2.10:502?unit=1").arm("test")
        async with gate("two", "modbus+tcp://192.0.2.11").armed("another PLC") as other:
            assert world.folder / "two" == other.path.parent


async def test_stop_en_off_and_an_empty_block_are_not_armed(world: GateWorld) -> None:
    world.plc.stop()
    with pytest.raises(StateError, match="the PLC is in STOP"):
        await world.gate().arm("test")
    world.plc.run()
    world.plc.restart(is_retained=False)
    with pytest.raises(StateError, match="every operand reads 0"):
        await world.gate().arm("test")


async def test_a_restart_that_loses_the_block_is_a_takeover(world: GateWorld) -> None:
    """What nobody of us wrote stands there, so that nothing is touched."""
    with pytest.raises(StateError, match="nothing was touched"):
        async with world.gate().armed("test") as gate:
            await gate.write({"SV": 52.5})
            world.plc.restart(is_retained=False)


async def test_what_was_kept_can_be_rolled_back_later(world: GateWorld) -> None:
    async with world.gate().armed("test", keep=True) as gate:
        await gate.write({"SV": 52.5})
    restored = await world.gate().recover()
    assert ("SV",) == restored.operands
    assert restored.is_clean
    assert [0x42480000] == world.holds("SV")
    assert await world.gate().recover() is None


async def test_the_journal_tells_who_why_and_every_value(world: GateWorld) -> None:
    async with world.gate(who="Ada").armed("tune it", keep=True) as gate:
        await gate.write({"SV": 52.5}, "first step")
    armed, write, verified, ended = verify(gate.path).records
    assert ("Ada", "tune it", "L1", [0, 0x4248]) == (armed["who"], armed["why"], armed["loop"], armed["as_found"]["SV"])
    assert ("first step", "holding register", 100, [0, 0x4252]) == tuple(
        write[key] for key in ("why", "table", "address", "words")
    )
    assert {"SV": [0, 0x4252]} == verified["holds"]
    assert ("kept", gate.anchor) == (ended["how"], ended["hash"])
    assert "D100" == json.loads(gate.path.read_text("utf-8").splitlines()[0])["places"]["SV"]


@pytest.mark.parametrize("device", ["SM400", "M1072"])
async def test_run_and_stop_are_never_written_whatever_the_list_says(tmp_path, device: str) -> None:
    world = GateWorld(tmp_path)
    bindings = {**world.loop.bindings, "PID_MAN": parse_device(device)}
    world.loop = replace(world.loop, bindings=bindings, writes={**WRITES, "PID_MAN": WriteLimit()})
    with pytest.raises(StateError, match=f"PID_MAN at `{device}` can stop the PLC and is never written"):
        await world.gate().preview({"PID_MAN": True})


async def test_shared_and_constant_operands_are_refused_whatever_the_list_says(tmp_path) -> None:
    world = GateWorld(tmp_path, loop_changes={"shared": frozenset({"SV"})}, consts={"BIAS": 1.5})
    world.loop = replace(world.loop, writes={**WRITES, "BIAS": WriteLimit(0.0, 1.0, 1.0)})
    with pytest.raises(StateError, match="SV at `D100` is shared with another loop"):
        await world.gate().preview({"SV": 51.0})
    with pytest.raises(StateError, match="BIAS is a constant of the program"):
        await world.gate().preview({"BIAS": 2.0})
