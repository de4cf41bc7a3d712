"""When an instruction is executed, what it reads and what it leaves."""

from __future__ import annotations

import numpy as np
import pytest

from ahgateway.clock import MILLISECOND
from ahgateway.codec.access import Read, Table, Write
from ahgateway.codec.devices import parse_device
from ahgateway.codec.station import FakeLoop, PlantSpec
from ahgateway.core.dialect import Dialect, FirstCall

REAL = np.float32
LOOP = "LIC-201"
STILL = FakeLoop({"SV": 10.0, "PV": 8.0, "CYCLE": 10, "Kp": 2.0, "Ki": 0.5})  # Ts 0.1 s


def milliseconds(plc, loop=LOOP):
    return [execution.time_ns // MILLISECOND for execution in plc.log(loop)]


def test_an_execution_leaves_integral_pv_and_mv_in_memory(make_plc):
    plc = make_plc(setups={LOOP: STILL})
    plc.scan()
    # P = 2·2 = 4, I = 0.5·2·0.1 = 0.1, MV = 4.1 = 0x40833333 in REAL; PV 8.0 = 0x41000000.
    assert plc.answer(Read(1, Table.HOLDING, 200, 2)) == (0x3333, 0x4083)
    assert plc.answer(Read(1, Table.HOLDING, 122, 4)) == (0xCCCD, 0x3DCC, 0x0000, 0x4100)


def test_the_first_execution_is_at_once_and_the_others_every_cycle(make_plc):
    plc = make_plc(setups={LOOP: STILL})
    plc.advance(320 * MILLISECOND)
    assert milliseconds(plc) == [5, 105, 205, 305]


def test_the_first_execution_can_wait_for_one_cycle(make_plc, make_dpid):
    loop = make_dpid(dialect=Dialect(first_call=FirstCall.AFTER_CYCLE))
    plc = make_plc([loop], {LOOP: STILL})
    plc.advance(320 * MILLISECOND)
    assert milliseconds(plc) == [105, 205, 305]


def test_a_scan_that_does_not_divide_the_cycle_causes_no_drift(make_plc):
    plc = make_plc(setups={LOOP: STILL}, scan_ns=7 * MILLISECOND)
    plc.advance(800 * MILLISECOND)
    # First at 7 ms; then at the first scan at or after 107, 207, … : the excess is carried over.
    assert milliseconds(plc) == [7, 112, 210, 308, 413, 511, 609, 707]


def test_time_that_would_make_the_next_execution_due_at_once_is_dropped(make_plc):
    plc = make_plc(setups={LOOP: STILL})
    plc.scan(5 * MILLISECOND)
    plc.scan(350 * MILLISECOND)
    plc.scan(5 * MILLISECOND)
    plc.scan(94 * MILLISECOND)
    plc.scan(1 * MILLISECOND)
    # At 355 ms 250 ms are left, which is a cycle and more: dropped. Then 5 + 94 + 1 = 100.
    assert milliseconds(plc) == [5, 355, 455]


def test_a_changed_cycle_counts_from_the_scan_that_sees_it(make_plc):
    plc = make_plc(setups={LOOP: STILL})
    plc.advance(55 * MILLISECOND)
    plc.write(LOOP, "CYCLE", 2)
    plc.advance(45 * MILLISECOND)
    # 50 ms are gathered; the next scan makes 55 ≥ 20: executed, 35 left are a cycle and more: dropped.
    assert milliseconds(plc) == [5, 60, 80, 100]


def test_cycle_below_its_range_acts_as_its_smallest_value(make_plc):
    plc = make_plc(setups={LOOP: FakeLoop({"CYCLE": -3})})
    plc.advance(30 * MILLISECOND)
    assert milliseconds(plc) == [5, 15, 25]


def test_while_en_is_off_nothing_happens_and_no_time_is_gathered(make_plc, make_dpid):
    plc = make_plc([make_dpid(en=parse_device("M20"))], {LOOP: STILL})
    plc.advance(50 * MILLISECOND)
    plc.answer(Write(1, Table.COIL, 20, (0,)))
    before = plc.answer(Read(1, Table.HOLDING, 100, 120))
    plc.advance(500 * MILLISECOND)
    assert plc.answer(Read(1, Table.HOLDING, 100, 120)) == before
    plc.answer(Write(1, Table.COIL, 20, (1,)))
    plc.advance(60 * MILLISECOND)
    # 45 ms before, 55 ms after.
    assert milliseconds(plc) == [5, 605]


def test_what_a_person_writes_into_i_mv_is_the_integral_of_the_next_execution(make_plc):
    plc = make_plc(setups={LOOP: FakeLoop({**STILL.initial, "Kp": 0.0})})
    plc.scan()
    plc.answer(Write(1, Table.HOLDING, 122, (0x0000, 0x41A0)))  # 20.0
    plc.advance(100 * MILLISECOND)
    assert plc.read(LOOP, "MV") == REAL(20) + (REAL(0.5) * REAL(2)) * REAL(0.1)


def test_the_transfer_from_manual_starts_from_what_the_mv_register_holds(make_plc):
    plc = make_plc(setups={LOOP: FakeLoop({**STILL.initial, "PID_MAN": True, "MOUT": 40.0})})
    plc.scan()
    plc.write(LOOP, "PID_MAN", False)
    plc.write(LOOP, "MV", 55.0)
    plc.advance(100 * MILLISECOND)
    assert plc.read(LOOP, "MV") == REAL(55)


def test_mout_follows_mv_only_when_it_should(make_plc):
    plc = make_plc(setups={LOOP: FakeLoop({**STILL.initial, "MOUT": 7.0})})
    plc.scan()
    assert plc.read(LOOP, "MOUT") == REAL(7)
    plc.write(LOOP, "MOUT_AUTO", True)
    plc.advance(100 * MILLISECOND)
    assert plc.read(LOOP, "MOUT") == plc.read(LOOP, "MV") == REAL(4.2)


def test_constants_of_the_program_are_read_and_never_written(make_plc, make_dpid):
    plc = make_plc(
        [make_dpid(constants={"MOUT": 3.0, "MOUT_AUTO": True, "CYCLE": 10})],
        {LOOP: FakeLoop({"SV": 10.0, "PV": 8.0, "Kp": 5.0, "Ki": 0.5})},
    )
    plc.scan()
    assert plc.read(LOOP, "MV") == REAL(10) + REAL(0.1)
    assert plc.read(LOOP, "MOUT") == REAL(3)
    assert plc.answer(Read(1, Table.HOLDING, 120, 2)) == (0, 0)


def test_words_of_i_mv_that_are_the_systems_hold_junk_that_stands_still(make_plc):
    plc = make_plc(setups={LOOP: STILL}, seed=3)
    first = plc.answer(Read(1, Table.HOLDING, 126, 8))
    plc.advance(300 * MILLISECOND)
    assert plc.answer(Read(1, Table.HOLDING, 126, 8)) == first
    assert len(set(first)) > 1
    assert make_plc(setups={LOOP: STILL}, seed=4).answer(Read(1, Table.HOLDING, 126, 8)) != first


def test_a_restless_plc_changes_the_systems_words_and_no_others(make_plc):
    calm = make_plc(setups={LOOP: STILL})
    restless = make_plc(setups={LOOP: STILL}, is_restless=True)
    first = restless.answer(Read(1, Table.HOLDING, 126, 8))
    for plc in (calm, restless):
        plc.advance(300 * MILLISECOND)
    assert restless.answer(Read(1, Table.HOLDING, 126, 8)) != first
    for address, count in ((100, 26), (200, 2)):
        read = Read(1, Table.HOLDING, address, count)
        assert restless.answer(read) == calm.answer(read)


def test_the_log_holds_what_the_instruction_saw_and_left(make_plc):
    plc = make_plc(setups={LOOP: STILL})
    plc.advance(110 * MILLISECOND)
    first, second = plc.log(LOOP)
    assert (first.inputs.sv, first.inputs.pv, first.ts, first.since_ns) == (REAL(10), REAL(8), REAL(0.1), 0)
    assert (second.before.i, second.state.i) == (REAL(0.1), REAL(0.2))
    assert second.terms.p == REAL(4)
    assert second.since_ns == 100 * MILLISECOND


@pytest.mark.parametrize(
    ("instruction", "gains"), [("DPID", ("Kp", "Ki", "Kd")), ("DPIDE", ("Kc_Kp", "Ti_Ki", "Td_Kd", "Tf"))]
)
def test_auto_tuning_swings_between_the_limits_and_ends_with_usable_gains(
    make_plc, make_dpid, make_dpide, instruction, gains
):
    loop, cycle = (make_dpid(), 10) if instruction == "DPID" else (make_dpide(), 100)
    plant = PlantSpec("fopdt", gain=1.0, tau_s=5.0, dead_time_s=0.5, noise=0.05)
    start = {"SV": 50.0, "CYCLE": cycle, "PID_MODE": 1, "MOUT_AUTO": False}
    plc = make_plc([loop], {loop.name: FakeLoop(start, plant)}, scan_ns=10 * MILLISECOND)
    plc.advance(30_000 * MILLISECOND)
    assert plc.read(loop.name, "PID_MODE") == 0
    tuning = [execution.terms.mv for execution in plc.log(loop.name) if execution.inputs.pid_mode == 1]
    assert set(tuning) == {REAL(0), REAL(100)}
    assert all(plc.read(loop.name, gain) > 0 for gain in gains)
    plc.advance(60_000 * MILLISECOND)
    assert plc.read(loop.name, "PV") == pytest.approx(50.0, abs=0.5)


def test_auto_tuning_gives_the_gains_that_the_formulas_give_for_a_known_swing(make_plc):
    """PV a square wave against MV: up 6 s, down 4 s, swing 20: L = 6·(1 − 6/10) = 2.4, KP = 1.2·100/20 = 6."""
    plc = make_plc(
        setups={LOOP: FakeLoop({"SV": 50.0, "PV": 40.0, "CYCLE": 100, "PID_MODE": 1})}, scan_ns=1_000_000_000
    )
    for _ in range(3):
        plc.write(LOOP, "PV", 60.0)
        plc.advance(4_000_000_000)
        plc.write(LOOP, "PV", 40.0)
        plc.advance(6_000_000_000)
    assert plc.read(LOOP, "PID_MODE") == 0
    assert plc.read(LOOP, "Kp") == pytest.approx(6.0)
    assert plc.read(LOOP, "Ki") == pytest.approx(6.0 / 4.8)
    assert plc.read(LOOP, "Kd") == pytest.approx(6.0 * 1.2)
