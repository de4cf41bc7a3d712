"""Executions without a fault by the hundred thousand, on the two roads a recording takes: judged, and walked in bulk.

The PLC is the law itself, interpreted, in any dialect, with operators who meddle. *Recorded* executions go one by one
through the follower and its judge, as records of the ring do; *walked* ones through the compiled walk of
`replay --bulk`, as blocks of a recording do.
"""

from __future__ import annotations

import random
from dataclasses import replace
from typing import Any

import numpy as np
from lockstep.dialect_traces import loop_of, trace

from ahgateway.apps.replay_bulk import Walker
from ahgateway.core.controllers import Controller
from ahgateway.core.dialect import Dialect
from ahgateway.core.fast import column_types, walk
from ahgateway.core.operands import Kind
from ahgateway.core.verdict import Counts
from ahgateway.fake.faults import Step
from ahgateway.lockstep.follow import Follower
from ahgateway.recording import layout
from ahgateway.recording.reader import spans

BLOCK = 4096
RECORDED_PART = 4000
STRETCH = 50
"""An operator changes something about so often, in executions."""


def recorded(law: str, dialect: Dialect, executions: int, seed: int, step: Step | None = None) -> Counts:
    """Judge so many executions of a law, or of a wrong one, each seen with what it read, as a recorder shows them."""
    total = Counts()
    for part in range(0, executions, RECORDED_PART):
        count = min(RECORDED_PART, executions - part)
        follower = Follower(replace(loop_of(law), dialect=dialect))
        for each in trace(law, dialect, seed + part, count, step):
            seen = replace(each.after, inputs=each.before.inputs, executions=(1, 1), is_exact=True)
            follower.see(seen)
        total += follower.counts
    return total


def walked(law: str, dialect: Dialect, executions: int, seed: int) -> tuple[int, int]:
    """Walk so many executions; return how many, and how many were not reproduced."""
    loop = replace(loop_of(law), dialect=dialect)
    controller = loop.controller
    columns = _columns(controller, executions, random.Random(f"walk {seed}"))
    ts = np.array([controller.ts(controller.inputs(cycle=int(cycle)), dialect) for cycle in columns["cycle"]])
    found = walk(controller, columns, controller.state(), dialect, ts.astype(np.float32), compiled=False)
    words = _words(loop, columns, found.state, found.terms)
    first = controller.state()._replace(**{name: column[0] for name, column in found.state.items()})
    walker = Walker(loop, first, compiled=True)
    for start in range(0, executions, BLOCK):
        walker.take(np.arange(start, min(start + BLOCK, executions)), words[start : start + BLOCK])
    return walker.executions, walker.differing


def _columns(controller: Controller, length: int, chance: random.Random) -> dict[str, Any]:
    """Operands of so many executions: each holds for a stretch, PV never stands still."""
    types = column_types(controller)
    sample = controller.inputs()
    gains = ("kp", "ki", "kd") if controller.name == "DPID" else ("kc_kp", "ti_ki", "td_kd", "tf", "bias")
    choices: dict[str, Any] = {
        **{name: lambda: np.float32(chance.uniform(0.05, 2.0)) for name in gains},
        "sv": lambda: np.float32(chance.uniform(20, 80)),
        "mv_max": lambda: np.float32(chance.choice([100.0, 70.0, 55.0])),
        # Above 0, so that PID_RUN = FALSE always shows: it puts MV to 0.
        "mv_min": lambda: np.float32(chance.choice([2.0, 10.0])),
        "err_dbw": lambda: np.float32(chance.choice([0.0, 0.0, 1.5])),
        "cycle": lambda: chance.choice([7, 10, 13]),
        "pid_man": lambda: chance.random() < 0.2,
        "pid_run": lambda: chance.random() < 0.95,
        "pid_dir": lambda: chance.random() < 0.9,
        "mout": lambda: np.float32(chance.uniform(-5, 105)),
    }
    if controller.name == "DPIDE":
        choices |= {"pid_eq": lambda: chance.random() < 0.3, "pid_de": lambda: chance.random() < 0.4}
    found = {}
    for name, kind in types.items():
        column = np.full(length, getattr(sample, name), kind)
        start = 0
        while name in choices and start < length:
            end = start + chance.randrange(1, 2 * STRETCH * 10)
            column[start:end] = choices[name]()
            start = end
        found[name] = column
    noise = np.random.default_rng(chance.randrange(1 << 30)).normal(0.0, 3.0, length)
    pv = (found["sv"] + noise).astype(np.float32)
    # What stands still by chance would make an execution that changes no word, which a walk cannot see.
    again = np.flatnonzero(pv[1:] == pv[:-1]) + 1
    pv[again] = np.nextafter(pv[again], np.float32(np.inf))
    found["pv"] = pv
    return found


def _words(loop: Any, columns: dict[str, Any], state: Any, terms: Any) -> Any:
    """The words of every operand behind each execution, as a recording holds them."""
    shape = layout.columns(loop)
    places = spans(shape)
    length = len(columns["sv"])
    found = np.zeros((length, sum(width for _, width in shape)), np.uint16)
    kinds = {Kind.REAL: "<f4", Kind.DINT: "<i4"}
    for row in loop.controller.operands:
        first, _ = places[row.name]
        if row.kind is Kind.BOOL:
            found[:, first] = columns[row.attr]
        elif row.kind in kinds and row.attr in columns:
            values = np.ascontiguousarray(columns[row.attr], kinds[row.kind])
            found[:, first : first + 2] = values.view("<u2").reshape(length, 2)
    for word in loop.controller.seen:
        first, _ = places[word.operand]
        source = state if word.attr in state else terms
        values = np.ascontiguousarray(source[word.attr], "<f4").view("<u2").reshape(length, 2)
        found[:, first + 2 * word.dword : first + 2 * word.dword + 2] = values
    return found
