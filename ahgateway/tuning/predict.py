"""What a loop will do: the exact controller on a model of the process, after a step of SV and after a load.

This file alone decides how overshoot, settling and IAE are read off a response.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ahgateway.tuning.models import Model
from ahgateway.tuning.runner import Runner

Array = NDArray[np.float64]

SETTLED = 0.02
"""Half width of the band within which PV has settled, as a share of the largest move."""


@dataclass(frozen=True, slots=True)
class Response:
    """One simulated response.

    Attributes:
        t_s: Time in s, one point per execution, 0 at the step.
        sv: Setpoint.
        pv: Process value as the execution saw it.
        mv: Output of the execution.
    """

    t_s: Array
    sv: Array
    pv: Array
    mv: Array


@dataclass(frozen=True, slots=True)
class Quality:
    """A response in numbers.

    Attributes:
        overshoot_percent: How far PV passed SV, in % of the step; for a load step how far it fell back beyond SV.
        settling_s: When PV stayed within 2 % of the step (of the largest deviation for a load); inf if it did not.
        iae: Integral of |SV − PV| in PV·s; at least the whole ∫(SV − PV) where the response was cut off too soon.
        peak: Largest |SV − PV| after the step for a load, largest PV deviation past SV for a setpoint.
        travel: Sum of |ΔMV|.
        mv_peak: Largest MV less smallest MV.
    """

    overshoot_percent: float
    settling_s: float
    iae: float
    peak: float
    travel: float
    mv_peak: float


def simulate(
    runner: Runner, model: Model, at: tuple[float, float], sv: float, load: float, length_s: float
) -> Response:
    """Run the controller on the process from rest.

    Args:
        runner: Stands still at the operating point.
        model: The process, standing still at the same point.
        at: PV and MV of the operating point.
        sv: Setpoint from time 0 on.
        load: Disturbance at the process's input from time 0 on, in MV.
        length_s: How long.
    """
    plant, state = model.plant(at[0], at[1], load)
    count = max(2, round(length_s / runner.ts_s) + 1)
    pvs, mvs = np.empty(count), np.empty(count)
    pv = at[0]
    for index in range(count):
        mv = runner.execute(sv, pv)
        pvs[index], mvs[index] = pv, mv
        state, pv = plant.step(state, mv, runner.ts_s)
    return Response(np.arange(count, dtype=np.float64) * runner.ts_s, np.full(count, sv), pvs, mvs)


def replayed(runner: Runner, model: Model, trace: Response, moved: Array) -> Response:
    """Run the controller through a recorded run: the same setpoints, and what disturbed PV then.

    Args:
        runner: Stands still at the run's first SV and MV.
        model: The process.
        trace: The run as recorded.
        moved: The share of PV that the recorded MV brought about; the rest is the disturbance that comes again.
    """
    plant, state = model.plant(0.0, 0.0)
    disturbed = trace.pv - moved
    count = max(2, int((trace.t_s[-1] - trace.t_s[0]) / runner.ts_s) + 1)
    times = trace.t_s[0] + np.arange(count, dtype=np.float64) * runner.ts_s
    held = np.clip(np.searchsorted(trace.t_s, times + 1e-9, side="right") - 1, 0, trace.t_s.size - 1)
    own = np.interp(times, trace.t_s, disturbed)
    pvs, mvs, brought = np.empty(count), np.empty(count), 0.0
    for index in range(count):
        pvs[index] = own[index] + brought
        mvs[index] = runner.execute(float(trace.sv[held[index]]), float(pvs[index]))
        state, brought = plant.step(state, float(mvs[index] - trace.mv[0]), runner.ts_s)
    return Response(times, trace.sv[held], pvs, mvs)


def judge_setpoint(response: Response, at: tuple[float, float], whole: float = 0.0) -> Quality:
    """Return the numbers of a step of SV from the operating point; `whole` is ∫(SV − PV) to the end, in PV·s."""
    step = float(response.sv[-1]) - at[0]
    relative = (response.pv - at[0]) / step
    over = max(0.0, float(np.max(relative)) - 1.0)
    return _quality(response, at[1], 100.0 * over, np.abs(relative - 1.0) <= SETTLED, over * abs(step), whole)


def judge_load(response: Response, at: tuple[float, float], whole: float = 0.0) -> Quality:
    """Return the numbers of a load step at an unchanged SV; `whole` is ∫(SV − PV) to the end, in PV·s."""
    away = response.pv - response.sv
    peak = float(np.max(np.abs(away)))
    first = float(away[int(np.argmax(np.abs(away)))]) or 1.0
    back = max(0.0, -float(np.min(away / first)))
    return _quality(response, at[1], 100.0 * back, np.abs(away) <= SETTLED * max(peak, 1e-300), peak, whole)


def _quality(
    response: Response, mv0: float, overshoot: float, inside: NDArray[np.bool_], peak: float, whole: float
) -> Quality:
    ts = float(response.t_s[1] - response.t_s[0])
    outside = np.flatnonzero(~inside)
    settled = 0.0 if not outside.size else float(response.t_s[outside[-1]]) + ts
    if outside.size and outside[-1] == inside.size - 1:
        settled = float("inf")
    iae = float(np.sum(np.abs(response.sv - response.pv)) * ts)
    moves = np.diff(np.concatenate([[mv0], response.mv]))
    return Quality(
        overshoot,
        settled,
        iae if math.isfinite(settled) else max(iae, abs(whole)),
        peak,
        float(np.sum(np.abs(moves))),
        float(np.ptp(np.concatenate([[mv0], response.mv]))),
    )
