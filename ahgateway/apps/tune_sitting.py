"""What every experiment and every proof at a live loop shares: pictures, bounds, writes with their times.

This file alone decides when an experiment or a proof is aborted. Every write goes through the gate, which puts
everything back at the end, at an abort, at a signal and at a lost link.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, NoReturn

import numpy as np

from ahgateway.apps.tune_source import settings_of
from ahgateway.clock import MILLISECOND, SECOND, Clock
from ahgateway.codec.station import Loop
from ahgateway.core.real import REAL
from ahgateway.errors import StateError
from ahgateway.lockstep.gate.gate import Gate
from ahgateway.lockstep.gate.states import State
from ahgateway.lockstep.picture import Picture, Sampler
from ahgateway.tuning.blocks import Params
from ahgateway.tuning.noise import noise, resolution
from ahgateway.tuning.sizing import Quiet

REST_SAMPLES = 40
REST_MAX = 8.0
"""Largest movement of PV in the rest before, in standard deviations of its noise."""
SV_SHARE = 0.05
"""Step of SV as a share of the envelope of PV, where none is given."""
SV_CLEAR = 10.0
"""The same step in standard deviations of the noise and in steps of the resolution; the largest counts."""
QUICK_NS = 50 * MILLISECOND
"""Shortest time between two pictures, and the time between them while MV is waited for."""


@dataclass(frozen=True, slots=True)
class Envelope:
    """Within what an experiment stays; beyond any of it, it is aborted and everything put back.

    Attributes:
        pv: Lowest and highest PV.
        mv: Lowest and highest MV.
        rate: Largest |ΔPV| per second, over ten samples; inf for none.
        time_s: Longest time of the whole experiment in s.
    """

    pv: tuple[float, float]
    mv: tuple[float, float]
    rate: float = math.inf
    time_s: float = 600.0


@dataclass
class Sitting:
    """One loop that is watched, moved within bounds, and put back.

    Args:
        loop: The loop.
        gate: Its gate, disarmed.
        sampler: Takes its pictures.
        clock: Time.
        envelope: Within what it stays.
        told: Called with a line of text whenever something begins or ends.
        patience_s: How long a loop that is not at rest is waited for.
        left: Why the envelope was left; empty while it was not.
        rows: Time in s since the beginning at which PV was read, SV, PV, MV, and when MV was read first; by picture.
    """

    loop: Loop
    gate: Gate
    sampler: Sampler
    clock: Clock
    envelope: Envelope
    told: Callable[[str], None] = lambda text: None
    patience_s: float = 0.0
    left: str = ""
    rows: list[tuple[float, float, float, float, float]] = field(default_factory=list)
    _begun_ns: int = 0
    _last: Picture | None = None
    _written_ns: int | None = None
    _sent_s: list[float] = field(default_factory=list)
    _moved_at: int = 0

    async def _rest(self) -> Quiet:
        """Watch the loop without writing until it stands still; return noise, resolution and room of PV.

        Raises:
            StateError: It does not stand still within the patience.
        """
        ends_ns = self.clock.now_ns() + round(self.patience_s * SECOND)
        while True:
            first = len(self.rows)
            for _ in range(REST_SAMPLES):
                await self._sample()
            pv = np.array([row[2] for row in self.rows[first:]])
            sigma, step = noise(pv), resolution(pv)
            third = pv.size // 3
            moved = abs(float(np.mean(pv[-third:]) - np.mean(pv[:third])))
            bound = max(REST_MAX * sigma / math.sqrt(third), step, 1e-9)
            if moved <= bound:
                del self.rows[:first]
                low, high = self.envelope.pv
                at = float(np.mean(pv))
                return Quiet(sigma, step, min(high - at, at - low))
            if self.clock.now_ns() >= ends_ns:
                raise StateError(
                    f"loop {self.loop.name}: PV is not at rest, it moved by {moved:.3g}, at most {bound:.3g} is taken",
                    hint="wait until it stands still; nothing was written",
                )

    def _sv_step(self, quiet: Quiet) -> float:
        """The step of SV that is taken where none was given: a share of the envelope, clear of the noise."""
        low, high = self.envelope.pv
        size = max(SV_SHARE * (high - low), SV_CLEAR * quiet.noise, SV_CLEAR * quiet.resolution)
        limit = self.loop.writes.get("SV")
        size = size if limit is None or limit.step_max is None else min(size, limit.step_max)
        if size < quiet.floor:
            raise StateError(
                f"loop {self.loop.name}: SV may move by {size:.4g} at once, but with noise {quiet.noise:.3g} and "
                f"resolution {quiet.resolution:.3g} of PV at least {quiet.floor:.3g} is needed; nothing was written",
                hint="allow a larger step_max of SV, or filter PV",
            )
        return size

    async def _write(self, values: dict[str, Any]) -> None:
        """Write through the gate, no sooner than the profile allows; the wait is sampled like any other time.

        Behind a MOUT pictures follow each other quickly until MV shows it, so that the moment is known.
        """
        limits = [self.loop.writes[name].interval_s for name in values if name in self.loop.writes]
        pause_ns = round(max(limits, default=0.0) * SECOND)
        while self._written_ns is not None and self.clock.now_ns() - self._written_ns < pause_ns:
            await self._sample()
        rows = len(self.rows)
        plan = await self.gate.write(values)
        self._written_ns = self.clock.now_ns()
        if not plan.steps:
            return
        self._moved_at = rows
        if "MOUT" in values:
            self._sent_s.append((self.gate.sent_ns - self._begun_ns) / SECOND)
            ends_ns = self.clock.now_ns() + self._pause_ns()
            while self.clock.now_ns() < ends_ns:
                await self._sample(QUICK_NS)
                if self.rows[-1][3] != self.rows[rows - 1][3]:
                    return

    async def _sample(self, pause_ns: int | None = None) -> Picture:
        """Wait for the next moment, take a picture, keep it, and judge it against the envelope."""
        await self.gate.pause(self._pause_ns() if pause_ns is None else pause_ns)
        picture = None
        while picture is None:
            picture = await self.sampler.picture()
        self._last = picture
        inputs = picture.inputs
        t, stood = self._times_s(picture)
        self.rows.append((t, float(inputs.sv), float(inputs.pv), float(picture.seen["MV"]), stood))
        if self.gate.state is not State.DISARMED:
            self.gate.look(picture)
            await self.gate.check()
        self._judge()
        return picture

    def _times_s(self, picture: Picture) -> tuple[float, float]:
        """When PV was read, in the middle of the bracket's last readings, and by when MV was, the end of its first."""
        plan = self.sampler.plan
        share = len(plan.bracket) / len(plan.requests)
        whole = (picture.last_ns - picture.sent_ns) / SECOND
        begun = (picture.sent_ns - self._begun_ns) / SECOND
        t = begun + whole * (1.0 - 0.5 * share)
        return t, min(t, begun + share * whole)

    def _pause_ns(self) -> int:
        if self._last is None:
            return 0
        cycle_s = float(self.loop.controller.nominal_ts(self._last.inputs))
        return round(max(cycle_s * SECOND, QUICK_NS))

    def _live(self) -> Params:
        """The loop's settings as they stand in the last picture."""
        assert self._last is not None
        return settings_of(self.loop.controller.name, self._last.inputs)

    def _check_mode(self, what: str) -> None:
        """Refuse what needs a loop in automatic."""
        assert self._last is not None
        inputs = self._last.inputs
        if not inputs.pid_run or inputs.pid_man or int(inputs.pid_mode) == 1:
            raise StateError(
                f"loop {self.loop.name} is not in automatic, {what}; nothing was written",
                hint="put the loop into automatic first",
            )

    def _judge(self) -> None:
        t, _, pv, mv, _ = self.rows[-1]
        bounds = self.envelope
        for name, value, (low, high) in (("PV", pv, bounds.pv), ("MV", mv, bounds.mv)):
            # A limit that was written into a register stands there rounded.
            if not float(REAL(low)) <= value <= float(REAL(high)):
                self._leave(f"{name} is {value:.5g}, outside the envelope {low:g}…{high:g}", "use a smaller --size")
        if len(self.rows) > 10:
            before = self.rows[-11]
            rate = abs(pv - before[2]) / (t - before[0])
            if rate > bounds.rate:
                self._leave(f"PV moves by {rate:.3g} per second, the envelope allows {bounds.rate:g}")

    def _leave(self, why: str, hint: str | None = None) -> NoReturn:
        self.left = why
        raise StateError(f"loop {self.loop.name}: {why}; aborted, everything has been put back", hint=hint)
