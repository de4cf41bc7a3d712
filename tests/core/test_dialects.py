"""What holds in every dialect: it runs, it is pure, MV keeps its limits; and what each value computes, by hand."""

from __future__ import annotations

import random
from typing import Any

import numpy as np
import pytest
from dialects import excited, random_dialect
from sequences import operands

from ahgateway.core import flags as flag
from ahgateway.core.controllers import CONTROLLERS, DPID, DPIDE
from ahgateway.core.dialect import AXES, DEFAULT, Dialect
from ahgateway.core.dialect_axes import BY_NAME, TABLE, spelled
from ahgateway.core.real import REAL, bits, quiet


@pytest.mark.parametrize("name", ["DPID", "DPIDE"])
def test_every_dialect_runs_is_pure_and_keeps_the_limits(name: str) -> None:
    controller = CONTROLLERS[name]
    for seed in range(30):
        dialect = random_dialect(seed)
        state, ran = controller.state(), 0
        for inputs in excited(controller, seed, 60):
            ts = controller.ts(inputs, dialect, 200)
            with quiet(all="ignore"):
                after, terms = controller.step(inputs, state, dialect, ts)
                again, _ = controller.step(inputs, state, dialect, ts)
            assert [bits(REAL(x)) for x in after] == [bits(REAL(x)) for x in again]
            assert {type(x) for x in after} <= {np.float32, bool, int}
            if not terms.flags & (flag.STOPPED | flag.AUTOTUNE | flag.BAD_INPUT):
                low, high = sorted((inputs.mv_min, inputs.mv_max))
                assert low <= after.mv <= high
                ran += 1
            state = after
        assert ran > 30


def test_every_axis_and_value_is_explained() -> None:
    assert tuple(AXES) == tuple(axis.name for axis in TABLE) == Dialect._fields
    assert {name: len(values) for name, values in AXES.items()} == {axis.name: len(axis.values) for axis in TABLE}
    assert {"both", "DPID", "DPIDE"} == {axis.instructions for axis in TABLE}
    assert set(DEFAULT) == {0}
    assert {} == spelled(DEFAULT)
    assert BY_NAME["filter"].concerns("DPIDE")
    assert not BY_NAME["filter"].concerns("DPID")


def dialect(**values: str) -> Any:
    return Dialect(**{axis: AXES[axis][value.upper()] for axis, value in values.items()})


@pytest.mark.parametrize(
    ("chosen", "cycle", "ticks", "ts"),
    [
        ({}, 7, 0, 0.07),
        ({"ts_unit": "counts"}, 7, 0, 7.0),
        ({"ts_unit": "left_out"}, 7, 0, 1.0),
        ({"ts_source": "ms"}, 7, 75, 0.075),
        ({"ts_source": "tenth_ms"}, 7, 703, 0.0703),
        ({"ts_source": "microsecond"}, 7, 70125, 0.070125),
        ({"ts_source": "ms", "ts_unit": "counts"}, 7, 75, 75.0),
    ],
)
def test_the_interval_by_dialect(chosen: dict[str, str], cycle: int, ticks: int, ts: float) -> None:
    assert REAL(ts) == DPID.ts(operands(DPID, cycle=cycle), dialect(**chosen), ticks)


def test_a_multiplied_interval_differs_in_the_last_bit() -> None:
    # 0.01 as REAL is 0x3C23D70A, a little too small: 9 times it rounds to the REAL below that of 9 / 100.
    inputs = operands(DPID, cycle=9)
    assert 0x3DB851EC == bits(DPID.ts(inputs, DEFAULT))
    assert 0x3DB851EB == bits(DPID.ts(inputs, dialect(ts_scale="multiplied")))


PI = {"sv": 10.0, "pv": 6.0, "kp": 2.0, "ki": 0.5, "cycle": 100}
"""E = 4, Ts = 1: P = 8, each execution integrates 2."""


def ran(controller: Any, rows: list[dict[str, Any]], start: dict[str, Any], **chosen: str) -> list[tuple[float, float]]:
    """MV and I_MV behind each execution; MOUT is written back."""
    inputs, state, found = operands(controller, **start), controller.state(), []
    for changes in rows:
        inputs = operands(controller, inputs, **changes)
        with quiet(all="ignore"):
            state, terms = controller.step(inputs, state, dialect(**chosen), controller.ts(inputs, dialect(**chosen)))
        inputs = inputs._replace(mout=terms.mout)
        found.append((float(state.mv), float(state.i)))
    return found


@pytest.mark.parametrize(
    ("chosen", "expected"),
    [
        ({}, [(10.0, 2.0), (7.0, 3.0)]),
        ({"direction": "inverted"}, [(0.0, 0.0), (0.0, 0.0)]),
        ({"integral_used": "old"}, [(8.0, 2.0), (6.0, 3.0)]),
        ({"integrator": "trapezoid"}, [(10.0, 2.0), (4.0 + 2.0 + 1.5, 3.5)]),
        ({"integrator": "previous"}, [(10.0, 2.0), (4.0 + 4.0, 4.0)]),
        ({"integral_store": "sum"}, [(10.0, 4.0), (4.0 + 0.5 * 6.0, 6.0)]),
    ],
)
def test_the_integral_by_dialect(chosen: dict[str, str], expected: list[tuple[float, float]]) -> None:
    # The second execution has E = 2: P = 4, increment 1.
    assert expected == ran(DPID, [{}, {"pv": 8.0}], PI, **chosen)


@pytest.mark.parametrize(
    ("chosen", "expected"),
    [
        ({}, (20.0, 18.0)),
        ({"freeze": "never"}, (20.0, 20.0)),
        ({"freeze": "back_calculated"}, (20.0, 12.0)),
        ({"limited_output": "recomputed"}, (20.0, 18.0)),
    ],
)
def test_beyond_a_limit_by_dialect(chosen: dict[str, str], expected: tuple[float, float]) -> None:
    # I was 18, P is 8: 18 + 2 + 8 lies above 20.
    state = DPID.state(i=REAL(18), mv=REAL(15), valid=True)
    inputs = operands(DPID, **PI, mv_max=20.0)
    after, _ = DPID.step(inputs, state, dialect(**chosen), DPID.nominal_ts(inputs))
    assert expected == (float(after.mv), float(after.i))


def test_only_the_last_increment_beyond_the_limit() -> None:
    # P + I = 8 + 11 = 19 lies below 20, the next increment of 2 carries it to 21.
    state = DPID.state(i=REAL(11), mv=REAL(15), valid=True)
    inputs = operands(DPID, **PI, mv_max=20.0)
    found = []
    for chosen in ({}, {"limited_output": "recomputed"}, {"limit_edge": "at"}):
        after, _ = DPID.step(inputs, state, dialect(**chosen), DPID.nominal_ts(inputs))
        found.append((float(after.mv), float(after.i)))
    assert [(20.0, 11.0), (19.0, 11.0), (20.0, 11.0)] == found


@pytest.mark.parametrize(
    ("chosen", "expected"),
    [
        ({}, [(50.0, 2.0), (50.0, 42.0)]),
        ({"transfer": "direct"}, [(50.0, 2.0), (12.0, 4.0)]),
        ({"transfer": "mv_as_i"}, [(50.0, 2.0), (60.0, 52.0)]),
        ({"preset_integrates": "yes"}, [(50.0, 2.0), (52.0, 44.0)]),
        ({"manual_integral": "runs", "transfer": "direct"}, [(50.0, 4.0), (14.0, 6.0)]),
        ({"manual_integral": "tracks", "transfer": "direct"}, [(50.0, 42.0), (52.0, 44.0)]),
        ({"preset_limit": "limited"}, [(50.0, 2.0), (50.0, 42.0)]),
    ],
)
def test_manual_and_back_by_dialect(chosen: dict[str, str], expected: list[tuple[float, float]]) -> None:
    # Automatic: P = 8, I = 2; then manual at 50, then automatic with the same E.
    rows = [{}, {"pid_man": True, "mout": 50.0}, {"pid_man": False}]
    assert expected == ran(DPID, rows, PI, **chosen)[1:]


STOP_IN_MANUAL: list[dict[str, Any]] = [
    {}, {"pid_man": True, "mout": 50.0}, {"pid_run": False}, {"pid_man": False}, {"pid_run": True},
]  # fmt: skip
MANUAL_IN_STOP: list[dict[str, Any]] = [
    {}, {"pid_run": False}, {"pid_man": True, "mout": 50.0}, {"pid_man": False, "pid_run": True},
]  # fmt: skip
OTHER_MOUT: list[dict[str, Any]] = [{}, {"pid_man": True, "mout": 50.0}, {"pid_man": False, "mout": 30.0}]


@pytest.mark.parametrize(
    ("rows", "chosen", "expected"),
    [
        # P = 8, I = 2. A transfer from the register, which PID_RUN = FALSE has set to 0, makes I -8.
        (STOP_IN_MANUAL, {}, (0.0, -8.0)),
        (STOP_IN_MANUAL, {"run_off_manual": "forgotten"}, (12.0, 4.0)),
        (STOP_IN_MANUAL, {"run_off_manual": "tracked"}, (12.0, 4.0)),
        (STOP_IN_MANUAL, {"preset_mv": "mout"}, (50.0, 42.0)),
        (MANUAL_IN_STOP, {}, (12.0, 4.0)),
        (MANUAL_IN_STOP, {"run_off_manual": "forgotten"}, (12.0, 4.0)),
        (MANUAL_IN_STOP, {"run_off_manual": "tracked"}, (0.0, -8.0)),
        (MANUAL_IN_STOP, {"run_off_manual": "tracked", "preset_mv": "mout"}, (50.0, 42.0)),
        (OTHER_MOUT, {}, (50.0, 42.0)),
        (OTHER_MOUT, {"preset_mv": "mout"}, (30.0, 22.0)),
        (OTHER_MOUT, {"preset_mv": "mout", "transfer": "mv_as_i"}, (40.0, 32.0)),
    ],
)
def test_what_a_transfer_starts_from_by_dialect(
    rows: list[dict[str, Any]], chosen: dict[str, str], expected: tuple[float, float]
) -> None:
    both = PI | {"kc_kp": PI["kp"], "ti_ki": PI["ki"], "td_kd": 0.0, "cycle": 1000}
    extended = {name: value for name, value in both.items() if name not in ("kp", "ki")}
    assert expected == ran(DPID, rows, PI, **chosen)[-1]
    assert expected == ran(DPIDE, rows, extended, **chosen)[-1]


@pytest.mark.parametrize(
    ("chosen", "d"),
    [
        ({}, 1.6),  # (1*0 + 4*2) / (1 + 4)
        ({"filter": "forward"}, 8.0),  # 0 + 4*(2 - 0)
        ({"filter": "tustin"}, 16 / 6),  # 2*4*2 / (2 + 4)
        ({"filter": "alpha"}, 1.6),  # 0.8*2
        ({"filter": "ignored"}, 2.0),  # 4*2/4
        ({"filter_content": "slope"}, 1.6),
    ],
)
def test_the_filter_by_dialect(chosen: dict[str, str], d: float) -> None:
    inputs = operands(DPIDE, sv=10.0, pv=6.0, kc_kp=0.0, ti_ki=0.0, td_kd=4.0, tf=1.0, cycle=4000)
    state = DPIDE.state(e1=REAL(2), er1=REAL(2), pv1=REAL(8), valid=True)
    _, terms = DPIDE.step(inputs, state, dialect(**chosen), DPIDE.nominal_ts(inputs))
    assert REAL(d) == pytest.approx(terms.d, rel=2e-7)


@pytest.mark.parametrize(
    ("chosen", "mv"),
    [
        ({}, 0.0),  # E counts as 0, and so does P
        ({"cross_band": "off"}, 2.0),
        ({"cross_d": "true_error"}, 0.0),
    ],
)
def test_the_zero_cross_band_by_dialect(chosen: dict[str, str], mv: float) -> None:
    inputs = operands(DPIDE, sv=10.0, pv=9.0, err_dbw=2.0, kc_kp=2.0, ti_ki=0.0, td_kd=0.0)
    state = DPIDE.state(e1=REAL(-1), er1=REAL(-1), pv1=REAL(11), valid=True)
    after, _ = DPIDE.step(inputs, state, dialect(**chosen), DPIDE.nominal_ts(inputs))
    assert mv == float(after.mv)


def test_dpids_bands() -> None:
    # |E| = 5 with a band of 3 and of 5; P alone, Kp = 2.
    found = {}
    for band in ("zeroed", "shifted", "mv_zero", "off"):
        for width in (3.0, 5.0, 7.0):
            rows = ran(DPID, [{}], {"sv": 10.0, "pv": 5.0, "kp": 2.0, "err_dbw": width}, band=band)
            found[band, width] = rows[0][0]
    assert [10.0, 0.0, 0.0] == [found["zeroed", width] for width in (3.0, 5.0, 7.0)]
    assert [4.0, 0.0, 0.0] == [found["shifted", width] for width in (3.0, 5.0, 7.0)]
    assert [10.0, 0.0, 0.0] == [found["mv_zero", width] for width in (3.0, 5.0, 7.0)]
    assert [10.0, 10.0, 10.0] == [found["off", width] for width in (3.0, 5.0, 7.0)]
    assert [(10.0, 0.0)] == ran(DPID, [{}], {"sv": 10.0, "pv": 5.0, "kp": 2.0, "err_dbw": 5.0}, band_edge="strict")


def test_orders_of_the_sum_round_differently() -> None:
    # 2^24 swallows a 1: (2^24 + 1) + 1 stays 2^24, 2^24 + (1 + 1) does not.
    big, one, base = 16777216.0, 1.0, {"kp": 1.0, "ki": 1.0, "kd": 0.0, "mv_max": 3e7, "mv_min": -3e7, "cycle": 100}
    state = DPID.state(i=REAL(0), e1=REAL(0), valid=True)
    inputs = operands(DPID, sv=1.0, pv=0.0, **base | {"kd": big})
    found = {
        order: float(DPID.step(inputs, state, dialect(sum_order=order), REAL(1))[0].mv)
        for order in ("pi_d", "p_id", "pd_i")
    }
    # P = 1, I = 1, D = 2^24: (1 + 1) + 2^24 is 2^24 + 2, the others lose a 1 in between.
    assert {"pi_d": big + 2 * one, "p_id": big, "pd_i": big} == found


@pytest.mark.parametrize("value", list(random.Random(3).sample(range(1000), 3)))
def test_a_dialect_of_random_values_is_one_of_the_axes(value: int) -> None:
    chosen = random_dialect(value)
    assert all(chosen[index] in AXES[name] for index, name in enumerate(AXES))
