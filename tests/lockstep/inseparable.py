"""What a run of the fault catalogue cannot show, proven on the run itself with nothing but the law.

Two laws that leave the same bits at every execution of a PLC, the unseen ones included, are told apart by no recording
of it; and a picture that the right law can have left convicts nobody.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any

from lockstep.bench_world import World
from lockstep.oracle import Oracle

from ahgateway.codec.station import Loop
from ahgateway.core.dialect import CrossBand, CrossScan
from ahgateway.core.real import REAL, bits, from_order, order, quiet
from ahgateway.fake.program import Execution
from ahgateway.lockstep.picture import Picture, predicted
from ahgateway.lockstep.suspects import Suspect, scaled, stretched

SIZES_MAX = 256
"""So many REALs of an estimate's interval are tried."""


def leaves_the_same(loop: Loop, suspect: Suspect, log: Sequence[Execution]) -> bool:
    """Tell whether the loop's law with this cause in it, of one size, leaves every word of the log by bits."""
    return any(_replays(each, log) for each in _twisted(loop, suspect, log[0]))


def _twisted(loop: Loop, suspect: Suspect, first: Execution) -> Iterator[Loop]:
    if suspect.twist is None:
        return
    if suspect.estimate is None or not suspect.estimate.value:
        yield suspect.twist(loop)
        return
    low, high = order(REAL(suspect.estimate.low)), order(REAL(suspect.estimate.high))
    held = suspect.estimate.value / suspect.ratio
    for position in range(low, high + 1, max(1, (high - low) // SIZES_MAX)):
        ratio = float(from_order(position)) / held
        twist = stretched(ratio) if suspect.cause == "cycle" else scaled(suspect.operand.lower(), ratio)
        yield twist(loop)


def _replays(loop: Loop, log: Sequence[Execution]) -> bool:
    law, state = loop.controller, log[0].before
    shown = [word.attr for word in law.seen if hasattr(state, word.attr)]
    for entry in log:
        # What stands in the PLC's memory may have been written meanwhile; what is hidden is the law's own.
        state = state._replace(**{name: getattr(entry.before, name) for name in shown})
        with quiet(all="ignore"):
            state, terms = law.step(entry.inputs, state, loop.dialect, entry.ts)
        ours, theirs = predicted(law, state, terms), predicted(law, entry.state, entry.terms)
        if any(bits(ours[name]) != bits(theirs[name]) for name in ours):
            return False
    return True


def is_possible(world: World, looks: Sequence[Picture]) -> bool:
    """Tell whether the right law can have left every one of these pictures, from the state behind the first of them.

    Enumerated: so many executions between two pictures as time allows, none included, and any moment of a write.
    """
    first = looks[0]
    log = [entry for entry in world.plc.log("L1") if entry.time_ns <= first.last_ns]
    oracle = Oracle(world.loop)
    oracle.states = {_as_shown(world.loop, log[-1].state, first)}
    for before, after in pairwise(looks):
        span_ns = after.last_ns - before.sent_ns
        apart_ns = round(float(world.loop.controller.nominal_ts(after.inputs)) * 1e9)
        if not oracle.follows(before, after, 1 + span_ns // apart_ns):
            return False
    return True


def may_have_crossed(loop: Loop, log: Sequence[Execution]) -> bool:
    """Tell whether the right law leaves every execution of a log, with the cross status one way or the other.

    Where the dialect looks scan by scan whether PV passes SV, nothing that a PLC shows of executions says which it was.
    """
    law, dialect = loop.controller, loop.dialect
    is_hidden = dialect.cross_scan == CrossScan.EACH_SCAN and dialect.cross_band == CrossBand.ZERO_CROSS
    if not is_hidden or not hasattr(law.state(), "cross"):
        return False
    for entry in log:
        theirs = predicted(law, entry.state, entry.terms)
        with quiet(all="ignore"):
            steps = [
                law.step(entry.inputs, entry.before._replace(cross=cross), dialect, entry.ts) for cross in (False, True)
            ]
        ours = [predicted(law, *step) for step in steps]
        if not any(all(bits(each[name]) == bits(theirs[name]) for name in theirs) for each in ours):
            return False
    return True


def _as_shown(loop: Loop, state: Any, picture: Picture) -> Any:
    shown = {word.attr: picture.seen[word.name] for word in loop.controller.seen if hasattr(state, word.attr)}
    return state._replace(**shown)
