"""The guided list: one step after the other, each kept on disk when it is done, so that a session can be resumed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ahgateway.apps.commission import link as link_step
from ahgateway.apps.commission import mapping, observe, reading, wiring
from ahgateway.apps.commission.checks import Check, Outcome, Progress, Step, save, skipped, unclear
from ahgateway.apps.commission.link_search import Opener
from ahgateway.apps.report import number
from ahgateway.apps.witness import Witness
from ahgateway.clock import SECOND, Clock
from ahgateway.codec.devices import DeviceMap
from ahgateway.codec.station import Loop, Station
from ahgateway.codec.words import decode
from ahgateway.core.operands import Kind
from ahgateway.errors import AhGatewayError, TransportError
from ahgateway.lockstep.gate.gate import Gate
from ahgateway.lockstep.gate.journal import verify
from ahgateway.lockstep.gate.place import Place, journal_path
from ahgateway.lockstep.patient import Patient
from ahgateway.lockstep.picture import Picture
from ahgateway.transports.base import Link

Said = Callable[[Step, Sequence[Check]], None]
"""Told of each step when it is done."""

Begins = Callable[[Step], None]
"""Told of each step when it begins."""


@dataclass(frozen=True, slots=True)
class Wishes:
    """What the person asks for.

    Attributes:
        executions: Executions to observe in steps 3 and 4.
        observe_ns: Longest observation.
        coverage_min: Share proven by bits that step 4 asks for.
        is_armed: Step 5 may write.
        mout_step: Size of a step of MOUT, None for the largest allowed.
        pv_band: How far PV may go either way, None for a tenth of its range.
        pv_rate_max: PV's largest rate a second, None for no limit.
        answer_ns: How long PV is given to answer a step.
        total_ns: Longest time of step 5.
        is_marked: A marker may be written to the scratch words.
        patience: How long step 1 may search, and listen to an idle connection.
    """

    executions: int = 60
    observe_ns: int = 120 * SECOND
    coverage_min: float = 0.5
    is_armed: bool = False
    mout_step: float | None = None
    pv_band: float | None = None
    pv_rate_max: float | None = None
    answer_ns: int = 60 * SECOND
    total_ns: int = 900 * SECOND
    is_marked: bool = False
    patience: link_step.Patience = link_step.PATIENCE


class Commission:
    """Commissioning of one loop.

    Args:
        station: The PLC; a step that finds other settings of the link goes on with those.
        loop: The loop.
        opener: Opens a link to a variant of the station.
        clock: Gives all times.
        progress: What was done before.
        path: Where progress is kept, None for nowhere.
        gates: Place of journals and leases.
        maps: Device maps to try when the profile's own does not fit.
        who: Who asks.
        witness: Keeps what is seen and written.
        begins: Told of each step when it begins.
    """

    def __init__(
        self,
        station: Station,
        loop: Loop,
        opener: Opener,
        clock: Clock,
        progress: Progress,
        *,
        path: Path | None,
        gates: Place,
        maps: Sequence[DeviceMap] = (),
        who: str = "",
        witness: Witness | None = None,
        begins: Begins = lambda step: None,
    ) -> None:
        self.station, self.loop, self.progress = station, loop, progress
        self.changes: dict[str, str | int] = {}
        self._opener, self._clock, self._path, self._gates, self._maps, self._who = (
            opener, clock, path, gates, maps, who,
        )  # fmt: skip
        self._begins = begins
        self._witness = witness or Witness(loop, None)

    async def run(self, wishes: Wishes, said: Said, *, consent: Callable[[wiring.Envelope], bool]) -> None:
        """Do every step that is not done yet; a step that cannot be done says so and the rest is skipped.

        Args:
            wishes: What is asked for.
            said: Told of each step.
            consent: Asked once, with the envelope, before the process is moved.

        Raises:
            ProfileError: Progress cannot be kept.
        """
        if not await self._link(wishes, said):
            return
        link = await self._opener(self.station)
        try:
            if not self.progress.is_done(Step.MAP):
                self._begins(Step.MAP)
                checks = await self._guarded(
                    "no-loop-there", mapping.settle(self.station, self.loop, Patient(link, self._clock), self._maps)
                )
                self._done(Step.MAP, [*checks, await self._marked(link, wishes, checks)], said)
            if any(check.outcome is Outcome.FAIL for check in self.progress.steps[Step.MAP]):
                return
            if not (self.progress.is_done(Step.LOOP) and self.progress.is_done(Step.SHADOW)):
                await self._observe(link, wishes, said)
            if not self.progress.is_done(Step.WIRING):
                await self._wiring(link, wishes, said, consent)
            await self._as_left(link)
        finally:
            await link.close()

    async def _link(self, wishes: Wishes, said: Said) -> bool:
        if self.progress.is_done(Step.LINK):
            return True
        self._begins(Step.LINK)
        found, checks = await link_step.find(
            self.station, self.loop, self._opener, self._clock, self._witness.see, patience=wishes.patience
        )
        if found is not None:
            self.changes = dict(found.changes)
            pacing = {
                key.removeprefix("pacing."): int(value) for key, value in self.changes.items() if "pacing." in key
            }
            self.station = replace(found.station, pacing=replace(found.station.pacing, **pacing))
            self.progress.facts["changes"] = self.changes
        self._done(Step.LINK, checks, said)
        return found is not None

    async def _marked(self, link: Link, wishes: Wishes, checks: Sequence[Check]) -> Check:
        if not wishes.is_marked:
            return skipped("marker", "not asked for: --marker with --arm writes to the scratch words")
        if any(check.outcome is Outcome.FAIL for check in checks):
            return skipped("marker", "not before the map fits")
        gate = self._gate(link)
        return await mapping.mark(gate, link)

    async def _observe(self, link: Link, wishes: Wishes, said: Said) -> None:
        self._begins(Step.LOOP)
        seen = await observe.observe(
            self.station, self.loop, link, self._clock, executions=wishes.executions, duration_ns=wishes.observe_ns,
            sees=self._witness.see,
        )  # fmt: skip
        if seen.pictures:
            self.progress.facts.setdefault("as_found", operands(self.loop, seen.pictures[0]))
            self.progress.facts["trace"] = seen.trace(self.loop)
        self._done(Step.LOOP, reading.read_loop(self.station, self.loop, seen), said)
        self._begins(Step.SHADOW)
        self._done(Step.SHADOW, reading.judge_shadow(self.loop, seen, wishes.coverage_min), said)

    async def _wiring(self, link: Link, wishes: Wishes, said: Said, consent: Callable[[wiring.Envelope], bool]) -> None:
        reason = "" if wishes.is_armed else f"not armed: --arm {self.loop.name} allows it"
        failed = [check.name for check in self.progress.steps.get(Step.LOOP, ()) if check.outcome is Outcome.FAIL]
        reason = reason or wiring.without_manual(self.loop)
        reason = reason or (f"not before step 3 is clean: {', '.join(failed)}" if failed else "")
        gate = self._gate(link)
        self._begins(Step.WIRING)
        try:
            if not reason:
                bounds = await self._envelope(link, wishes)
                if consent(bounds):
                    proof = await wiring.prove(
                        gate, self.station, self.loop, link, self._clock, bounds, self._witness.see
                    )
                    self.progress.facts["wiring_trace"] = proof.trace
                    self._done(Step.WIRING, proof.checks, said)
                    return
                reason = "nobody consented"
        except AhGatewayError as error:
            # It was asked for and could not begin: that is no pass.
            first, *others = wiring.NAMES
            checks = [unclear(first, error.message), *(skipped(name, error.message) for name in others)]
        else:
            checks = [skipped(name, reason) for name in wiring.NAMES]
        self._done(Step.WIRING, checks, said)

    async def _envelope(self, link: Link, wishes: Wishes) -> wiring.Envelope:
        seen = await self._glance(link, 2)
        if not seen.pictures:
            raise TransportError(seen.refused or "no picture of the loop was taken")
        bounds = wiring.envelope(self.loop, seen.pictures[-1], step=wishes.mout_step, pv=wishes.pv_band)
        return replace(bounds, pv_rate_max=wishes.pv_rate_max, answer_ns=wishes.answer_ns, total_ns=wishes.total_ns)

    async def _as_left(self, link: Link) -> None:
        seen = await self._glance(link, 1)
        if seen.pictures:
            self.progress.facts["as_left"] = operands(self.loop, seen.pictures[-1])
        path = journal_path(self._gates, self.station, self.loop)
        if path.exists():
            # Also what another command wrote: whatever stands before this hash cannot be changed any more.
            self.progress.facts["journal"] = {"file": str(path), "hash": verify(path).last}
        self._keep()

    async def _glance(self, link: Link, executions: int) -> observe.Observation:
        return await observe.observe(
            self.station, self.loop, link, self._clock, executions=executions, duration_ns=5 * SECOND,
            sees=self._witness.see,
        )  # fmt: skip

    def _gate(self, link: Link) -> Gate:
        return Gate(
            self.station, self.loop, link, self._clock, self._gates, who=self._who,
            sees=self._witness.see, told=self._witness.told,
        )  # fmt: skip

    async def _guarded(self, name: str, work: Any) -> list[Check]:
        try:
            found: list[Check] = await work
        except AhGatewayError as error:
            return [unclear(name, error.message)]
        return found

    def _done(self, step: Step, checks: Sequence[Check], said: Said) -> None:
        self.progress.take(step, checks, self._clock.utc_ns())
        self._keep()
        said(step, checks)

    def _keep(self) -> None:
        if self._path is not None:
            save(self.progress, self._path)


def operands(loop: Loop, picture: Picture) -> dict[str, Any]:
    """Return every operand of a picture as JSON holds it: value and words, the instruction's memory by words alone."""
    found: dict[str, Any] = {"utc_ns": picture.utc_ns, "values": {}, "words": {}}
    for row in loop.controller.operands:
        words = picture.words[row.name]
        found["words"][row.name] = list(words)
        if row.kind is not Kind.BLOCK:
            found["values"][row.name] = number(decode(row.kind, words))
    return found
