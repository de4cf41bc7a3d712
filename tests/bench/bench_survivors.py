"""Random dialects over all axes: does the search keep the true one, and is all else it keeps the same or named open?

Run it as a program: `python tests/bench/bench_survivors.py [DIALECTS] [EXECUTIONS] [FIRST] [DPID|DPIDE|both]`: of each
law so many dialects, 100 of 2 000 executions if nothing is said, the first with that seed. For each the law makes
a trace of ordinary excitation, and the search sees nothing but its words. A survivor that differs from the truth in an
axis that is not open must give the same bits on another trace, which the search has not seen. It prints a line for each
dialect and ends with 1 unless all hold: the true one is never lost, no survivor is wrong, and nine of ten searches look
at their whole trace.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent.parent))

import numpy as np
from dialects import excited, random_dialect
from lockstep.dialect_traces import loop_of, suited, told, trace
from lockstep.test_identify_proof import lost, wrong_and_closed

from ahgateway.cli.compiled_laws import keep_compiled
from ahgateway.core.controllers import CONTROLLERS
from ahgateway.core.controllers.delta_terms import ticks_per_second
from ahgateway.core.dialect import Dialect
from ahgateway.core.real import quiet
from ahgateway.lockstep.identify import identify
from ahgateway.lockstep.shadow import state_key

WHOLE_MIN = 0.9
FRESH = 1000
"""Executions of the trace that the search has not seen."""


def words(name: str, dialect: Dialect, truth: Dialect, seed: int) -> list[tuple[int, ...]]:
    """What a dialect leaves, execution by execution, on operands that were made for the true one."""
    law, found = CONTROLLERS[name], []
    state: Any = law.state()
    chance = np.random.default_rng(seed)
    for inputs in excited(law, seed + 100_000, FRESH):
        read = suited(law, inputs, truth)
        elapsed = float(law.nominal_ts(read)) + float(chance.uniform(-0.002, 0.002))
        ts = law.ts(read, dialect, round(elapsed * ticks_per_second(dialect)))
        with quiet(all="ignore"):
            state, terms = law.step(read, state, dialect, ts)
        found.append(state_key((state.i, state.mv, terms.mout)))
    return found


def judged(name: str, seed: int, executions: int) -> tuple[bool, bool]:
    """Search one dialect and print what came of it: whether all holds, and whether the whole trace was looked at."""
    dialect = told(name, random_dialect(seed, without=("pv_word",)))
    observations = trace(name, dialect, seed, executions)
    started = time.process_time()
    found = identify(loop_of(name), observations, compiled=True)
    took = time.process_time() - started
    missing = lost(found, dialect)
    wrong = wrong_and_closed(name, found, dialect)
    if wrong:
        truth = words(name, dialect, dialect, seed)
        wrong = [each for each in wrong if words(name, each, dialect, seed) != truth]
    state = "crowded" if found.is_crowded else "cut" if found.is_cut else "whole"
    if found.unexplained is not None:
        state = f"NOT EXPLAINED at {found.unexplained.number}"
    sys.stdout.write(
        f"{name} {seed}: {dialect.ts_source.name.lower()} {dialect.filter.name.lower()} {state}, "
        f"{found.executions} explained, {len(found.survivors)} left, {took:.1f} s"
        f"{f', LOST {sorted(missing)}' if missing else ''}{f', {len(wrong)} WRONG' if wrong else ''}\n"
    )
    sys.stdout.flush()
    return not missing and not wrong and found.unexplained is None, state == "whole"


def main() -> int:
    given = sys.argv[1:]
    dialects, executions, first = (int(text) for text in (given[:3] + ["100", "2000", "0"][len(given[:3]) :]))
    which = given[3] if len(given) > 3 else "both"
    names = ("DPID", "DPIDE") if which == "both" else (which,)
    keep_compiled()
    results = [judged(name, seed, executions) for seed in range(first, first + dialects) for name in names]
    kept, whole = (sum(each[place] for each in results) for place in (0, 1))
    sys.stdout.write(
        f"{len(results)} dialects in {time.process_time():.0f} s of CPU: the true one kept in {kept}, "
        f"looked at whole in {whole}\n"
    )
    return int(kept < len(results) or whole < WHOLE_MIN * len(results))


if __name__ == "__main__":
    sys.exit(main())
