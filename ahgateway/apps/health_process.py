"""What is wrong behind MV: a model of the process learned from the first part of the data, and what it leaves later.

This file alone decides when a model is learned and when PV has left it. Nobody hands a model in: the first part of the
run is taken for a process in order, if the data tell one at all (`tuning.identify` refuses those that do not: nothing
moved, feedback alone moved it, noise, a valve that sticks already). What comes later is compared with the model's
answer to the recorded MV, initial state and a constant load free. Only with a shadow that acquits the controller does
a difference mean valve or process.

Source:
    ASSUMED what was learned first was in order; a fault that was there from the beginning is not seen this way.
"""

from __future__ import annotations

import math
from concurrent.futures import Executor, Future
from dataclasses import dataclass, replace

import numpy as np

from ahgateway.apps.health import SAMPLES_MIN, Health, Window
from ahgateway.core.verdict import Counts
from ahgateway.errors import ProfileError
from ahgateway.tuning.fit import driven
from ahgateway.tuning.identify import identify
from ahgateway.tuning.models import Kind, Model
from ahgateway.tuning.noise import noise, resolution
from ahgateway.tuning.record import Record, even, polled

LEARN_MIN = 300
"""Fewest samples that a model is learned from."""
LEARN_MAX = 1000
"""Most samples; the newest count."""
RATIO_MIN = 3.0
"""A plant residual of so many times what noise and the model's own doubt explain is no noise."""
DOUBT_MIN = 0.02
"""A model is never surer of its gain than this share."""


@dataclass(frozen=True, slots=True)
class Process:
    """A process as the first part of the data showed it.

    Attributes:
        model: First order with dead time.
        spread: What the model left unexplained of PV then, standard deviation.
        doubt: Half of the gain's 95 % interval as a share of the gain.
        until_s: End of the data that it was learned from.
    """

    model: Model
    spread: float
    doubt: float
    until_s: float


@dataclass(frozen=True, slots=True)
class PlantResidual:
    """What a model of the process leaves unexplained of PV.

    Attributes:
        rms: Root mean square of PV less the model's answer to MV, a constant difference taken away.
        ratio: `rms` by what noise, resolution and the model's own doubt explain; infinite when that is nothing.
    """

    rms: float
    ratio: float

    @property
    def is_nought(self) -> bool:
        """True when noise and the model's doubt explain it."""
        return self.ratio < RATIO_MIN


def _record(window: Window) -> Record:
    limits = (float(np.min(window.mv_min)), float(np.max(window.mv_max)))
    return polled(Record(window.t_s - window.t_s[0], window.sv, window.pv, window.mv, "window", limits))


def learned(window: Window) -> Process | None:
    """Return the process that a window shows; None where it shows none."""
    try:
        found = identify(_record(part(window, -LEARN_MAX)), Kind.FOPDT)
    except ProfileError:
        return None
    if found.fit is None or found.is_refused:
        return None
    model = found.fit.model
    doubt = max(found.fit.interval["gain"] / abs(model.gain), DOUBT_MIN)
    return Process(model, found.fit.spread, doubt, float(window.t_s[-1]))


def part(window: Window, first: int) -> Window:
    """Return the window from a sample on; negative counts from the end."""
    return replace(window, **{name: getattr(window, name)[first:] for name in Window.__dataclass_fields__})


def plant_residual(window: Window, known: Process) -> PlantResidual | None:
    """Return what a process that was learned earlier does not explain; None where the window is too short to say.

    Args:
        window: Samples behind `known.until_s`.
        known: The process. What it remembers from before the window is left open for its dead time.
    """
    if window.t_s.size < SAMPLES_MIN:
        return None
    record, model = even(_record(window)), known.model
    answer = driven(model, record.input - record.input[0], record.ts_s)
    kept = record.t_s >= model.dead_time_s
    if np.count_nonzero(kept) < SAMPLES_MIN or record.t_s[-1] < 2.0 * model.dead_time_s:
        return None
    free = np.column_stack([np.exp(-record.t_s / model.tau_s), np.ones_like(record.t_s)])[kept]
    rest = (record.pv - answer)[kept]
    errors = rest - free @ np.linalg.lstsq(free, rest, rcond=1e-10)[0]
    rms = float(np.sqrt(np.mean(errors**2)))
    pv = record.pv[kept]
    quiet = max(noise(pv), resolution(pv), known.spread, 1e-9 * float(np.max(np.abs(pv))))
    floor = math.hypot(quiet, known.doubt * float(np.std(answer[kept])))
    return PlantResidual(rms, rms / floor if floor > 0.0 else (math.inf if rms else 0.0))


class Learner:
    """Learns one loop's process once, besides everything else, and then judges what comes later.

    Args:
        pool: Where the learning is done; it takes up to seconds.

    Attributes:
        known: The process; None while nothing is known.
    """

    def __init__(self, pool: Executor) -> None:
        self.known: Process | None = None
        self._pool = pool
        self._under_way: Future[Process | None] | None = None
        self._again_s = -math.inf

    def look(self, window: Window) -> PlantResidual | None:
        """Return what the learned process leaves of the samples behind it; None while nothing can be said.

        A window that tells no process is asked again when it has grown to twice its length.
        """
        if self._under_way is not None and self._under_way.done():
            self.known, self._under_way = self._under_way.result(), None
        if self.known is not None:
            return plant_residual(
                part(window, int(np.searchsorted(window.t_s, self.known.until_s, "right"))), self.known
            )
        if self._under_way is None and window.t_s.size >= LEARN_MIN and window.t_s[-1] >= self._again_s:
            self._again_s = 2.0 * window.t_s[-1] - window.t_s[0]
            self._under_way = self._pool.submit(learned, window)
        return None


@dataclass(frozen=True, slots=True)
class Statement:
    """What the figures and the shadow together allow to say; `name` is stable."""

    name: str
    text: str


def statement(found: Health, counts: Counts, residual: PlantResidual | None = None) -> Statement | None:
    """Return what can be said about where a trouble lies; None when there is none, or nothing is known.

    Only a shadow that matched the controller bit for bit, and not merely at rest, acquits the controller; then what
    is left of a swing or of a plant residual lies behind MV.

    Args:
        found: Figures of the window.
        counts: What the shadow said of the same time.
        residual: What a model of the process leaves unexplained, when there is a model.
    """
    if counts.diverged:
        return Statement(
            "controller", "the controller differs from its reference: find out why before anything is tuned"
        )
    if not counts.informative:
        return None
    sticks = found.oscillates and found.stiction is not None and found.stiction.says == "stiction"
    if residual is not None and not residual.is_nought:
        evidence = f"the plant residual is {residual.ratio:.1f} times its noise"
    elif sticks:
        evidence = "MV and PV swing as they do with a sticking valve"
    else:
        if not found.oscillates or found.oscillation is None:
            return None
        return Statement(
            "oscillation",
            f"the controller computes what it should, and PV swings with a period of "
            f"{found.oscillation.period_s:.3g} s: tuning, valve or a disturbance, not told apart",
        )
    return Statement(
        "valve-or-process", f"the controller computes what it should, but {evidence}: valve or process, do not retune"
    )
