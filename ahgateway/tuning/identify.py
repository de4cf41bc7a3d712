"""From a record to a model: every candidate fitted, one chosen with its reason, the valve suspected, data refused.

This file alone decides which model wins. How one is fitted stands in `fit`, when data are refused in `checks`.

Theory of operation: IPDT, FOPDT and SOPDT are fitted with white noise; when the best leaves coloured residuals, all are
fitted again with a noise model. The simplest model within 6 of the smallest information criterion wins. Then the
winner is asked whether an evenly rising load, a valve with play or friction, or two gains explain PV better.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ahgateway.tuning import checks
from ahgateway.tuning.findings import Finding, Weight, refused
from ahgateway.tuning.fit import Fit, driven, fit, left_over
from ahgateway.tuning.models import Kind
from ahgateway.tuning.noise import Whiteness, noise, resolution, whiteness
from ahgateway.tuning.record import Record, checked, even
from ahgateway.tuning.timing import left_by_timing, timed
from ahgateway.tuning.valve import backlash, stiction

Array = NDArray[np.float64]

BIC_MARGIN = 6.0
"""A richer model must be better by this much: odds of about 20 to 1."""
SURE = 10.0
"""A suspicion is stated when the criterion is better by this much: odds of about 150 to 1."""
BAND_MIN = 0.05
"""Smallest play or friction that is spoken of, as a share of the range of MV in the record."""
ASYMMETRY_MIN = 0.2
"""Smallest difference of two gains that is spoken of, as a share of the larger."""
ORDER = (Kind.IPDT, Kind.FOPDT, Kind.SOPDT)
TWO_GAINS_ROUNDS = 5
WORN_TRIED = 4
"""Of each kind of worn valve the most probable ones are fitted in full."""
BANDS = tuple(0.05 * step for step in range(1, 17))


@dataclass(frozen=True, slots=True)
class Identification:
    """What a record says about its process.

    Attributes:
        record: On its even grid.
        fit: The chosen one; None when data were refused before any fit.
        candidates: Every fit in order of simplicity.
        reason: Why this one.
        whiteness: Of the chosen fit's prediction errors.
        noise: Standard deviation of the fast noise on PV.
        resolution: Step of a quantised PV, 0 where none is seen.
        findings: Refusals, warnings, notes.
    """

    record: Record
    fit: Fit | None
    candidates: tuple[Fit, ...]
    reason: str
    whiteness: Whiteness | None
    noise: float
    resolution: float
    findings: tuple[Finding, ...]

    @property
    def is_refused(self) -> bool:
        """Tell whether no proposal may be made from it."""
        return self.fit is None or bool(refused(self.findings))


def identify(raw: Record, kind: Kind | None = None) -> Identification:
    """Find the model of the process in a record.

    Args:
        raw: Samples as they came, evenly spaced or not.
        kind: The model to take; None chooses.

    Raises:
        ProfileError: Too few samples, or time that does not rise.
    """
    whole = checked(raw)
    record = even(whole)
    size, step = noise(record.pv), resolution(record.pv)
    first = [*checks.gaps(whole), *checks.before(record)]
    if not raw.is_even:
        first.append(_resampled(raw, record))
    if any(finding.weight is Weight.REFUSED for finding in first):
        return Identification(record, None, (), "data refused", None, size, step, tuple(first))
    kinds = ORDER if kind is None else (kind,)
    record = timed(record, Kind.FOPDT if kind is None else kind)
    candidates = tuple(fit(record, each, noise=False) for each in kinds)
    best = min(candidates, key=lambda each: each.bic)
    if not whiteness(best.residuals, 0).is_white:
        coloured = tuple(fit(record, each, noise=True) for each in kinds)
        if min(each.bic for each in coloured) < best.bic - SURE:
            candidates = coloured
    chosen, reason = choose(candidates)
    test = whiteness(chosen.residuals, 0 if chosen.noise_model is None else 2)
    findings = [*first, *checks.after(record, chosen, null_bic(record, chosen), test.p)]
    if not any(each.name == "stuck-valve" for each in findings):
        ramp = _ramp(record, chosen)
        flat = ramp.simulated - ramp.moved
        findings += checks.drift(chosen, ramp, float(flat[-1] - flat[flat.size // 10]))
        findings += _nonlinear(record, chosen, ramp)
    return Identification(record, chosen, candidates, reason, test, size, step, tuple(findings))


def _resampled(raw: Record, record: Record) -> Finding:
    text = f"the samples are not evenly spaced: {raw.t_s.size} were drawn onto a grid of {record.ts_s:g} s"
    return Finding("uneven", Weight.NOTE, text)


def choose(candidates: tuple[Fit, ...]) -> tuple[Fit, str]:
    """Return the simplest candidate within `BIC_MARGIN` of the best, and the reason in a sentence."""
    smallest = min(each.bic for each in candidates)
    for each in candidates:
        if each.bic <= smallest + BIC_MARGIN and math.isfinite(each.bic):
            chosen = each
            break
    others = [other for other in candidates if other is not chosen]
    if not others:
        return chosen, f"{chosen.model.kind.value} was asked for"
    parts = [f"{other.model.kind.value} {other.bic - chosen.bic:+.0f}" for other in others]
    richer = any(other.bic < chosen.bic for other in others)
    why = f"simplest model within {BIC_MARGIN:g} of the best" if richer else "smallest information criterion"
    return chosen, f"{chosen.model.kind.value}: {why} (BIC against it: {', '.join(parts)})"


def null_bic(record: Record, chosen: Fit) -> float:
    """Criterion of what PV does without MV: the same free motion, load and noise model, gain 0.

    A noise model alone may be slow enough to follow anything, so the better of white and of a first-order one counts.
    """
    t = record.t_s - record.t_s[0]
    n = t.size
    y = record.pv - record.pv[0]
    columns = [np.ones(n), t / t[-1]]
    if chosen.model.kind is not Kind.IPDT:
        columns.append(np.exp(-t / chosen.model.tau_s))
    x = np.column_stack(columns)
    best = math.inf
    for phi in (0.0,) if chosen.noise_model is None else (0.0, 0.5, 0.8, 0.9, 0.95, 0.98):
        xf, yf = x[1:] - phi * x[:-1], y[1:] - phi * y[:-1]
        errors = yf - xf @ np.linalg.lstsq(xf, yf, rcond=None)[0]
        rss = max(float(errors @ errors), 1e-300)
        best = min(best, n * math.log(rss / n) + (len(columns) + (2 if phi else 0)) * math.log(n))
    return best


def _ramp(record: Record, chosen: Fit) -> Fit:
    """The same process with a load that rises evenly, of first order at most.

    Its search starts anew: what a drift has bent may be far from the process.
    """
    kind = Kind.FOPDT if chosen.model.kind is Kind.IPDT else chosen.model.kind
    return fit(record, kind, noise=chosen.noise_model is not None, load_ramp=True)


def _nonlinear(record: Record, chosen: Fit, ramp: Fit) -> tuple[Finding, ...]:
    """Ask for a worn valve and for two gains; state the better of the two where it is surely better than neither.

    Either must be surely better than a load that rises evenly, and a worn valve must explain more than what not knowing
    when MV moved can leave.
    """
    kind, coloured = chosen.model.kind, chosen.noise_model is not None
    reach = float(np.ptp(record.mv))
    penalty = math.log(record.pv.size)
    best_bic = min(chosen.bic, ramp.bic) - SURE
    excused = left_by_timing(record, chosen.model)
    best: tuple[Finding, ...] = ()
    for name, share, position in _worn(record, chosen):
        tried = fit(record, kind, noise=coloured, mv=position, near=chosen)
        bic = tried.bic + (2.0 if name == "backlash" else 1.0) * penalty
        if bic < best_bic and max(_squares(chosen) - _squares(tried)) > excused:
            best_bic, best = bic, (_valve(name, share * reach, share, chosen.bic - bic),)
    two = _two_gains(record, chosen)
    return (two[1],) if two is not None and two[0] + penalty < best_bic else best


def _squares(fit: Fit) -> Array:
    """Sums of squares in PV² that a fit leaves: of its prediction errors, and of PV around what MV alone explains."""
    return np.array([float(fit.residuals @ fit.residuals), fit.residuals.size * fit.spread**2])


def _worn(record: Record, chosen: Fit) -> list[tuple[str, float, Array]]:
    """The most probable valves with play or friction: name, share of MV's range, position."""
    reach = float(np.ptp(record.mv))
    out: list[tuple[str, float, Array]] = []
    for name, starts in (("backlash", (-0.5, 0.0, 0.5)), ("stiction", (0.0,))):
        tried = []
        for share in BANDS:
            for start in starts:
                band = share * reach
                position = backlash(record.input, band, start) if name == "backlash" else stiction(record.input, band)
                if float(np.ptp(position)) > 0.0 and not np.array_equal(position, record.input):
                    tried.append((left_over(record, chosen, position), share, position))
        tried.sort(key=lambda each: each[0])
        out += [(name, share, position) for _, share, position in tried[:WORN_TRIED]]
    return out


def _valve(name: str, band: float, share: float, sure: float) -> Finding:
    text = (
        f"a valve with {name} of about {band:.2g} in MV ({100 * share:.0f} % of MV's range here) "
        f"explains PV better (BIC {-sure:.0f})"
    )
    return Finding(name, Weight.REFUSED, text, "fix the valve, do not retune")


def _two_gains(record: Record, chosen: Fit) -> tuple[float, Finding] | None:
    """Fit one gain above the first MV and one below it; None unless MV went both ways and the two differ."""
    u = record.input - record.input[0]
    reach = float(np.ptp(u))
    if min(float(u.max()), -float(u.min())) < 0.1 * reach:
        return None
    tried, up, down = chosen, 0.0, 0.0
    for _ in range(TWO_GAINS_ROUNDS):
        unit = replace(tried.model, gain=1.0)
        above = driven(unit, np.maximum(u, 0.0), record.ts_s)
        below = driven(unit, np.minimum(u, 0.0), record.ts_s)
        y = record.pv - record.pv[0] - (tried.simulated - tried.moved)
        up, down, _ = np.linalg.lstsq(np.column_stack([above, below, np.ones_like(y)]), y, rcond=None)[0].tolist()
        mean = 0.5 * (up + down)
        if mean == 0.0:
            return None
        bent = record.input[0] + np.where(u > 0.0, up / mean, down / mean) * u
        tried = fit(record, chosen.model.kind, noise=chosen.noise_model is not None, mv=bent, near=chosen)
    if abs(up - down) < ASYMMETRY_MIN * max(abs(up), abs(down)):
        return None
    text = f"the gain is {up:.3g} above MV {record.mv[0]:g} and {down:.3g} below it"
    hint = "tune for the larger gain, or give the loop two sets; a doublet cannot tell this from play, more steps can"
    return tried.bic, Finding("direction-gain", Weight.WARNING, text, hint)
