"""Tuning measured: coverage of the confidence intervals, and Åström and Hägglund's test batch with noise.

    python tests/bench/bench_tuning.py [runs]

Exit code 1 when a parameter's 95 % interval holds the truth less often than four standard deviations of chance below
95 % of the runs allow, or is wider than 1.5 times what that needs. The batch stands in `tests/tuning_batch.py`, and
what CI asks of it in `tests/tuning/test_published_batch.py`.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent))

from tuning_batch import BATCH, TS, answered, model_error, response
from tuning_data import coverage

from ahgateway.tuning.canonical import standard
from ahgateway.tuning.identify import identify
from ahgateway.tuning.margins import controller
from ahgateway.tuning.models import Kind, Model
from ahgateway.tuning.rules import RULES, apply

WIDTH_MAX = 1.5
"""Largest mean width of an interval, as a share of 1.96 standard deviations of what was found."""


def say(text: str) -> None:
    """Write a line at once."""
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


def batch() -> None:
    """Print, for each process, the model, its error, and the Ms that rules reach on the real process."""
    names = ("SIMC PI", "AMIGO PI", "AMIGO PID", "Tyreus-Luyben PI", "Ziegler-Nichols PI")
    rules = [rule for rule in RULES if rule.name in names]
    say(f"{'process':<18} {'model':<6} {'error':>6}  true Ms: {'  '.join(rule.name for rule in rules)}  findings")
    omega = np.geomspace(1e-3, np.pi / TS * 0.99, 6000)
    for name in BATCH:
        found = identify(answered(name, 1))
        true = response(name, omega)
        if found.fit is None:
            say(f"{name:<18} refused: {[each.name for each in found.findings]}")
            continue
        model = found.fit.model
        error = model_error(name, model.response(omega), omega)
        cells = []
        for rule in rules:
            gains = apply(rule, model, TS)
            if gains is None:
                cells.append("-")
                continue
            settings = standard(gains.kc, gains.ti_s, gains.td_s, ts_s=TS, tf_s=gains.td_s / 8.0)
            held = np.exp(-0.5j * omega * TS) * np.sinc(omega * TS / 2.0 / np.pi)
            ms = float(np.max(1.0 / np.abs(1.0 + controller(settings, omega) * true * held)))
            cells.append(f"{ms:.2f}")
        names_found = [each.name for each in found.findings]
        say(f"{name:<18} {model.kind.value:<6} {100 * error:5.1f}%  {'   '.join(cells)}   {names_found or ''}")


def intervals(runs: int) -> bool:
    """Print how often 95 % intervals hold the truth and how wide they are; tell whether all are as they should be."""
    bar, good = 0.95 - 4.0 * (0.95 * 0.05 / runs) ** 0.5, True
    for model in (
        Model(Kind.FOPDT, 1.5, 4.3, 20.0), Model(Kind.SOPDT, 1.5, 2.1, 6.0, 0.5), Model(Kind.SOPDT, 1.5, 2.1, 6.0, 1.3),
        Model(Kind.IPDT, 0.02, 3.2),
    ):  # fmt: skip
        for noise in (0.1, 0.5):
            hits, widths = coverage(model, noise, range(runs))
            shares = ", ".join(f"{name} {100 * share:.0f} % × {widths[name]:.2f}" for name, share in hits.items())
            good = good and all(share >= bar for share in hits.values()) and max(widths.values()) < WIDTH_MAX
            say(f"{model.kind.value:<6} ζ {model.zeta:<4g} noise {noise:<4g} {runs} runs: {shares}")
    return good


def main() -> int:
    """Run both; return the exit code."""
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    begun = time.perf_counter()
    batch()
    say(f"batch: {time.perf_counter() - begun:.1f} s\n")
    good = intervals(runs)
    say(f"in all {time.perf_counter() - begun:.1f} s: {'passed' if good else 'FAILED'}")
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
