"""From what was seen of a scenario to its expectations: each met, violated or unknown, with its figure.

Figures of a response are taken within its window; the step of SV is what SV differs by between the picture before the
window and the end of it. Overshoot counts beyond the new SV, in % of the step; settling is when PV last lay outside
the band.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any

from ahgateway.apps.check.result import Outcome, State
from ahgateway.apps.check.watch import Moment, Seen
from ahgateway.clock import SECOND
from ahgateway.core.real import same_bits
from ahgateway.core.verdict import Exit, Proof, Verdict, outcome, reason
from ahgateway.lockstep.follow import computes, cycle_ns
from ahgateway.schema.formula import holds
from ahgateway.schema.scenario import ExpectForm, ResponseForm, Scenario

PROVEN = (Proof.BITS, None)


def judged(scenario: Scenario, seen: Seen) -> tuple[Outcome, ...]:
    """Return every expectation of a scenario with what became of it, in the order of the file."""
    expect = scenario.expect
    found = list(_shadow(expect, seen))
    if expect.bumpless is not None:
        found.append(_bumpless(expect.bumpless.within, seen))
    if expect.clamps:
        found.append(_clamps(seen))
    if expect.quiet_in_band:
        found.append(_quiet(seen))
    if expect.fresh_pv:
        found.append(_fresh_pv(seen))
    if expect.recovery is not None:
        found.append(_recovery(expect.recovery, seen))
    for number, window in enumerate(expect.response):
        found.extend(_response(f"response.{number}", window, seen, scenario.duration_s))
    return tuple(found)


def _shadow(expect: ExpectForm, seen: Seen) -> Iterator[Outcome]:
    """Agreement of PLC and reference, and how much of it was proven."""
    if expect.shadow == "none":
        return
    diverged = _first_diverged(seen)
    claim = outcome(seen.counts, 0.0)
    if diverged is not None:
        moment, execution = diverged
        assert execution.blame is not None
        text = f"{seen.counts.diverged} executions diverged, first at {moment.t_s:.2f} s: {execution.blame.term}"
        text += f" plc {float(execution.blame.plc):.9g}, ref {float(execution.blame.ref):.9g}, {execution.blame.cause}"
        yield Outcome("shadow", State.VIOLATED, text, float(seen.counts.diverged), moment.t_s)
    elif claim is Exit.PASS and not (expect.shadow == "bits" and seen.counts.ulp + seen.counts.tolerance):
        yield Outcome("shadow", State.MET, reason(seen.counts, 0.0), 0.0)
    else:
        yield Outcome("shadow", State.UNKNOWN, reason(seen.counts, 0.0), 0.0)
    if expect.coverage > 0.0:
        is_enough = seen.counts.coverage >= expect.coverage
        text = f"{seen.counts.coverage:.1%} of the executions proven by bits, asked for {expect.coverage:.1%}"
        yield Outcome("coverage", State.MET if is_enough else State.UNKNOWN, text, seen.counts.coverage)


def _first_diverged(seen: Seen) -> tuple[Moment, Any] | None:
    for moment in seen.moments:
        for execution in moment.executions:
            if execution.verdict is Verdict.DIVERGED:
                return moment, execution
    return None


def _bumpless(within: float, seen: Seen) -> Outcome:
    """Behind each transfer from manual: MV of the first execution in automatic against MV in manual."""
    worst, at_s, count = 0.0, None, 0
    manual: float | None = None
    for before, after in pairwise(seen.moments):
        if before.picture.inputs.pid_man and not after.picture.inputs.pid_man:
            manual = before.mv
        if after.picture.inputs.pid_man:
            manual = None
        if manual is not None and after.executions:
            moved = abs(after.mv - manual)
            count, manual = count + 1, None
            if not moved <= worst:
                worst, at_s = moved, after.t_s
    if not count:
        return Outcome("bumpless", State.UNKNOWN, "no transfer from manual to automatic was seen")
    text = f"MV moved by at most {worst:.4g} over {count} transfers, allowed {within:g}"
    return Outcome("bumpless", _state(worst <= within), text, worst, at_s)


def _clamps(seen: Seen) -> Outcome:
    """MV within its limits wherever the instruction computes and has had the time to."""
    worst, at_s, count = 0.0, None, 0
    for before, after in pairwise(seen.moments):
        inputs = after.picture.inputs
        if not after.executions or inputs != before.picture.inputs._replace(pv=inputs.pv, mout=inputs.mout):
            continue
        if not computes(seen.loop, after.picture):
            continue
        low, high = sorted((float(inputs.mv_min), float(inputs.mv_max)))
        beyond = max(low - after.mv, after.mv - high)
        count += 1
        if not beyond <= worst:
            worst, at_s = beyond, after.t_s
    if not count:
        return Outcome("clamps", State.UNKNOWN, "no execution was seen that computed an MV")
    text = f"MV left its limits by {worst:.4g} over {count} executions"
    return Outcome("clamps", _state(not worst > 0.0), text, worst, at_s)


def _quiet(seen: Seen) -> Outcome:
    """MV once the error counts as 0: from the third execution inside the band, for DPIDE inside and past SV."""
    worst, at_s, executed, rested = 0.0, None, 0, 0
    last: float | None = None
    crosses = hasattr(seen.loop.controller.inputs(), "tf")
    side, is_crossed = 0.0, not crosses
    for moment in seen.moments:
        error = _error_in_band(seen, moment)
        if error is None:
            executed, last, side, is_crossed = 0, None, 0.0, not crosses
            continue
        is_crossed = is_crossed or side * error < 0.0
        side = error
        executed += len(moment.executions) if is_crossed else 0
        # What brought PV into the band, D above all, dies away first.
        if executed < QUIET_AFTER:
            continue
        mv = moment.mv
        if last is not None and not abs(mv - last) <= worst:
            worst, at_s = abs(mv - last), moment.t_s
        last = mv
        rested += len(moment.executions)
    if rested < QUIET_AFTER:
        return Outcome("quiet_in_band", State.UNKNOWN, "PV did not rest inside the dead band")
    return Outcome(
        "quiet_in_band", _state(not worst > 0.0), f"MV moved by {worst:.4g} inside the dead band", worst, at_s
    )


def _error_in_band(seen: Seen, moment: Moment) -> float | None:
    """SV - PV where it lies inside the dead band in automatic, else None."""
    inputs = moment.picture.inputs
    if not computes(seen.loop, moment.picture) or inputs.pid_man:
        return None
    error = float(inputs.sv) - float(inputs.pv)
    return error if abs(error) < abs(float(inputs.err_dbw)) else None


QUIET_AFTER = 3
"""Executions inside the band before MV must stand still: one may have used the PV before, one brings D to rest."""


def _fresh_pv(seen: Seen) -> Outcome:
    """PV as the instruction recorded it against the register of the same scan, where the scan before held another."""
    names = [word.name for word in seen.loop.controller.seen if word.attr == "pv1"]
    late, at_s, count = 0, None, 0
    for before, after in pairwise(seen.moments):
        inputs = after.picture.inputs
        if not after.executions or inputs.pid_man or not computes(seen.loop, after.picture):
            continue
        if same_bits(before.picture.inputs.pv, inputs.pv):
            continue
        count += 1
        if not same_bits(after.picture.seen[names[0]], inputs.pv):
            late, at_s = late + 1, after.t_s if at_s is None else at_s
    if not count:
        return Outcome("fresh_pv", State.UNKNOWN, "no execution was seen for which PV had just changed")
    text = f"{late} of {count} executions used another PV than that of their scan"
    return Outcome("fresh_pv", _state(not late), text, float(late), at_s)


def _recovery(allowed_s: float, seen: Seen) -> Outcome:
    """From the link's return to the next execution that matched by bits; the worst of all returns."""
    if not seen.link_up_s:
        return Outcome("recovery", State.UNKNOWN, "the link did not come back")
    worst = 0.0
    for up_s in seen.link_up_s:
        proven = [moment.t_s for moment in seen.moments if moment.t_s >= up_s and _is_proven(moment)]
        if not proven:
            text = f"nothing was proven behind the link's return at {up_s:.2f} s"
            return Outcome("recovery", State.UNKNOWN, text)
        worst = max(worst, proven[0] - up_s)
    text = f"{worst:.2f} s to the first execution proven, allowed {allowed_s:g} s"
    return Outcome("recovery", _state(worst <= allowed_s), text, worst, seen.link_up_s[0])


def _is_proven(moment: Moment) -> bool:
    return any(each.verdict is Verdict.MATCH and each.proof in PROVEN for each in moment.executions)


def _response(name: str, window: ResponseForm, seen: Seen, duration_s: float) -> Iterator[Outcome]:
    end_s = duration_s if window.before is None else window.before
    inside = [each for each in seen.moments if window.after <= each.t_s <= end_s]
    earlier = [each for each in seen.moments if each.t_s < window.after]
    asked = [key for key in FIGURES if getattr(window, key) is not None]
    if not inside or inside[-1].t_s < end_s - _unseen_max_s(seen, window.after, end_s):
        for key in asked:
            yield Outcome(f"{name}.{key.rstrip('_')}", State.UNKNOWN, "the window was not seen to its end")
        return
    first = earlier[-1] if earlier else inside[0]
    for key in asked:
        yield FIGURES[key](f"{name}.{key.rstrip('_')}", window, first, inside)


def _unseen_max_s(seen: Seen, after_s: float, end_s: float) -> float:
    """How much of a window's end may be missing: a tenth, or the CYCLE in which the next picture would have come."""
    return max(0.1 * (end_s - after_s), cycle_ns(seen.loop, seen.moments[-1].picture) / SECOND)


def _step_of(first: Moment, inside: Sequence[Moment]) -> float:
    return inside[-1].sv - first.sv


def _errors(inside: Sequence[Moment]) -> list[tuple[float, float]]:
    """Times, and PV - SV at them."""
    return [(each.t_s, each.pv - each.sv) for each in inside]


def _overshoot(name: str, window: ResponseForm, first: Moment, inside: Sequence[Moment]) -> Outcome:
    step = _step_of(first, inside)
    if step == 0.0:
        return Outcome(name, State.UNKNOWN, "SV made no step in the window")
    beyond, at_s = max((error / step, t) for t, error in _errors(inside))
    percent = max(0.0, 100.0 * beyond)
    assert window.overshoot is not None
    text = f"{percent:.3g} % of a step of {step:g}, allowed {window.overshoot:g} %"
    return Outcome(name, _state(percent <= window.overshoot), text, percent, at_s)


def _settling(name: str, window: ResponseForm, first: Moment, inside: Sequence[Moment]) -> Outcome:
    step = _step_of(first, inside)
    if step == 0.0:
        return Outcome(name, State.UNKNOWN, "SV made no step in the window")
    band = abs(step) * window.band / 100.0
    outside = [t for t, error in _errors(inside) if not abs(error) <= band]
    settled_s = (outside[-1] if outside else window.after) - window.after
    assert window.settling is not None
    is_settled = not outside or outside[-1] < inside[-1].t_s
    text = f"PV stays within ±{band:.3g} after {settled_s:.3g} s, allowed {window.settling:g} s"
    if not is_settled:
        text = f"PV lies outside ±{band:.3g} at the end of the window, {settled_s:.3g} s behind the step"
    return Outcome(name, _state(is_settled and settled_s <= window.settling), text, settled_s, inside[-1].t_s)


def _iae(name: str, window: ResponseForm, first: Moment, inside: Sequence[Moment]) -> Outcome:
    errors = _errors(inside)
    total = sum(abs(error) * (later - t) for (t, error), (later, _) in pairwise(errors))
    assert window.iae is not None
    text = f"integral of |SV - PV| is {total:.4g}, allowed {window.iae:g}"
    return Outcome(name, _state(total <= window.iae), text, total, inside[-1].t_s)


def _steady(name: str, window: ResponseForm, first: Moment, inside: Sequence[Moment]) -> Outcome:
    errors = [abs(error) for _, error in _errors(inside)][-max(1, len(inside) // 5) :]
    mean = sum(errors) / len(errors)
    assert window.steady_error is not None
    text = f"mean |SV - PV| at the end is {mean:.4g}, allowed {window.steady_error:g}"
    return Outcome(name, _state(mean <= window.steady_error), text, mean, inside[-1].t_s)


def _direction(name: str, window: ResponseForm, first: Moment, inside: Sequence[Moment]) -> Outcome:
    start = first.mv
    moved = next((each for each in inside if each.mv != start), None)
    if moved is None:
        return Outcome(name, State.UNKNOWN, f"MV stood still at {start:g}")
    way = "up" if moved.mv > start else "down"
    text = f"MV went {way} from {start:.5g} to {moved.mv:.5g}, wanted is {window.direction}"
    return Outcome(name, _state(way == window.direction), text, None, moved.t_s)


def _values(moment: Moment) -> dict[str, float | bool]:
    inputs, seen = moment.picture.inputs, moment.picture.seen
    found: dict[str, float | bool] = {
        name.upper(): value if isinstance(value, bool) else float(value) for name, value in inputs._asdict().items()
    }
    return found | {name.upper(): float(value) for name, value in seen.items()} | {"T": moment.t_s}


def _always(name: str, window: ResponseForm, first: Moment, inside: Sequence[Moment]) -> Outcome:
    assert window.always is not None
    for each in inside:
        if not _holds(window.always, each):
            return Outcome(name, State.VIOLATED, f"`{window.always}` does not hold at {each.t_s:.2f} s", None, each.t_s)
    return Outcome(name, State.MET, f"`{window.always}` holds at {len(inside)} moments")


def _finally(name: str, window: ResponseForm, first: Moment, inside: Sequence[Moment]) -> Outcome:
    assert window.finally_ is not None
    last = inside[-1]
    is_met = _holds(window.finally_, last)
    text = f"`{window.finally_}` {'holds' if is_met else 'does not hold'} at {last.t_s:.2f} s"
    return Outcome(name, _state(is_met), text, None, last.t_s)


class _AnyCase(dict[str, Any]):
    """Values by the manual's spelling, whatever its case."""

    def __missing__(self, key: str) -> Any:
        return self[key.upper()] if key != key.upper() else math.nan


def _holds(text: str, moment: Moment) -> bool:
    return holds(text, _AnyCase(_values(moment)))


FIGURES = {
    "overshoot": _overshoot,
    "settling": _settling,
    "iae": _iae,
    "steady_error": _steady,
    "direction": _direction,
    "always": _always,
    "finally_": _finally,
}
"""Figure of a response to what measures it."""


def _state(is_met: bool) -> State:
    return State.MET if is_met else State.VIOLATED
