"""What a loop's divergences have in common: every suspect is a rival law with its own shadow, held to what follows.

This file alone decides which causes still stand after several executions. One execution rarely tells two causes apart:
last bits agree by chance, and a written integral looks like a wrong sum. So the law that a suspect describes is
stepped along beside the reference, from the state before the first divergence, with what it would remember itself. It
must reproduce every later execution, those that the reference reproduces too; a size that is estimated must be the
same each time, and its interval shrinks to what all executions allow.

Theory of operation: rivals that keep missing are dropped. What happens once (somebody writes, a mode changes) is no
law and is counted instead. When nothing explains most of the divergences, the cause is unknown.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from ahgateway.codec.station import Loop
from ahgateway.core.controllers.delta_terms import ticks_per_second
from ahgateway.core.real import REAL
from ahgateway.core.verdict import Verdict, Weight
from ahgateway.lockstep.causes import FORM_BITS, sized_again
from ahgateway.lockstep.counting import is_known, led, reproduced
from ahgateway.lockstep.judge import Execution
from ahgateway.lockstep.picture import Picture
from ahgateway.lockstep.reads import input_variants
from ahgateway.lockstep.shadow import Bound, Fit, Shadow, apart, explain, judged_names, merged, patched, recalled
from ahgateway.lockstep.suspects import Estimate, Key, Suspect, agreeing, scaled, stretched
from ahgateway.lockstep.unseen import lingered

RIVALS_MAX = 32
SHARE_MIN = 0.85
"""A rival that explains less of what it was shown is dropped: corners of a law cost a persistent cause a few."""

CREDIBLE_MIN = 8
"""A suspect that the first divergence did not name must explain so many others: last bits agree by chance."""

ESTIMATES_MAX = 64
"""After so many estimates an interval is narrow enough to be only checked."""

PROVEN_MIN = 20
"""After so many informative matches a dialect that no longer fits was changed: it had been right."""

ONCE = frozenset(
    {
        "operand-written",
        "mode-change",
        "stale-pv",
        "clamp",
        "missed-execution",
        "torn-picture",
        "rounding",
        "integral",
    }
)
"""Causes that can be a single event, so that later executions do not speak against them."""

CLOCK = "ts_source = "
"""An interval that is measured shows itself in I_MV alone, also where no shadow of the rest can follow it."""

ROUNDING_RATIO = 1e-3
"""A factor nearer to 1 than this is not told from rounding where last bits alone differ."""

ORDERS = frozenset(
    {
        "bias_joins",
        "dependent_sum",
        "derivative_product",
        "preset_order",
        "product",
        "ratio",
        "sum_order",
        "ts_scale",
    }
)
"""Axes that say in which order to compute: another value leaves other last bits, as any other rounding does."""

ORDER_SURE = 8
"""So many divergences an order has to explain, all of them, before it is more likely than rounding of another kind."""

RATIO_NEAR = 1e-4
"""Two factors this near are one: the memory of the filter is not known better."""

GRID = 2.0**-23
"""A factor lies between two REALs of the operand; two of its intervals may miss by one."""

NOT_LEARNED = "; nothing has agreed yet: the dialect is not learned, run `ahgateway identify PROFILE --save PROFILE`"

REPEATED_MIN = 3
"""From so many on, a written integral is a wrong sum."""


class Rival:
    """One suspect's law, stepped along beside the PLC.

    Attributes:
        suspect: The suspect, with the interval that all executions so far allow.
        explained: Divergences that it reproduces.
        missed: Executions that it does not reproduce.
    """

    def __init__(self, loop: Loop, suspect: Suspect, before: Picture, after: Picture, most: int) -> None:
        assert suspect.twist is not None
        self.suspect = suspect
        self.explained = 1
        self.missed = 0
        self._shown = 1
        self._was_blind = False
        self._ref = loop
        self._loop = suspect.twist(loop)
        self._shadow = self._behind(suspect, before, after, most)

    def _behind(self, named: Suspect, before: Picture, after: Picture, most: int) -> Shadow:
        """What its law can remember behind an execution, or several, that it was named for."""
        fit: Fit = named.fit
        if most > 1:
            return merged(each.after for each in reproduced(self._loop, (fit.before,), before, after, most))
        every = []
        for form in (0, *FORM_BITS.values()) if hasattr(fit.before.low, "form1") else (0,):
            start = Bound(*(end._replace(form1=end.form1 ^ form) if form else end for end in fit.before))
            every.append(explain(self._loop, (start,), [fit.inputs], after.seen, judged_names(self._ref)))
            if every[-1].fits:
                return patched(self._loop, every[-1].fits[0], after.seen)
        # A size that is not known to the last bit fits nowhere: then no form was misread.
        return () if every[0].nearest is None else patched(self._loop, every[0].nearest, after.seen)

    @property
    def is_standing(self) -> bool:
        """True while it explains what it is shown."""
        return self._shown * SHARE_MIN <= self._shown - self.missed

    def named_again(self, named: Suspect, before: Picture, after: Picture, most: int) -> None:
        """An execution that it could not be held against, because it remembered nothing, is explained by it too."""
        if self._was_blind:
            self._shown += 1
            self.explained += 1
            self._shadow = self._behind(named, before, after, most) or self._shadow

    @property
    def shadow(self) -> Shadow:
        """What the PLC remembers if this suspect is right."""
        return self._shadow

    def sees(self, before: Picture, after: Picture, *, has_diverged: bool, most: int = 1) -> None:
        """Hold it against the next execution, or against several, when there can have been `most`."""
        self._was_blind = not self._shadow
        if most > 1:
            self._sees_several(before, after, has_diverged, most)
            return
        variants = input_variants(self._ref, before, after)
        if not self._shadow:
            self._shadow = recalled(self._loop, (after.inputs, before.inputs), after.seen)
            return
        found = explain(self._loop, self._shadow, variants, after.seen, judged_names(self._ref))
        fit = found.fits[0] if found.fits else found.nearest
        assert fit is not None
        is_it = bool(found.fits)
        if self.suspect.estimate is not None and self.suspect.estimate.value:
            is_it = self._measured(fit, before, after) or is_it
        if is_it and found.fits:
            self._shadow = merged(each.after for each in found.fits)
        else:
            self._shadow = patched(self._loop, fit, after.seen)
        self._shown += 1
        self.missed += not is_it
        self.explained += is_it and has_diverged

    def _sees_several(self, before: Picture, after: Picture, has_diverged: bool, most: int) -> None:
        """Some number of executions must reproduce the words; a size is estimated on each run there can have been."""
        if not self._shadow:
            self._shadow = recalled(self._loop, (after.inputs, before.inputs), after.seen)
            return
        found = reproduced(self._loop, self._shadow, before, after, most)
        is_it = bool(found)
        if not is_it and self.suspect.estimate is not None and self.suspect.estimate.value:
            for fit in led(self._loop, apart(self._shadow)[0], before, after, most):
                if self._measured(fit, before, after):
                    found = reproduced(self._loop, self._shadow, before, after, most) or [fit]
                    is_it = True
                    break
        self._shadow = merged(bound for fit in found for bound in patched(self._loop, fit, after.seen))
        self._shown += 1
        self.missed += not is_it
        self.explained += is_it and has_diverged

    def rests(self, before: Picture, after: Picture, most: int) -> None:
        """Go on through up to `most` executions that changed no word: what is hidden may have moved."""
        if self._loop.controller.law_ts is not None and ticks_per_second(self._loop.dialect):
            # Where Ts is measured each tick of the clock is a memory of its own: too many to go on with.
            return
        self._shadow = lingered(self._loop, self._shadow, before, after, most)

    def explains(self, before: Picture, after: Picture, most: int) -> bool:
        """Tell whether up to `most` executions by its law leave the words of the second picture."""
        return bool(self._shadow and reproduced(self._loop, self._shadow, before, after, most))

    def pass_on(self, change: Callable[[Shadow], Shadow]) -> None:
        """Something happened to what the instruction remembers, whatever that is."""
        self._shadow = change(self._shadow)

    def forget(self) -> None:
        """What it remembers is no longer known."""
        self._shadow = ()

    def _measured(self, fit: Fit, before: Picture, after: Picture) -> bool:
        """Estimate the size anew and keep what both allow; tell whether anything is left."""
        if self._shown > ESTIMATES_MAX:
            return False
        fresh = sized_again(self._ref, fit, before, after, self.suspect)
        if fresh is None or fresh.estimate is None or self.suspect.estimate is None:
            return False
        common = _common(self.suspect, fresh)
        if common is None:
            return False
        self.suspect = common
        assert common.twist is not None
        self._loop = common.twist(self._ref)
        return True


class Inquiry:
    """Every divergence of one loop, and what still explains them.

    Attributes:
        suspects: Causes that stand, likeliest first; () as long as nothing diverged.
    """

    def __init__(self, loop: Loop) -> None:
        self.suspects: tuple[Suspect, ...] = ()
        self._loop = loop
        self._rivals: list[Rival] = []
        self._seen: Counter[Key] = Counter()
        self._named: dict[Key, Suspect] = {}
        self._diverged = 0
        self._proven_before = 0
        self._proven = 0

    def hear(self, execution: Execution, before: Picture, after: Picture, most: int = 1) -> Execution:
        """Take in a judged execution, one of at most so many; return it with its causes as they stand now."""
        is_led = most > 1 and self._loop.controller.begin is None and is_known(self._loop, before, after)
        if execution.blame is None:
            self._proven += execution.weight is Weight.INFORMATIVE
            if not self._diverged:
                self._proven_before += execution.weight is Weight.INFORMATIVE
            elif is_led or (most <= 1 and execution.count == 1 and execution.terms is not None):
                self._show(before, after, has_diverged=False, most=most)
                self.suspects = self._standing()
            elif most > 1 or execution.verdict is Verdict.UNOBSERVABLE:
                self.forget()
            return execution
        self._diverged += 1
        if self._loop.controller.begin is not None or (most > 1 and not is_led):
            self.forget()
            self.suspects = (
                agreeing(self.suspects, execution.blame.suspects) or self.suspects or execution.blame.suspects
            )
            return execution
        self._show(before, after, has_diverged=True, most=most)
        self._admit(execution.blame.suspects, before, after, most)
        self.suspects = self._standing()
        return replace(execution, blame=replace(execution.blame, suspects=self._ordered(execution.blame.suspects)))

    def rests(self, before: Picture, after: Picture, most: int) -> None:
        """No word changed between two pictures, in which there can have been so many executions."""
        for rival in self._rivals:
            rival.rests(before, after, most)

    def explains(self, before: Picture, after: Picture, most: int) -> bool:
        """Tell whether the likeliest cause, a law, leaves what stands behind up to so many executions."""
        likely = self.suspects[0].key if self.suspects else None
        return any(rival.suspect.key == likely and rival.explains(before, after, most) for rival in self._rivals)

    def pass_on(self, change: Callable[[Shadow], Shadow]) -> None:
        """Something happened to what the instruction remembers, whoever is right."""
        for rival in self._rivals:
            rival.pass_on(change)

    def forget(self) -> None:
        """Executions went by unseen: what the rivals remember is open."""
        for rival in self._rivals:
            rival.forget()

    @property
    def hidden(self) -> Shadow:
        """What the PLC remembers by the likeliest cause; () when no law stands."""
        if self.suspects:
            for rival in self._rivals:
                if rival.suspect.key == self.suspects[0].key:
                    return apart(rival.shadow)[0]
        return ()

    def _show(self, before: Picture, after: Picture, *, has_diverged: bool, most: int) -> None:
        for rival in self._rivals:
            rival.sees(before, after, has_diverged=has_diverged, most=most)
        self._rivals = [rival for rival in self._rivals if rival.is_standing]

    def _admit(self, named: tuple[Suspect, ...], before: Picture, after: Picture, most: int) -> None:
        known = {rival.suspect.key: rival for rival in self._rivals}
        for suspect in named:
            self._seen[suspect.key] += 1
            self._named[suspect.key] = suspect
            if suspect.key in known:
                known[suspect.key].named_again(suspect, before, after, most)
            elif suspect.twist is not None and len(self._rivals) < RIVALS_MAX:
                self._rivals.append(Rival(self._loop, suspect, before, after, most))

    def _standing(self) -> tuple[Suspect, ...]:
        """Laws that explain the divergences, then events that explain most of them, else the unknown."""
        total = self._diverged
        laws = [rival for rival in self._rivals if rival.explained >= min(CREDIBLE_MIN, SHARE_MIN * total)]
        laws.sort(key=lambda rival: rival.missed)
        known = {rival.suspect.key for rival in laws}
        events = [key for key, count in self._seen.items() if self._is_event(key, count) and key not in known]
        events.sort(key=lambda key: (total >= REPEATED_MIN and key[0] == "operand-written", -self._seen[key]))
        # What an event explains by bits each time stands before a law of which a size has to be fitted, or an order,
        # until one fits twice: two writes that happen to follow one factor are not to be expected.
        is_fitted = all((_is_order(each) or each.suspect.estimate is not None) and each.explained < 2 for each in laws)
        early = total < REPEATED_MIN and is_fitted
        first = [
            key
            for key in events
            if (early and self._seen[key] == total and key[0] in ONCE) or self._is_rounding(key, laws)
        ]
        rest = [key for key in events if key not in first]
        found = (
            *(self._named[key] for key in first),
            *(self._dated(rival.suspect) for rival in laws),
            *(self._named[key] for key in rest),
        )
        if found:
            return found
        text = "no single change of an operand, mode or dialect reproduces"
        what = "what the PLC wrote" if total == 1 else f"most of these {total} divergences"
        is_new = not self._proven and self._loop.controller.law_ts is not None
        return (Suspect("unknown", f"{text} {what}{NOT_LEARNED if is_new else ''}"),)

    def _is_event(self, key: Key, count: int) -> bool:
        """Tell whether this happens once and again and explains most; a picture is not torn every time."""
        if key[0] == "torn-picture" and self._diverged >= REPEATED_MIN:
            return False
        is_clock = key[2].startswith(CLOCK)
        return (key[0] in ONCE or is_clock) and 2 * count >= self._diverged

    def _is_rounding(self, key: Key, laws: list[Rival]) -> bool:
        """Tell whether last bits alone differ: a law that misses some, or is nearly the reference's, is rounding."""
        if key[0] != "rounding" or self._seen[key] < SHARE_MIN * self._diverged:
            return False
        return all(each.missed or _is_near(each) for each in laws)

    def _dated(self, suspect: Suspect) -> Suspect:
        """A dialect that was right for long has been changed."""
        if suspect.cause != "dialect" or self._proven_before < PROVEN_MIN:
            return suspect
        evidence = f"{suspect.evidence} since then; {self._proven_before} executions before were proven without it"
        return replace(suspect, cause="firmware-change", evidence=evidence)

    def _ordered(self, suspects: tuple[Suspect, ...]) -> tuple[Suspect, ...]:
        """An execution's own suspects, those that stand for all of them first."""
        own = {suspect.key for suspect in suspects}
        first = tuple(each for each in self.suspects if each.key in own or each.cause == "unknown")
        keys = {each.key for each in first}
        return (*first, *(each for each in suspects if each.key not in keys and each.cause != "unknown")) or suspects


def _is_near(rival: Rival) -> bool:
    """Tell whether a law is hardly another than the reference's: in a size by its last digits, or in an order."""
    if rival.suspect.estimate is not None:
        return abs(rival.suspect.ratio - 1.0) < ROUNDING_RATIO
    return _is_order(rival) and rival.explained < ORDER_SURE


def _is_order(rival: Rival) -> bool:
    return rival.suspect.setting.partition(" = ")[0] in ORDERS


def _common(known: Suspect, fresh: Suspect) -> Suspect | None:
    """One suspect with the factors that both allow; an exact estimate outweighs a fitted one. None for no factor."""
    old, new = known.estimate, fresh.estimate
    assert old is not None
    assert new is not None
    left, right = _factors(known), _factors(fresh)
    low, high = max(left[0], right[0]), min(left[1], right[1])
    is_empty = low > high * (1.0 + GRID)
    if not is_empty and old.is_exact != new.is_exact:
        return known if old.is_exact else fresh
    if is_empty:
        # They miss by the rounding of a fit, or by what an earlier, coarser size has left in D's filter.
        if abs(known.ratio - fresh.ratio) > RATIO_NEAR:
            return None
        is_fitted = not (old.is_exact and new.is_exact)
        return known if is_fitted else _within(known, fresh)
    ratio = (low + high) / 2.0
    held = new.value / fresh.ratio
    # Ends that miss by one REAL are each other's.
    value, smallest, largest = (float(REAL(held * each)) for each in (ratio, *sorted((low, high))))
    estimate = Estimate(value, smallest, largest, new.unit, old.is_exact and new.is_exact)
    if fresh.cause == "cycle":
        evidence = f"an interval of {estimate.text()} s instead of CYCLE's {held:.6g} s ({ratio - 1:+.3%})"
        twist = stretched(ratio)
    else:
        evidence = f"{fresh.operand} acts as {estimate.text()}, its register holds {held:.7g} ({ratio - 1:+.3%})"
        twist = scaled(_attr(fresh.operand), ratio)
    return replace(fresh, evidence=evidence, ratio=ratio, estimate=estimate, twist=twist)


def _within(known: Suspect, fresh: Suspect) -> Suspect:
    """The fresh one, with an interval that holds both and is no longer claimed by bits."""
    assert fresh.estimate is not None
    held = fresh.estimate.value / fresh.ratio
    (left, right), (low, high) = _factors(known), _factors(fresh)
    smallest, largest = (float(REAL(held * each)) for each in (min(left, low), max(right, high)))
    return replace(fresh, estimate=replace(fresh.estimate, low=smallest, high=largest, is_exact=False))


def _factors(suspect: Suspect) -> tuple[float, float]:
    estimate: Any = suspect.estimate
    held = estimate.value / suspect.ratio
    return estimate.low / held, estimate.high / held


def _attr(operand: str) -> str:
    return operand.lower()
