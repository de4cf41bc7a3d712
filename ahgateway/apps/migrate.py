"""From one controller to another as data: settings, losses, and the proof by running both in their own arithmetic.

This file alone decides the verdict. Both run on the same process from the same rest: a setpoint step and a load within
the limits, which the verdict is about, and a setpoint far away that drives MV into its limits, which every pair of
blocks answers differently and which is reported beside it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import Enum
from typing import Any

import numpy as np

from ahgateway.apps.report import number
from ahgateway.core.controllers import CONTROLLERS
from ahgateway.tuning.blocks import Given, Use
from ahgateway.tuning.conversion import Conversion, convert
from ahgateway.tuning.models import Kind, Model
from ahgateway.tuning.predict import Response
from ahgateway.tuning.record import Array, Record
from ahgateway.tuning.runner import Runner, runner

Json = dict[str, Any]

EQUIVALENT_MAX = 0.01
"""Largest difference of MV and PV, as a share of their ranges, that counts as equivalent."""
POINTS_MAX = 6000
"""Most executions of a simulated run."""


class Verdict(Enum):
    """What the proof says."""

    IDENTICAL = "identical"
    EQUIVALENT = "equivalent"
    DIFFERENT = "different"
    UNPROVEN = "unproven"


@dataclass(frozen=True, slots=True)
class Run:
    """Both controllers on one course of events, in the source's units.

    Attributes:
        name: What happens.
        old: The source's response.
        new: The target's.
        mv_apart: Largest difference of MV, as a share of its range.
        pv_apart: Largest difference of PV, as a share of its range.
        is_same: Every MV is the same number.
    """

    name: str
    old: Response
    new: Response
    mv_apart: float
    pv_apart: float
    is_same: bool


@dataclass(frozen=True, slots=True)
class Migration:
    """One migration with its proof.

    Attributes:
        conversion: Settings and losses.
        process: What both ran on.
        process_text: Where the process came from.
        runs: The run within the limits first, then the one into them, then the recorded one where there is a record;
            empty where a block has no law of ours.
        verdict: What the first run says.
        text: The verdict in a sentence.
    """

    conversion: Conversion
    process: Model
    process_text: str
    runs: tuple[Run, ...]
    verdict: Verdict
    text: str


@dataclass(frozen=True, slots=True)
class Course:
    """What happens in a run: SV and load over time, from rest at the operating point.

    Attributes:
        name: What it is called.
        length_s: How long.
        sv: Steps of SV as (time in s, value).
        load: Steps of the load as (time in s, value in MV).
    """

    name: str
    length_s: float
    sv: tuple[tuple[float, float], ...]
    load: tuple[tuple[float, float], ...]


def migrate(
    source: str,
    given: Given,
    target: str,
    *,
    scaling: Any,
    use_from: Use | None = None,
    use_to: Use | None = None,
    process: Model | None = None,
    record: Record | None = None,
    file: str = "",
) -> Migration:
    """Rebuild one controller as another and prove what became of it.

    Args:
        source: Block of the settings.
        given: Settings by the manual's names.
        target: Block to write.
        scaling: Ranges of PV and MV on both sides (`tuning.canonical.Scaling`).
        use_from: How the source stands in its plant.
        use_to: How the target will.
        process: What both run on; None takes one that the source's settings suit.
        record: A run of the source; its SV and PV go through both once more.
        file: Where the settings came from, for messages.

    Raises:
        ProfileError: A block or a setting that is not known.
    """
    use_from, use_to = use_from or Use(), use_to or Use()
    made = convert(source, given, target, scaling=scaling, use_from=use_from, use_to=use_to, file=file)
    text = "as given"
    if process is None:
        process, text = suited(made, use_from), "one that the source's gains suit by SIMC; no process was given"
    if use_to.stroke_s is not None and not use_to.process_gain:
        # PV per % of stroke, in the target's units: it sizes the zone.
        share = (scaling.mv_from[1] - scaling.mv_from[0]) / 100.0
        use_to = replace(use_to, process_gain=process.gain * share * scaling.pv_ratio)
        made = convert(source, given, target, scaling=scaling, use_from=use_from, use_to=use_to, file=file)
    runs = tuple(
        run for course in courses(made, process) if (run := _both(made, process, course, use_from, use_to)) is not None
    )
    if record is not None and (again := _recorded(made, record, use_from, use_to)) is not None:
        runs = (*runs, again)
    verdict, why = judged(made, runs)
    return Migration(made, process, text, runs, verdict, why)


def suited(made: Conversion, use: Use) -> Model:
    """The first-order process for which SIMC would give the source's gains; its dead time is a quarter of its lag."""
    canonical = made.wanted
    scaling = made.scaling
    kc = canonical.kp * scaling.pv_ratio / scaling.mv_ratio or 1.0
    slow = max(canonical.td_s, canonical.tf_s, canonical.ts_s)
    tau = canonical.ti_s if math.isfinite(canonical.ti_s) else 20.0 * slow
    tau = max(tau, 8.0 * canonical.ts_s)
    return Model(Kind.FOPDT, canonical.sign * 2.0 / kc, tau / 4.0, tau)


def courses(made: Conversion, process: Model) -> tuple[Course, Course]:
    """A small step and a load within the limits, and a setpoint that MV cannot reach."""
    scaling = made.scaling
    low, high = scaling.pv_from
    span, mv_span = high - low, scaling.mv_from[1] - scaling.mv_from[0]
    middle = (low + high) / 2.0
    slow = max(process.slowness_s, made.wanted.ti_s if math.isfinite(made.wanted.ti_s) else 0.0)
    length = 8.0 * max(slow, 5.0 * made.wanted.ts_s)
    # Small enough that MV stays within its limits with these gains.
    kc = max(made.wanted.kp * scaling.pv_ratio / scaling.mv_ratio, 1e-9)
    step = min(
        0.1 * span, 0.15 * mv_span / kc / (1.0 + made.wanted.td_s / max(made.wanted.ts_s + made.wanted.tf_s, 1e-9))
    )
    load = 0.1 * mv_span
    within = Course(
        "setpoint and load within the limits", 2.0 * length, ((length * 0.05, middle + step),), ((length, load),)
    )
    far = middle + 2.0 * abs(process.gain) * mv_span if process.kind is not Kind.IPDT else middle + span
    beyond = Course("setpoint out of reach and back", 2.0 * length, ((length * 0.05, far), (length, middle)), ())
    return within, beyond


def _both(made: Conversion, process: Model, course: Course, use_from: Use, use_to: Use) -> Run | None:
    """One course with both controllers; None where one of them has no law of ours."""
    scaling = made.scaling
    pv0 = sum(scaling.pv_from) / 2.0
    mv0 = sum(scaling.mv_from) / 2.0
    pair = _pair(made, (pv0, mv0), use_from, use_to)
    if pair is None:
        return None
    first, second = (course_of(each, process, course, (pv0, mv0)) for each in pair)
    return compared(course.name, first, second, scaling.pv_from, scaling.mv_from)


def _pair(made: Conversion, at: tuple[float, float], use_from: Use, use_to: Use) -> tuple[Runner, Runner] | None:
    """Source and target at rest at this PV and MV, both in the source's units; None where one has no law of ours."""
    scaling = made.scaling
    # A target without a negative gain is fed −SV and −PV, as its loss says.
    sign = made.wanted.sign if made.reached.sign != made.wanted.sign else 1
    pv = sign * scaling.pv(at[0])
    old = runner(made.source, made.given, at[0], at[0], at[1], use_from.stroke_s)
    new = runner(made.target, made.settings, pv, pv, scaling.mv(at[1]), use_to.stroke_s)
    if old is None or new is None:
        return None
    inner = new.execute

    def outer(sv: float, pv: float) -> float:
        mv = inner(sign * scaling.pv(sv), sign * scaling.pv(pv))
        return scaling.mv_from[0] + (mv - scaling.mv_to[0]) / scaling.mv_ratio

    return old, Runner(new.ts_s, outer)


def _recorded(made: Conversion, record: Record, use_from: Use, use_to: Use) -> Run | None:
    """The recorded SV and PV through both, from rest at the first PV and MV; PV does not answer here."""
    if not np.all(np.isfinite(record.sv)):
        return None
    pair = _pair(made, (float(record.pv[0]), float(record.mv[0])), use_from, use_to)
    if pair is None:
        return None
    sides = []
    for each in pair:
        count = int(min(POINTS_MAX * 5, (record.t_s[-1] - record.t_s[0]) / each.ts_s)) + 1
        t = np.arange(count, dtype=np.float64) * each.ts_s
        held = np.clip(np.searchsorted(record.t_s - record.t_s[0], t + 1e-9, side="right") - 1, 0, record.t_s.size - 1)
        sv, pv = record.sv[held], record.pv[held]
        mv = np.array([each.execute(float(s), float(p)) for s, p in zip(sv, pv, strict=True)])
        sides.append(Response(t, sv, pv, mv))
    return compared("the recorded SV and PV", sides[0], sides[1], made.scaling.pv_from, made.scaling.mv_from)


def course_of(run: Runner, process: Model, course: Course, at: tuple[float, float]) -> Response:
    """Let a controller go through a course."""
    plant, state = process.plant(*at)
    count = int(min(POINTS_MAX * 5, course.length_s / run.ts_s))
    t = np.arange(count, dtype=np.float64) * run.ts_s
    svs, loads = _steps(t, at[0], course.sv), _steps(t, 0.0, course.load)
    pvs, mvs, pv = np.empty(count), np.empty(count), at[0]
    for index in range(count):
        pvs[index] = pv
        mvs[index] = run.execute(float(svs[index]), pv)
        state, pv = plant.step(state, float(mvs[index] + loads[index]), run.ts_s)
    return Response(t, svs, pvs, mvs)


def _steps(t: Array, first: float, steps: tuple[tuple[float, float], ...]) -> Array:
    values = np.full(t.shape, first)
    for at, value in steps:
        values[t >= at] = value
    return values


def compared(name: str, old: Response, new: Response, pv: tuple[float, float], mv: tuple[float, float]) -> Run:
    """Compare two responses at the source's executions; the target's MV is held between its own."""
    count = int(np.searchsorted(old.t_s, new.t_s[-1], side="right"))
    at = np.clip(np.searchsorted(new.t_s, old.t_s[:count] + 1e-9, side="right") - 1, 0, new.t_s.size - 1)
    mv_apart = float(np.max(np.abs(old.mv[:count] - new.mv[at]))) / (mv[1] - mv[0])
    pv_apart = float(np.max(np.abs(old.pv[:count] - np.interp(old.t_s[:count], new.t_s, new.pv)))) / (pv[1] - pv[0])
    same = old.mv.size == new.mv.size and bool(np.array_equal(old.mv, new.mv))
    return Run(name, old, new, mv_apart, pv_apart, same)


def judged(made: Conversion, runs: tuple[Run, ...]) -> tuple[Verdict, str]:
    """Return the verdict of the run within the limits, with its numbers."""
    if not runs:
        return Verdict.UNPROVEN, f"no law of ours for {' or '.join(_lawless(made))}: the settings stand unproven"
    run = runs[0]
    apart = max(run.mv_apart, run.pv_apart)
    far = "" if len(runs) < 2 else f"; beyond the limits MV differs by up to {100 * runs[1].mv_apart:.3g} %"
    if len(runs) > 1 and runs[1].is_same:
        far = ", and beyond them"
    if len(runs) > 2:
        far += f"; on the recorded SV and PV by up to {100 * runs[2].mv_apart:.3g} %"
    if run.is_same:
        return Verdict.IDENTICAL, f"identical: every MV is the same number within the limits{far}"
    if apart <= EQUIVALENT_MAX:
        size = f"{100 * run.mv_apart:.2g} % of MV and {100 * run.pv_apart:.2g} % of PV"
        return Verdict.EQUIVALENT, f"equivalent within {size}{far}"
    codes = list(dict.fromkeys(loss.code for loss in made.losses if not loss.is_exact))
    because = ", ".join(codes) or "the laws themselves: no warning stands for it"
    size = f"MV {100 * run.mv_apart:.2g} %, PV {100 * run.pv_apart:.2g} %"
    return Verdict.DIFFERENT, f"different because of {because}: {size}{far}"


def _lawless(made: Conversion) -> list[str]:
    """The blocks of this conversion that no law of ours runs."""
    return [name for name in dict.fromkeys((made.source, made.target)) if name not in CONTROLLERS]


def as_json(found: Migration) -> Json:
    """Return the migration as one object; the form stands in docs/reference/migrate.md."""
    made = found.conversion
    return {
        "kind": "migration",
        "from": made.source,
        "to": made.target,
        "given": made.given,
        "settings": made.settings,
        "exact": made.is_exact,
        "losses": [
            {"code": each.code, "text": each.text, "size": number(each.size), "unit": each.unit, "exact": each.is_exact}
            for each in made.losses
        ],
        "process": {
            "kind": found.process.kind.value,
            "gain": found.process.gain,
            "dead_time_s": found.process.dead_time_s,
            "tau_s": found.process.tau_s,
            "origin": found.process_text,
        },
        "runs": [
            {"name": run.name, "identical": run.is_same, "mv_apart": run.mv_apart, "pv_apart": run.pv_apart}
            for run in found.runs
        ],
        "verdict": found.verdict.value,
        "text": found.text,
    }
