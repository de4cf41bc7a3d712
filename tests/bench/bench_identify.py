"""Learning a dialect from a long trace, with the compiled law and without, beside trying combinations one by one.

Run it as a program: `python tests/bench/bench_identify.py [EXECUTIONS] [COMBINATIONS] [fast|plain|both]`. It prints the
CPU seconds of each search, what readies the compiled law apart (compiling it, or reading it where an earlier run left
it), and those of so many combinations walked alone. It ends with 1 when a search takes longer than its bar: 10 s with
`fast`, 2 minutes without, both for 100 000 executions and in proportion to them.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent))

import numpy as np
from dialects import random_dialect
from lockstep.dialect_traces import loop_of, trace

from ahgateway.cli.compiled_laws import keep_compiled
from ahgateway.codec.station import Loop
from ahgateway.core.fast import walk
from ahgateway.lockstep.identify import Observation, identify
from ahgateway.lockstep.trace import columns

BARS_S = {"fast": 10.0, "plain": 120.0}
BAR_EXECUTIONS = 100_000


def searched(loop: Loop, observations: Sequence[Observation], road: str) -> float:
    """Search a trace and print what came of it; CPU seconds."""
    started = time.process_time()
    if road == "fast":
        identify(loop, observations[:200], compiled=True)
    ready = time.process_time() - started
    started = time.process_time()
    found = identify(loop, observations, compiled=road == "fast")
    took = time.process_time() - started
    sys.stdout.write(
        f"{road}: {len(observations)} executions searched in {took:.1f} s of CPU, {ready:.1f} s to be ready; "
        f"{found.executions} explained, {len(found.survivors)} left, named {found.is_named}\n"
    )
    sys.stdout.flush()
    return took


def one_by_one(loop: Loop, observations: Sequence[Observation], dialect: object, combinations: int) -> float:
    """CPU seconds of so many combinations walked alone by the compiled law."""
    rows = columns(loop, observations).rows
    inputs = dict(zip(loop.controller.input_names, rows.T, strict=True))
    ts = np.full(len(rows), float(loop.controller.nominal_ts(observations[0].before.inputs)), np.float32)
    walk(loop.controller, inputs, loop.controller.state(), dialect, ts)
    started = time.process_time()
    for _ in range(3):
        walk(loop.controller, inputs, loop.controller.state(), dialect, ts)
    return (time.process_time() - started) / 3 * combinations


def main() -> int:
    given = sys.argv[1:]
    executions, combinations = (int(text) for text in (given[:2] + ["100000", "10000"][len(given[:2]) :]))
    which = given[2] if len(given) > 2 else "both"
    keep_compiled()
    loop, dialect = loop_of("DPID"), random_dialect(5, without=("pv_word", "ts_source"))
    observations = trace("DPID", dialect, 5, executions)
    times = {road: searched(loop, observations, road) for road in BARS_S if which in (road, "both")}
    if "fast" in times:
        alone = one_by_one(loop, observations, dialect, combinations)
        sys.stdout.write(
            f"{combinations} combinations one by one: {alone:.0f} s of CPU; ratio {alone / times['fast']:.0f}\n"
        )
    return int(any(took > BARS_S[road] * executions / BAR_EXECUTIONS for road, took in times.items()))


if __name__ == "__main__":
    sys.exit(main())
