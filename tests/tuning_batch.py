"""Åström and Hägglund's test batch for PID control, with noise and quantisation, for tests and benches.

The batch is that of "Benchmark systems for PID control", IFAC PID 2000, and Advanced PID Control (2006), ch. 7: lags
with dead time, multiple lags, wide-spread lags, inverse response, an oscillating process, an integrator. It is
simulated by scipy, not by our plants.
"""

from __future__ import annotations

import numpy as np
from scipy import signal

from ahgateway.tuning.record import Record

TS = 0.1
NOISE = 0.01
QUANTUM = 0.005


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
"""Name to numerator, denominator and dead time in s."""


def answered(name: str, seed: int) -> Record:
    """A doublet of 1 in MV with noise of 1 % and a resolution of 0.5 % of it."""
    top, bottom, dead = BATCH[name]
    count = 900
    mv = np.zeros(count)
    mv[50:300] = 1.0
    mv[300:600] = -1.0
    late = np.concatenate([np.zeros(round(dead / TS)), mv])[:count]
    system = signal.cont2discrete(signal.tf2ss(top, bottom), TS, "zoh")
    _, pv, _ = signal.dlsim(system, late)
    pv = pv[:, 0] + NOISE * np.random.default_rng(seed).standard_normal(count)
    return Record(np.arange(count) * TS, np.zeros(count), QUANTUM * np.round(pv / QUANTUM), mv, "batch")


def response(name: str, omega: np.ndarray) -> np.ndarray:
    """The process itself at these frequencies in rad/s."""
    top, bottom, dead = BATCH[name]
    s = 1j * omega
    return np.polyval(top, s) / np.polyval(bottom, s) * np.exp(-s * dead)


def model_error(name: str, found: np.ndarray, omega: np.ndarray) -> float:
    """Largest |G − Ĝ|/|G| up to where G has turned by −135°; below it a PI or PID loop works."""
    true = response(name, omega)
    edge = int(np.argmax(np.unwrap(np.angle(true)) <= np.radians(-135.0))) or omega.size
    return float(np.max(np.abs(found[:edge] - true[:edge]) / np.abs(true[:edge])))
