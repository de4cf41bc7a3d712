"""The compiled law and the interpreted one: equal bits on random operands, states forwarded or carried."""

from __future__ import annotations

import random
from typing import Any

import numpy as np
import pytest
from strategies import ODD_BITS

from ahgateway.core.controllers import CONTROLLERS, Controller
from ahgateway.core.dialect import DEFAULT
from ahgateway.core.fast import column_types, walk
from ahgateway.core.operands import Kind
from ahgateway.core.real import REAL

LENGTH = 400
DIALECTS = 25


def trace(controller: Controller, rng: random.Random, *, odd: bool) -> dict[str, Any]:
    """Random columns; with `odd` every fifth REAL is any bit pattern."""
    columns: dict[str, Any] = {}
    rows = {row.attr: row for row in controller.operands}
    for name, dtype in column_types(controller).items():
        kind = rows[name].kind
        if kind is Kind.BOOL:
            share = 0.95 if name == "pid_run" else 0.3
            columns[name] = np.array([rng.random() < share for _ in range(LENGTH)], dtype)
        elif kind is Kind.REAL:
            span = 8.0 if rows[name].minimum == 0 else 100.0
            values = np.array([rng.uniform(-0.2 * span, span) for _ in range(LENGTH)], np.float32)
            if odd:
                places = [place for place in range(LENGTH) if rng.random() < 0.2]
                values.view(np.uint32)[places] = [rng.choice(ODD_BITS) for _ in places]
            columns[name] = values
        else:
            columns[name] = np.array([rng.choice([0, 0, 0, 2, 100, 7, 1]) for _ in range(LENGTH)], dtype)
    return columns


def random_dialect(controller: Controller, rng: random.Random) -> Any:
    chosen: Any = {axis: rng.choice(list(values)) for axis, values in controller.axes.items()}
    chosen |= {axis: REAL(rng.choice([0.0, 0.5, 1.7])) for axis in controller.numbers}
    return controller.dialect._replace(**chosen)


def assert_equal(left: Any, right: Any) -> None:
    """Equal bits, where all NaNs are one."""
    for one, other in ((left.state, right.state), (left.terms, right.terms)):
        for name, column in one.items():
            same = column == other[name]
            if column.dtype == np.float32:
                same = (column.view(np.uint32) == other[name].view(np.uint32)) | (
                    np.isnan(column) & np.isnan(other[name])
                )
            assert [] == np.flatnonzero(~same).tolist(), name


@pytest.mark.slow
@pytest.mark.parametrize("name", ["DPID", "DPIDE", "MELSEC_PID"])
def test_compiled_and_interpreted_laws_give_equal_bits_in_every_dialect(name: str) -> None:
    rng = random.Random(11)
    controller = CONTROLLERS[name]
    ts = np.full(LENGTH, 0.1, np.float32)
    for number in range(DIALECTS):
        dialect = random_dialect(controller, rng) if number else controller.dialect
        inputs = trace(controller, rng, odd=number % 2 == 1)
        compiled = walk(controller, inputs, controller.state(), dialect, ts)
        interpreted = walk(controller, inputs, controller.state(), dialect, ts, compiled=False)
        assert (True, False) == (compiled.is_compiled, interpreted.is_compiled)
        assert_equal(compiled, interpreted)


@pytest.mark.parametrize("name", ["DPID", "DPIDE"])
def test_an_interpreted_walk_is_the_law_step_by_step(name: str) -> None:
    rng = random.Random(12)
    controller = CONTROLLERS[name]
    inputs = trace(controller, rng, odd=False)
    ts = np.full(LENGTH, 0.25, np.float32)
    found = walk(controller, inputs, controller.state(), DEFAULT, ts, compiled=False)
    state = controller.state()
    with np.errstate(all="ignore"):
        for at in range(LENGTH):
            row = controller.inputs(*[inputs[field][at] for field in controller.input_names])
            state, terms = controller.step(row, state, DEFAULT, ts[at])
            assert [float(found.state[field][at]) for field in ("i", "mv", "pv1")] == [state.i, state.mv, state.pv1]
            assert float(terms.p) == float(found.terms["p"][at])


def test_what_was_seen_is_forwarded_before_each_step() -> None:
    controller = CONTROLLERS["DPID"]
    columns: dict[str, Any] = {
        name: np.full(3, value) for name, value in zip(controller.input_names, controller.inputs(), strict=True)
    }
    columns |= {"sv": np.full(3, 1, np.float32), "ki": np.full(3, 1, np.float32), "kp": np.zeros(3, np.float32)}
    ts = np.ones(3, np.float32)
    carried = walk(controller, columns, controller.state(), DEFAULT, ts, compiled=False)
    assert [1.0, 2.0, 3.0] == carried.state["i"].tolist()
    seen = {"i": np.array([10, 20, 30], np.float32)}
    forwarded = walk(controller, columns, controller.state(), DEFAULT, ts, seen=seen, compiled=False)
    assert [11.0, 21.0, 31.0] == forwarded.state["i"].tolist()


def test_a_column_of_another_length_is_refused() -> None:
    with pytest.raises(ValueError, match=r"do not have 3 values: .*sv"):
        walk(CONTROLLERS["DPID"], {}, CONTROLLERS["DPID"].state(), DEFAULT, np.ones(3, np.float32))
