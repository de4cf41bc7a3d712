"""Steps per second of the laws, beside a plain binary64 version of the same law and, if installed, simple-pid.

Run it as a program: `python tests/bench/bench_core.py`. Rounds are interleaved, so that a busy machine slows all
contestants alike; the ratio is the number to keep. This is the only place below the roof that reads the wall clock.
"""

from __future__ import annotations

import importlib.util
import random
import statistics
import sys
import time
from collections.abc import Callable

from ahgateway.core.controllers import DPID, DPIDE, Controller
from ahgateway.core.dialect import DEFAULT
from ahgateway.core.real import REAL

STEPS = 4000
ROUNDS = 9
PVS = [random.Random(1).uniform(45.0, 55.0) for _ in range(256)]


def law(controller: Controller, **values: float) -> Callable[[], None]:
    """The law as the shadow calls it: operands of every execution ready, state carried."""
    fixed = {name: REAL(value) for name, value in values.items()}
    operands = [controller.inputs(sv=REAL(50), pv=REAL(pv), **fixed) for pv in PVS]
    ts = controller.nominal_ts(operands[0])

    def run() -> None:
        state, step = controller.state(), controller.step
        for number in range(STEPS):
            state, _ = step(operands[number & 255], state, DEFAULT, ts)

    return run


def plain_binary64() -> Callable[[], None]:
    """P + I + D with limits and freeze in Python floats: what the same control costs without the PLC's bits."""

    def run() -> None:
        kp, ki, kd, ts, low, high = 2.0, 0.1, 0.3, 1.0, 0.0, 100.0
        integral = last = 0.0
        for number in range(STEPS):
            e = 50.0 - PVS[number & 255]
            candidate = integral + (ki * e) * ts
            raw = kp * e + candidate + kd * (e - last) / ts
            if low <= raw <= high:
                integral = candidate
            _ = min(max(raw, low), high)
            last = e

    return run


def simple_pid() -> Callable[[], None] | None:
    """The peer: simple-pid with its sampling time given, so that it reads no clock; None where it is not installed."""
    if importlib.util.find_spec("simple_pid") is None:
        return None
    from simple_pid import PID

    def run() -> None:
        pid = PID(2.0, 0.1, 0.3, setpoint=50.0, sample_time=None, output_limits=(0.0, 100.0))
        for number in range(STEPS):
            pid(PVS[number & 255], dt=1.0)

    return run


def main() -> None:
    contestants: dict[str, Callable[[], None]] = {
        "DPID": law(DPID, kp=2.0, ki=0.1, kd=0.3),
        "DPIDE": law(DPIDE, kc_kp=2.0, ti_ki=0.1, td_kd=0.3, tf=1.0, err_dbw=1.0),
        "plain binary64": plain_binary64(),
    }
    peer = simple_pid()
    if peer is not None:
        contestants["simple-pid"] = peer
    took: dict[str, list[float]] = {name: [] for name in contestants}
    for _ in range(ROUNDS):
        for name, run in contestants.items():
            start = time.perf_counter()
            run()
            took[name].append((time.perf_counter() - start) / STEPS)
    base = statistics.median(took["simple-pid" if peer is not None else "plain binary64"])
    for name, rounds in took.items():
        median = statistics.median(rounds)
        sys.stdout.write(
            f"{name:16s} {median * 1e6:7.2f} us/step  {1 / median:10,.0f} steps/s  speed ratio {base / median:5.2f}\n"
        )


if __name__ == "__main__":
    main()
