"""Ten million executions stepped along a trace, interpreted and compiled, with equal bits.

Run it as a program: `python tests/bench/bench_replay.py [EXECUTIONS]`. The interpreted road runs a part of the trace
and is scaled; the same part is compared bit by bit. Compiling is timed apart.
"""

from __future__ import annotations

import sys
import time
from typing import Any

import numpy as np

from ahgateway.core.controllers import CONTROLLERS, Controller
from ahgateway.core.fast import column_types, walk

INTERPRETED = 100_000
CHUNK = 1_000_000


def columns(controller: Controller, length: int) -> dict[str, Any]:
    """A loop at work: constant parameters, PV a random walk around SV."""
    types = column_types(controller)
    sample = controller.inputs()
    found = {name: np.full(length, getattr(sample, name), types[name]) for name in types}
    walk_of_pv = np.cumsum(np.random.default_rng(1).normal(0.0, 0.05, length))
    found["sv"] = np.full(length, 50.0, np.float32)
    found["pv"] = (50.0 + 5.0 * np.sin(walk_of_pv)).astype(np.float32)
    found["ki" if controller.name == "DPID" else "ti_ki"] = np.full(length, 0.1, np.float32)
    return found


def main() -> None:
    total = int(sys.argv[1]) if len(sys.argv) > 1 else 10_000_000
    for name in ("DPID", "DPIDE"):
        controller = CONTROLLERS[name]
        trace = columns(controller, CHUNK)
        ts = np.full(CHUNK, 0.1, np.float32)
        part = {key: column[:INTERPRETED] for key, column in trace.items()}
        start = time.perf_counter()
        walk(
            controller,
            {key: column[:1] for key, column in trace.items()},
            controller.state(),
            controller.dialect,
            ts[:1],
        )
        compiling = time.perf_counter() - start
        start = time.perf_counter()
        slow = walk(controller, part, controller.state(), controller.dialect, ts[:INTERPRETED], compiled=False)
        interpreted = (time.perf_counter() - start) / INTERPRETED
        state, first = controller.state(), None
        start = time.perf_counter()
        for _ in range(0, total, CHUNK):
            found = walk(controller, trace, state, controller.dialect, ts)
            first = first or found
            state = type(state)(*[found.state[field][-1] for field in state._fields])
        compiled = (time.perf_counter() - start) / total
        assert first is not None
        for field in ("i", "mv", "pv1"):
            assert slow.state[field].tobytes() == first.state[field][:INTERPRETED].tobytes()
        sys.stdout.write(
            f"{name:6s} {total:,} executions: compiled {compiled * total:.1f} s ({1 / compiled:,.0f}/s, and "
            f"{compiling:.1f} s to compile), interpreted {interpreted * total:.0f} s ({1 / interpreted:,.0f}/s), "
            f"{interpreted / compiled:.0f} times; {INTERPRETED:,} compared bit by bit\n"
        )


if __name__ == "__main__":
    main()
