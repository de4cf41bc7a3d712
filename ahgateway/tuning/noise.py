"""What is noise in a PV: its size, the resolution of the converter behind it, and whether residuals are white."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy  # its parts are loaded when they are first used
from numpy.typing import NDArray

Array = NDArray[np.float64]

LAGS_MAX = 20


@dataclass(frozen=True, slots=True)
class Whiteness:
    """Ljung-Box test of residuals.

    Attributes:
        statistic: Q over `lags` lags.
        lags: How many autocorrelations were summed.
        p: Probability of so large a Q in white noise; below 0.01 the residuals are not white.
    """

    statistic: float
    lags: int
    p: float

    @property
    def is_white(self) -> bool:
        return self.p >= 0.01


def resolution(pv: Array) -> float:
    """Return the step between neighbouring values of a quantised PV, 0 where none is seen.

    A step is seen when every change is within 2 % of a multiple of the smallest one, and there are few enough values.
    """
    levels = np.unique(pv)
    if levels.size < 2:
        return 0.0
    gaps = np.diff(levels)
    scale = float(np.max(np.abs(levels)))
    gaps = gaps[gaps > 1e-9 * max(scale, 1e-300)]
    if not gaps.size or levels.size > 0.8 * pv.size:
        return 0.0
    smallest = float(np.min(gaps))
    multiples = gaps / smallest
    if np.any(np.abs(multiples - np.round(multiples)) > 0.02 * np.maximum(multiples, 1.0)):
        return 0.0
    return smallest


def noise(pv: Array) -> float:
    """Return the standard deviation of the fast noise in PV, from its second differences.

    The second difference of white noise has 6 times its variance; what moves slowly has nearly none. The largest tenth
    is left out, so that steps in PV do not count, and the rest scaled for it (0.7785 of σ remains of a normal law).
    """
    if pv.size < 5:
        return 0.0
    second = np.sort(np.abs(np.diff(pv, 2)))
    kept = second[: max(3, int(0.9 * second.size))]
    return float(np.sqrt(np.mean(kept**2) / 6.0) / 0.7785)


def whiteness(residuals: Array, fitted: int) -> Whiteness:
    """Test residuals for autocorrelation (Ljung and Box 1978).

    Args:
        residuals: One-step prediction errors.
        fitted: Parameters of the noise model, which take degrees of freedom.
    """
    n = residuals.size
    lags = int(min(LAGS_MAX, max(fitted + 1, n // 5)))
    centred = residuals - np.mean(residuals)
    power = float(centred @ centred)
    if power <= 0.0:
        return Whiteness(0.0, lags, 1.0)
    correlations = np.array([float(centred[k:] @ centred[:-k]) / power for k in range(1, lags + 1)])
    statistic = float(n * (n + 2) * np.sum(correlations**2 / (n - np.arange(1, lags + 1))))
    return Whiteness(statistic, lags, float(scipy.special.chdtrc(max(1, lags - fitted), statistic)))
