"""What makes a record unfit to tune from, seen before any model is fitted, and what a fit gives away afterwards.

This file alone decides the limits at which data are refused. It fits nothing itself.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ahgateway.tuning.findings import Finding, Weight
from ahgateway.tuning.fit import Fit
from ahgateway.tuning.models import Kind
from ahgateway.tuning.noise import noise, resolution
from ahgateway.tuning.record import Record

Array = NDArray[np.float64]

MOVES_MIN = 30
"""Fewest moves of MV that are taken for a controller's."""
SNR_MIN = 5.0
"""Smallest change of PV by MV, peak to peak, in standard deviations of what is left."""
SATURATED_MAX = 0.25
"""Largest share of the record that MV may stand at a limit."""
FLAT_MAX = 0.15
"""Largest share of the record that PV may stand unmoved at its highest or lowest value."""
GAIN_INTERVAL_MAX = 0.3
"""Largest half width of the gain's confidence interval, as a share of the gain."""
DRIFT_MAX = 0.5
"""Largest drift over the record, as a share of what MV brought about; above half of it a warning."""
LENGTH_MIN = 2.0
"""Fewest times that the record must hold the process's slowness."""
GAP_MIN = 5.0
"""A gap is a time between two samples that is this many times the usual one, in a record that is even otherwise."""
GAP_MOVE = 0.2
"""Largest move of MV across a gap, as a share of its range; of PV it is a warning."""
TIMING_MAX = 0.15
"""Largest time within which each move of MV is known, as a share of the lag."""
HELD_MIN = 0.5
"""Share of samples at which MV stands still that tells a person's moves from a controller's."""


def before(record: Record) -> tuple[Finding, ...]:
    """Return what can be said without a model: nothing moved, only feedback moved, limits reached."""
    found: list[Finding] = []
    reach = float(np.ptp(record.mv))
    if reach <= 0.0:
        return (
            Finding(
                "not-excited",
                Weight.REFUSED,
                f"MV stands at {record.mv[0]:g} over the whole record, so nothing can be told about the process",
                "record a step of MOUT in manual, or a step of SV in automatic",
            ),
        )
    if float(np.ptp(record.pv)) <= 0.0:
        text = f"PV stands at {record.pv[0]:g} while MV moves by {reach:g}"
        return (Finding("frozen-pv", Weight.REFUSED, text, "check the sensor and the column that was read as PV"),)
    found += _feedback_only(record)
    found += _saturated(record)
    found += _flat(record)
    step, sigma = resolution(record.pv), noise(record.pv)
    if step > 0.0 and sigma < step:
        found.append(
            Finding("quantised", Weight.NOTE, f"PV has a resolution of {step:g}, its noise is {sigma:.3g}, so it hides")
        )
    return tuple(found)


def gaps(raw: Record) -> tuple[Finding, ...]:
    """Return what is to be said of gaps: nobody knows when MV moved in one, nor which way PV took."""
    steps = np.diff(raw.t_s)
    usual = float(np.median(steps))
    if float(np.mean(np.abs(steps - usual) <= 0.5 * usual)) < 0.9:
        return ()
    found = []
    for name, values, weight in (("MV", raw.mv, Weight.REFUSED), ("PV", raw.pv, Weight.WARNING)):
        moved = np.abs(np.diff(values)) * (steps > GAP_MIN * usual)
        place = int(np.argmax(moved))
        if moved[place] > 0.0 and moved[place] >= GAP_MOVE * float(np.ptp(values)):
            text = (
                f"{steps[place]:.4g} s are missing from {raw.t_s[place]:g} s on, usual are {usual:.3g} s between "
                f"samples, and {name} went from {values[place]:.5g} to {values[place + 1]:.5g} meanwhile"
            )
            found.append(Finding("gap", weight, text, "cut the file there, or record again without a gap"))
    return tuple(found[:1])


def _feedback_only(record: Record) -> list[Finding]:
    """Data in which nothing but the controller moved MV show the controller, not the process."""
    held = float(np.mean(np.diff(record.mv) == 0.0))
    if held >= HELD_MIN and not _is_controlled(record.mv):
        return []
    if not np.any(np.isfinite(record.sv)):
        text = f"SV is not known and MV moves in {100 - 100 * held:.0f} % of the samples: feedback may hide the process"
        return [Finding("sv-unknown", Weight.WARNING, text, "name the column with SV")]
    if float(np.nanmax(record.sv) - np.nanmin(record.sv)) > 0.0:
        return []
    text = (
        f"SV stands at {record.sv[0]:g} and MV moves in {100 - 100 * held:.0f} % of the samples: "
        "feedback alone moved it"
    )
    return [Finding("not-excited", Weight.REFUSED, text, "record a step of SV in automatic, or of MOUT in manual")]


def _is_controlled(mv: Array) -> bool:
    """Tell whether MV moves all the time and hardly ever to a value that it had before: a controller that is looked at
    more often than it executes; a person's moves are few, and a relay's values are two."""
    places = np.flatnonzero(np.diff(mv))
    if places.size < MOVES_MIN or np.unique(mv[places + 1]).size < 0.5 * places.size:
        return False
    waits = np.diff(places)
    return float(np.sum(waits[waits <= 5.0 * np.median(waits)])) > HELD_MIN * mv.size


def _saturated(record: Record) -> list[Finding]:
    """MV at a limit is MV that does not answer; a step test may stand on a limit, a controller may not for long."""
    if record.mv_limits is None:
        return []
    low, high = record.mv_limits
    edge = 1e-6 * (high - low)
    share = float(np.mean((record.mv <= low + edge) | (record.mv >= high - edge)))
    if share <= SATURATED_MAX:
        return []
    text = (
        f"MV stands at a limit ({low:g} or {high:g}) in {100 * share:.0f} % of the samples, "
        f"at most {100 * SATURATED_MAX:.0f} % are taken"
    )
    return [
        Finding("saturated", Weight.REFUSED, text, "use a smaller step, or an operating point farther from the limits")
    ]


def _flat(record: Record) -> list[Finding]:
    """A PV that stands at its own extreme for long, while it moves elsewhere, has met the end of its range."""
    pv = record.pv
    still = np.concatenate([[False], np.diff(pv) == 0.0])
    elsewhere = (
        float(np.mean(still[(pv < pv.max()) & (pv > pv.min())])) if np.any((pv < pv.max()) & (pv > pv.min())) else 1.0
    )
    for extreme in (float(pv.max()), float(pv.min())):
        share = float(np.mean(still & (pv == extreme)))
        if share > FLAT_MAX and elsewhere < 0.3:
            text = (
                f"PV stands at its extreme {extreme:g} in {100 * share:.0f} % of the samples, at most "
                f"{100 * FLAT_MAX:.0f} % are taken: the sensor or the process is at its end"
            )
            return [Finding("saturated", Weight.REFUSED, text, "use a smaller step, or check the range of the sensor")]
    return []


def after(record: Record, fit: Fit, null_bic: float, white_p: float) -> tuple[Finding, ...]:
    """Return what the chosen fit gives away about the data.

    Args:
        record: What was fitted.
        fit: The chosen model.
        null_bic: Criterion of a fit without MV: what PV does by itself.
        white_p: Probability of the residual test.
    """
    reach, answer = float(np.ptp(record.mv)), float(np.ptp(fit.moved))
    if null_bic < fit.bic + 10.0:
        text = f"PV does not follow MV: MV moves by {reach:g}, and PV is explained as well without it"
        return (
            Finding(
                "stuck-valve", Weight.REFUSED, text, "valve stuck or by-passed, loop not in this mode, or wrong column"
            ),
        )
    found: list[Finding] = []
    if fit.snr < SNR_MIN:
        text = (
            f"PV answers MV by {answer:.3g}, its noise is {fit.spread:.3g}: ratio {fit.snr:.1f}, "
            f"at least {SNR_MIN:g} is needed"
        )
        found.append(Finding("noisy", Weight.REFUSED, text, f"use a step {SNR_MIN / fit.snr:.1f} times as large"))
    model = fit.model
    share = fit.interval["gain"] / abs(model.gain)
    span = float(record.t_s[-1] - record.t_s[0])
    if share > GAIN_INTERVAL_MAX:
        text = f"the gain is {model.gain:.4g} ± {100 * share:.0f} %, at most ± {100 * GAIN_INTERVAL_MAX:.0f} % is taken"
        found.append(Finding("uncertain", Weight.REFUSED, text, "record more steps, or let PV settle after each"))
    if model.kind is not Kind.IPDT and span < LENGTH_MIN * model.slowness_s:
        text = (
            f"the record holds {span:g} s, the process needs {model.slowness_s:.4g} s to answer: "
            f"at least {LENGTH_MIN:g} times that is needed"
        )
        found.append(Finding("short", Weight.WARNING, text, "record until PV has settled"))
    lag = 0.0 if model.kind is Kind.IPDT else model.slowness_s - model.dead_time_s
    if record.timing_s > TIMING_MAX * lag > 0.0:
        text = (
            f"when MV moved is known to ± {record.timing_s:.2g} s only, beside a lag of {lag:.3g} s, which may be off"
        )
        found.append(
            Finding("coarse-times", Weight.WARNING, text, "look more often: a quicker line, or fewer requests")
        )
    if white_p < 0.01:
        text = f"the prediction errors are not white (p = {white_p:.2g}), so the intervals are too narrow"
        found.append(Finding("not-white", Weight.WARNING, text, "look at the plot: a disturbance, or a richer process"))
    return tuple(found)


def drift(fit: Fit, ramp: Fit, rise: float) -> tuple[Finding, ...]:
    """Return what an evenly rising load says, when it explains PV better than none."""
    answer = float(np.ptp(ramp.moved)) or 1e-300
    share = abs(rise) / answer
    if ramp.bic > fit.bic - 10.0 or share <= DRIFT_MAX / 2.0:
        return ()
    weight = Weight.REFUSED if share > DRIFT_MAX else Weight.WARNING
    text = (
        f"PV drifts by {rise:.3g} over the record, {100 * share:.0f} % of what MV brought about, "
        f"at most {100 * DRIFT_MAX:.0f} % is taken"
    )
    return (Finding("drifting", weight, text, "wait until PV stands still before the step, or find the disturbance"),)
