"""Predicted against measured: the exact controller on the model, advanced beside a live loop.

This file alone decides what the fit of a verification is, and how far PV may leave its prediction.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ahgateway.tuning.models import Model
from ahgateway.tuning.runner import Runner

Array = NDArray[np.float64]

TUBE = 0.5
"""Largest |measured − predicted| PV, as a share of the step of SV."""
TUBE_NOISE = 8.0
"""The same in standard deviations of the noise; the larger counts."""
LATE_SAMPLES = 3
"""Samples by which PV may follow its prediction late: nobody sees in which part of a CYCLE a write lands."""
FIT_MIN = 50.0
"""Smallest fit in % of a verification that is passed; a right model with SV ten times the noise has about 75."""


def fit_percent(measured: Array, predicted: Array) -> float:
    """Return 100·(1 − ‖y − ŷ‖/‖y − mean(y)‖): 100 for equal courses, 0 for no better than the mean."""
    spread = float(np.linalg.norm(measured - np.mean(measured)))
    if spread == 0.0:
        return 100.0 if np.array_equal(measured, predicted) else 0.0
    return 100.0 * (1.0 - float(np.linalg.norm(measured - predicted)) / spread)


def fit_late(measured: Array, predicted: Array) -> float:
    """Return the best fit with PV up to `LATE_SAMPLES` behind its prediction; both arrays of one length."""
    most = min(LATE_SAMPLES, measured.size - 2)
    return max(fit_percent(measured[late:], predicted[: predicted.size - late]) for late in range(max(most, 0) + 1))


def tube(step: float, sigma: float, resolution: float) -> float:
    """Return how far PV may be from its prediction, in PV."""
    return max(TUBE * abs(step), TUBE_NOISE * sigma, 4.0 * resolution)


class Predictor:
    """A loop that runs beside the real one, as far as it is told.

    Args:
        runner: The controller at rest at `at`.
        model: The process.
        at: PV and MV at rest.
    """

    def __init__(self, runner: Runner, model: Model, at: tuple[float, float]) -> None:
        self._runner = runner
        self._plant, self._state = model.plant(at[0], at[1])
        self._t = self._before_t = 0.0
        self._pv = self._before_pv = at[0]
        self._mv = at[1]

    def until(self, t_s: float, sv: float) -> tuple[float, float]:
        """Run with this SV up to a time; return PV there, drawn straight between executions, and MV."""
        while self._t < t_s:
            self._mv = self._runner.execute(sv, self._pv)
            self._before_t, self._before_pv = self._t, self._pv
            self._state, self._pv = self._plant.step(self._state, self._mv, self._runner.ts_s)
            self._t += self._runner.ts_s
        if self._t == self._before_t:
            return self._pv, self._mv
        share = (t_s - self._before_t) / (self._t - self._before_t)
        return self._before_pv + share * (self._pv - self._before_pv), self._mv
