"""What the PLC's own tuning (PID_MODE = 1) is worth: its gains on the model of the very run that it made.

The method is the vendor's and not published, and the manual itself says that its gains do not fit every process; so
they are one proposal among the others, judged by the same numbers.
"""

from __future__ import annotations

import math
from dataclasses import replace

from ahgateway.apps.tune import Tuning, shown, writable_ones
from ahgateway.tuning.blocks import BLOCKS, Params, Use
from ahgateway.tuning.findings import Finding, Weight
from ahgateway.tuning.propose import GAIN_NAMES, MS_WANTED, Proposal, evaluate, recommended

NAME = "PLC auto-tuning"
SOURCE = "written by the PLC itself with PID_MODE = 1; its method is not published"


def judged(result: Tuning, before: Params, brought: Params) -> Tuning:
    """Return the result with the PLC's own gains among the proposals, and what is to be said of them.

    Args:
        result: What the run's trace says.
        before: The loop's settings before the PLC tuned itself.
        brought: Its settings afterwards.
    """
    changes = [name for name in GAIN_NAMES if name in brought and brought[name] != before[name]]
    text = "the PLC's own tuning changed " + ", ".join(
        f"{name} {shown(before[name])} to {shown(brought[name])}" for name in changes
    )
    fit, loop = result.identified.fit, result.loop
    if fit is None or loop is None:
        found = Finding("plc-tuning", Weight.WARNING, f"{text}; no model, so that nothing can be said of them")
        return replace(result, findings=(*result.findings, found))
    own = evaluate(NAME, SOURCE, BLOCKS[loop.instruction].read(loop.settings | _gains(brought), Use()), fit.model, loop)
    proposals = (own, *result.found)
    return replace(
        result,
        found=proposals,
        chosen=recommended(writable_ones(proposals, loop)),
        findings=(*result.findings, _said(own, text)),
    )


def _gains(settings: Params) -> Params:
    return {name: value for name, value in settings.items() if name in GAIN_NAMES}


def _said(own: Proposal, text: str) -> Finding:
    ms = own.margins.ms
    if not own.margins.is_stable:
        return Finding("plc-tuning", Weight.WARNING, f"{text}: with these the loop is unstable", "take a rule's gains")
    numbers = f"Ms {ms:.2f}, overshoot {own.setpoint.overshoot_percent:.0f} %"
    if ms > MS_WANTED or not math.isfinite(ms):
        hint = "take a rule's gains, or the PLC's Kp with a smaller I and D part, as its manual advises"
        return Finding("plc-tuning", Weight.WARNING, f"{text}: {numbers}, robust is up to Ms {MS_WANTED:g}", hint)
    return Finding("plc-tuning", Weight.NOTE, f"{text}: {numbers}, which is robust")
