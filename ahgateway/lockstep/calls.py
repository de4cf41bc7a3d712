"""Follows one block that is called again and again: how many calls lie between two pictures, and what each is worth.

This file alone judges PID_REG_CE, PID_Temp and MELSEC PID. It claims nothing unless exactly one call lies between two
pictures, what that call read is known, and the block's memory is known. Whatever cannot be known is UNOBSERVABLE, and
the shadow waits for a place where it can start again.

Theory of operation: a counter in the PLC tells the number of calls. Without one, a call shows itself by a changed
value; calls that change nothing may have happened wherever time allows one, and the shadow keeps both possibilities.
An EN contact that was seen off for longer than a scan makes the next execution start afresh.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from copy import copy
from dataclasses import replace
from typing import Any

from ahgateway.clock import MILLISECOND
from ahgateway.codec.station import Loop
from ahgateway.codec.ways import COUNTS
from ahgateway.core import flags as flag
from ahgateway.core.compare import compare, weakest
from ahgateway.core.verdict import Proof, Verdict, Weight
from ahgateway.lockstep.call_causes import blame_call
from ahgateway.lockstep.call_shadow import (
    explain,
    fed_back,
    flat,
    key_of,
    lingered,
    may_be_written,
    merged,
    names_for,
    reads,
    rejoined,
    started,
    stepped,
)
from ahgateway.lockstep.events import Change
from ahgateway.lockstep.judge import OPEN_STATE, Execution
from ahgateway.lockstep.picture import Picture, predicted
from ahgateway.lockstep.shadow import Fit, Shadow, judged_names

TRIVIAL_FLAGS = flag.MANUAL | flag.STOPPED | flag.BAD_INPUT | flag.AUTOTUNE | flag.FROZEN

SEVERAL = "more than one call lay between two pictures; poll faster than the calls"
TUNING = "a tuner of which no law is known is at work"
PV_OPEN = "what the call read as PV is not known: its register may move at any time; see `pv_held` in the profile"
AFRESH = "the first execution after the contact turned on shows from which value it started"


class Calls:
    """What is known of one block, from picture to picture.

    Attributes:
        missed: The prediction nearest to the last call that none fitted.
    """

    def __init__(self, loop: Loop, *, blames: bool = True) -> None:
        self.loop = loop
        self._blames = blames
        self.missed: Fit | None = None
        self._is_apart = False
        self._shadow: Shadow = ()
        self._earliest_ns: int | None = None
        self._off_since_ns: int | None = None

    def read_as(self, dialect: Any) -> Calls:
        """Return the same block, with what is known of it, read in another dialect; this one stays as it is."""
        other = copy(self)
        other.loop = replace(self.loop, dialect=dialect)
        return other

    def known(self) -> Hashable:
        """What is known, as something to compare."""
        bounds = frozenset(
            tuple((key_of(low), key_of(high)) for (_, low), (_, high) in zip(flat(b.low), flat(b.high), strict=True))
            for b in self._shadow
        )
        return bounds, self._earliest_ns, self._off_since_ns, self._is_apart

    def forget(self) -> None:
        """Pictures were lost: nothing is known any more."""
        self._shadow = ()
        self._earliest_ns = None
        self._off_since_ns = None

    def see(self, before: Picture | None, after: Picture, interval_ns: int) -> list[Execution | Change]:
        """Take the next picture and return what happened since the one before.

        Args:
            before: The picture before; None when there is none.
            after: The picture.
            interval_ns: Nominal time between two calls.
        """
        if before is None:
            return []
        if after.running is False:
            return []
        if after.enabled is False:
            return self._off(before, after)
        if before.enabled is not False:
            self._off_since_ns = None
        calls = self._counted(before, after)
        names = judged_names(self.loop)
        moved = {name for name in names if key_of(before.seen[name]) != key_of(after.seen[name])}
        if calls == 0 or (calls is None and not moved):
            return self._still(before, after, moved, interval_ns, is_counted=calls == 0)
        if calls is None and moved <= self.loop.controller.roles.writable and self._is_written(before, after):
            return self._written(before, after, moved)
        most = calls if calls is not None else max(1, self._calls_max(before, after, interval_ns))
        execution = self._judged(before, after, most)
        self._earliest_ns = before.sent_ns
        return [execution]

    def rests(self, before: Picture, after: Picture) -> bool:
        """Tell whether a call now would change nothing that can be seen."""
        return bool(explain(self.loop, self._shadow, reads(self.loop, before, after), after.seen).fits)

    def _counted(self, before: Picture, after: Picture) -> int | None:
        if before.count is None or after.count is None:
            return None
        return (after.count - before.count) % COUNTS

    def _off(self, before: Picture, after: Picture) -> list[Execution | Change]:
        """The contact is off: the next execution starts afresh, once a scan has surely seen it off."""
        fresh = started(self.loop, None, after, one_call=False)
        if self._off_since_ns is None:
            self._off_since_ns = after.last_ns
            self._shadow = merged((*self._shadow, *fresh)) if self._shadow else ()
        elif after.sent_ns - self._off_since_ns > self.loop.scan_ms_max * MILLISECOND:
            self._shadow = fresh
        self._earliest_ns = None
        return self._changes(before, after, set(judged_names(self.loop)))

    def _changes(self, before: Picture, after: Picture, names: set[str]) -> list[Execution | Change]:
        return [
            Change(name, before.seen[name], after.seen[name])
            for name in sorted(names)
            if key_of(before.seen[name]) != key_of(after.seen[name])
        ]

    def _still(
        self, before: Picture, after: Picture, moved: set[str], interval_ns: int, *, is_counted: bool
    ) -> list[Execution | Change]:
        """No call shows itself: nothing happened, or calls that changed nothing."""
        if moved:
            return self._written(before, after, moved)
        possible = 0 if is_counted else self._calls_max(before, after, interval_ns)
        if possible and self._shadow:
            self._shadow = lingered(self.loop, self._shadow, before, after, possible)
        return []

    def _is_written(self, before: Picture, after: Picture) -> bool:
        return not explain(self.loop, self._shadow, reads(self.loop, before, after), after.seen).fits

    def _written(self, before: Picture, after: Picture, moved: set[str]) -> list[Execution | Change]:
        """Somebody wrote what the block writes, without a call: it goes on from there where it reads it."""
        writable = moved & self.loop.controller.roles.writable
        shown = {name: after.seen[name] for name in writable}
        if shown:
            self._shadow = merged(rejoined(self.loop, bound.low, shown) for bound in self._shadow)
        return self._changes(before, after, moved)

    def _calls_max(self, before: Picture, after: Picture, interval_ns: int) -> int:
        """How many calls fit between the first request of one picture and the last reply of the next."""
        apart = max(interval_ns - self.loop.scan_ms_max * MILLISECOND, interval_ns // 2)
        start = before.sent_ns
        if self._earliest_ns is not None:
            start = max(start, self._earliest_ns + apart)
        return 0 if after.last_ns < start else 1 + (after.last_ns - start) // apart

    def _judged(self, before: Picture, after: Picture, calls: int) -> Execution:
        loop = self.loop
        if loop.controller.tunes(after.inputs, after.seen) or loop.controller.tunes(before.inputs, before.seen):
            self._shadow = ()
            return Execution(Verdict.UNOBSERVABLE, reason=TUNING, inputs=after.inputs, count=calls)

        def fresh() -> Shadow:
            return started(loop, before, after, one_call=calls == 1)

        variants = reads(loop, before, after)
        reason = ""
        if calls > 1:
            reason = SEVERAL
        elif not variants:
            reason = PV_OPEN
        elif not self._shadow:
            reason = f"what the block remembers is hidden: it is {loop.controller.roles.starts}"
        if reason:
            self._shadow = fresh()
            return Execution(Verdict.UNOBSERVABLE, reason=reason, inputs=after.inputs, count=calls)
        found = explain(loop, self._shadow, variants, after.seen)
        if found.fits:
            self._is_apart = False
            self._shadow = merged(fit.after for fit in found.fits) or fresh()
            return self._agreed(found.fits[0], before, after, is_decided=found.is_decided)
        nearest = found.nearest
        assert nearest is not None
        self.missed = nearest
        afresh = [bound for bound in self._shadow if not bound.low.valid] if fed_back(loop) else []
        if afresh:
            reached = [stepped(loop, inputs, bound)[0].low for inputs in variants for bound in afresh]
            self._shadow = merged(rejoined(loop, state, after.seen) for state in reached)
            return Execution(Verdict.UNOBSERVABLE, reason=AFRESH, terms=nearest.terms, inputs=nearest.inputs)
        # Without a counter the value may have been written by somebody, and no call at all have happened.
        kept = self._shadow if may_be_written(loop, before, after) and not self._is_apart else ()
        self._is_apart = True
        self._shadow = merged((rejoined(loop, nearest.after.low, after.seen), *fresh(), *kept))
        proof = self._proof(nearest, after.seen)
        if proof is not None:
            reason = f"agrees by {proof.value} only; the tolerance of the profile allows it"
            weight = self._weigh(nearest.terms, before, after)
            return Execution(Verdict.MATCH, proof, weight, reason, nearest.terms, inputs=nearest.inputs)
        blame = blame_call(loop, nearest, before, after) if self._blames else None
        return Execution(Verdict.DIVERGED, terms=nearest.terms, inputs=nearest.inputs, blame=blame)

    def _agreed(self, fit: Fit, before: Picture, after: Picture, *, is_decided: bool) -> Execution:
        open_terms = fit.open_terms
        if not is_decided:
            return Execution(
                Verdict.UNOBSERVABLE, reason=OPEN_STATE, terms=fit.terms, open_terms=open_terms, inputs=fit.inputs
            )
        weight = self._weigh(fit.terms, before, after)
        return Execution(Verdict.MATCH, Proof.BITS, weight, terms=fit.terms, open_terms=open_terms, inputs=fit.inputs)

    def _weigh(self, terms: Any, before: Picture, after: Picture) -> Weight:
        """Tell what a match is worth: another law would have left the same where nothing was computed."""
        if terms.flags & TRIVIAL_FLAGS:
            return Weight.TRIVIAL
        computed = self.loop.controller.roles.computed
        still = all(key_of(before.seen[name]) == key_of(after.seen[name]) for name in computed if name in after.seen)
        return Weight.TRIVIAL if still else Weight.INFORMATIVE

    def _proof(self, fit: Fit, seen: Mapping[str, Any]) -> Proof | None:
        """The strongest proof within the tolerances; whole numbers and switches agree or do not."""
        ref = predicted(self.loop.controller, fit.after.low, fit.terms)
        limits = self.loop.tolerance
        outputs = {self.loop.controller.roles.mv, self.loop.controller.roles.integral}
        proofs: list[Proof | None] = []
        for name in names_for(self.loop, fit.before):
            a, b = seen[name], ref[name]
            if hasattr(a, "dtype"):
                proofs.append(compare(a, b, limits.ulp_max, limits.mv_max if name in outputs else 0.0))
            elif name in outputs and a != b and abs(a - b) <= limits.mv_max:
                proofs.append(Proof.TOLERANCE)
            else:
                proofs.append(Proof.BITS if a == b else None)
        return weakest(tuple(proofs))
