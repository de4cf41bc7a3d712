"""Why an execution left the reference: hypotheses about the PLC, each tried on the same execution.

This file alone names causes. A cause is named when the law, changed in just this way, reproduces what the PLC wrote.
Causes that one execution cannot tell apart are all named, likeliest first; the loop's later executions thin them out.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import isfinite, log
from typing import Any

from ahgateway.codec.station import Loop
from ahgateway.core.controllers import Controller
from ahgateway.core.dialect import AXES
from ahgateway.core.operands import Kind
from ahgateway.core.real import REAL, quiet, same_bits, ulp_distance
from ahgateway.lockstep.picture import Picture, predicted
from ahgateway.lockstep.shadow import Fit, judged_names, same_words

RATIO_MIN, RATIO_MAX = 0.2, 5.0
"""A gain that would have to be wrong by more than this explains nothing."""

ULP_SLACK = 16
"""How far a fitted gain may miss, in ULP of the larger of MV and its terms: the fit itself is rounded."""


RATIO_SPREAD = 2e-3
"""Estimates of one cause from two executions agree within this."""


@dataclass(frozen=True, slots=True)
class Suspect:
    """One possible cause.

    Attributes:
        cause: Its name, `gain`, `direction`, `integral` …
        evidence: What speaks for it, one sentence with numbers.
        operand: The operand that it concerns, or nothing.
        ratio: By which factor that operand acts, 1.0 when it is not a matter of size.
    """

    cause: str
    evidence: str
    operand: str = ""
    ratio: float = 1.0


@dataclass(frozen=True, slots=True)
class Blame:
    """Where and why an execution left the reference.

    Attributes:
        term: The first term that left: PV, P, I, D, MV or MOUT.
        plc: Its value on the PLC; computed back from MV where the PLC does not show it.
        ref: Its value in the reference.
        suspects: Possible causes, likeliest first; never empty.
    """

    term: str
    plc: REAL
    ref: REAL
    suspects: tuple[Suspect, ...]

    @property
    def cause(self) -> str:
        """The likeliest cause."""
        return self.suspects[0].cause


@dataclass(frozen=True, slots=True)
class _Case:
    """One diverged execution as the hypotheses see it."""

    loop: Loop
    fit: Fit
    before: Picture
    after: Picture
    names: tuple[str, ...]

    @property
    def controller(self) -> Controller:
        return self.loop.controller

    @property
    def seen(self) -> Mapping[str, REAL]:
        return self.after.seen

    def run(self, inputs: Any = None, dialect: Any = None, ts: REAL | None = None) -> tuple[dict[str, REAL], Any]:
        """Step the law with something changed; return the words it leaves, and its terms."""
        read = self.fit.inputs if inputs is None else inputs
        span = self._span(read, dialect) if ts is None else ts
        with quiet(all="ignore"):
            state, terms = self.controller.step(read, self.fit.before.low, dialect or self.loop.dialect, span)
        return predicted(self.controller, state, terms), terms

    def _span(self, read: Any, dialect: Any) -> REAL:
        """Ts of a hypothesis: as this execution had it, or from CYCLE where that alone decides."""
        chosen = dialect or self.loop.dialect
        is_measured = self.controller.law_ts is not None and chosen.ts_source
        if is_measured and self.fit.ts is not None:
            return self.fit.ts
        return self.controller.ts(read, chosen)

    def reproduces(self, words: Mapping[str, REAL]) -> bool:
        return same_words(self.names, words, self.seen)


def blame(loop: Loop, fit: Fit, before: Picture, after: Picture) -> Blame:
    """Say which term left first, and what reproduces what the PLC wrote."""
    case = _Case(loop, fit, before, after, judged_names(loop))
    suspects = [suspect for hypothesis in HYPOTHESES for suspect in hypothesis(case)]
    if not suspects:
        suspects = [Suspect("unknown", "no single change of an operand, mode or dialect reproduces what the PLC wrote")]
    term, plc, ref = _first_term(case, suspects[0])
    return Blame(term, plc, ref, tuple(suspects))


def agreeing(known: tuple[Suspect, ...], fresh: tuple[Suspect, ...]) -> tuple[Suspect, ...]:
    """Keep the fresh suspects that the known ones name too, with the same size; all of them when none are known."""
    if not known:
        return fresh
    return tuple(
        suspect
        for suspect in fresh
        if any(
            (suspect.cause, suspect.operand) == (other.cause, other.operand)
            and abs(suspect.ratio - other.ratio) <= RATIO_SPREAD * max(suspect.ratio, other.ratio)
            for other in known
        )
    )


def _first_term(case: _Case, suspect: Suspect) -> tuple[str, REAL, REAL]:
    """The first term of the law that left: what the block shows, and behind that what MV gives away."""
    ref, terms = case.run()
    wrong = [name for name in case.names if not same_bits(ref[name], case.seen[name])]
    by_attr = {word.name: word.attr for word in case.controller.seen}
    if any(by_attr[name] == "pv1" for name in wrong):
        name = next(name for name in wrong if by_attr[name] == "pv1")
        return "PV", case.seen[name], ref[name]
    if suspect.operand and suspect.cause == "gain":
        for term in ("p", "i", "d"):
            changed = _scaled(case, suspect.operand, suspect.ratio)
            value, before = getattr(changed, term), getattr(terms, term)
            if not same_bits(value, before):
                if term == "i":
                    return "I", case.seen["I_MV"], ref["I_MV"]
                return term.upper(), _from_mv(case, terms, term), before
    if "I_MV" in wrong:
        return "I", case.seen["I_MV"], ref["I_MV"]
    if "MV" in wrong:
        return "MV", case.seen["MV"], ref["MV"]
    return "MOUT", case.seen["MOUT"], ref["MOUT"]


def _from_mv(case: _Case, terms: Any, term: str) -> REAL:
    """Compute a term of the PLC back from its MV and I_MV and the reference's other terms."""
    rest = float(case.seen["I_MV"]) + float(getattr(terms, "bias", 0.0))
    rest += sum(float(getattr(terms, other)) for other in ("p", "d") if other != term)
    return REAL(float(case.seen["MV"]) - rest)


def _scaled(case: _Case, operand: str, ratio: float) -> Any:
    attr = case.controller.operand(operand).attr
    value = REAL(float(getattr(case.fit.inputs, attr)) * ratio)
    return case.run(case.fit.inputs._replace(**{attr: value}))[1]


def _other_modes(case: _Case) -> list[Suspect]:
    """A switch that the instruction saw the other way round."""
    found = []
    for attr, cause, what in (
        ("pid_dir", "direction", "PID_DIR acts the other way round: E has the opposite sign"),
        ("pid_man", "mode-change", "the instruction was in {}, its PID_MAN reads otherwise"),
        ("pid_run", "mode-change", "PID_RUN acts the other way round"),
        ("pid_de", "dialect", "D acts on {} although PID_DE says otherwise"),
        ("pid_eq", "dialect", "the other form of PID_EQ is computed"),
    ):
        if not hasattr(case.fit.inputs, attr):
            continue
        value = not getattr(case.fit.inputs, attr)
        if case.reproduces(case.run(case.fit.inputs._replace(**{attr: value}))[0]):
            filled = {"pid_man": "manual" if value else "automatic", "pid_de": "PV" if value else "E"}
            found.append(Suspect(cause, what.format(filled.get(attr, "")), attr.upper()))
    return found


def _stale_pv(case: _Case) -> list[Suspect]:
    """The PV of an earlier execution was used."""
    names = tuple(name for name in case.names if name not in _pv_names(case))
    for pv, text in ((case.fit.before.low.pv1, "the PV of the execution before"), (case.before.inputs.pv, "an old PV")):
        words, _ = case.run(case.fit.inputs._replace(pv=pv))
        if same_words(names, words, case.seen) and not same_bits(pv, case.fit.inputs.pv):
            evidence = f"{text}, {float(pv):g}, reproduces MV; the block records {float(case.fit.inputs.pv):g}"
            return [Suspect("stale-pv", evidence, "PV")]
    return []


def _pv_names(case: _Case) -> set[str]:
    return {word.name for word in case.controller.seen if word.attr == "pv1"}


def _other_dialect(case: _Case) -> list[Suspect]:
    """The law under another value of one axis."""
    found = []
    for axis, values in AXES.items():
        for value in values:
            if value == getattr(case.loop.dialect, axis):
                continue
            other: Any = {axis: value}
            words, _ = case.run(dialect=case.loop.dialect._replace(**other))
            if case.reproduces(words):
                found.append(Suspect("dialect", f"{axis} = {value.name.lower()} reproduces it"))
    return found


def _beyond_limits(case: _Case) -> list[Suspect]:
    inputs, mv = case.fit.inputs, float(case.seen["MV"])
    low, high = sorted((float(inputs.mv_min), float(inputs.mv_max)))
    if low <= mv <= high or (not inputs.pid_run and mv == 0.0):
        return []
    return [Suspect("clamp", f"MV is {mv:g}, outside its limits {low:g} to {high:g}", "MV")]


def _gains(case: _Case) -> list[Suspect]:
    """A gain that acts with another size than its register shows; the smallest change first."""
    found = []
    for operand in case.controller.operands:
        if operand.kind is Kind.REAL and operand.minimum == 0:
            found.extend(_gain(case, operand.name, operand.attr))
    ts = case.controller.ts(case.fit.inputs, case.loop.dialect) if case.fit.ts is None else case.fit.ts
    cycle = _fitted(case, lambda ratio: case.run(ts=REAL(float(ts) * ratio))[0])
    if cycle is not None:
        evidence = f"an interval of {float(ts) * cycle:.6g} s instead of CYCLE's {float(ts):.6g} s ({cycle - 1:+.3%})"
        found.append(Suspect("cycle", evidence, "CYCLE", cycle))
    return sorted(found, key=lambda suspect: abs(log(suspect.ratio)))


def _gain(case: _Case, name: str, attr: str) -> list[Suspect]:
    value = float(getattr(case.fit.inputs, attr))
    if not isfinite(value) or value <= 0.0:
        return []

    def words(ratio: float) -> dict[str, REAL]:
        return case.run(case.fit.inputs._replace(**{attr: REAL(value * ratio)}))[0]

    ratio = _fitted(case, words)
    if ratio is None:
        return []
    evidence = f"{name} acts as {value * ratio:.7g}, its register holds {value:.7g} ({ratio - 1:+.3%})"
    return [Suspect("gain", evidence, name, ratio)]


def _fitted(case: _Case, words: Callable[[float], dict[str, REAL]]) -> float | None:
    """Solve for the factor under which the law leaves what the PLC wrote; None when no factor does.

    The law is linear in each gain between its branches, so a secant finds the factor; Tf needs a few rounds.
    """
    ratio = 1.0
    ref = words(1.0)
    name = max(("I_MV", "MV"), key=lambda word: _miss(case, ref, word))
    target = float(case.seen[name])
    for _ in range(6):
        here, there = float(words(ratio)[name]), float(words(ratio * 1.0078125)[name])
        slope = (there - here) / (ratio * 0.0078125)
        if not isfinite(slope) or slope == 0.0:
            return None
        ratio += (target - here) / slope
        if not isfinite(ratio) or not RATIO_MIN < ratio < RATIO_MAX:
            return None
    final = words(ratio)
    return ratio if all(_miss(case, final, word) <= ULP_SLACK for word in ("I_MV", "MV")) and ratio != 1.0 else None


def _miss(case: _Case, words: Mapping[str, REAL], name: str) -> float:
    """Distance of a word from what the PLC wrote, in ULP of the larger of the two and MV's biggest term."""
    scale = max(abs(float(words["I_MV"])), abs(float(words["MV"])), abs(float(case.seen[name])), 1e-30)
    return abs(float(words[name]) - float(case.seen[name])) / (scale * 2.0**-23)


def _overwritten(case: _Case) -> list[Suspect]:
    """Only MV changed while the recorded PV and the integral stand still: nothing was executed."""
    others = [name for name in case.names if name != "MV"]
    stood_still = same_words(others, case.before.seen, case.after.seen)
    if not stood_still or same_words(others, case.run()[0], case.seen):
        return []
    old, new = float(case.before.seen["MV"]), float(case.seen["MV"])
    return [Suspect("operand-written", f"MV went from {old:g} to {new:g} without an execution", "MV")]


def _integral(case: _Case) -> list[Suspect]:
    """MV follows from the integral that is shown, but that integral does not follow from the one before."""
    ref, terms = case.run()
    if same_bits(ref["I_MV"], case.seen["I_MV"]):
        return []
    rest_plc = float(case.seen["MV"]) - float(case.seen["I_MV"])
    rest_ref = float(terms.raw) - float(terms.i)
    scale = max(abs(float(case.seen["MV"])), abs(float(case.seen["I_MV"])), 1e-30)
    mv_fits = abs(rest_plc - rest_ref) <= 4 * scale * 2.0**-23
    mv_is_ref = same_bits(ref["MV"], case.seen["MV"])
    if not (mv_fits or mv_is_ref):
        return []
    distance = ulp_distance(case.seen["I_MV"], ref["I_MV"])
    evidence = f"MV agrees with the integral in I_MV, which is {distance} ULP away from the reference's"
    return [Suspect("operand-written", evidence, "I_MV"), Suspect("integral", evidence, "I_MV")]


HYPOTHESES: tuple[Callable[[_Case], list[Suspect]], ...] = (
    _overwritten,
    _other_modes,
    _stale_pv,
    _other_dialect,
    _beyond_limits,
    _gains,
    _integral,
)
"""Tried in this order; exact ones stand before fitted ones."""
