"""Learning a dialect from a long trace, beside trying combinations one after another with the compiled law.

Run it as a program: `python tests/bench/bench_identify.py [EXECUTIONS] [COMBINATIONS]`. It prints the seconds of the
search, compiling apart, those of one combination walked alone, times the combinations, and the ratio of the two. This
reads the wall clock; the ratio is the number to keep.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent))

import numpy as np
from dialects import random_dialect
from lockstep.dialect_traces import loop_of, trace

from ahgateway.core.fast import walk
from ahgateway.lockstep.identify import identify
from ahgateway.lockstep.trace import columns


def main() -> None:
    executions, combinations = (int(text) for text in (sys.argv[1:] + ["100000", "10000"][len(sys.argv) - 1 :]))
    loop, dialect = loop_of("DPID"), random_dialect(5, without=("pv_word", "ts_source"))
    observations = trace("DPID", dialect, 5, executions)
    identify(loop, observations[:200], compiled=True)
    started = time.perf_counter()
    found = identify(loop, observations, compiled=True)
    took = time.perf_counter() - started

    rows = columns(loop, observations)
    inputs = dict(zip(loop.controller.input_names, rows.columns, strict=True))
    ts = np.full(len(rows.columns[0]), float(loop.controller.nominal_ts(observations[0].before.inputs)), np.float32)
    walk(loop.controller, inputs, loop.controller.state(), dialect, ts)
    started = time.perf_counter()
    for _ in range(3):
        walk(loop.controller, inputs, loop.controller.state(), dialect, ts)
    alone = (time.perf_counter() - started) / 3 * combinations
    sys.stdout.write(
        f"{len(observations)} executions: search {took:.1f} s, {len(found.survivors)} left, named {found.is_named}; "
        f"{combinations} combinations one by one {alone:.0f} s; ratio {alone / took:.0f}\n"
    )


if __name__ == "__main__":
    main()
