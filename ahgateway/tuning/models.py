"""The three models that a loop is described with, sampled exactly.

This file alone decides what FOPDT, SOPDT and IPDT are, in continuous time and at the samples of a held input.

    FOPDT  K·e^(−θs) / (τs + 1)
    SOPDT  K·e^(−θs) / (τ²s² + 2ζτs + 1), overdamped for ζ > 1, two equal lags at 1, oscillating below
    IPDT   K·e^(−θs) / s, K in PV per MV and second

Theory of operation: for an input held between samples the pulse transfer function is exact for every dead time, whole
samples as a shift, the rest in the numerator: g(n) = s(nh − f) − s((n−1)h − f) with the step response s.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass
from enum import Enum
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ahgateway.plants.base import DelayLine, Plant
from ahgateway.plants.fopdt import Fopdt, FopdtState
from ahgateway.plants.integrating import Integrating, IntegratingState
from ahgateway.plants.second_order import SecondOrder, SecondOrderState

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


class Kind(Enum):
    """Which model."""

    FOPDT = "FOPDT"
    SOPDT = "SOPDT"
    IPDT = "IPDT"


@dataclass(frozen=True, slots=True)
class Pulse:
    """A pulse transfer function z^(−delay)·(b0 z⁻¹ + b1 z⁻² + …)/(1 + a1 z⁻¹ + …) at sampling time `ts_s`."""

    b: tuple[float, ...]
    a: tuple[float, ...]
    delay: int
    ts_s: float

    def response(self, omega: Array) -> Complex:
        """Frequency response at `omega` rad/s, below π/ts."""
        z1 = np.exp(-1j * omega * self.ts_s)
        top = sum(b * z1 ** (index + 1) for index, b in enumerate(self.b))
        bottom = sum(a * z1**index for index, a in enumerate(self.a))
        answer: Complex = z1**self.delay * top / bottom
        return answer


@dataclass(frozen=True, slots=True)
class Model:
    """One process model.

    Attributes:
        kind: Which of the three.
        gain: K in PV per MV, for IPDT in PV per MV and second.
        dead_time_s: θ in s.
        tau_s: τ in s; for SOPDT the inverse of the natural frequency; unused for IPDT.
        zeta: ζ, damping; SOPDT only.
    """

    kind: Kind
    gain: float
    dead_time_s: float = 0.0
    tau_s: float = 1.0
    zeta: float = 1.0

    @property
    def lags_s(self) -> tuple[float, ...]:
        """Time constants in s, longest first; none for IPDT and for an oscillating SOPDT."""
        if self.kind is Kind.FOPDT:
            return (self.tau_s,)
        if self.kind is Kind.IPDT or self.zeta < 1.0:
            return ()
        root = math.sqrt(self.zeta**2 - 1.0)
        return (self.tau_s * (self.zeta + root), self.tau_s / (self.zeta + root))

    @property
    def slowness_s(self) -> float:
        """Sum of the lags and dead time in s; for IPDT the dead time alone."""
        lag = {Kind.FOPDT: self.tau_s, Kind.SOPDT: 2.0 * self.zeta * self.tau_s, Kind.IPDT: 0.0}[self.kind]
        return lag + self.dead_time_s

    def response(self, omega: Array) -> Complex:
        """Frequency response of the continuous model at `omega` rad/s."""
        s = 1j * omega
        bottom = {
            Kind.FOPDT: self.tau_s * s + 1.0,
            Kind.SOPDT: self.tau_s**2 * s**2 + 2.0 * self.zeta * self.tau_s * s + 1.0,
            Kind.IPDT: s,
        }[self.kind]
        answer: Complex = self.gain * np.exp(-s * self.dead_time_s) / bottom
        return answer

    def poles(self) -> tuple[complex, ...]:
        """Poles of the continuous model without dead time, in 1/s."""
        if self.kind is Kind.IPDT:
            return (0j,)
        if self.kind is Kind.FOPDT:
            return (complex(-1.0 / self.tau_s),)
        root = cmath.sqrt(self.zeta**2 - 1.0)
        return ((-self.zeta + root) / self.tau_s, (-self.zeta - root) / self.tau_s)

    def step_response(self, t_s: float) -> float:
        """PV `t_s` seconds after the dead time of a unit step is over; 0 before."""
        if t_s <= 0.0:
            return 0.0
        if self.kind is Kind.IPDT:
            return self.gain * t_s
        if self.kind is Kind.FOPDT:
            return self.gain * -math.expm1(-t_s / self.tau_s)
        even, odd = decays(self.tau_s, self.zeta, np.array([t_s]))
        return self.gain * (1.0 - float(even[0]) - self.zeta / self.tau_s * float(odd[0]))

    def pulse(self, ts_s: float) -> Pulse:
        """Exact pulse transfer function for an input held for `ts_s`."""
        whole = math.floor(self.dead_time_s / ts_s + 1e-9)
        rest = max(0.0, self.dead_time_s - whole * ts_s)
        a = [1.0]
        for pole in self.poles():
            root = cmath.exp(pole * ts_s)
            a = [(x - root * y) for x, y in zip([*a, 0.0], [0.0, *a], strict=True)]  # type: ignore[misc]
        real = [complex(x).real for x in a]
        order = len(real) - 1
        steps = [self.step_response(n * ts_s - rest) for n in range(order + 2)]
        g = [late - early for early, late in pairwise(steps)]
        b = [sum(real[j] * g[n - j] for j in range(min(n, order) + 1)) for n in range(order + 1)]
        return Pulse(tuple(b), tuple(real), whole, ts_s)

    def half_rule(self) -> Model:
        """First-order or integrating model with the same lag sum: the half rule (Skogestad 2003, eq. 10-11).

        An oscillating model has no lags to halve; its two lags are taken as equal to ζτ, with a dead time to match.
        """
        if self.kind is not Kind.SOPDT:
            return self
        first, second = self.lags_s or (self.zeta * self.tau_s, self.zeta * self.tau_s)
        return Model(Kind.FOPDT, self.gain, self.dead_time_s + second / 2.0, first + second / 2.0)

    def plant(self, pv: float, mv: float, load: float = 0.0) -> tuple[Plant[Any], Any]:
        """Return a plant that stands still at this PV and MV, and its state there.

        Args:
            pv: PV at the operating point.
            mv: MV that holds it there.
            load: Disturbance at the plant's input from the start on, in MV.
        """
        line = DelayLine(0.0, mv, mv)
        if self.kind is Kind.IPDT:
            tank = Integrating(self.gain, self.dead_time_s, -self.gain * (mv - load), pv)
            return tank, IntegratingState(pv, line)
        bias = pv - self.gain * (mv - load)
        if self.kind is Kind.FOPDT:
            return Fopdt(self.gain, self.tau_s, self.dead_time_s, bias, pv), FopdtState(pv, line)
        second = SecondOrder(self.gain, self.tau_s, self.zeta, self.dead_time_s, bias, pv)
        return second, SecondOrderState(pv, 0.0, line)


def decays(tau_s: float, zeta: float, t_s: Array) -> tuple[Array, Array]:
    """The two free motions of a second-order lag: e^(−ζt/τ)·cosh(wt) and e^(−ζt/τ)·sinh(wt)/w, w² = (ζ²−1)/τ².

    Smooth through ζ = 1, where w is 0; below it cosh and sinh become cos and sin.
    """
    w = cmath.sqrt(zeta**2 - 1.0) / tau_s
    slow = np.exp((-zeta / tau_s + w) * t_s)
    fast = np.exp((-zeta / tau_s - w) * t_s)
    even: Array = np.real(slow + fast) / 2.0
    if abs(w) * float(np.max(np.abs(t_s), initial=0.0)) < 1e-5:
        odd: Array = t_s * np.exp(-zeta / tau_s * t_s)
    else:
        odd = np.real((slow - fast) / (2.0 * w))
    return even, odd
