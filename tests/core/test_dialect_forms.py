"""Axes of a dialect that show when operands change or are no numbers, by hand: what each value computes."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from sequences import operands

from ahgateway.core.controllers import CONTROLLERS, DPID, DPIDE
from ahgateway.core.controllers.delta_terms import decayed
from ahgateway.core.dialect import AXES, Dialect
from ahgateway.core.real import REAL, bits, quiet


def dialect(**values: str) -> Any:
    return Dialect(**{axis: AXES[axis][value.upper()] for axis, value in values.items()})


def ran(controller: Any, rows: list[dict[str, Any]], start: dict[str, Any], **chosen: str) -> list[tuple[float, float]]:
    """MV and I_MV behind each execution."""
    inputs, state, found = operands(controller, **start), controller.state(), []
    for changes in rows:
        inputs = operands(controller, inputs, **changes)
        with quiet(all="ignore"):
            state, _ = controller.step(inputs, state, dialect(**chosen), controller.ts(inputs, dialect(**chosen)))
        found.append((float(state.mv), float(state.i)))
    return found


PI = {"sv": 10.0, "pv": 6.0, "kp": 2.0, "ki": 0.5, "cycle": 100}
"""E = 4, Ts = 1: P = 8, each execution integrates 2."""


@pytest.mark.parametrize(
    ("chosen", "second"),
    [
        ({}, (10.0, 2.0)),
        # E = 10 - 0: P = 20, 5 integrated.
        ({"bad_input": "as_zero"}, (27.0, 7.0)),
    ],
)
def test_a_pv_that_is_no_number(chosen: dict[str, str], second: tuple[float, float]) -> None:
    assert [(10.0, 2.0), second] == ran(DPID, [{}, {"pv": math.nan}], PI, **chosen)


def test_a_pv_that_is_no_number_can_stay_for_good() -> None:
    found = ran(DPID, [{}, {"pv": math.nan}, {"pv": 6.0}], PI, bad_input="propagated")
    assert (10.0, 2.0) == found[0]
    assert all(math.isnan(x) for row in found[1:] for x in row)


D_OF_E = {"sv": 10.0, "pv": 6.0, "kp": 0.0, "ki": 0.0, "kd": 3.0, "cycle": 100, "mv_min": -100.0}
D_OF_PV = {"sv": 10.0, "pv": 6.0, "kc_kp": 0.0, "ti_ki": 0.0, "td_kd": 3.0, "cycle": 1000, "mv_min": -100.0}


@pytest.mark.parametrize(
    ("chosen", "mv"),
    [
        # E was 4 and is -4: D = 3 * -8 as recorded; the last E turned is -4, so that nothing has changed.
        ({}, -24.0),
        ({"form_change": "one_cell"}, -24.0),
        ({"form_change": "reset"}, 0.0),
        ({"form_change": "turned"}, 0.0),
    ],
)
def test_a_direction_that_is_switched(chosen: dict[str, str], mv: float) -> None:
    rows = [{}, {"pid_dir": False}]
    assert [0.0, mv] == [row[0] for row in ran(DPID, rows, D_OF_E, **chosen)]
    assert [0.0, mv] == [row[0] for row in ran(DPIDE, rows, D_OF_PV, **chosen)]


@pytest.mark.parametrize(
    ("chosen", "mv"),
    [
        # PV goes from 6 to 7: D = 3 * -1. With one cell the last E, 4, stands where the last PV should: 3 * -(7 - 4).
        ({}, -3.0),
        ({"form_change": "turned"}, -3.0),
        ({"form_change": "reset"}, 0.0),
        ({"form_change": "one_cell"}, -9.0),
    ],
)
def test_a_derivative_that_changes_from_e_to_pv(chosen: dict[str, str], mv: float) -> None:
    found = ran(DPIDE, [{}, {"pid_de": True, "pv": 7.0}], D_OF_PV, **chosen)
    assert [0.0, mv] == [row[0] for row in found]


@pytest.mark.parametrize(
    ("chosen", "found"),
    [
        # Independent: Ki = 0.5, the sum of E times Ts is 4, the term 2. Dependent: Ti = 0.5, Kc = 2: the term is 4 * i.
        ({"integral_store": "sum"}, (8.0 + 4.0 * 8.0, 8.0)),
        ({"integral_store": "sum", "form_integral": "rescaled"}, (8.0 + 4.0 * 4.5, 4.5)),
        ({"integral_store": "sum", "form_integral": "zeroed"}, (8.0 + 4.0 * 4.0, 4.0)),
        # Kept as the term: 2, and 2 * 4 / 0.5 is added.
        ({}, (8.0 + 18.0, 18.0)),
        ({"form_integral": "zeroed"}, (8.0 + 16.0, 16.0)),
    ],
)
def test_an_integral_whose_form_is_switched(chosen: dict[str, str], found: tuple[float, float]) -> None:
    start = {"sv": 10.0, "pv": 6.0, "kc_kp": 2.0, "ti_ki": 0.5, "td_kd": 0.0, "cycle": 1000}
    assert found == ran(DPIDE, [{}, {"pid_eq": True}], start, **chosen)[1]


BAND = {"sv": 10.0, "pv": 15.0, "err_dbw": 3.0, "kc_kp": 2.0, "ti_ki": 0.0, "td_kd": 0.0, "mv_min": -100.0}
"""E = -5, outside; P alone."""


def test_a_jump_over_sv_into_the_band() -> None:
    # E goes from -5 to 1: by the literal reading PV has passed SV, and E counts as 0.
    assert [-10.0, 0.0] == [mv for mv, _ in ran(DPIDE, [{}, {"pv": 9.0}], BAND)]
    assert [-10.0, 2.0] == [mv for mv, _ in ran(DPIDE, [{}, {"pv": 9.0}], BAND, cross_jump="ignored")]


def test_a_change_of_sv_inside_the_band() -> None:
    # -1, then passed at 1, then SV moves by a half: E is 1.5 and counts again where that clears the status.
    rows = [{"pv": 11.0}, {"pv": 9.0}, {"sv": 10.5}]
    assert [-2.0, 0.0, 0.0] == [mv for mv, _ in ran(DPIDE, rows, BAND)]
    assert [-2.0, 0.0, 3.0] == [mv for mv, _ in ran(DPIDE, rows, BAND, cross_sv="cleared")]


@pytest.mark.parametrize(
    ("name", "chosen", "ticks", "ts"),
    [
        ("DPID", {"ts_unit": "hundred_ms"}, 0, 0.7),
        ("DPID", {"ts_unit": "ten_ms"}, 0, 7.0),
        ("DPIDE", {"ts_unit": "hundred_ms"}, 0, 0.07),
        ("DPIDE", {"ts_unit": "ten_ms"}, 0, 0.7),
        ("DPIDE", {"ts_unit": "ten_ms", "ts_source": "tenth_ms"}, 71, 0.71),
    ],
)
def test_units_of_the_interval(name: str, chosen: dict[str, str], ticks: int, ts: float) -> None:
    law = CONTROLLERS[name]
    assert REAL(ts) == law.ts(operands(law, cycle=7), dialect(**chosen), ticks)


@pytest.mark.parametrize(
    ("chosen", "d"),
    [
        # x goes from 2 to 4, the filter held 2; Tf = 1, Ts = 4, Kd = 4: D is 4 * what it moved / 4.
        ({}, (1 * 2 + 4 * 4) / 5 - 2),
        ({"filter": "forward"}, 4 * (4 - 2)),
        ({"filter": "tustin"}, ((2 - 4) * 2 + 4 * (4 + 2)) / 6 - 2),
        ({"filter": "alpha"}, 0.8 * 2),
        ({"filter": "exact"}, 2 * (1 - math.exp(-4))),
        ({"filter": "ignored"}, 2.0),
    ],
)
def test_a_filter_before_the_difference(chosen: dict[str, str], d: float) -> None:
    inputs = operands(DPIDE, sv=10.0, pv=6.0, kc_kp=0.0, ti_ki=0.0, td_kd=4.0, tf=1.0, cycle=4000)
    state = DPIDE.state(e1=REAL(2), er1=REAL(2), pv1=REAL(8), d=REAL(2), valid=True)
    _, terms = DPIDE.step(inputs, state, dialect(filter_content="input", **chosen), DPIDE.nominal_ts(inputs))
    assert terms.d == pytest.approx(d, rel=2e-6)


def test_a_filter_that_holds_0_begins_with_what_it_meets() -> None:
    inputs = operands(DPIDE, sv=10.0, pv=6.0, kc_kp=0.0, ti_ki=0.0, td_kd=4.0, tf=1.0, cycle=4000)
    after, terms = DPIDE.step(inputs, DPIDE.state(), dialect(filter_content="input"), DPIDE.nominal_ts(inputs))
    assert (4.0, 0.0) == (float(after.d), float(terms.d))


@pytest.mark.parametrize("x", [-1e-30, -1e-6, -0.01, -0.3, -0.34657, -1.0, -7.3, -50.0, -87.0, -103.0])
def test_the_exponential_is_rounded_once(x: float) -> None:
    narrow = REAL(x)
    assert bits(REAL(math.exp(float(narrow)))) == bits(decayed(narrow))


def test_the_exponential_of_what_is_far_below_0_is_0() -> None:
    assert [0.0, 0.0, 0.0] == [float(decayed(REAL(x))) for x in (-105.0, -1e30, -np.inf)]


def test_a_band_that_is_no_number_is_none() -> None:
    assert [(10.0, 2.0)] == ran(DPID, [{"err_dbw": math.nan}], PI)
