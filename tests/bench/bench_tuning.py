"""Tuning measured: coverage of the confidence intervals, and Åström and Hägglund's test batch with noise.

    python tests/bench/bench_tuning.py [runs]

The batch is that of Åström and Hägglund, "Benchmark systems for PID control", IFAC PID 2000, and Advanced PID Control
(2006), ch. 7: lags, multiple lags, wide-spread lags, inverse response, and an integrator. The model error is the
largest |G − Ĝ|/|G| up to the frequency where G has turned by −135°; below it a PI or PID loop works.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np
from scipy import signal

sys.path.insert(0, str(Path(__file__).parent.parent))

from tuning_data import doublet

from ahgateway.tuning.canonical import standard
from ahgateway.tuning.fit import fit
from ahgateway.tuning.identify import identify
from ahgateway.tuning.margins import controller
from ahgateway.tuning.models import Kind, Model
from ahgateway.tuning.record import Record
from ahgateway.tuning.rules import RULES, apply

TS = 0.1
NOISE = 0.01
QUANTUM = 0.005


def say(text: str) -> None:
    """Write a line at once."""
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


def poly(*lags: float) -> np.ndarray:
    """Denominator of a product of lags."""
    out = np.array([1.0])
    for lag in lags:
        out = np.polymul(out, [lag, 1.0])
    return out


BATCH: dict[str, tuple[list[float], np.ndarray, float]] = {
    "e^-s/(1+0.5s)": ([1.0], poly(0.5), 1.0),
    "e^-s/(1+4s)": ([1.0], poly(4.0), 1.0),
    "e^-s/(1+s)^2": ([1.0], poly(1.0, 1.0), 1.0),
    "1/(s+1)^3": ([1.0], poly(*[1.0] * 3), 0.0),
    "1/(s+1)^4": ([1.0], poly(*[1.0] * 4), 0.0),
    "1/(s+1)^8": ([1.0], poly(*[1.0] * 8), 0.0),
    "four lags, 0.2": ([1.0], poly(1.0, 0.2, 0.04, 0.008), 0.0),
    "four lags, 0.5": ([1.0], poly(1.0, 0.5, 0.25, 0.125), 0.0),
    "(1-0.2s)/(s+1)^3": ([-0.2, 1.0], poly(*[1.0] * 3), 0.0),
    "1/(s^2+s+1)": ([1.0], np.array([1.0, 1.0, 1.0]), 0.0),
    "e^-s/s": ([1.0], np.array([1.0, 0.0]), 1.0),
}


def answered(top: list[float], bottom: np.ndarray, dead: float, seed: int) -> Record:
    """A doublet of 1 in MV with noise of 1 % and a resolution of 0.5 % of it."""
    count = 900
    mv = np.zeros(count)
    mv[50:300] = 1.0
    mv[300:600] = -1.0
    late = np.concatenate([np.zeros(round(dead / TS)), mv])[:count]
    system = signal.cont2discrete(signal.tf2ss(top, bottom), TS, "zoh")
    a, b, c, d, _ = system
    x, pv = np.zeros((a.shape[0], 1)), np.empty(count)
    for index, u in enumerate(late):
        pv[index] = float((c @ x + d * u)[0, 0])
        x = a @ x + b * u
    pv += NOISE * np.random.default_rng(seed).standard_normal(count)
    return Record(np.arange(count) * TS, np.zeros(count), QUANTUM * np.round(pv / QUANTUM), mv, "batch")


def true_response(top: list[float], bottom: np.ndarray, dead: float, omega: np.ndarray) -> np.ndarray:
    """The process itself."""
    s = 1j * omega
    return np.polyval(top, s) / np.polyval(bottom, s) * np.exp(-s * dead)


def batch() -> None:
    """Print, for each process, the model, its error, and the Ms that rules reach on the real process."""
    names = ("SIMC PI", "AMIGO PI", "AMIGO PID", "Tyreus-Luyben PI", "Ziegler-Nichols PI")
    rules = [rule for rule in RULES if rule.name in names]
    say(f"{'process':<18} {'model':<6} {'error':>6}  true Ms: {'  '.join(rule.name for rule in rules)}  findings")
    omega = np.geomspace(1e-3, np.pi / TS * 0.99, 6000)
    for name, (top, bottom, dead) in BATCH.items():
        found = identify(answered(top, bottom, dead, 1))
        true = true_response(top, bottom, dead, omega)
        phase = np.unwrap(np.angle(true))
        edge = int(np.argmax(phase <= np.radians(-135.0))) or omega.size
        if found.fit is None:
            say(f"{name:<18} refused: {[each.name for each in found.findings]}")
            continue
        model = found.fit.model
        error = float(np.max(np.abs(model.response(omega[:edge]) - true[:edge]) / np.abs(true[:edge])))
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


def coverage(runs: int) -> None:
    """Print the share of 95 % intervals that hold the truth."""
    for model in (
        Model(Kind.FOPDT, 1.5, 4.3, 20.0), Model(Kind.SOPDT, 1.5, 2.1, 6.0, 0.5), Model(Kind.SOPDT, 1.5, 2.1, 6.0, 1.3),
        Model(Kind.IPDT, 0.02, 3.2),
    ):  # fmt: skip
        for noise in (0.1, 0.5):
            hits: dict[str, int] = {}
            for seed in range(runs):
                found = fit(doublet(model, noise=noise, seed=seed), model.kind, noise=False)
                for name, half in found.interval.items():
                    hits.setdefault(name, 0)
                    hits[name] += abs(getattr(found.model, name) - getattr(model, name)) <= half
            shares = ", ".join(f"{name} {100 * count / runs:.0f} %" for name, count in hits.items())
            say(f"{model.kind.value:<6} ζ {model.zeta:<4g} noise {noise:<4g} {runs} runs: {shares}")


def main() -> None:
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    begun = time.perf_counter()
    batch()
    say(f"batch: {time.perf_counter() - begun:.1f} s\n")
    coverage(runs)
    say(f"in all {time.perf_counter() - begun:.1f} s")


if __name__ == "__main__":
    main()
