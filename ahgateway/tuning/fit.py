"""Prediction-error fit of one model to one record: dead time as a parameter, initial state and load free.

This file alone decides what is minimised. It does not choose between models, nor refuse data.

Theory of operation: y = G(τ, ζ, θ)·u + free motion + load + H·e with H = (1 + c z⁻¹)/(1 − φ z⁻¹), or H = 1. Gain, free
motion and load are linear, so for each (τ, ζ, θ, φ, c) they are solved exactly (variable projection, Golub and Pereyra
1973) and least squares walks over the rest only, from the best points of a coarse grid: no starting guess of a
person's is needed. H is what makes the estimate hold in closed loop, where output error alone is drawn off by slow
disturbances (Ljung, System Identification, 2nd ed., ch. 13.4). Intervals come from the Jacobian of all parameters,
the linear ones included.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy  # its parts are loaded when they are first used: a monitor starts without them
from numpy.typing import NDArray

from ahgateway.tuning.models import Kind, Model, decays
from ahgateway.tuning.record import Record

Array = NDArray[np.float64]

POLE_MAX = 0.98
ZERO_MAX = 0.9
"""Within these a noise model is told from a free mean; beyond them it would only hide one."""
GRID = 14
STARTS = 3


@dataclass(frozen=True, slots=True)
class Fit:
    """One model fitted to one record.

    Attributes:
        model: The process.
        interval: Parameter name to half the width of its 95 % confidence interval.
        noise_model: (φ, c), or None for white noise.
        residuals: One-step prediction errors in PV units.
        simulated: PV as the model alone gives it from MV, free motion and load included.
        moved: The share of `simulated` that MV brought about.
        sigma: Standard deviation of the prediction errors.
        spread: Standard deviation of PV around `simulated`.
        bic: Bayesian information criterion; smaller is better.
        count: Parameters that were fitted.
        point: Where the search ended: dead time, logarithm of lag and of damping, φ, c.
    """

    model: Model
    interval: dict[str, float]
    noise_model: tuple[float, float] | None
    residuals: Array
    simulated: Array
    moved: Array
    sigma: float
    spread: float
    bic: float
    count: int
    point: Array

    @property
    def snr(self) -> float:
        """Change of PV that MV brought about, peak to peak, over the spread around the model."""
        reach = float(np.ptp(self.moved))
        return reach / self.spread if self.spread > 0.0 else math.inf

    @property
    def fit_percent(self) -> float:
        """100 for a model that leaves nothing, 0 for one no better than the mean."""
        everything = self.simulated + 0.0
        deviation = float(np.std(everything)) or 1e-300
        return 100.0 * max(0.0, 1.0 - self.spread / math.hypot(deviation, self.spread))


@dataclass(frozen=True, slots=True)
class _Problem:
    """What stays the same during one fit: samples relative to the first, and how a point becomes a model."""

    kind: Kind
    t_s: Array
    y: Array
    u: Array
    ts_s: float
    noise: bool
    load_ramp: bool

    def model(self, point: Array, gain: float = 1.0) -> Model:
        if self.kind is Kind.IPDT:
            return Model(self.kind, gain, float(point[0]))
        zeta = math.exp(point[2]) if self.kind is Kind.SOPDT else 1.0
        return Model(self.kind, gain, float(point[0]), math.exp(point[1]), zeta)

    def noise_of(self, point: Array) -> tuple[float, float] | None:
        return (float(point[-2]), float(point[-1])) if self.noise else None

    def regressors(self, point: Array) -> Array:
        """Columns: answer of the unit-gain model to MV, the free motions, the load."""
        model = self.model(point)
        columns = [driven(model, self.u, self.ts_s)]
        if self.kind is Kind.IPDT:
            columns += [np.ones_like(self.t_s), self.t_s]
        elif self.kind is Kind.FOPDT:
            columns += [np.exp(-self.t_s / model.tau_s), np.ones_like(self.t_s)]
        else:
            even, odd = decays(model.tau_s, model.zeta, self.t_s)
            columns += [even, odd / model.tau_s, np.ones_like(self.t_s)]
        if self.load_ramp:
            columns.append(self.t_s / self.t_s[-1])
        return np.column_stack(columns)

    def errors(self, point: Array) -> Array:
        """Prediction errors at this point, the linear parameters solved."""
        return self.solved(point)[1]

    def solved(self, point: Array) -> tuple[Array, Array, Array]:
        """Linear parameters, prediction errors, and the unfiltered regressors at this point."""
        raw = self.regressors(point)
        colour = self.noise_of(point)
        x, y = raw, self.y
        if colour is not None:
            # H⁻¹; its first sample is taken as it is, the free motion makes up for it.
            phi, c = colour
            x = scipy.signal.lfilter([1.0, -phi], [1.0, c], raw, axis=0)
            y = scipy.signal.lfilter([1.0, -phi], [1.0, c], self.y)
        scale = np.sqrt(np.sum(x**2, axis=0))
        scale[scale <= 0.0] = 1.0
        scaled = x / scale
        linear = np.linalg.lstsq(scaled, y, rcond=1e-10)[0]
        return linear / scale, y - scaled @ linear, raw


def driven(model: Model, u: Array, ts_s: float) -> Array:
    """Answer of a model at rest to MV given as its deviation from the first sample, exact between samples."""
    pulse = model.pulse(ts_s)
    moved: Array = scipy.signal.lfilter([0.0, *pulse.b], pulse.a, u)
    if pulse.delay == 0:
        return moved
    late = np.zeros_like(moved)
    late[pulse.delay :] = moved[: -pulse.delay] if pulse.delay < moved.size else moved[:0]
    return late


def fit(
    record: Record,
    kind: Kind,
    *,
    noise: bool,
    load_ramp: bool = False,
    mv: Array | None = None,
    near: Fit | None = None,
) -> Fit:
    """Fit one kind of model to an even record.

    Args:
        record: On an even grid; see `record.even`.
        kind: Which model.
        noise: True fits a noise model beside the process, False takes the noise as white.
        load_ramp: True lets the load rise evenly over the record: a drift.
        mv: What moved the process, where it is not the record's input: behind a valve model, for instance.
        near: A fit of this kind to start from, instead of a search over the whole grid.
    """
    u = record.input if mv is None else mv
    problem = _Problem(
        kind, record.t_s - record.t_s[0], record.pv - record.pv[0], u - u[0], record.ts_s, noise, load_ramp
    )
    low, high = _bounds(problem)
    best: Any = None
    for start in _starts(problem) if near is None else [near.point]:
        found = scipy.optimize.least_squares(
            problem.errors,
            np.clip(start, low + 1e-9, high - 1e-9),
            bounds=(low, high),
            x_scale=_scales(problem, start),
            max_nfev=60,
            xtol=1e-10,
            ftol=1e-10,
        )
        if best is None or found.cost < best.cost:
            best = found
    return _finished(problem, best.x, record.timing_s)


def left_over(record: Record, near: Fit, mv: Array) -> float:
    """Return the sum of squared prediction errors where only gain, free motion and load are fitted to another MV."""
    kind, coloured = near.model.kind, near.noise_model is not None
    y = record.pv - record.pv[0]
    problem = _Problem(kind, record.t_s - record.t_s[0], y, mv - mv[0], record.ts_s, coloured, False)
    errors = problem.errors(near.point)
    return float(errors @ errors)


def _bounds(problem: _Problem) -> tuple[Array, Array]:
    span, ts = float(problem.t_s[-1]), problem.ts_s
    low, high = [0.0], [0.5 * span]
    if problem.kind is not Kind.IPDT:
        low.append(math.log(0.1 * ts))
        high.append(math.log(5.0 * span))
    if problem.kind is Kind.SOPDT:
        low.append(math.log(0.05))
        high.append(math.log(10.0))
    if problem.noise:
        low += [-POLE_MAX, -ZERO_MAX]
        high += [POLE_MAX, ZERO_MAX]
    return np.array(low), np.array(high)


def _scales(problem: _Problem, start: Array) -> Array:
    scales = np.ones_like(start)
    scales[0] = max(start[0], problem.ts_s)
    return scales


def _starts(problem: _Problem) -> list[Array]:
    """The best points of a coarse grid over dead time and lag, white noise assumed, far enough from each other."""
    span, ts = float(problem.t_s[-1]), problem.ts_s
    white = _Problem(problem.kind, problem.t_s, problem.y, problem.u, ts, False, problem.load_ramp)
    thetas = np.concatenate([[0.0], np.geomspace(ts, 0.4 * span, GRID)])
    axes: list[Array] = [thetas]
    if problem.kind is not Kind.IPDT:
        axes.append(np.log(np.geomspace(ts, 2.0 * span, GRID)))
    if problem.kind is Kind.SOPDT:
        axes = [thetas[::2], axes[1], np.log(np.array([0.3, 1.0, 2.5]))]
    points = np.array(np.meshgrid(*axes, indexing="ij")).reshape(len(axes), -1).T
    costs = np.array([float(np.sum(white.solved(point)[1] ** 2)) for point in points])
    chosen: list[Array] = []
    for index in np.argsort(costs):
        point = points[index]
        if all(
            np.max(np.abs(point[1:] - other[1:]), initial=abs(point[0] - other[0]) / span) > 0.1 for other in chosen
        ):
            chosen.append(point)
        if len(chosen) == STARTS:
            break
    if not problem.noise:
        return chosen
    return [np.concatenate([point, [0.5, 0.0]]) for point in chosen]


def _finished(problem: _Problem, point: Array, timing_s: float) -> Fit:
    """Everything that is said about the optimum: gain, intervals from the whole Jacobian, criterion.

    When MV moved is known to `timing_s` only, and nothing in the data averages that out: it adds to the dead time's.
    """
    linear, errors, raw = problem.solved(point)
    n, count = problem.y.size, point.size + linear.size
    rss = max(float(errors @ errors), 1e-300)
    sigma = math.sqrt(rss / max(1, n - count))
    simulated = raw @ linear
    full = np.concatenate([point, linear])
    jacobian = _jacobian(lambda values: _errors_at(problem, values), full, problem)
    scale = np.sqrt(np.sum(jacobian**2, axis=0))
    scale[scale <= 0.0] = 1.0
    scaled = jacobian / scale
    covariance = sigma**2 * np.linalg.pinv(scaled.T @ scaled, rcond=1e-12) / np.outer(scale, scale)
    half = 1.96 * np.sqrt(np.maximum(np.diag(covariance), 0.0))
    model = problem.model(point, float(linear[0]))
    interval = {"dead_time_s": float(half[0]) + timing_s, "gain": float(half[point.size])}
    if problem.kind is not Kind.IPDT:
        interval["tau_s"] = float(half[1]) * model.tau_s
    if problem.kind is Kind.SOPDT:
        interval["zeta"] = float(half[2]) * model.zeta
    return Fit(
        model,
        interval,
        problem.noise_of(point),
        errors,
        simulated,
        raw[:, 0] * linear[0],
        sigma,
        float(np.std(problem.y - simulated)),
        n * math.log(rss / n) + count * math.log(n),
        count,
        point,
    )


def _errors_at(problem: _Problem, values: Array) -> Array:
    """Prediction errors with the linear parameters given instead of solved."""
    size = values.size - (problem.regressors(values).shape[1])
    point, linear = values[:size], values[size:]
    errors: Array = problem.y - problem.regressors(point) @ linear
    colour = problem.noise_of(point)
    if colour is not None:
        errors = scipy.signal.lfilter([1.0, -colour[0]], [1.0, colour[1]], errors)
    return errors


def _jacobian(function: Callable[[Array], Array], at: Array, problem: _Problem) -> Array:
    """Central differences; for the dead time over half a sample, since it has a kink at every whole one."""
    columns = []
    for index in range(at.size):
        width = 0.5 * problem.ts_s if index == 0 else 1e-5 * max(1.0, abs(at[index]))
        above, below = at.copy(), at.copy()
        above[index] += width
        below[index] = max(0.0, below[index] - width) if index == 0 else below[index] - width
        columns.append((function(above) - function(below)) / (above[index] - below[index]))
    return np.column_stack(columns)
