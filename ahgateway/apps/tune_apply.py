"""Gains into a live loop, and the proof: written as one set, tried with a small step of SV, kept or put back.

This file alone decides when gains stay. They stay when SV has gone up and back inside the envelope, PV never left its
prediction by more than the tube of `tuning.verify`, and the fit is good enough. Whatever else happens (an end in the
middle, somebody else who writes, a lost link), the gate puts back everything as it was found.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ahgateway.apps.report import number
from ahgateway.apps.tune import Tuning, named, shown
from ahgateway.apps.tune_sitting import Sitting
from ahgateway.clock import SECOND
from ahgateway.codec.station import Loop
from ahgateway.core.real import REAL
from ahgateway.errors import StateError
from ahgateway.lockstep.gate.outcome import Plan
from ahgateway.lockstep.gate.states import State
from ahgateway.tuning.blocks import BLOCKS, Params
from ahgateway.tuning.propose import GAIN_NAMES, Proposal
from ahgateway.tuning.record import Array
from ahgateway.tuning.runner import delta
from ahgateway.tuning.verify import FIT_MIN, LATE_SAMPLES, Predictor, fit_late, tube

Json = dict[str, Any]

HOLD_SETTLINGS = 1.5
"""How long SV stands on each side, in predicted settling times."""
HOLD_EXECUTIONS_MIN = 30
QUIET_SAMPLES = 10
"""Samples between the gains and the step of SV."""


@dataclass(frozen=True, slots=True)
class Verification:
    """What became of gains that were tried; the arrays have one length, time in s from the step of SV.

    Attributes:
        rule: Whose gains.
        lines: What was written: device, old, new, raw words.
        step: Size of the step of SV, in PV.
        t_s: Time.
        sv: Setpoint.
        pv: Process value as measured.
        mv: Output as measured.
        predicted_pv: What the model and the exact law said before.
        predicted_mv: The same for MV.
        tube: How far PV was allowed to be from its prediction, in PV.
        fit_percent: The one number; NaN when the step never began.
        reason: Why everything was put back; empty when the gains stay.
    """

    rule: str
    lines: tuple[str, ...]
    step: float
    t_s: Array
    sv: Array
    pv: Array
    mv: Array
    predicted_pv: Array
    predicted_mv: Array
    tube: float
    fit_percent: float
    reason: str = ""

    @property
    def is_kept(self) -> bool:
        """Tell whether the gains stand in the PLC now."""
        return not self.reason


def wanted(result: Tuning, proposal: Proposal, live: Params, loop: Loop) -> tuple[Params, Params]:
    """Return the flags and the gains that differ from what the PLC holds now.

    Gains that stand between two that change are named too, so that one request can hold the set.

    Raises:
        StateError: The proposal was computed for a loop that is set otherwise, or asks for another direction.
    """
    form = result.loop
    assert form is not None
    if form.instruction != loop.controller.name:
        raise StateError(f"loop {loop.name} is a {loop.controller.name}, the proposal is for {form.instruction}")
    now = BLOCKS[form.instruction].settings(form.settings)
    others = [name for name in now if name not in GAIN_NAMES and not _same(now[name], live[name])]
    if others:
        texts = (f"{name} is {shown(live[name])}, taken was {shown(now[name])}" for name in others)
        raise StateError(
            f"loop {loop.name}: the proposal was computed for other settings: {', '.join(texts)}",
            hint=" ".join(f"--set {name}={shown(live[name])}" for name in others),
        )
    changed = {name: value for name, value in proposal.settings.items() if not _same(value, live[name])}
    if "PID_DIR" in changed:
        raise StateError(
            f"loop {loop.name}: PID_DIR is {shown(live['PID_DIR'])}, which does not fit the process",
            hint="the direction is wiring, not tuning: look at the loop, then change it with `ahgateway write`",
        )
    gains = {name: value for name, value in changed.items() if name in GAIN_NAMES}
    order = [
        name for name in now if any(name in family for family in loop.controller.roles.together) and name in GAIN_NAMES
    ]
    places = [order.index(name) for name in gains]
    if places:
        between = order[min(places) : max(places) + 1]
        gains = {name: proposal.settings.get(name, live[name]) for name in between}
    return {name: value for name, value in changed.items() if name not in GAIN_NAMES}, gains


def _same(one: float | int | bool, other: float | int | bool) -> bool:
    """Tell whether a register cannot tell the two apart."""
    return bool(REAL(one) == REAL(other))


@dataclass
class Trial(Sitting):
    """Gains tried on a live loop; the envelope is that of an experiment."""

    _predictor: Predictor | None = None
    _from_s: float = 0.0
    _first: int = 0
    _tube: float = math.inf
    _beside: list[tuple[float, float]] = field(default_factory=list)

    async def dry_run(self, result: Tuning, proposal: Proposal) -> Plan:
        """Return what `apply` would write now; reads only.

        Raises:
            StateError: As `apply`; a limit of the profile forbids it.
        """
        await self._sample()
        flags, gains = wanted(result, proposal, self._live(), self.loop)
        return await self.gate.preview({**flags, **gains})

    async def apply(
        self, result: Tuning, rule: str, size: float | None = None, hold_s: float | None = None
    ) -> Verification:
        """Write a rule's gains, prove them with SV up and back, keep them or put everything back.

        Args:
            result: The tuning that made the proposals.
            rule: Whose; `recommended` is the recommended one.
            size: Step of SV in PV; None as for an experiment with SV.
            hold_s: How long SV stands on each side; None from the predicted settling time.

        Raises:
            ProfileError: No such proposal.
            StateError: Refused before anything was written; or stopped, or somebody else wrote, and put back.
        """
        proposal = named(result, rule)
        self._begun_ns = self.clock.now_ns()
        plan = await self.dry_run(result, proposal)
        self._check_mode("a step of SV would prove nothing")
        for line in plan.lines:
            self.told(f"{self.loop.name} {line}")
        quiet = await self._rest()
        size = size if size is not None else self._sv_step(quiet)
        hold = hold_s if hold_s is not None else self._hold_s(proposal)
        self._check_ahead(result, proposal, size, hold)
        self._tube = tube(size, quiet.noise, quiet.resolution)
        self.told(
            f"noise {quiet.noise:.3g}: SV {size:+.4g} for {hold:.4g} s and back, "
            f"PV within {self._tube:.3g} of predicted"
        )
        reason = ""
        try:
            await self._tried(result, proposal, size, hold)
        except StateError:
            # Only leaving the envelope is an answer; all else is an error, and so is what could not be put back.
            if not self.left or self.gate.state is State.BROKEN:
                raise
            reason = self.left
        self.told("everything is put back" if reason else "kept")
        return self._outcome(proposal.name, tuple(plan.lines), size, reason)

    async def _tried(self, result: Tuning, proposal: Proposal, size: float, hold_s: float) -> None:
        why = f"tune: gains of {proposal.name}"
        async with self.gate.armed(why, duration_ns=round(self.envelope.time_s * SECOND), keep=True):
            flags, gains = wanted(result, proposal, self._live(), self.loop)
            for values in (flags, gains):
                if values:
                    await self._write(values)
            for _ in range(QUIET_SAMPLES):
                await self._sample()
            rest = np.array(self.rows[:-QUIET_SAMPLES])
            sv, at = self.rows[-1][1], (float(np.mean(rest[:, 2])), float(np.mean(rest[:, 3])))
            await self._write({"SV": sv + size})
            assert self._written_ns is not None
            self._from_s = (self._written_ns - self._begun_ns) / SECOND
            self._first = len(self.rows)
            self._predictor = _predictor(result, proposal, at, sv)
            await self._held(hold_s)
            await self._write({"SV": sv})
            await self._held(hold_s)
            table = np.array(self.rows[self._first :])
            fit = fit_late(table[:, 2], np.array([row[0] for row in self._beside]))
            if fit < FIT_MIN:
                self._leave(f"the fit of predicted and measured PV is {fit:.0f} %, at least {FIT_MIN:g} % is asked for")

    async def _held(self, hold_s: float) -> None:
        ends_ns = self.clock.now_ns() + round(hold_s * SECOND)
        while self.clock.now_ns() < ends_ns:
            await self._sample()

    def _judge(self) -> None:
        if self._predictor is not None:
            # Kept in step with the rows, whatever is found wrong next.
            t, sv, *_ = self.rows[-1]
            self._beside.append(self._predictor.until(t - self._from_s, sv))
        super()._judge()
        if self._predictor is not None:
            pv, late = self.rows[-1][2], [row[0] for row in self._beside[-1 - LATE_SAMPLES :]]
            if max(min(late) - pv, pv - max(late)) > self._tube:
                self._leave(
                    f"PV is {self.rows[-1][2]:.5g}, predicted was {self._beside[-1][0]:.5g}, "
                    f"at most {self._tube:.3g} between them is allowed"
                )

    def _hold_s(self, proposal: Proposal) -> float:
        settling = proposal.setpoint.settling_s
        longest = float(proposal.setpoint_trace.t_s[-1])
        whole = min(HOLD_SETTLINGS * settling, longest) if math.isfinite(settling) else longest
        return max(whole, HOLD_EXECUTIONS_MIN * proposal.canonical.ts_s)

    def _check_ahead(self, result: Tuning, proposal: Proposal, size: float, hold_s: float) -> None:
        """Refuse what the prediction already shows to leave the envelope, or what time does not allow."""
        bounds = self.envelope
        if 2.0 * hold_s > 0.95 * bounds.time_s:
            raise StateError(
                f"loop {self.loop.name}: SV must stand {hold_s:.4g} s on each side, the whole may take "
                f"{bounds.time_s:g} s; nothing was written",
                hint=f"--seconds {math.ceil(2.2 * hold_s)}, or a shorter --hold",
            )
        table = np.array(self.rows)
        at, sv = (float(np.mean(table[:, 2])), float(np.mean(table[:, 3]))), self.rows[-1][1]
        ahead, ts = _predictor(result, proposal, at, sv), proposal.canonical.ts_s
        for count in range(1, int(2.0 * hold_s / ts) + 1):
            pv, mv = ahead.until(count * ts, sv + (size if count * ts <= hold_s else 0.0))
            for name, value, (low, high) in (("PV", pv, bounds.pv), ("MV", mv, bounds.mv)):
                if not low <= value <= high:
                    raise StateError(
                        f"loop {self.loop.name}: with {proposal.name} and SV {size:+.4g} {name} would be {value:.4g}, "
                        f"outside the envelope {low:g}…{high:g}; nothing was written",
                        hint="a smaller --size, wider bounds, or a more cautious --dial",
                    )

    def _outcome(self, rule: str, lines: tuple[str, ...], size: float, reason: str) -> Verification:
        count = len(self._beside)
        table = np.array(self.rows[len(self.rows) - count :], dtype=np.float64).reshape(-1, 5)
        beside = np.array(self._beside, dtype=np.float64).reshape(-1, 2)
        fit = fit_late(table[:, 2], beside[:, 0]) if count > 1 else math.nan
        return Verification(
            rule, lines, size, table[:, 0] - self._from_s, table[:, 1], table[:, 2], table[:, 3],
            beside[:, 0], beside[:, 1], self._tube, fit, reason,
        )  # fmt: skip


def _predictor(result: Tuning, proposal: Proposal, at: tuple[float, float], sv: float) -> Predictor:
    form, fit = result.loop, result.identified.fit
    assert form is not None
    assert fit is not None
    settings = BLOCKS[form.instruction].settings(form.settings) | proposal.settings
    return Predictor(delta(form.instruction, settings, sv, at[0], at[1], form.dialect), fit.model, at)


def as_json(found: Verification) -> Json:
    """Return the verification as one object; the form stands in docs/reference/tune.md."""
    return {
        "rule": found.rule,
        "kept": found.is_kept,
        "reason": found.reason or None,
        "fit_percent": number(found.fit_percent),
        "sv_step": found.step,
        "tube": found.tube,
        "largest": number(largest(found)),
        "written": list(found.lines),
    }


def largest(found: Verification) -> float:
    """Largest |measured − predicted| in PV; NaN when nothing was measured."""
    return float(np.max(np.abs(found.pv - found.predicted_pv))) if found.pv.size else math.nan


def as_text(found: Verification) -> str:
    """Return the verification as lines of text."""
    ended = "kept" if found.is_kept else f"put back: {found.reason}"
    return "\n".join(
        [
            f"verified {found.rule} with SV {found.step:+.4g} and back: fit {found.fit_percent:.0f} % "
            f"(PV at most {largest(found):.3g} from its prediction of the same moment)",
            f"  the gains are {ended}",
        ]
    )
