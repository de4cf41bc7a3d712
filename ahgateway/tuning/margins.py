"""Robustness of a loop from its frequency response: Ms, gain margin, phase margin, stability.

This file alone decides how they are computed: on the sampled loop as it is, with the process held between samples
(zero-order hold and dead time exact) and the controller's own difference equation, not on a continuous likeness.

Theory of operation: L(e^{jωTs}) = C·G on a grid up to half the sampling frequency. Ms is the largest |1/(1 + L)|. The
loop is stable when 1 + L turns by +90° for each integrator in L from ω → 0 to π/Ts (Nyquist, contour closed at z = 1).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ahgateway.tuning.canonical import Canonical
from ahgateway.tuning.models import Kind, Model

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


@dataclass(frozen=True, slots=True)
class Margins:
    """Robustness of one loop.

    Attributes:
        ms: Largest sensitivity, inf for an unstable loop; 1.2 to 2 is usual.
        gain_margin: Factor by which the gain may grow, inf where it may without end.
        phase_margin_deg: Phase that may be lost, in degrees; inf where |L| never is 1.
        is_stable: The closed loop is stable.
        crossover: ω in rad/s where |L| is last 1, 0 where it never is.
    """

    ms: float
    gain_margin: float
    phase_margin_deg: float
    is_stable: bool
    crossover: float


def controller(settings: Canonical, omega: Array) -> Complex:
    """Frequency response of the position law's difference equation from error to MV (spec B.3), feedback part."""
    z1 = np.exp(-1j * omega * settings.ts_s)
    c: Complex = np.full(omega.shape, settings.kp, dtype=np.complex128)
    if settings.ki > 0.0:
        c = c + settings.ki * settings.ts_s / (1.0 - z1)
    if settings.kd > 0.0:
        c = c + settings.kd * (1.0 - z1) / (settings.tf_s * (1.0 - z1) + settings.ts_s)
    if settings.tau_pv_s > 0.0:
        share = settings.tau_pv_s / (settings.tau_pv_s + settings.ts_s)
        c = c * (1.0 - share) / (1.0 - share * z1)
    return c


def grid(model: Model, settings: Canonical) -> Array:
    """Frequencies in rad/s, dense from far below the slowest motion up to half the sampling frequency."""
    top = math.pi / settings.ts_s
    ti = settings.ti_s if math.isfinite(settings.ti_s) else 0.0
    slow = max(model.slowness_s, ti, 10.0 * settings.ts_s)
    logarithmic = np.geomspace(1e-4 / slow, top, 4000)
    turns = model.dead_time_s / settings.ts_s
    even = np.linspace(0.0, top, int(min(40000, 400 + 40 * turns)))[1:]
    points: Array = np.unique(np.concatenate([logarithmic, even]))
    return points


def margins(model: Model, settings: Canonical) -> Margins:
    """Return the robustness of a loop whose direction of action fits the process: |K| is used."""
    positive = Model(model.kind, abs(model.gain), model.dead_time_s, model.tau_s, model.zeta)
    omega = grid(positive, settings)
    loop = controller(settings, omega) * positive.pulse(settings.ts_s).response(omega)
    integrators = (1 if settings.ki > 0.0 else 0) + (1 if positive.kind is Kind.IPDT else 0)
    around = 1.0 + loop
    turned = np.unwrap(np.angle(around))
    # Near ω = 0 the loop is its integrators alone, which stand at −90° each.
    stable = bool(abs((turned[-1] - turned[0]) - 0.5 * math.pi * integrators) < 0.25 * math.pi)
    size = np.abs(loop)
    ms = float(np.max(1.0 / np.maximum(np.abs(around), 1e-12))) if stable else math.inf
    return Margins(ms, _gain_margin(loop), *_phase_margin(omega, loop, size, stable))


def _gain_margin(loop: Complex) -> float:
    """Smallest 1/|L| above 1 where L meets the negative real axis; below 1 only when there is none above."""
    imaginary, real = loop.imag, loop.real
    crossing = np.flatnonzero((imaginary[:-1] < 0.0) != (imaginary[1:] < 0.0))
    values = []
    for index in crossing:
        run = imaginary[index + 1] - imaginary[index]
        share = -imaginary[index] / run if run else 0.0
        at = real[index] + share * (real[index + 1] - real[index])
        if at < 0.0:
            values.append(-1.0 / at)
    if loop[-1].real < 0.0:
        values.append(-1.0 / float(loop[-1].real))
    above = [value for value in values if value > 1.0]
    if above and len(above) == len(values):
        return float(min(above))
    return float(min(values)) if values else math.inf


def _phase_margin(omega: Array, loop: Complex, size: Array, stable: bool) -> tuple[float, bool, float]:
    """Smallest phase left where |L| is 1, whether the loop is stable, and the last such frequency."""
    crossing = np.flatnonzero((size[:-1] >= 1.0) & (size[1:] < 1.0))
    if not crossing.size:
        return math.inf, stable, 0.0
    phase = np.unwrap(np.angle(loop))
    # The phase at ω → 0 is known up to whole turns; it lies between 0 and −180°.
    phase -= 2.0 * math.pi * np.round((phase[0] + 0.5 * math.pi) / (2.0 * math.pi))
    left = []
    for index in crossing:
        share = (math.log(size[index])) / (math.log(size[index]) - math.log(size[index + 1]))
        left.append(180.0 + math.degrees(phase[index] + share * (phase[index + 1] - phase[index])))
    return float(min(left)), stable, float(omega[crossing[-1]])
