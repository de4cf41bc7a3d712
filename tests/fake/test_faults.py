"""Every fault changes a bit where it should, changes nothing where it cannot, and does what its text says."""

from __future__ import annotations

import random

import numpy as np
import pytest

from ahgateway.clock import MILLISECOND
from ahgateway.codec.station import FakeLoop, PlantSpec
from ahgateway.core import flags as flag
from ahgateway.core.controllers import DPID, DPIDE
from ahgateway.core.dialect import DEFAULT
from ahgateway.core.real import bits, quiet
from ahgateway.errors import StateError
from ahgateway.fake.faults import FAULTS, fault

REAL = np.float32
PAIRS = [(name, controller) for name, each in FAULTS.items() for controller in sorted(each.controllers)]
CONTROLLERS = {"DPID": DPID, "DPIDE": DPIDE}
SEEN_BY_STEP = [(name, controller) for name, controller in PAIRS if not FAULTS[name].is_pv_late]


def excitation(controller):
    """Two hundred executions: set-point steps, a noisy PV that crosses SV, manual phases, saturation, a bias."""
    rng = random.Random(5)
    gains = {"kp": 3.1, "ki": 0.7, "kd": 0.3} if controller is DPID else {"kc_kp": 3.1, "ti_ki": 0.7, "td_kd": 0.3}
    if controller is DPIDE:
        gains.update(tf=0.9, bias=5.3)
    for tick in range(200):
        sv = 50.0 if tick % 50 < 25 else 46.0
        yield controller.inputs(
            **{name: REAL(value) for name, value in gains.items()},
            sv=REAL(sv),
            pv=REAL(48.0 + rng.uniform(-6, 6) + (30.0 if tick % 40 > 35 else 0.0)),
            err_dbw=REAL(1.7),
            pid_man=tick % 60 > 54,
            mout=REAL(33.3),
            mv_min=REAL(2.0),
        )


def outputs(controller, step):
    state, found = controller.state(), []
    with quiet(all="ignore"):
        for inputs in excitation(controller):
            state, _ = step(inputs, state, DEFAULT, REAL(0.1))
            found.append((bits(state.i), bits(state.mv)))
    return found


@pytest.mark.parametrize(("name", "instruction"), SEEN_BY_STEP)
def test_a_fault_changes_a_bit_of_what_can_be_seen(name, instruction):
    controller = CONTROLLERS[instruction]
    wrong = outputs(controller, fault(name, controller).wrong(controller.step))
    assert wrong != outputs(controller, controller.step)


@pytest.mark.parametrize(("name", "instruction"), SEEN_BY_STEP)
def test_a_fault_leaves_reals_behind(name, instruction):
    controller = CONTROLLERS[instruction]
    step = fault(name, controller).wrong(controller.step)
    state = controller.state()
    with quiet(all="ignore"):
        for inputs in excitation(controller):
            state, terms = step(inputs, state, DEFAULT, REAL(0.1))
            for value in (*state, *terms):
                assert isinstance(value, (REAL, bool, int)), (type(value), state, terms)


@pytest.mark.parametrize(("name", "instruction"), SEEN_BY_STEP)
def test_a_fault_leaves_pid_run_false_alone(name, instruction):
    controller = CONTROLLERS[instruction]
    inputs = controller.inputs(pid_run=False, sv=REAL(5), bias=REAL(7)) if instruction == "DPIDE" else None
    inputs = inputs or controller.inputs(pid_run=False, sv=REAL(5))
    state = controller.state(i=REAL(3), mv=REAL(20))
    after, terms = fault(name, controller).wrong(controller.step)(inputs, state, DEFAULT, REAL(1))
    assert (after.mv, after.i, terms.flags) == (REAL(0), REAL(3), flag.STOPPED)


@pytest.mark.parametrize(("name", "instruction"), PAIRS)
def test_a_fault_in_the_plc_shows_in_its_registers(make_plc, make_dpid, make_dpide, name, instruction):
    loop, gains = (
        (make_dpid(), {"Kp": 2.3, "Ki": 0.4, "Kd": 0.2})
        if instruction == "DPID"
        else (make_dpide(), {"Kc_Kp": 2.3, "Ti_Ki": 0.4, "Td_Kd": 0.2, "Tf": 0.7, "BIAS": 4.4})
    )
    cycle = 10 if instruction == "DPID" else 100
    setup = FakeLoop(
        {**gains, "SV": 30.0, "CYCLE": cycle, "ERR_DBW": 1.5, "MV_MAX": 60.0, "MOUT": 20.0},
        PlantSpec("fopdt", gain=1.0, tau_s=3.0, dead_time_s=0.2, noise=0.3),
    )

    def run(fault_name):
        plc = make_plc([loop], {loop.name: setup}, seed=9, log_max=1000)
        plc.fail(loop.name, fault_name)
        for number in range(8):
            plc.at(number * 3000 * MILLISECOND, lambda plc, n=number: plc.write(loop.name, "SV", 30.0 - 9 * (n % 2)))
        plc.at(9000 * MILLISECOND, lambda plc: plc.write(loop.name, "PID_MAN", True))
        plc.at(11000 * MILLISECOND, lambda plc: plc.write(loop.name, "PID_MAN", False))
        plc.advance(24_000 * MILLISECOND)
        return [(bits(each.state.i), bits(each.state.mv), bits(each.state.pv1)) for each in plc.log(loop.name)]

    assert run(name) != run(None)


def test_a_fault_can_come_and_go(make_plc):
    plc = make_plc(setups={"LIC-201": FakeLoop({"SV": 3.0, "CYCLE": 1})})
    plc.at(20 * MILLISECOND, lambda plc: plc.fail("LIC-201", "direction-reversed"))
    plc.at(40 * MILLISECOND, lambda plc: plc.fail("LIC-201", None))
    plc.write("LIC-201", "MV_MIN", -100.0)
    plc.advance(65 * MILLISECOND)
    assert [float(each.terms.mv) for each in plc.log("LIC-201")] == [3.0, 3.0, -3.0, -3.0, 3.0, 3.0, 3.0]


def test_a_late_pv_is_the_pv_of_the_scan_before(make_plc):
    plc = make_plc(setups={"LIC-201": FakeLoop({"SV": 0.0, "CYCLE": 1})}, scan_ns=10 * MILLISECOND)
    plc.fail("LIC-201", "pv-one-scan-late")
    for pv in (1.0, 2.0, 3.0):
        plc.write("LIC-201", "PV", pv)
        plc.scan()
    assert [float(each.inputs.pv) for each in plc.log("LIC-201")] == [1.0, 1.0, 2.0]
    assert float(plc.log("LIC-201")[-1].state.pv1) == 2.0


def one(controller, name, state=None, **operands):
    inputs = controller.inputs(**{k: REAL(v) if isinstance(v, float) else v for k, v in operands.items()})
    step = fault(name, controller).wrong(controller.step) if name else controller.step
    return step(inputs, state or controller.state(), DEFAULT, REAL(1))


def test_windup_lets_the_integral_run_beyond_the_limit():
    state, _ = one(DPID, "windup", sv=200.0, ki=1.0)
    assert (float(state.i), float(state.mv)) == (200.0, 100.0)
    assert float(one(DPID, None, sv=200.0, ki=1.0)[0].i) == 0.0


def test_bias_after_limits_leaves_the_range_by_the_bias():
    state, _ = one(DPIDE, "bias-after-limits", sv=500.0, bias=8.0)
    assert float(state.mv) == 108.0


def test_limits_before_the_sum_let_d_leave_the_range():
    before = DPID.state(valid=True, e1=REAL(490))
    state, _ = one(DPID, "limits-before-sum", before, sv=500.0, kd=2.0)
    assert float(state.mv) == 120.0


def test_integral_late_computes_with_the_integral_before():
    state, _ = one(DPID, "integral-late", DPID.state(i=REAL(10)), sv=2.0, ki=3.0)
    assert (float(state.i), float(state.mv)) == (16.0, 12.0)


def test_derivative_of_the_other_gives_no_kick_at_a_set_point_step():
    before = DPID.state(valid=True, e1=REAL(0), pv1=REAL(10))
    _, terms = one(DPID, "derivative-of-the-other", before, sv=20.0, pv=10.0, kd=5.0)
    assert float(terms.d) == 0.0
    assert float(one(DPID, None, before, sv=20.0, pv=10.0, kd=5.0)[1].d) == 50.0


def test_no_bumpless_takes_the_held_integral():
    before = DPID.state(i=REAL(5), mv=REAL(70), man1=True, valid=True)
    assert float(one(DPID, "no-bumpless", before, sv=1.0, ki=1.0)[0].mv) == 7.0
    assert float(one(DPID, None, before, sv=1.0, ki=1.0)[0].mv) == 70.0


def test_truncation_rounds_towards_zero():
    # 1 + 3·2^-25 lies between 1 and 1 + 2^-23, nearer to the latter.
    kp, pv = REAL(1), REAL(-3 * 2.0**-25)
    wrong, _ = fault("truncation", DPID).wrong(DPID.step)(
        DPID.inputs(sv=REAL(1), pv=pv, kp=kp), DPID.state(), DEFAULT, REAL(1)
    )
    right, _ = DPID.step(DPID.inputs(sv=REAL(1), pv=pv, kp=kp), DPID.state(), DEFAULT, REAL(1))
    assert (bits(wrong.mv), bits(right.mv)) == (0x3F800000, 0x3F800001)


@pytest.mark.parametrize(
    ("name", "hint"), [("wind-up", "did you mean `windup`?"), ("filter-ignored", "it can have gain-1-percent")]
)
def test_a_wrong_name_is_refused_with_a_way_out(name, hint):
    with pytest.raises(StateError) as refused:
        fault(name, DPID)
    assert refused.value.hint is not None
    assert refused.value.hint.startswith(hint)
