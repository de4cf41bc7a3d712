"""Random dialects, and ordinary excitation that an operator could give a loop: steps, manual, limits, band, gains."""

from __future__ import annotations

import random
from collections.abc import Iterator
from typing import Any

from ahgateway.core.controllers import Controller
from ahgateway.core.dialect import AXES, Dialect
from ahgateway.core.real import REAL

NOT_DRAWN = {("ts_unit", 3), ("pv_word", 6), ("pv_word", 7), ("pv_word", 8), ("pv_word", 9)}


def random_dialect(seed: int, *, share: float = 1.0, without: tuple[str, ...] = ()) -> Dialect:
    """Every axis drawn with probability `share`, each from its own source, the rest as by default.

    A place of PV that the block of a DPID does not have is not drawn, nor 10 ms as a unit, which are a DPID's counts.
    """
    chosen: dict[str, Any] = {}
    for name, axis in AXES.items():
        chance = random.Random(f"dialect {seed} {name}")
        value = chance.choice([each for each in axis if (name, int(each)) not in NOT_DRAWN])
        if chance.random() < share and name not in without:
            chosen[name] = value
    return Dialect(**chosen)


def start(controller: Controller, chance: random.Random) -> dict[str, Any]:
    """Odd gains and an odd CYCLE, so that every order of operations rounds its own way."""
    if controller.name == "DPID":
        return {
            "kp": REAL(chance.uniform(0.7, 2.3)),
            "ki": REAL(chance.uniform(0.2, 0.9)),
            "kd": REAL(chance.uniform(0.05, 0.4)),
            "cycle": chance.choice([5, 9, 18]),
        }
    return {
        "kc_kp": REAL(chance.uniform(0.7, 2.3)),
        "ti_ki": REAL(chance.uniform(0.3, 1.9)),
        "td_kd": REAL(chance.uniform(0.05, 0.4)),
        "tf": REAL(chance.uniform(0.1, 0.6)),
        "bias": REAL(chance.uniform(1.0, 5.0)),
        "cycle": chance.choice([70, 130, 230]),
    }


def changes(controller: Controller, chance: random.Random, inputs: Any) -> dict[str, Any]:
    """One thing that an operator does, or nothing."""
    if chance.random() < 0.92:
        return {}
    kind = chance.randrange(10)
    if kind < 3:
        return {"sv": REAL(round(chance.uniform(20, 80), 1))}
    if kind == 3:
        return {"pid_man": not inputs.pid_man, "mout": REAL(chance.uniform(-5, 110))}
    if kind == 4:
        return {"mv_max": REAL(chance.uniform(50, 100)), "mv_min": REAL(chance.uniform(-10, 30))}
    if kind == 5:
        return {"err_dbw": REAL(chance.choice([0.0, 0.0, 2.5, 6.0]))}
    if kind == 6:
        return {"pid_run": not inputs.pid_run}
    if kind == 7:
        return {"mout_auto": not inputs.mout_auto}
    if kind == 8 and controller.name == "DPIDE":
        return {"pid_eq": not inputs.pid_eq} if chance.random() < 0.5 else {"pid_de": not inputs.pid_de}
    return {"pid_mode": chance.choice([0, 2])} if controller.name == "DPID" else {}


def excited(controller: Controller, seed: int, executions: int) -> Iterator[Any]:
    """Operands of so many executions; PV wanders around SV on a converter's grid."""
    chance = random.Random(f"excitation {seed}")
    inputs = controller.inputs(sv=REAL(50), pv=REAL(45), **start(controller, chance))
    pv = 45.0
    for _ in range(executions):
        inputs = inputs._replace(**changes(controller, chance, inputs))
        # Manual, standstill and auto-tuning do not last.
        if inputs.pid_man and chance.random() < 0.2:
            inputs = inputs._replace(pid_man=False)
        if not inputs.pid_run and chance.random() < 0.4:
            inputs = inputs._replace(pid_run=True)
        if inputs.err_dbw != 0 and chance.random() < 0.05:
            inputs = inputs._replace(err_dbw=REAL(0))
        pv += (float(inputs.sv) - pv) * chance.uniform(0.0, 0.4) + chance.gauss(0, 1.5)
        inputs = inputs._replace(pv=REAL(round(pv * 10) / 10))
        yield inputs
