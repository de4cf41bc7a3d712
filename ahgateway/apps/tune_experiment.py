"""Experiments on a live loop: a step, a doublet or a relay of MOUT in manual, a step of SV in automatic.

This file alone decides when an experiment is aborted. Every write goes through the gate, which puts everything back at
the end, at an abort, at a signal and at a lost link. Noise and resolution are measured first, by reading only; the
size of the step and the relay's hysteresis follow from them where nobody gives them.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, NoReturn

import numpy as np

from ahgateway.apps.tune_source import settings_of
from ahgateway.clock import MILLISECOND, SECOND, Clock
from ahgateway.codec.station import Loop
from ahgateway.errors import StateError
from ahgateway.lockstep.gate.gate import Gate
from ahgateway.lockstep.gate.states import State
from ahgateway.lockstep.picture import Picture, Sampler
from ahgateway.tuning.blocks import Params
from ahgateway.tuning.noise import noise, resolution
from ahgateway.tuning.record import Array, Record

REST_SAMPLES = 40
REST_MAX = 8.0
"""Largest movement of PV in the rest before, in standard deviations of its noise."""
HYSTERESIS = 3.0
"""The relay's hysteresis in standard deviations of the noise."""
SHARE = 0.05
"""Step of MOUT as a share of MV's range, and of SV as a share of the envelope of PV, where none is given."""
SETTLED_SAMPLES = 30
CYCLES = 3


class Kind(Enum):
    """What is moved, and how."""

    STEP = "step"
    DOUBLET = "doublet"
    SV = "sv"
    RELAY = "relay"


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


@dataclass(frozen=True, slots=True)
class Wanted:
    """What a person asks for; None is sized from the noise or from the profile.

    Attributes:
        kind: What is moved.
        size: Step in MV, or in PV for `sv`.
        hold_s: How long each leg is held; None until PV has settled.
    """

    kind: Kind
    size: float | None = None
    hold_s: float | None = None


@dataclass
class Experiment:
    """One experiment on one loop.

    Args:
        loop: The loop.
        gate: Its gate, disarmed.
        sampler: Takes its pictures.
        clock: Time.
        envelope: Within what it stays.
        stop: Set by whoever wants it to end.
        told: Called with a line of text whenever something begins or ends.
        patience_s: How long a loop that is not at rest is waited for.
        left: Why the envelope was left; empty while it was not.
    """

    loop: Loop
    gate: Gate
    sampler: Sampler
    clock: Clock
    envelope: Envelope
    stop: asyncio.Event = field(default_factory=asyncio.Event)
    told: Callable[[str], None] = lambda text: None
    patience_s: float = 0.0
    left: str = ""
    rows: list[tuple[float, float, float, float]] = field(default_factory=list)
    _begun_ns: int = 0
    _last: Picture | None = None
    _written_ns: int | None = None

    async def run(self, wanted: Wanted) -> tuple[Record, Params]:
        """Measure the rest, excite the loop, put everything back; return the trace and the loop's settings.

        Raises:
            StateError: Not at rest, outside the envelope, somebody else wrote, stopped; everything has been put back.
            TransportError: The link failed for longer than the gate waits.
        """
        self._begun_ns = self.clock.now_ns()
        sigma, step = await self._rest()
        assert self._last is not None
        size = wanted.size if wanted.size is not None else self._sized(wanted.kind, sigma, step)
        self.told(f"noise {sigma:.3g}, resolution {step:.3g}: {wanted.kind.value} of {size:.4g}")
        duration_ns = round(self.envelope.time_s * SECOND)
        settings = settings_of(self.loop.controller.name, self._last.inputs)
        async with self.gate.armed(f"tune: {wanted.kind.value} of {size:g}", duration_ns=duration_ns):
            await self._excite(wanted, size, sigma, step)
            self.told("done, everything is put back")
        table = np.array(self.rows, dtype=np.float64)
        record = Record(
            table[:, 0] - table[0, 0], table[:, 1], table[:, 2], table[:, 3], f"{self.loop.name} {wanted.kind.value}"
        )
        return record, settings

    async def _rest(self) -> tuple[float, float]:
        """Watch the loop without writing until it stands still; return noise and resolution of PV."""
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
                return sigma, step
            if self.clock.now_ns() >= ends_ns:
                raise StateError(
                    f"loop {self.loop.name}: PV is not at rest, it moved by {moved:.3g}, at most {bound:.3g} is taken",
                    hint="wait until it stands still; nothing was written",
                )

    def _sized(self, kind: Kind, sigma: float, step: float) -> float:
        """The step that is taken where none was given: a share of the range, what the profile allows at most."""
        if kind is Kind.SV:
            low, high = self.envelope.pv
            limit = self.loop.writes.get("SV")
            size = max(SHARE * (high - low), 10.0 * sigma, 10.0 * step)
        else:
            low, high = self.envelope.mv
            limit = self.loop.writes.get("MOUT")
            size = SHARE * (high - low)
        if limit is not None and limit.step_max is not None:
            # A doublet and a relay go from one side to the other in one write.
            size = min(size, limit.step_max / (2.0 if kind in (Kind.DOUBLET, Kind.RELAY) else 1.0))
        return size

    async def _excite(self, wanted: Wanted, size: float, sigma: float, step: float) -> None:
        assert self._last is not None
        if wanted.kind is Kind.SV:
            sv = float(self._last.inputs.sv)
            for value in (sv + size, sv):
                await self._write({"SV": value})
                await self._leg(wanted, sigma)
            return
        await self._write({"PID_MAN": True})
        picture = await self._sample()
        base = float(picture.seen["MV"])
        if wanted.kind is Kind.RELAY:
            await self._relay(base, size, max(HYSTERESIS * sigma, 2.0 * step, 1e-6))
            return
        levels = (base + size, base) if wanted.kind is Kind.STEP else (base + size, base - size, base)
        for value in levels:
            await self._write({"MOUT": value})
            await self._leg(wanted, sigma)

    async def _write(self, values: dict[str, Any]) -> None:
        """Write through the gate, no sooner than the profile allows; the wait is sampled like any other time."""
        limits = [self.loop.writes[name].interval_s for name in values if name in self.loop.writes]
        pause_ns = round(max(limits, default=0.0) * SECOND)
        while self._written_ns is not None and self.clock.now_ns() - self._written_ns < pause_ns:
            await self._sample()
        await self.gate.write(values)
        self._written_ns = self.clock.now_ns()

    async def _leg(self, wanted: Wanted, sigma: float) -> None:
        """Hold until the time given is over, or PV has settled, or half the way to the envelope is used up."""
        begun_ns, first = self.clock.now_ns(), len(self.rows)
        start = self.rows[-1][2]
        while True:
            picture = await self._sample()
            pv = np.array([row[2] for row in self.rows[first:]])
            if wanted.hold_s is not None:
                if self.clock.now_ns() - begun_ns >= wanted.hold_s * SECOND:
                    return
                continue
            low, high = self.envelope.pv
            room = (high - start) if float(picture.inputs.pv) > start else (start - low)
            if abs(float(picture.inputs.pv) - start) > 0.5 * room or _settled(pv, start, sigma):
                return

    async def _relay(self, base: float, size: float, hysteresis: float) -> None:
        """Two-position control of MOUT around the PV of the rest, until `CYCLES` periods are seen."""
        centre = float(np.mean([row[2] for row in self.rows[:REST_SAMPLES]]))
        up, switched = True, 0
        await self._write({"MOUT": base + size})
        rising = 0.0
        while switched < 2 * CYCLES:
            pv = float((await self._sample()).inputs.pv)
            if not rising and abs(pv - centre) > hysteresis:
                # The first answer tells the direction of the process.
                rising = 1.0 if pv > centre else -1.0
            if rising and rising * (pv - centre) * (1.0 if up else -1.0) > hysteresis:
                up = not up
                switched += 1
                await self._write({"MOUT": base + size if up else base - size})

    async def _sample(self) -> Picture:
        """Wait for the next moment, take a picture, keep it, and judge it against the envelope."""
        await self.gate.pause(self._pause_ns())
        if self.stop.is_set():
            raise StateError(f"loop {self.loop.name}: stopped; everything has been put back")
        picture = None
        while picture is None:
            picture = await self.sampler.picture()
        self._last = picture
        inputs = picture.inputs
        t = (picture.last_ns - self._begun_ns) / SECOND
        self.rows.append((t, float(inputs.sv), float(inputs.pv), float(picture.seen["MV"])))
        if self.gate.state is not State.DISARMED:
            self.gate.look(picture)
            await self.gate.check()
        self._judge()
        return picture

    def _pause_ns(self) -> int:
        if self._last is None:
            return 0
        cycle_s = float(self.loop.controller.nominal_ts(self._last.inputs))
        return round(max(cycle_s * SECOND, 50 * MILLISECOND))

    def _judge(self) -> None:
        t, _, pv, mv = self.rows[-1]
        bounds = self.envelope
        for name, value, (low, high) in (("PV", pv, bounds.pv), ("MV", mv, bounds.mv)):
            if not low <= value <= high:
                self._leave(f"{name} is {value:.5g}, outside the envelope {low:g}…{high:g}", "use a smaller --size")
        if len(self.rows) > 10:
            before = self.rows[-11]
            rate = abs(pv - before[2]) / (t - before[0])
            if rate > bounds.rate:
                self._leave(f"PV moves by {rate:.3g} per second, the envelope allows {bounds.rate:g}")

    def _leave(self, why: str, hint: str | None = None) -> NoReturn:
        self.left = why
        raise StateError(f"loop {self.loop.name}: {why}; aborted, everything has been put back", hint=hint)


def _settled(pv: Array, start: float, sigma: float) -> bool:
    """Tell whether PV has moved and then stood still: its last two fifths agree within noise and 2 % of the move."""
    count = pv.size
    if count < SETTLED_SAMPLES:
        return False
    part = count // 5
    last, before = float(np.mean(pv[-part:])), float(np.mean(pv[-2 * part : -part]))
    move = abs(last - start)
    return move > 6.0 * sigma and abs(last - before) < max(3.0 * sigma / math.sqrt(part), 0.02 * move)
