"""A tank that empties through its outlet: dh/dt = bias + K·u(t − θ) − c·√h, between empty and full. Not linear."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import expm1, inf, log, sqrt

from ahgateway.plants.base import DelayLine, delayed
from ahgateway.plants.integrating import IntegratingState

TRIES_MAX = 200
"""Bisection alone needs about 60; the bound only keeps a bug from hanging."""


@dataclass(frozen=True, slots=True)
class Tank:
    """A level with a free outlet, solved exactly for an input that is held.

    Torricelli's law separates: with s = √h and q the inflow, 2·s·ds/(q − c·s) = dt. Its integral is inverted by
    Newton's method inside a bracket, to the last bits of a binary64.

    Attributes:
        gain: K, inflow in PV per MV and second.
        outflow: c, so that c·√PV leaves per second; 0 or more.
        dead_time_s: θ, 0 or more; before the first input arrives, 0 acts.
        bias: Inflow at u = 0; negative is a draw besides the outlet.
        initial: PV at rest, 0 or more.
        full: PV at which it overflows.
    """

    gain: float
    outflow: float
    dead_time_s: float = 0.0
    bias: float = 0.0
    initial: float = 0.0
    full: float = inf

    def __post_init__(self) -> None:
        if not self.outflow >= 0.0 or not self.dead_time_s >= 0.0 or not 0.0 <= self.initial <= self.full:
            raise ValueError(
                f"outflow and dead_time_s must not be negative and initial must lie within 0 to full: "
                f"{self.outflow}, {self.dead_time_s}, 0 <= {self.initial} <= {self.full}"
            )

    def rest(self) -> IntegratingState:
        return IntegratingState(self.initial, DelayLine())

    def output(self, state: IntegratingState) -> float:
        return state.y

    def step(self, state: IntegratingState, u: float, dt_s: float) -> tuple[IntegratingState, float]:
        line, pieces = delayed(state.line, u, dt_s, self.dead_time_s)
        y = state.y
        for duration_s, acting in pieces:
            # Between two changes of the inflow a level runs one way only: what it has passed stays behind it.
            y = min(_level(y, self.gain * acting + self.bias, self.outflow, duration_s), self.full)
        return IntegratingState(y, line), y


def _level(h: float, q: float, c: float, t: float) -> float:
    """Return the level after `t` seconds of inflow `q`, from `h`."""
    if c == 0.0:
        return max(0.0, h + q * t)
    s = sqrt(h)
    away = q - c * s
    if away == 0.0 or t == 0.0 or (h == 0.0 and q <= 0.0):
        return h
    if q == 0.0:
        return max(0.0, s - c * t / 2.0) ** 2

    def elapsed(x: float) -> float:
        """Time until q − c·s has become e^x of what it was; grows as x falls below 0."""
        return 2.0 / c**2 * (away * expm1(x) - q * x)

    if q < 0.0:
        low = log(q / away)
        if elapsed(low) <= t:
            return 0.0
    else:
        low = -(t * c**2 / 2.0 + max(0.0, away)) / q

    def slope(x: float) -> float:
        return 2.0 / c**2 * (away * (expm1(x) + 1.0) - q)

    x = _found(lambda x: elapsed(x) - t, slope, low)
    # From s itself: near the balance, q − away·e^x would be the difference of two large numbers.
    return max(0.0, s - away * expm1(x) / c) ** 2


def _found(off: Callable[[float], float], slope: Callable[[float], float], low: float) -> float:
    """Return where a falling function is 0 within low…0: Newton's method, halving where it would leave the bracket."""
    high, x = 0.0, low / 2.0
    for _ in range(TRIES_MAX):
        missed = off(x)
        if missed > 0.0:
            low = x
        else:
            high = x
        better = x - missed / slope(x) if slope(x) else low
        if not low < better < high:
            better = (low + high) / 2.0
        if better == x or not low < better < high:
            return better
        x = better
    return x
