"""How a loop lives: figures of one window of samples, each with the source of its formula; pure, binary64.

This file alone decides what the figures mean. It does not know where the samples come from, live or recorded, nor how
an execution is judged.

Theory of operation: every sample holds until the next one, so shares of time and integrals are sums over intervals,
even when the samples are not evenly spaced. Correlations need an even grid: PV is drawn straight between samples,
everything else is held. What is said about the error counts only the time in automatic.

Source:
    Oscillation: Thornhill, Huang, Zhang, Detection of multiple oscillations in control loops, J. Process Control 13
    (2003) 91-100. Stiction: Horch, A simple method for detection of stiction in control valves, Control Engineering
    Practice 7 (1999) 1221-1231. Variability: Bialkowski, Dreams versus reality, Pulp & Paper Canada 94:11 (1993).
    Noise: second differences, von Neumann, Ann. Math. Statist. 12 (1941) 367-395, as in `tuning.noise`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ahgateway.tuning.noise import noise, resolution

Array = NDArray[np.float64]

SAMPLES_MIN = 20
"""Fewest samples of which anything is said."""
CROSSINGS_MIN = 5
CROSSINGS_MAX = 11
"""Zero crossings of the autocorrelation that are used: 4 to 10 half periods (Thornhill and others use 10)."""
HYSTERESIS = 0.1
"""The autocorrelation must come this far to the other side to have crossed zero; ours, against noise around zero."""
REGULARITY_MIN = 1.0
"""Above this regularity an oscillation is one (Thornhill and others)."""
STRENGTH_MIN = 0.3
"""Smallest share of the variance that returns after one period; ours, against slow drift."""
ODD_MIN = 2 / 3
EVEN_MAX = 1 / 3
"""Horch's limits: both measures above the first say stiction, both below the second say none."""
LIMITED_SHOWN_MIN = 0.1
AUTO_SHOWN_MAX = 0.9
"""From these shares on a table speaks of limits, and below of manual; ours."""


@dataclass(frozen=True, slots=True)
class Window:
    """Samples of one loop, arrays of one length, time strictly rising, numbers only.

    Attributes:
        t_s: Time in s.
        sv: Setpoint in the loop's PV unit.
        pv: Process value.
        mv: Output in the loop's MV unit.
        auto: True where the controller computed MV itself.
        mv_min: Lower limit of MV.
        mv_max: Upper limit of MV.
    """

    t_s: Array
    sv: Array
    pv: Array
    mv: Array
    auto: NDArray[np.bool_]
    mv_min: Array
    mv_max: Array


@dataclass(frozen=True, slots=True)
class Oscillation:
    """What the autocorrelation of the error shows.

    Attributes:
        period_s: Twice the mean time between its zero crossings.
        amplitude: Of the part that returns after one period, in PV units; noise does not count.
        regularity: Mean period by three times its standard deviation; infinite when all are equal.
        strength: Share of the variance that returns after one period, up to 1.
    """

    period_s: float
    amplitude: float
    regularity: float
    strength: float

    @property
    def is_one(self) -> bool:
        """True when it is regular and strong enough to be called an oscillation."""
        return self.regularity > REGULARITY_MIN and self.strength >= STRENGTH_MIN


@dataclass(frozen=True, slots=True)
class Stiction:
    """Shape of the cross-correlation of MV and PV: odd with a sticking valve, even without; self-regulating only.

    Attributes:
        lag_skew: |τl − τr| / (τl + τr) of the zero crossings beside lag 0; 1 is odd, 0 is even.
        size_skew: |r0 − ropt| / |r0 + ropt| of lag 0 and the extremum between them.
    """

    lag_skew: float
    size_skew: float

    @property
    def says(self) -> str:
        """`stiction`, `none` or `open`."""
        if min(self.lag_skew, self.size_skew) > ODD_MIN:
            return "stiction"
        return "none" if max(self.lag_skew, self.size_skew) < EVEN_MAX else "open"


@dataclass(frozen=True, slots=True)
class Health:
    """Figures of one window.

    Attributes:
        duration_s: From the first sample to the last.
        samples: How many samples.
        auto_share: Share of the time in automatic, 0…1.
        low_share: Share of the time at MV_MIN.
        high_share: Share of the time at MV_MAX.
        iae: Integral of |SV − PV| over the time in automatic, PV unit times s.
        error_mean_abs: `iae` by that time.
        error_std: Standard deviation of SV − PV in automatic.
        variability: 200 σ / |mean| of PV in percent; None when the mean is nought.
        mv_travel: Sum of all movements of MV.
        mv_travel_per_h: The same by time.
        reversals: How often MV turned round.
        noise: Standard deviation of the fast noise in PV.
        resolution: Step of a quantised PV, 0 where none is seen.
        oscillation: None when the window is too short to see one.
        stiction: None when nothing oscillates.
    """

    duration_s: float
    samples: int
    auto_share: float
    low_share: float
    high_share: float
    iae: float
    error_mean_abs: float
    error_std: float
    variability: float | None
    mv_travel: float
    mv_travel_per_h: float
    reversals: int
    noise: float
    resolution: float
    oscillation: Oscillation | None
    stiction: Stiction | None

    @property
    def oscillates(self) -> bool:
        """True when the error swings regularly and by more than noise and resolution would."""
        found = self.oscillation
        return found is not None and found.is_one and found.amplitude > max(2.0 * self.noise, self.resolution)


def health(window: Window) -> Health | None:
    """Return the figures of a window; None for fewer than `SAMPLES_MIN` samples."""
    if window.t_s.size < SAMPLES_MIN:
        return None
    holds_s = np.diff(window.t_s)
    duration_s = float(window.t_s[-1] - window.t_s[0])
    auto = window.auto[:-1]
    error = window.sv - window.pv
    auto_s = float(holds_s @ auto)
    iae = float(np.abs(error[:-1]) * auto @ holds_s)
    moves = np.diff(window.mv)
    turns = np.sign(moves[moves != 0.0])
    mean = float(np.mean(window.pv))
    oscillation = oscillation_of(window)
    is_one = oscillation is not None and oscillation.is_one
    return Health(
        duration_s=duration_s,
        samples=int(window.t_s.size),
        auto_share=auto_s / duration_s,
        low_share=float(holds_s @ (window.mv <= window.mv_min)[:-1]) / duration_s,
        high_share=float(holds_s @ (window.mv >= window.mv_max)[:-1]) / duration_s,
        iae=iae,
        error_mean_abs=iae / auto_s if auto_s > 0.0 else 0.0,
        error_std=float(np.std(error[window.auto])) if np.any(window.auto) else 0.0,
        variability=200.0 * float(np.std(window.pv)) / abs(mean) if mean else None,
        mv_travel=float(np.sum(np.abs(moves))),
        mv_travel_per_h=float(np.sum(np.abs(moves))) * 3600.0 / duration_s,
        reversals=int(np.count_nonzero(np.diff(turns))),
        noise=noise(window.pv),
        resolution=resolution(window.pv),
        oscillation=oscillation,
        stiction=stiction_of(window) if is_one else None,
    )


def _grid(window: Window) -> tuple[float, Array, Array, Array]:
    """Return the interval in s, and error, PV and MV on an even grid with the median interval, means taken away."""
    ts_s = float(np.median(np.diff(window.t_s)))
    count = min(int((window.t_s[-1] - window.t_s[0]) / ts_s + 1e-6) + 1, 4 * window.t_s.size)
    t_s = window.t_s[0] + ts_s * np.arange(count)
    held = np.clip(np.searchsorted(window.t_s, t_s + 1e-6 * ts_s, side="right") - 1, 0, window.t_s.size - 1)
    pv = np.interp(t_s, window.t_s, window.pv)
    error, mv = window.sv[held] - pv, window.mv[held]
    return ts_s, error - np.mean(error), pv - np.mean(pv), mv - np.mean(mv)


def _correlation(left: Array, right: Array) -> Array:
    """Return sums of left(t)·right(t + lag) for lags −(n−1)…n−1."""
    size = 2 * left.size - 1
    length = 1 << (size - 1).bit_length()
    spectrum = np.conj(np.fft.rfft(left, length)) * np.fft.rfft(right, length)
    found = np.fft.irfft(spectrum, length)
    return np.concatenate((found[length - left.size + 1 :], found[: left.size]))


def oscillation_of(window: Window) -> Oscillation | None:
    """Return period, amplitude and regularity of the error's swing; None when too few half periods fit."""
    ts_s, error, _, _ = _grid(window)
    size = error.size
    sums = _correlation(error, error)[size - 1 :]
    if sums[0] <= 1e-18 * size:
        return None
    unbiased = sums / np.arange(size, 0, -1)
    lags = _crossings((unbiased / unbiased[0])[: 3 * size // 4])[:CROSSINGS_MAX]
    if lags.size < CROSSINGS_MIN:
        return None
    periods = 2.0 * np.diff(lags)
    period = float(np.mean(periods))
    spread = float(np.std(periods, ddof=1))
    returned = float(np.interp(period, np.arange(size), unbiased))
    return Oscillation(
        period_s=period * ts_s,
        amplitude=math.sqrt(2.0 * max(0.0, returned)),
        regularity=period / (3.0 * spread) if spread > 0.0 else math.inf,
        strength=returned / float(unbiased[0]),
    )


def _crossings(curve: Array) -> Array:
    """Return where a curve passes zero, in samples, not counting what stays within the hysteresis of it."""
    found = []
    side = 1
    for index in np.flatnonzero(np.abs(curve) >= HYSTERESIS).tolist():
        if curve[index] * side < 0.0:
            side = -side
            # The last pair of neighbours with different signs before it.
            left = index - 1
            while curve[left] * side > 0.0:
                left -= 1
            low, high = float(curve[left]), float(curve[left + 1])
            found.append(left + low / (low - high))
    return np.asarray(found)


def stiction_of(window: Window) -> Stiction | None:
    """Return the skews of the cross-correlation of MV and PV; None when it has no zero on one of the sides."""
    _, _, pv, mv = _grid(window)
    middle = mv.size - 1
    sums = _correlation(mv, pv)
    right = _first_zero(sums[middle:])
    left = _first_zero(sums[middle::-1])
    if right is None or left is None:
        return None
    if left + right == 0.0:
        return Stiction(0.0, 0.0)
    between = sums[middle - math.floor(left) : middle + math.floor(right) + 1]
    best = float(between[np.argmax(np.abs(between))])
    here = float(sums[middle])
    total = abs(here + best)
    return Stiction(abs(left - right) / (left + right), abs(here - best) / total if total else 1.0)


def _first_zero(half: Array) -> float | None:
    """Lag of the first zero from lag 0 on, drawn straight between samples."""
    if half[0] == 0.0:
        return 0.0
    changed = np.flatnonzero(half * half[0] <= 0.0)
    if not changed.size:
        return None
    index = int(changed[0])
    before, after = float(half[index - 1]), float(half[index])
    return index - 1 + before / (before - after)


def label(found: Health | None) -> str:
    """Return the worst figure as a few words for a table; `-` while there are too few samples."""
    if found is None:
        return "-"
    if found.oscillates and found.oscillation is not None:
        sticks = found.stiction is not None and found.stiction.says == "stiction"
        return f"swings {found.oscillation.period_s:.3g} s{', sticks' if sticks else ''}"
    limited = found.low_share + found.high_share
    if limited >= LIMITED_SHOWN_MIN:
        return f"at limit {limited:.0%}"
    if found.auto_share < AUTO_SHOWN_MAX:
        return f"auto {found.auto_share:.0%}"
    return "steady"
