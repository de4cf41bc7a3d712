"""Tuning as data: identify a process from a trace, propose gains in the loop's form, say what each will do.

No printing and no link: `cli/tune` shows the result, `apps/tune_page` makes a report of it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from difflib import get_close_matches
from typing import Any

import numpy as np

from ahgateway.apps.health import Window, health
from ahgateway.apps.report import number
from ahgateway.core.real import REAL
from ahgateway.errors import ProfileError
from ahgateway.tuning.blocks import BLOCKS, Params, Use
from ahgateway.tuning.compare import Comparison, compare
from ahgateway.tuning.findings import Finding, Weight
from ahgateway.tuning.identify import Identification, identify
from ahgateway.tuning.models import Kind, Model
from ahgateway.tuning.predict import Quality, Response, replayed
from ahgateway.tuning.propose import (
    GAIN_NAMES,
    TUNED,
    LoopForm,
    Proposal,
    action,
    evaluate,
    present,
    proposals,
    recommended,
)
from ahgateway.tuning.record import Record
from ahgateway.tuning.rules import RULES, Rule
from ahgateway.tuning.runner import at_rest

Json = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Tuning:
    """What a trace says about a loop, and what to do with it.

    Attributes:
        identified: The process, or why it could not be told.
        loop: The loop as it stands; None when data were refused before any fit.
        dial: 0 cautious … 1 fast.
        present: What the gains that the loop holds now do; None where they were not given.
        found: Every rule's proposal; empty when refused.
        chosen: The recommended one.
        again: Proposal name to the recorded run with its gains; empty unless the run was in closed loop.
        findings: All of them, the loop's own included.
    """

    identified: Identification
    loop: LoopForm | None
    dial: float
    present: Proposal | None
    found: tuple[Proposal, ...]
    chosen: Proposal | None
    again: Mapping[str, Response]
    findings: tuple[Finding, ...]

    @property
    def is_refused(self) -> bool:
        """Tell whether no proposal was made."""
        return self.identified.is_refused or self.loop is None


def tune(
    record: Record,
    instruction: str,
    settings: Params,
    *,
    dial: float = 0.5,
    kind: Kind | None = None,
    rules: tuple[Rule, ...] = RULES,
    writable: frozenset[str] | None = None,
) -> Tuning:
    """Identify the process in a trace and propose gains for the loop.

    Args:
        record: The trace.
        instruction: DPID, DPIDE, MELSEC_PID or PID_Temp without cooling.
        settings: What is known of its operands; what is missing has its default.
        dial: 0 cautious … 1 fast.
        kind: The model to take; None chooses.
        rules: Which rules.
        writable: Operands that may be written where the gains go; None is all.

    Raises:
        ProfileError: The trace is too short or runs backwards, a setting is not known, or no rule knows the block.
    """
    full = BLOCKS[instruction].settings(settings)
    _check_block(instruction, full)
    bounds = BLOCKS[instruction].read(full, Use())
    identified = identify(replace(record, mv_limits=record.mv_limits or (bounds.umin, bounds.umax)), kind)
    if identified.fit is None or identified.is_refused:
        findings = (*identified.findings, *_swinging(identified))
        return Tuning(identified, None, dial, None, (), None, {}, findings)
    model = identified.fit.model
    if instruction == "PID_Temp" and model.gain < 0.0:
        text = f"PID_Temp has no negative gain, and the process's gain is {model.gain:.3g}"
        found_ = Finding("wrong-direction", Weight.REFUSED, text, "tune the cooling output as a block of its own")
        return Tuning(identified, None, dial, None, (), None, {}, (*identified.findings, found_))
    loop = replace(_loop(identified, instruction, full), writable=writable)
    found = proposals(model, loop, dial, rules)
    now = None
    if any(name in settings for name in ("Kp", "Kc_Kp", "KP", "Heat_Gain")):
        now = evaluate("present", "what the loop holds now", present(loop), model, loop)
    again = _again(identified, loop, (*found, *((now,) if now else ())))
    findings = (*identified.findings, *_of_loop(model, loop, settings))
    return Tuning(identified, loop, dial, now, found, recommended(writable_ones(found, loop)), again, findings)


def _swinging(identified: Identification) -> tuple[Finding, ...]:
    """What a loop that swings by itself, and so shows no process, says of its valve."""
    record = identified.record
    if not any(each.name == "not-excited" for each in identified.findings) or not np.all(np.isfinite(record.sv)):
        return ()
    low, high = record.mv_limits or (-math.inf, math.inf)
    ends = (np.full(record.mv.size, low), np.full(record.mv.size, high))
    found = health(Window(record.t_s, record.sv, record.pv, record.mv, np.ones(record.mv.size, dtype=bool), *ends))
    if found is None or not found.oscillates or found.oscillation is None:
        return ()
    swing = f"PV swings by ± {found.oscillation.amplitude:.3g} with a period of {found.oscillation.period_s:.3g} s"
    if found.stiction is None or found.stiction.says != "stiction":
        hint = "see in manual whether the swing stays: then it is a disturbance, else tuning or the valve"
        return (Finding("oscillating", Weight.WARNING, f"{swing} while SV stands", hint),)
    skews = f"{found.stiction.lag_skew:.2f} and {found.stiction.size_skew:.2f}"
    text = f"{swing} while SV stands, and follows MV as behind a valve that sticks (skews {skews}, both above 0.67)"
    return (Finding("stiction", Weight.REFUSED, text, "fix the valve, do not retune"),)


def writable_ones(found: tuple[Proposal, ...], loop: LoopForm) -> tuple[Proposal, ...]:
    """Return the proposals that change only what may be written."""
    if loop.writable is None:
        return found
    now = BLOCKS[loop.instruction].settings(loop.settings)
    return tuple(
        each
        for each in found
        if all(name in loop.writable or REAL(value) == REAL(now[name]) for name, value in each.settings.items())
    )


def _check_block(instruction: str, settings: Params) -> None:
    """Refuse the blocks for which rules for PID gains would be guesses."""
    if instruction not in TUNED:
        raise ProfileError(
            f"rules for PID gains know {', '.join(TUNED)}, not {instruction}, which moves its actuator by pulses",
            hint="tune it as a DPIDE with an analog output, then `ahgateway migrate --to PID_REG_CE --stroke SECONDS`"
            if instruction == "PID_REG_CE"
            else None,
        )
    for name, is_tuning in (("PID_MODE", settings.get("PID_MODE") == 1), ("ACT", int(settings.get("ACT", 0)) & 0x10)):
        if is_tuning:
            raise ProfileError(
                f"{instruction} still seeks its gains itself ({name} is {shown(settings[name])}), its law stands",
                key=name,
                hint="wait until it has ended, or say what it will be with --set",
            )
    if settings.get("ActivateCooling"):
        raise ProfileError(
            "PID_Temp heats and cools: one model cannot stand for both, so that no gains are proposed",
            key="ActivateCooling",
            hint="record heating alone and tune with --set ActivateCooling=FALSE, then cooling alone",
        )


def _loop(identified: Identification, instruction: str, settings: Params) -> LoopForm:
    """The operating point is where the trace began; steps are as large as what the trace saw."""
    record = identified.record
    fit = identified.fit
    assert fit is not None
    moved, reach = float(np.ptp(fit.moved)), float(np.ptp(record.mv))
    at = (float(np.median(record.pv[: max(3, record.pv.size // 50)])), float(record.mv[0]))
    # Room to the limits, so that the prediction is of the law and not of its limits.
    return LoopForm(instruction, settings, at, _round_number(moved / 2.0), _round_number(reach / 2.0))


def _round_number(value: float) -> float:
    """The next smaller 1, 2 or 5 times a power of ten."""
    power = 10.0 ** math.floor(math.log10(value))
    return max(step for step in (1.0, 2.0, 5.0) if step <= value / power * (1.0 + 1e-9)) * power


def _of_loop(model: Model, loop: LoopForm, settings: Params) -> list[Finding]:
    """What the loop's present settings have to do with the model."""
    found = []
    now = present(loop)
    name = "ACT" if loop.instruction == "MELSEC_PID" else "PID_DIR"
    if name in settings and now.sign != action(model, loop):
        text = (
            f"{name} is {shown(settings[name])}, but the process's gain is {model.gain:.3g}: "
            "with this direction the loop runs away"
        )
        found.append(Finding("wrong-direction", Weight.WARNING, text, f"the proposals hold the right {name}"))
    fast = max(model.dead_time_s, 0.1 * model.slowness_s)
    if now.ts_s > 0.5 * fast:
        text = f"CYCLE is {now.ts_s:g} s, which is slow beside the process's {fast:.3g} s: it costs gain"
        found.append(Finding("slow-cycle", Weight.WARNING, text, f"choose a CYCLE of {fast / 5:.2g} s or less"))
    return found


def _again(identified: Identification, loop: LoopForm, found: tuple[Proposal, ...]) -> dict[str, Response]:
    """The recorded run with each proposal, where the run had a setpoint that moved."""
    record, fit = identified.record, identified.fit
    assert fit is not None
    if not np.all(np.isfinite(record.sv)) or float(np.ptp(record.sv)) == 0.0 or record.sv.size > 20000:
        return {}
    trace = Response(record.t_s, record.sv, record.pv, record.mv)
    block = BLOCKS[loop.instruction]
    out = {}
    for each in found:
        settings = block.settings(loop.settings) | each.settings
        still = at_rest(loop.instruction, settings, float(record.sv[0]), float(record.pv[0]), float(record.mv[0]))
        out[each.name] = replayed(still, fit.model, trace, fit.moved)
    return out


def compared(result: Tuning, proposal: Proposal | None) -> Comparison | None:
    """Return MV of the recorded run with the present gains and with a proposal's; None where either is not known."""
    if proposal is None or result.present is None or result.loop is None:
        return None
    loop = result.loop
    old = BLOCKS[loop.instruction].settings(loop.settings)
    return compare(result.identified.record, loop.instruction, old, old | proposal.settings, loop.dialect)


def comparison_text(found: Comparison) -> str:
    """Return the comparison in one line, its one number first."""
    old, new = found.travel
    return (
        f"on the recorded PV the new gains differ by {found.difference:.4g} MV (rms), {found.largest:.4g} at most; "
        f"MV travels {new:.4g} instead of {old:.4g}"
    )


def named(result: Tuning, rule: str) -> Proposal:
    """Return the proposal of a rule; `recommended` is the recommended one.

    Raises:
        ProfileError: No proposal has that name.
    """
    if rule.lower() == "recommended" and result.chosen is not None:
        return result.chosen
    by_name = {each.name.lower(): each for each in result.found}
    if rule.lower() in by_name:
        return by_name[rule.lower()]
    near = get_close_matches(rule.lower(), by_name, 1)
    raise ProfileError(
        f"`{rule}` has no proposal here, there are {', '.join(each.name for each in result.found) or 'none'}"
        + ("" if result.chosen else "; none is recommended"),
        key="--apply",
        hint=f"did you mean `{by_name[near[0]].name}`?" if near else None,
    )


def iae(response: Response) -> float:
    """Integral of |SV − PV| over a response in PV·s."""
    ts = float(np.median(np.diff(response.t_s)))
    return float(np.sum(np.abs(response.sv - response.pv)) * ts)


def as_json(result: Tuning) -> Json:
    """Return the result as one object; the form stands in docs/reference/tune.md."""
    identified = result.identified
    return {
        "kind": "tuning",
        "source": identified.record.name,
        "refused": result.is_refused,
        "samples": int(identified.record.t_s.size),
        "interval_s": identified.record.ts_s,
        "noise": identified.noise,
        "resolution": identified.resolution,
        "model": _model_json(identified),
        "findings": [
            {"name": each.name, "weight": each.weight.value, "text": each.text, "hint": each.hint or None}
            for each in result.findings
        ],
        "dial": result.dial,
        "loop": _loop_json(result.loop),
        "present": _proposal_json(result.present, result) if result.present else None,
        "proposals": [_proposal_json(each, result) for each in result.found],
        "recommended": result.chosen.name if result.chosen else None,
        "compared": _compared_json(compared(result, result.chosen)),
    }


def _compared_json(found: Comparison | None) -> Json | None:
    if found is None:
        return None
    old, new = found.travel
    return {"rms": found.difference, "largest": found.largest, "mv_travel_old": old, "mv_travel_new": new}


def _model_json(identified: Identification) -> Json | None:
    fit = identified.fit
    if fit is None:
        return None
    model = fit.model
    names = {"gain": model.gain, "dead_time_s": model.dead_time_s}
    if model.kind is not Kind.IPDT:
        names["tau_s"] = model.tau_s
    if model.kind is Kind.SOPDT:
        names["zeta"] = model.zeta
    return {
        "kind": model.kind.value,
        "parameters": {name: {"value": value, "plus_minus": fit.interval[name]} for name, value in names.items()},
        "lags_s": list(model.lags_s),
        "reason": identified.reason,
        "snr": number(fit.snr),
        "sigma": fit.sigma,
        "fit_percent": fit.fit_percent,
        "noise_model": None if fit.noise_model is None else {"phi": fit.noise_model[0], "c": fit.noise_model[1]},
        "residuals_p": identified.whiteness.p if identified.whiteness else None,
        "candidates": [{"kind": each.model.kind.value, "bic": each.bic} for each in identified.candidates],
    }


def _loop_json(loop: LoopForm | None) -> Json | None:
    if loop is None:
        return None
    return {
        "instruction": loop.instruction,
        "settings": loop.settings,
        "pv": loop.at[0],
        "mv": loop.at[1],
        "sv_step": loop.sv_step,
        "load_step": loop.load_step,
    }


def _proposal_json(each: Proposal, result: Tuning) -> Json:
    return {
        "rule": each.name,
        "source": each.source,
        "settings": each.settings,
        "ms": number(each.margins.ms),
        "gain_margin": number(each.margins.gain_margin),
        "phase_margin_deg": number(each.margins.phase_margin_deg),
        "stable": each.margins.is_stable,
        "setpoint": _quality_json(each.setpoint),
        "load": _quality_json(each.load),
        "simulated_s": each.pace_s,
        "recorded_iae": iae(result.again[each.name]) if each.name in result.again else None,
    }


def _quality_json(quality: Quality) -> Json:
    return {
        "overshoot_percent": quality.overshoot_percent,
        "settling_s": number(quality.settling_s),
        "iae": quality.iae,
        "peak": quality.peak,
        "mv_travel": quality.travel,
        "mv_range": quality.mv_peak,
    }


def as_text(result: Tuning) -> str:
    """Return the result as a page of text."""
    identified = result.identified
    record = identified.record
    lines = [
        f"{record.name}: {record.t_s.size} samples every {record.ts_s:g} s, noise {identified.noise:.3g}"
        + (f", resolution {identified.resolution:g}" if identified.resolution else "")
    ]
    if identified.fit is not None:
        lines += ["", model_text(identified), f"  {identified.reason}"]
    for each in result.findings:
        lines += ["", f"{each.weight.value}: {each.name}: {each.text}"]
        if each.hint:
            lines.append(f"  hint: {each.hint}")
    if result.is_refused:
        return "\n".join([*lines, "", "no proposal is made"])
    assert result.loop is not None
    loop = result.loop
    lines += [
        "",
        f"proposals for {loop.instruction}, dial {result.dial:g}; predicted for SV {loop.sv_step:+g} and a load of "
        f"{loop.load_step:+g} MV at PV {loop.at[0]:.4g}, MV {loop.at[1]:.4g}",
        *_table(result),
        *(f"  {line}" for line in pace_note(result)),
    ]
    if result.chosen is not None:
        written = ", ".join(f"{name} {shown(value)}" for name, value in result.chosen.settings.items())
        lines += ["", f"recommended: {result.chosen.name}: {written}"]
        side_by_side = compared(result, result.chosen)
        if side_by_side is not None:
            lines.append(f"  {comparison_text(side_by_side)}")
    else:
        lines += ["", f"recommended: none, {_why_none(result)}"]
    return "\n".join(lines)


def _why_none(result: Tuning) -> str:
    """Why nothing is recommended: nothing is robust, or what is may not be written."""
    best, loop = recommended(result.found), result.loop
    if best is None or loop is None or loop.writable is None:
        return "no proposal is robust (Ms above 1.7): turn the dial down"
    kept = [name for name in best.settings if name not in loop.writable]
    return f"the profile lets nobody write {', '.join(kept)}; by its numbers it would be {best.name}"


def pace_note(result: Tuning) -> list[str]:
    """What is to be said where a prediction took longer than CYCLE between two executions."""
    slower = [each.pace_s for each in result.found if each.pace_s > each.canonical.ts_s * 1.5]
    if not slower:
        return []
    return [
        f"CYCLE is short beside the process: predicted with an execution every {min(slower):g} to {max(slower):g} s"
    ]


def model_text(identified: Identification) -> str:
    """Return the model in one line, each parameter with half its 95 % interval."""
    fit = identified.fit
    assert fit is not None
    model = fit.model
    unit = "PV/(MV·s)" if model.kind is Kind.IPDT else "PV/MV"
    parts = [f"K {model.gain:.4g} ± {fit.interval['gain']:.2g} {unit}"]
    parts.append(f"dead time {model.dead_time_s:.4g} ± {fit.interval['dead_time_s']:.2g} s")
    if model.kind is not Kind.IPDT:
        parts.append(f"τ {model.tau_s:.4g} ± {fit.interval['tau_s']:.2g} s")
    if model.kind is Kind.SOPDT:
        parts.append(f"ζ {model.zeta:.3g} ± {fit.interval['zeta']:.2g}")
    return f"{model.kind.value}: {', '.join(parts)}; SNR {fit.snr:.1f}"


def shown(value: float | int | bool) -> str:
    """A setting as people read it."""
    if isinstance(value, bool):
        return "TRUE" if value else "FALSE"
    return f"{value:.5g}" if isinstance(value, float) else str(value)


NUMBERS = ("Ms", "GM", "PM", "over", "settling", "IAE SV", "IAE load", "travel")


def heads(result: Tuning) -> list[str]:
    """Return what stands above `rows`: rule, the loop's gains by the manual's names, and the numbers."""
    return ["rule", *_gain_names(result), *NUMBERS, *(["record"] if result.again else [])]


def rows(result: Tuning) -> list[list[str]]:
    """Return one row of text per proposal under `heads`, the present settings first."""
    names = _gain_names(result)
    out = []
    for each in _all(result):
        again = [f"{iae(result.again[each.name]):.4g}"] if each.name in result.again else []
        out.append(
            [
                each.name + (" *" if each is result.chosen else ""),
                *(f"{each.settings[name]:.4g}" if each.settings.get(name) else "-" for name in names),
                f"{each.margins.ms:.2f}" if math.isfinite(each.margins.ms) else "unstable",
                f"{each.margins.gain_margin:.2f}" if math.isfinite(each.margins.gain_margin) else "-",
                f"{each.margins.phase_margin_deg:.0f}°" if math.isfinite(each.margins.phase_margin_deg) else "-",
                f"{each.setpoint.overshoot_percent:.0f} %",
                f"{each.setpoint.settling_s:.4g} s" if math.isfinite(each.setpoint.settling_s) else "-",
                f"{each.setpoint.iae:.4g}",
                f"{each.load.iae:.4g}",
                f"{each.setpoint.travel:.4g}",
                *again,
            ]
        )
    return out


def _all(result: Tuning) -> tuple[Proposal, ...]:
    return (*((result.present,) if result.present else ()), *result.found)


def _gain_names(result: Tuning) -> list[str]:
    """The gains that any of them has, in the blocks' order."""
    return [name for name in GAIN_NAMES if any(each.settings.get(name) for each in _all(result))]


def _table(result: Tuning) -> list[str]:
    table = [heads(result), *rows(result)]
    widths = [max(len(cell) for cell in column) for column in zip(*table, strict=True)]
    return [
        "  " + "  ".join(f"{cell:<{width}}" for cell, width in zip(row, widths, strict=True)).rstrip() for row in table
    ]
