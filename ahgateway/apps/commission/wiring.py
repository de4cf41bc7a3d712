"""Step 5, prove the wiring: small steps of the manual value, inside an excitation envelope, and everything back.

It is the one step that moves the process. Each picture is held against the envelope (PV, its rate, time) and against
what we wrote; anything odd ends the test, and the gate puts the loop back. The sign of the process is what matters:
where E = SV - PV, PV must rise when MV rises, where E = PV - SV it must fall, or the loop runs away in automatic.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from ahgateway.apps.commission.checks import Check, failed, judged, passed, skipped, unclear
from ahgateway.apps.commission.observe import trace
from ahgateway.clock import MILLISECOND, SECOND, Clock
from ahgateway.codec.station import Loop, Station, WriteLimit
from ahgateway.codec.words import decode
from ahgateway.errors import AhGatewayError, PlcRefusedError, StateError, TransportError
from ahgateway.lockstep.follow import cycle_ns, output_of, process_value_of
from ahgateway.lockstep.gate.change import in_manual, shown
from ahgateway.lockstep.gate.gate import Gate
from ahgateway.lockstep.gate.states import State
from ahgateway.lockstep.patient import BUSY, Patient
from ahgateway.lockstep.picture import Picture, Sampler, Sees
from ahgateway.transports.base import Link

NAMES = (
    "pv-does-not-answer", "wrong-direction", "envelope-left", "taken-over", "clamp-ignored", "bump", "not-written",
    "not-as-found",
)  # fmt: skip
SIGNIFICANT = 6.0
"""PV has moved when it left the noise around its drift by so many standard deviations, three pictures in a row."""
BASELINE_SHARE = 0.5
"""Share of the time for an answer that is spent on the noise and drift before the first step."""


@dataclass(frozen=True, slots=True)
class Envelope:
    """What the test may do to the process.

    Attributes:
        step: Size of a step of the manual value, in MV's unit.
        pv_low: PV below ends the test.
        pv_high: PV above ends the test.
        pv_rate_max: PV's largest rate per second over one CYCLE and at least a second; None is no limit.
        answer_ns: How long PV is given to answer a step.
        total_ns: Longest time of the whole test; the arming ends with it.
        operand: What the controller calls its manual value.
    """

    step: float
    pv_low: float
    pv_high: float
    pv_rate_max: float | None = None
    answer_ns: int = 60 * SECOND
    total_ns: int = 900 * SECOND
    operand: str = "MOUT"


class LeftError(StateError):
    """PV, its rate or the time left the envelope."""


class TakenError(StateError):
    """Somebody else wrote to the loop."""


def without_manual(loop: Loop) -> str:
    """Say why this controller cannot be moved by hand, empty when it can."""
    roles = loop.controller.roles
    if roles.manual and roles.mout:
        return ""
    return f"{loop.controller.name} has no manual value by which its output could be moved in steps"


def envelope(loop: Loop, picture: Picture, *, step: float | None = None, pv: float | None = None) -> Envelope:
    """Return an envelope around where the loop stands: a tenth of PV's range, the largest step, unless given.

    Raises:
        StateError: The profile allows no MOUT, or nothing says how far PV may go.
    """
    roles = loop.controller.roles
    limit = loop.writes.get(roles.mout)
    if limit is None or limit.step_max is None or roles.manual not in loop.writes:
        raise StateError(
            f"loop {loop.name}: {roles.mout} and {roles.manual} are not on the list of what may be written",
            hint=f"[loops.{loop.name}.write] in the profile is that list",
        )
    size = min(limit.step_max, step or limit.step_max)
    if pv is None and loop.pv_range is None:
        raise StateError(
            f"loop {loop.name}: nothing says how far PV may go",
            hint="name `ranges.pv` in the profile, or use --pv-band",
        )
    band = pv if pv is not None else 0.1 * (loop.pv_range[1] - loop.pv_range[0])  # type: ignore[index]
    stands = float(process_value_of(loop, picture))
    return Envelope(size, stands - band, stands + band, operand=roles.mout)


@dataclass(slots=True)
class Proof:
    """What step 5 brought: its checks and the trace of the test."""

    checks: list[Check] = field(default_factory=list)
    trace: dict[str, list[float]] = field(default_factory=dict)


async def prove(
    gate: Gate, station: Station, loop: Loop, link: Link, clock: Clock, bounds: Envelope, sees: Sees | None = None
) -> Proof:
    """Run the test and put everything back; what goes wrong is a check, never an exception of the weather."""
    test = _Test(gate, Sampler(loop, station, Patient(link, clock), clock, sees), loop, clock, bounds)
    try:
        async with gate.armed("prove the wiring", duration_ns=bounds.total_ns):
            await test.run()
    except LeftError as error:
        test.note(failed("envelope-left", error.message))
    except TakenError as error:
        test.note(failed("taken-over", error.message))
    except AhGatewayError as error:
        test.note(_failure(error))
    if gate.state is State.BROKEN:
        test.note(failed("not-as-found", "something was left; the gate is broken until a person looks"))
    elif gate.session is not None:
        test.note(passed("not-as-found", "everything is as found"))
    return Proof(test.complete(), trace(loop, test.pictures))


def _failure(error: AhGatewayError) -> Check:
    """Sort what the gate says: taken over, not written, or the link."""
    text = error.message
    if "somebody else writes" in text or "taken over" in text:
        return failed("taken-over", text)
    if isinstance(error.__cause__, TransportError):
        return unclear("not-written", text)
    if isinstance(error, StateError) or (isinstance(error, PlcRefusedError) and error.code != BUSY):
        return failed("not-written", text)
    return unclear("not-written", text)


class _Test:
    def __init__(self, gate: Gate, sampler: Sampler, loop: Loop, clock: Clock, bounds: Envelope) -> None:
        self.gate, self.sampler, self.loop, self.clock, self.bounds = gate, sampler, loop, clock, bounds
        self.pictures: list[Picture] = []
        self.checks: dict[str, Check] = {}
        self.roles = loop.controller.roles
        self._poll_ns = 50 * MILLISECOND

    def note(self, check: Check) -> None:
        """Keep a check; the first of a name counts."""
        self.checks.setdefault(check.name, check)

    def complete(self) -> list[Check]:
        """Return all checks of the step; what was not reached is skipped."""
        first = next((check for check in self.checks.values() if check.outcome.value == "fail"), None)
        reason = f"the test ended before: {first.name}" if first else "the test ended before"
        return [self.checks.get(name, skipped(name, reason)) for name in NAMES]

    async def run(self) -> None:
        picture = await self.look()
        self._poll_ns = max(20 * MILLISECOND, cycle_ns(self.loop, picture) // 2)
        was_manual = in_manual(self.roles, picture.words)
        before = self._mv(picture)
        await self.gate.write({self.roles.manual: self.roles.is_manual_when}, "into manual")
        await self._settle()
        await self._steps()
        await self._clamps()
        self.note(passed("envelope-left", "PV, its rate and the time stayed inside"))
        if was_manual:
            self.note(skipped("bump", "the loop was in manual before"))
        else:
            await self._return(before)
        self.note(passed("taken-over", "nobody else wrote"))
        self.note(passed("not-written", "what was written stood there"))

    def _pv(self, picture: Picture) -> float:
        return float(process_value_of(self.loop, picture))

    def _mv(self, picture: Picture) -> float:
        return float(output_of(self.loop, picture))

    def _value(self, picture: Picture, operand: str) -> Any:
        return decode(self.loop.controller.operand(operand).kind, picture.words[operand])

    def _reach(self, limit: WriteLimit) -> tuple[float, float]:
        """Where the manual value may go: within what may be written, and within the limits in force."""
        assert limit.minimum is not None
        assert limit.maximum is not None
        limits = self.loop.controller.limits(self.pictures[-1].inputs)
        bounds = sorted(float(value) for _, value in limits) if limits else [limit.minimum, limit.maximum]
        return max(limit.minimum, bounds[0]), min(limit.maximum, bounds[1])

    async def look(self) -> Picture:
        """Take a picture, hold it against the envelope and against what we wrote."""
        while True:
            await self.gate.check()
            picture = await self.sampler.picture()
            if picture is not None:
                break
            await self.gate.pause(self._poll_ns)
        self.pictures.append(picture)
        try:
            self.gate.look(picture)
        except StateError as error:
            raise TakenError(error.message) from error
        self._inside(picture)
        return picture

    def _inside(self, picture: Picture) -> None:
        bounds, pv = self.bounds, self._pv(picture)
        if not math.isfinite(pv) or not bounds.pv_low <= pv <= bounds.pv_high:
            raise LeftError(f"PV is {pv:g}, the envelope {bounds.pv_low:g}…{bounds.pv_high:g}")
        if picture.running is False:
            raise LeftError("the PLC went to STOP")
        if bounds.pv_rate_max is None:
            return
        window_ns = max(SECOND, cycle_ns(self.loop, picture))
        earlier = next((each for each in reversed(self.pictures) if picture.last_ns - each.last_ns >= window_ns), None)
        if earlier is not None:
            rate = abs(pv - self._pv(earlier)) / ((picture.last_ns - earlier.last_ns) / SECOND)
            if rate > bounds.pv_rate_max:
                raise LeftError(f"PV moves by {rate:.3g} a second, the envelope allows {bounds.pv_rate_max:g}")

    async def _watch(self, duration_ns: int) -> list[Picture]:
        ends_ns = self.clock.now_ns() + duration_ns
        found = []
        while self.clock.now_ns() < ends_ns:
            await self.gate.pause(self._poll_ns)
            found.append(await self.look())
        return found

    async def _settle(self) -> None:
        """Let an execution or two pass, so that MV is what was written."""
        picture = self.pictures[-1]
        await self._watch(2 * cycle_ns(self.loop, picture) + 4 * self.loop.scan_ms_max * MILLISECOND)

    async def _steps(self) -> None:
        """One step each way and back; does PV move, which way, does that fit PID_DIR?"""
        base = float(self._value(self.pictures[-1], self.roles.mout))
        limit = self.loop.writes[self.roles.mout]
        low, high = self._reach(limit)
        sizes = [sign * self.bounds.step for sign in (1.0, -1.0) if low <= base + sign * self.bounds.step <= high]
        if not sizes:
            text = f"{self.roles.mout} is {base:g}, a step of {self.bounds.step:g} leaves {low:g}…{high:g} either way"
            for name in ("pv-does-not-answer", "wrong-direction"):
                self.note(unclear(name, text))
            return
        answers: list[tuple[float, float]] = []
        for size in sizes:
            quiet = await self._watch(round(BASELINE_SHARE * self.bounds.answer_ns))
            await self._write_mout(base + size)
            moved = await self._answer(quiet)
            await self._write_mout(base)
            answers.append((size, moved))
            if moved:
                await self._watch(self.bounds.answer_ns)
        self._judge(answers, self.loop.controller.rises(self.pictures[-1].inputs))

    async def _write_mout(self, value: float) -> None:
        wait_s = self.loop.writes[self.roles.mout].interval_s
        await self._watch(round(wait_s * SECOND))
        await self.gate.write({self.roles.mout: value}, "step")

    async def _answer(self, quiet: Sequence[Picture]) -> float:
        """Return by how much PV left its drift; 0 when it did not within the time given."""
        start_ns = quiet[0].last_ns
        line = _drift([((each.last_ns - start_ns) / SECOND, self._pv(each)) for each in quiet])
        ends_ns = self.clock.now_ns() + self.bounds.answer_ns
        run: list[float] = []
        while self.clock.now_ns() < ends_ns:
            await self.gate.pause(self._poll_ns)
            picture = await self.look()
            elapsed = (picture.last_ns - start_ns) / SECOND
            away = self._pv(picture) - (line[0] + line[1] * elapsed)
            is_far = abs(away) > SIGNIFICANT * line[2]
            run = [*run, away] if is_far and (not run or (away > 0) == (run[-1] > 0)) else []
            if len(run) >= 3:
                return run[-1]
        return 0.0

    def _judge(self, answers: Sequence[tuple[float, float]], wants_rise: bool) -> None:
        texts = [f"{self.roles.mout} {size:+g}: PV {f'{moved:+.3g}' if moved else 'still'}" for size, moved in answers]
        text = ", ".join(texts)
        signs = {math.copysign(1.0, size * moved) for size, moved in answers if moved}
        if not signs:
            self.note(failed("pv-does-not-answer", f"{text}, within {self.bounds.answer_ns / SECOND:g} s each"))
            self.note(skipped("wrong-direction", "PV did not move"))
            return
        self.note(passed("pv-does-not-answer", text))
        equation = "E = SV - PV" if wants_rise else "E = PV - SV"
        if len(signs) > 1:
            self.note(unclear("wrong-direction", f"{text}: both ways at once, something else moved PV"))
            return
        rises = signs == {1.0}
        found = "rises" if rises else "falls"
        said = f"PV {found} when MV rises, the loop works by {equation}; {text}"
        self.note(judged("wrong-direction", rises is wants_rise, said))

    async def _clamps(self) -> None:
        """Move each limit to just beyond the present MV and see MV follow it, half a step at most."""
        limits = self.loop.controller.limits(self.pictures[-1].inputs)
        names = tuple(name for name, _ in reversed(limits)) if limits else ()
        if len(set(names)) < 2 or any(name not in self.loop.writes for name in names):
            listed = " and ".join(names) if len(set(names)) == 2 else "limits of its own"
            self.note(skipped("clamp-ignored", f"{listed} are not on the list of what may be written"))
            return
        await self._settle()
        wrong, texts = [], []
        for name, sign in zip(names, (-1.0, 1.0), strict=True):
            picture = self.pictures[-1]
            found = self._value(picture, name)
            aim = self._mv(picture) + sign * 0.5 * self.bounds.step
            try:
                plan = await self.gate.preview({name: aim})
            except StateError as error:
                self.note(skipped("clamp-ignored", error.message))
                return
            wanted = plan.steps[0].items[0].new_value
            await self.gate.write({name: aim}, "clamp")
            await self._settle()
            mv = output_of(self.loop, self.pictures[-1])
            texts.append(f"{name} {shown(wanted)}: MV {shown(mv)}")
            if mv != wanted:
                wrong.append(name)
            await self._watch(round(self.loop.writes[name].interval_s * SECOND))
            await self.gate.write({name: found}, "clamp back")
            await self._settle()
        self.note(judged("clamp-ignored", not wrong, ", ".join(texts)))

    async def _return(self, before: float) -> None:
        """Back to automatic: MV of the first executions against MV of before."""
        held = self._mv(self.pictures[-1])
        await self._watch(round(self.loop.writes[self.roles.manual].interval_s * SECOND))
        await self.gate.write({self.roles.manual: not self.roles.is_manual_when}, "back to automatic")
        seen = await self._watch(2 * cycle_ns(self.loop, self.pictures[-1]))
        moved = max((self._mv(each) for each in seen), key=lambda mv: abs(mv - held), default=held)
        jump, allowed = abs(moved - held), self.bounds.step
        text = f"MV was {held:g} in manual and {moved:g} at the most behind the transfer, {before:g} at first"
        self.note(judged("bump", jump <= allowed, text, jump=round(jump, 6), allowed=allowed))


def _drift(points: Sequence[tuple[float, float]]) -> tuple[float, float, float]:
    """Fit a straight line: value at 0, slope per second, standard deviation around it (never quite 0)."""
    count = len(points)
    middle_t = sum(t for t, _ in points) / count
    middle_y = sum(y for _, y in points) / count
    spread = sum((t - middle_t) ** 2 for t, _ in points)
    slope = sum((t - middle_t) * (y - middle_y) for t, y in points) / spread if spread else 0.0
    start = middle_y - slope * middle_t
    rest = sum((y - start - slope * t) ** 2 for t, y in points) / max(1, count - 2)
    return start, slope, max(math.sqrt(rest), 1e-5 * max(abs(middle_y), 1.0))
