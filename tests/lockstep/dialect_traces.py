"""Traces made by the law itself in a given dialect: what pictures show, execution by execution, without a wire."""

from __future__ import annotations

import random
from collections.abc import Callable
from typing import Any

from dialects import excited
from lockstep.bench_world import bindings

from ahgateway.codec.station import Loop
from ahgateway.core.controllers import CONTROLLERS
from ahgateway.core.controllers.delta_terms import ticks_per_second
from ahgateway.core.dialect import AXES, DEFAULT, Dialect
from ahgateway.core.real import REAL, quiet
from ahgateway.lockstep.candidates import SAME_ON_DPID
from ahgateway.lockstep.identify import Observation
from ahgateway.lockstep.picture import Picture, predicted

Step = Callable[[Any, Any, Any, Any], tuple[Any, Any]]


def loop_of(name: str, dialect: Dialect = DEFAULT) -> Loop:
    law = CONTROLLERS[name]
    return Loop("L1", law, bindings(law, 100, 1, 200, {}), dialect=dialect, scan_ms_max=3)


def told(name: str, dialect: Dialect) -> Dialect:
    """The dialect under its usual name: a DPID has neither Kc nor BIAS, and some values are the default there."""
    if name != "DPID":
        return dialect
    same: dict[str, Any] = {a: AXES[a](0) for a, value in SAME_ON_DPID.items() if getattr(dialect, a) == value}
    return dialect._replace(**same)


def picture(tick: int, inputs: Any, seen: dict[str, Any]) -> Picture:
    return Picture(tick, inputs, seen, {}, None, None, tick, tick, tick, 0)


def suited(law: Any, inputs: Any, dialect: Dialect) -> Any:
    """The operands with which an engineer would make this loop work in this dialect: its sign, its unit of time."""
    changes: dict[str, Any] = {"pid_dir": not dialect.direction}
    nominal = law.nominal_ts(inputs)
    # Nobody tunes a loop by a clock's ticks; what matters is that gain times Ts comes out as in seconds.
    scale = nominal / law.ts(inputs, dialect, round(float(nominal) * ticks_per_second(dialect)))
    if law.name == "DPID":
        return inputs._replace(**changes, ki=inputs.ki * scale, kd=inputs.kd / scale)
    ti_ki = inputs.ti_ki / scale if inputs.pid_eq else inputs.ti_ki * scale
    return inputs._replace(**changes, ti_ki=ti_ki, td_kd=inputs.td_kd / scale, tf=inputs.tf / scale)


def trace(name: str, dialect: Dialect, seed: int, executions: int, step: Step | None = None) -> list[Observation]:
    """Return so many executions of ordinary excitation, computed in this dialect or by another step."""
    loop, chance = loop_of(name, dialect), random.Random(f"ticks {seed}")
    law = loop.controller
    state, found = law.state(), []
    seen = {word.name: getattr(state, word.attr, law.inputs().mout) for word in law.seen}
    per_second = ticks_per_second(dialect)
    mout = None
    pv = 45.0
    for tick, wanted in enumerate(excited(law, seed, executions)):
        pv += (1.1 * float(state.mv) - pv) * 0.08 + chance.gauss(0, 0.4)
        inputs = suited(law, wanted, dialect)._replace(pv=REAL(round(pv * 16) / 16))
        if mout is not None and wanted.mout_auto and not wanted.pid_man:
            inputs = inputs._replace(mout=mout)
        nominal = float(law.nominal_ts(inputs))
        ticks = round((nominal + chance.uniform(-0.002, 0.002)) * per_second) if per_second else 0
        with quiet(all="ignore"):
            state, terms = (step or law.step)(inputs, state, dialect, law.ts(inputs, dialect, ticks))
        mout = terms.mout
        before = picture(2 * tick, inputs, {**seen, "MOUT": inputs.mout})
        seen = predicted(law, state, terms)
        after = picture(2 * tick + 1, inputs._replace(mout=terms.mout), seen)
        found.append(Observation(before, after, tick > 0))
    return found
