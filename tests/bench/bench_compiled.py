"""All five laws compiled and interpreted: equal bits on random operands in random dialects, and how much quicker.

Run it as a program: `PYTHONPATH=tests:tests/core python tests/bench/bench_compiled.py`. Half a minute goes into
compiling, which is why the test suite holds only three of the laws to it. Exit code 1 where a bit differs, or where a
compiled law is not TIMES_MIN times as quick.
"""

from __future__ import annotations

import random
import sys
import time
from typing import Any

import numpy as np
from test_fast import LENGTH, assert_equal, random_dialect, trace

from ahgateway.core.controllers import CONTROLLERS, Controller
from ahgateway.core.fast import Trace, walk, why_interpreted

DIALECTS = 60
TIMES_MIN = 5.0


def timed(controller: Controller, inputs: Any, dialect: Any, ts: Any, *, compiled: bool) -> tuple[Trace, float]:
    begin = time.process_time()
    found = walk(controller, inputs, controller.state(), dialect, ts, compiled=compiled)
    return found, time.process_time() - begin


def run(controller: Controller) -> bool:
    """Compare and time one law; tell whether it holds the bar."""
    rng = random.Random(5)
    ts = np.full(LENGTH, 0.1, np.float32)
    _, compiling_s = timed(controller, trace(controller, rng, odd=False), controller.dialect, ts, compiled=True)
    quick_s = slow_s = 0.0
    for number in range(DIALECTS):
        dialect = random_dialect(controller, rng) if number else controller.dialect
        inputs = trace(controller, rng, odd=number % 2 == 1)
        left, quick = timed(controller, inputs, dialect, ts, compiled=True)
        right, slow = timed(controller, inputs, dialect, ts, compiled=False)
        try:
            assert_equal(left, right)
        except AssertionError as error:
            sys.stdout.write(f"{controller.name}: bits differ in {dialect}: {error}\n")
            return False
        quick_s, slow_s = quick_s + quick, slow_s + slow
    steps = DIALECTS * LENGTH
    sys.stdout.write(
        f"{controller.name} {steps} executions in {DIALECTS} dialects, equal bits, compiled in {compiling_s:.0f} s; "
        f"{1e6 * slow_s / steps:.1f} to {1e6 * quick_s / steps:.1f} µs a step, {slow_s / quick_s:.0f} times\n"
    )
    return slow_s / quick_s >= TIMES_MIN


def main() -> int:
    why = why_interpreted()
    if why:
        sys.stdout.write(f"{why}\n")
        return 1
    held = [run(CONTROLLERS[name]) for name in CONTROLLERS]
    return 0 if all(held) else 1


if __name__ == "__main__":
    sys.exit(main())
