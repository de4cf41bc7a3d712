"""Experiments on a live loop: a step, a doublet or a relay of MOUT in manual, a step of SV, or the PLC's own tuning.

This file alone decides what is moved and when. Noise and resolution are measured first, by reading only; a step of MOUT
that nobody sized is grown from a small one until PV's answer stands clear of both (`tuning.sizing`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from enum import Enum

import numpy as np

from ahgateway.apps.tune_sitting import REST_SAMPLES, Sitting
from ahgateway.clock import SECOND
from ahgateway.errors import StateError
from ahgateway.tuning import sizing
from ahgateway.tuning.blocks import Params
from ahgateway.tuning.record import Array, Record, polled
from ahgateway.tuning.sizing import Quiet

HYSTERESIS = 3.0
"""The relay's hysteresis in standard deviations of the noise; at least two steps of PV's resolution."""
BIAS = 0.25
"""How far the middle of the relay's two values lies above the MV of rest, as a share of its half swing."""
SETTLED_SAMPLES = 30
CYCLES = 3
TRY_SHARE = 0.1
"""How long a small step that shows nothing is waited for, as a share of the whole time; twice that when it shows."""


class Kind(Enum):
    """What is moved, and how."""

    STEP = "step"
    DOUBLET = "doublet"
    SV = "sv"
    RELAY = "relay"
    AUTOTUNE = "autotune"


@dataclass(frozen=True, slots=True)
class Wanted:
    """What a person asks for; None is sized from the noise, from PV's answer, or from the profile.

    Attributes:
        kind: What is moved.
        size: Step in MV, or in PV for `sv`.
        hold_s: How long each leg is held; None until PV has settled.
        hysteresis: Of the relay, in PV.
        bias: Of the relay, as a share of `size`.
    """

    kind: Kind
    size: float | None = None
    hold_s: float | None = None
    hysteresis: float | None = None
    bias: float = BIAS


@dataclass
class Experiment(Sitting):
    """One experiment on one loop.

    Attributes:
        brought: The loop's settings behind the PLC's own tuning; empty for every other experiment.
    """

    brought: Params = field(default_factory=dict)
    _ends_ns: int = 0

    async def run(self, wanted: Wanted) -> tuple[Record, Params]:
        """Measure the rest, excite the loop, put everything back; return the trace and the loop's settings.

        Raises:
            StateError: Not at rest, outside the envelope, somebody else wrote, stopped; everything has been put back.
            TransportError: The link failed for longer than the gate waits.
        """
        self._begun_ns = self.clock.now_ns()
        quiet = await self._rest()
        if wanted.kind is Kind.SV and wanted.size is None:
            wanted = replace(wanted, size=self._sv_step(quiet))
        if wanted.kind in (Kind.SV, Kind.AUTOTUNE):
            self._check_mode(f"which `{wanted.kind.value}` needs")
        elif wanted.size is None:
            sizing.check_room(quiet, self.loop.name)
        size = "" if wanted.size is None else f" of {wanted.size:.4g}"
        self.told(f"noise {quiet.noise:.3g}, resolution {quiet.resolution:.3g}: {wanted.kind.value}{size}")
        settings = self._live()
        duration_ns = round(self.envelope.time_s * SECOND)
        self._ends_ns = self.clock.now_ns() + duration_ns
        async with self.gate.armed(f"tune: {wanted.kind.value}{size}", duration_ns=duration_ns):
            await self._excite(wanted, quiet)
            self.told("done, everything is put back")
        return self._record(wanted.kind), settings

    def _record(self, kind: Kind) -> Record:
        table = np.array(self.rows, dtype=np.float64)
        # The PLC's own tuner drives MV from limit to limit: there a limit is no sign of a loop that cannot answer.
        limits = (-math.inf, math.inf) if kind is Kind.AUTOTUNE else None
        t = table[:, 0] - table[0, 0]
        record = Record(t, table[:, 1], table[:, 2], table[:, 3], f"{self.loop.name} {kind.value}", limits)
        sent = np.array(self._sent_s) - table[0, 0]
        stood = table[:, 4] - table[0, 0]
        return polled(record, stood, sent if kind in (Kind.STEP, Kind.DOUBLET, Kind.RELAY) else None)

    async def _excite(self, wanted: Wanted, quiet: Quiet) -> None:
        if wanted.kind is Kind.AUTOTUNE:
            await self._tuned_by_the_plc()
            return
        if wanted.kind is Kind.SV:
            assert self._last is not None
            assert wanted.size is not None
            sv = float(self._last.inputs.sv)
            for value, left in ((sv + wanted.size, 2), (sv, 1)):
                await self._write({"SV": value})
                await self._leg(wanted, quiet, left)
            return
        await self._write({"PID_MAN": True})
        base = float((await self._sample()).seen["MV"])
        size = wanted.size if wanted.size is not None else await self._sized(wanted, quiet, base)
        if wanted.kind is Kind.RELAY:
            await self._relay(wanted, quiet, base, size)
            return
        levels = (base + size, base) if wanted.kind is Kind.STEP else (base + size, base - size, base)
        for index, value in enumerate(levels):
            await self._write({"MOUT": value})
            await self._leg(wanted, quiet, len(levels) - index)

    async def _sized(self, wanted: Wanted, quiet: Quiet, base: float) -> float:
        """Grow a small step of MOUT until PV answers, and return the step that the answer asks for.

        Raises:
            StateError: Even the largest step that is allowed leaves PV below the floor.
        """
        low, high = self._mv_room()
        largest = self._largest(wanted, base)
        if abs(largest) < sizing.FIRST_SHARE * (high - low):
            raise StateError(
                f"loop {self.loop.name}: MV stands at {base:.4g} and may go from {low:g} to {high:g}: "
                f"saturated, there is no room for a {wanted.kind.value}; everything has been put back",
                hint="move the loop to another operating point first, or allow a larger step_max of MOUT",
            )
        sign, largest = math.copysign(1.0, largest), abs(largest)
        step = sizing.first(high - low, largest)
        rest = float(np.mean([row[2] for row in self.rows[:REST_SAMPLES]]))
        while True:
            await self._write({"MOUT": base + sign * step})
            answer = await self._answer(wanted, quiet, rest)
            if answer >= quiet.wanted:
                size = step
            elif answer < quiet.floor and step < largest:
                step = min(sizing.GROWTH * step, largest)
                continue
            else:
                size = sizing.sized(quiet, step, answer, largest, self.loop.name)
            self.told(f"PV answers {step:.3g} of MOUT by {answer:.3g}: {wanted.kind.value} of {size:.4g}")
            return sign * size

    def _mv_room(self) -> tuple[float, float]:
        """Between what MV may be moved: the envelope, and what the PLC itself lets through."""
        assert self._last is not None
        ends = sorted((float(self._last.inputs.mv_min), float(self._last.inputs.mv_max)))
        return max(self.envelope.mv[0], ends[0]), min(self.envelope.mv[1], ends[1])

    def _largest(self, wanted: Wanted, base: float) -> float:
        """The largest step of MOUT that profile and bounds allow; negative where only downwards is room."""
        low, high = self._mv_room()
        limit = self.loop.writes.get("MOUT")
        at_once = math.inf if limit is None or limit.step_max is None else limit.step_max
        if wanted.kind is Kind.STEP:
            return min(at_once, high - base) if high - base >= base - low else -min(at_once, base - low)
        # A doublet and a relay go from one side to the other in one write.
        share = 1.0 + (abs(wanted.bias) if wanted.kind is Kind.RELAY else 0.0)
        return min(at_once / 2.0, (high - base) / share, (base - low) / share)

    async def _answer(self, wanted: Wanted, quiet: Quiet, rest: float) -> float:
        """Watch PV behind a small step: until it moved enough, or settled, or nothing came for some time."""
        begun_ns, first = self.clock.now_ns(), len(self.rows)
        patience_ns = round((wanted.hold_s or TRY_SHARE * self.envelope.time_s) * SECOND)
        while True:
            await self._sample()
            pv = np.array([row[2] for row in self.rows[first:]])
            last = pv[-max(3, pv.size // 5) :]
            answer = abs(float(np.mean(last)) - rest)
            waited_ns = self.clock.now_ns() - begun_ns
            seen = pv.size >= 3 and answer >= quiet.seen(last.size)
            # Beside little answer noise looks like rest, so that a settled PV is believed only after some time.
            settled = waited_ns >= 0.5 * patience_ns and _settled(pv, rest, quiet.noise)
            if settled or (seen and answer >= quiet.wanted):
                return answer
            if waited_ns >= (2 if seen else 1) * patience_ns:
                return answer

    async def _tuned_by_the_plc(self) -> None:
        """PID_MODE = 1 until the instruction sets it back to 0; MV is held within the envelope by its own limits."""
        assert self._last is not None
        inputs, (low, high) = self._last.inputs, self.envelope.mv
        ends = sorted((float(inputs.mv_min), float(inputs.mv_max)))
        if ends[0] < low or ends[1] > high:
            await self._write({"MV_MAX": min(ends[1], high), "MV_MIN": max(ends[0], low)})
        before = self._live()
        await self._write({"PID_MODE": 1})
        while int((await self._sample()).inputs.pid_mode) == 1:
            pass
        assert self._last is not None
        self.gate.tuned(self._last)
        self.brought = self._live()
        if all(self.brought[name] == before[name] for name in before):
            raise StateError(
                f"loop {self.loop.name}: the PLC ended its tuning and left every gain as it was; "
                "everything has been put back",
                hint="its tuning is meant for temperature loops; use another experiment",
            )

    async def _leg(self, wanted: Wanted, quiet: Quiet, left: int) -> None:
        """Hold until the time given is over, or PV has settled, or half the way to the envelope is used up.

        Whatever PV does, one of `left` legs takes no more than its share of the time that is left: PV of an
        integrating process, or behind a valve that did not move, never settles.
        """
        begun_ns, first = self.clock.now_ns(), self._moved_at
        latest_ns = begun_ns + (self._ends_ns - begun_ns) // (left + 1)
        start = self.rows[first - 1][2]
        while True:
            picture = await self._sample()
            if wanted.hold_s is not None:
                if self.clock.now_ns() - begun_ns >= wanted.hold_s * SECOND:
                    return
                continue
            pv = np.array([row[2] for row in self.rows[first:]])
            low, high = self.envelope.pv
            room = (high - start) if float(picture.inputs.pv) > start else (start - low)
            used = abs(float(picture.inputs.pv) - start) > 0.5 * room
            if used or self.clock.now_ns() >= latest_ns or _settled(pv, start, quiet.noise):
                return

    async def _relay(self, wanted: Wanted, quiet: Quiet, base: float, size: float) -> None:
        """Two-position control of MOUT around the PV of the rest, until `CYCLES` periods are seen."""
        hysteresis = wanted.hysteresis or max(HYSTERESIS * quiet.noise, 2.0 * quiet.resolution, 1e-6)
        centre = float(np.mean([row[2] for row in self.rows[:REST_SAMPLES]]))
        levels = (base + size * (wanted.bias - 1.0), base + size * (wanted.bias + 1.0))
        up, switched = True, 0
        await self._write({"MOUT": levels[up]})
        rising = 0.0
        while switched < 2 * CYCLES:
            pv = float((await self._sample()).inputs.pv)
            if not rising and abs(pv - centre) > hysteresis:
                # The first answer tells the direction of the process.
                rising = 1.0 if pv > centre else -1.0
            if rising and rising * (pv - centre) * (1.0 if up else -1.0) > hysteresis:
                up = not up
                switched += 1
                await self._write({"MOUT": levels[up]})


def _settled(pv: Array, start: float, sigma: float) -> bool:
    """Tell whether PV has moved and then stood still: its last two fifths agree within noise and 2 % of the move."""
    count = pv.size
    if count < SETTLED_SAMPLES:
        return False
    part = count // 5
    last, before = float(np.mean(pv[-part:])), float(np.mean(pv[-2 * part : -part]))
    move = abs(last - start)
    return move > 6.0 * sigma and abs(last - before) < max(3.0 * sigma / math.sqrt(part), 0.02 * move)
