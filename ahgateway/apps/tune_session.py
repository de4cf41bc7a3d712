"""One sitting at one loop: experiments, what each says, and the gains that are tried in the end; one gate for all."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ahgateway.apps.tune import Tuning, named
from ahgateway.apps.tune_apply import Trial, Verification
from ahgateway.apps.tune_autotune import judged
from ahgateway.apps.tune_experiment import Experiment, Wanted
from ahgateway.apps.tune_sitting import Envelope
from ahgateway.apps.tune_spread import middle
from ahgateway.apps.witness import Witness
from ahgateway.clock import Clock
from ahgateway.codec.station import Loop, Station
from ahgateway.errors import AhGatewayError
from ahgateway.lockstep.gate.gate import Gate
from ahgateway.lockstep.gate.place import Place
from ahgateway.lockstep.picture import Sampler
from ahgateway.transports.base import Link
from ahgateway.tuning.blocks import Params
from ahgateway.tuning.record import Record

Judge = Callable[[Record, str, Params], Tuning]


@dataclass(frozen=True, slots=True)
class Gains:
    """What is tried: a rule's gains, with a step of SV in PV held for some time on each side; None is sized."""

    rule: str
    size: float | None = None
    hold_s: float | None = None


@dataclass(frozen=True, slots=True)
class Live:
    """What came of it.

    Attributes:
        result: The one that speaks for all.
        repeats: Every experiment's.
        record: The trace behind `result`; None where no experiment was made.
        proof: What became of the gains; None when none were tried.
        preview: What would be written, where nothing was.
        error: Why the gains were refused or aborted; what the experiments found stands all the same.
    """

    result: Tuning
    repeats: tuple[Tuning, ...]
    record: Record | None = None
    proof: Verification | None = None
    preview: tuple[str, ...] = ()
    error: AhGatewayError | None = None


class Session:
    """A link, a loop and its gate, for as long as the command takes.

    Args:
        station: The PLC.
        loop: The loop.
        link: The way there.
        clock: Time.
        folder: Where journal and lease stand.
        bounds: Within what everything stays.
        who: Who asks, for the journal.
        told: Called with a line of text whenever something begins or ends.
        witness: Keeps what is seen and written.
    """

    def __init__(
        self, station: Station, loop: Loop, link: Link, clock: Clock, folder: Place, bounds: Envelope, *,
        who: str = "", told: Callable[[str], None] = lambda text: None, witness: Witness | None = None,
    ) -> None:  # fmt: skip
        witness = witness or Witness(loop, None)
        self.loop, self.bounds, self._clock, self._told = loop, bounds, clock, told
        self.gate = Gate(station, loop, link, clock, folder, who=who, sees=witness.see, told=witness.told)
        self._sampler = Sampler(loop, station, link, clock, witness.see)

    async def excited(self, wanted: Wanted, judge: Judge, repeat: int = 1, gains: Gains | None = None) -> Live:
        """Make the experiment, as often as asked, judge each, and try gains of the one in the middle.

        Raises:
            StateError: Aborted; everything has been put back.
        """
        made = []
        for count in range(repeat):
            # The first must find the loop at rest; the others wait until it is again.
            experiment = Experiment(**self._parts(), patience_s=self.bounds.time_s if count else 0.0)
            record, settings = await experiment.run(wanted)
            result = await asyncio.to_thread(judge, record, self.loop.controller.name, settings)
            if experiment.brought:
                result = judged(result, settings, experiment.brought)
            made.append((record, result))
        results = tuple(result for _, result in made)
        record, result = made[middle(results)]
        if gains is None or result.is_refused:
            return Live(result, results, record)
        try:
            return Live(result, results, record, await self.tried(result, gains))
        except AhGatewayError as error:
            return Live(result, results, record, error=error)

    async def tried(self, result: Tuning, gains: Gains) -> Verification:
        """Try gains, once the loop stands still.

        Raises:
            ProfileError: No such proposal.
            StateError: Refused; or aborted, and everything has been put back.
        """
        trial = Trial(**self._parts(), patience_s=self.bounds.time_s)
        return await trial.apply(result, gains.rule, gains.size, gains.hold_s)

    async def previewed(self, result: Tuning, rule: str) -> Live:
        """Say what trying would write now; reads only."""
        plan = await Trial(**self._parts()).dry_run(result, named(result, rule))
        return Live(result, (result,), preview=tuple(plan.lines))

    def _parts(self) -> dict[str, Any]:
        return {
            "loop": self.loop, "gate": self.gate, "sampler": self._sampler, "clock": self._clock,
            "envelope": self.bounds, "told": self._told,
        }  # fmt: skip
