"""Why an execution left the reference: hypotheses about the PLC, each tried on the same execution.

This file alone names causes of one execution. A cause is named when the law, changed in just this way, reproduces
what the PLC wrote. Causes that one execution cannot tell apart are all named, likeliest first; `inquiry` holds them
against the loop's other executions.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from math import inf, isfinite, log
from typing import Any

from ahgateway.codec.station import Loop
from ahgateway.core.controllers import Controller
from ahgateway.core.controllers.delta import ZERO, gain
from ahgateway.core.dialect import AXES, FilterContent, TsSource
from ahgateway.core.dialect_axes import BY_NAME
from ahgateway.core.operands import Kind
from ahgateway.core.real import REAL, bits, from_order, order, quiet, same_bits, ulp_distance
from ahgateway.lockstep.estimate import Size, sized
from ahgateway.lockstep.interval import unlimited
from ahgateway.lockstep.picture import Picture, predicted
from ahgateway.lockstep.shadow import Fit, Shadow, explain, is_settled, judged_names, same_words
from ahgateway.lockstep.suspects import (
    Blame,
    Estimate,
    Key,
    Suspect,
    Twist,
    doubled,
    flipped,
    in_dialect,
    scaled,
    stretched,
    zeroed,
)
from ahgateway.lockstep.unseen import advanced

HALF = 0xFFFF
NEIGHBOURS = 8
"""Rounding of an integral computed back is no more than this many REALs away."""

ROUNDED_ULP = 8
"""Further than this from the reference, in ULP of the largest term, rounding alone does not carry a sum."""

PAIRS_MAX = 12

FORM_BITS = {"pid_dir": 1, "pid_eq": 2, "pid_de": 4}
"""Of what Delta's instructions remember of the execution before; see `dpide.form_of`."""

MEASURED_MIN, MEASURED_MAX = 0.5, 2.0
"""A measured interval is CYCLE but for scans; outside of this it is another cause."""


class _Noticing:
    """A dialect that notes which of its axes were read."""

    __slots__ = ("_dialect", "read")

    def __init__(self, dialect: Any) -> None:
        self._dialect = dialect
        self.read: set[str] = set()

    def __getattr__(self, name: str) -> Any:
        self.read.add(name)
        return getattr(self._dialect, name)


@dataclass(frozen=True, slots=True)
class _Case:
    """One diverged execution as the hypotheses see it."""

    loop: Loop
    fit: Fit
    before: Picture
    after: Picture
    names: tuple[str, ...]
    wanted: frozenset[Key] = frozenset()

    def asks(self, cause: str, operand: str = "", setting: str = "") -> bool:
        """Tell whether this cause is wanted; all are where none is named."""
        return not self.wanted or (cause, operand, setting) in self.wanted

    @property
    def controller(self) -> Controller:
        return self.loop.controller

    @property
    def seen(self) -> Mapping[str, REAL]:
        return self.after.seen

    def run(
        self, inputs: Any = None, dialect: Any = None, ts: REAL | None = None, state: Any = None
    ) -> tuple[dict[str, REAL], Any]:
        """Step the law with something changed; return the words it leaves, and its terms."""
        read = self.fit.inputs if inputs is None else inputs
        chosen, reached = dialect or self.loop.dialect, state or self.fit.before.low
        with quiet(all="ignore"):
            for each in (*self._led(read), read):
                span = self.span(each, dialect) if ts is None else ts
                reached, terms = self.controller.step(each, reached, chosen, span)
        return predicted(self.controller, reached, terms), terms

    def _led(self, read: Any) -> list[Any]:
        """What the unseen executions before it read, with the same operands changed."""
        if not self.fit.lead:
            return []
        changes = {
            name: new for name, new, old in zip(read._fields, read, self.fit.inputs, strict=True) if new is not old
        }
        return [each._replace(**changes) for each in self.fit.lead]

    def span(self, read: Any, dialect: Any) -> REAL:
        """Ts of a hypothesis: as this execution had it, or from CYCLE where that alone decides."""
        chosen = dialect or self.loop.dialect
        is_measured = self.controller.law_ts is not None and chosen.ts_source
        if is_measured and self.fit.ts is not None:
            return self.fit.ts
        return self.controller.ts(read, chosen)

    def on_grid(self, inputs: Any, source: TsSource, ticks: int) -> REAL:
        """I_MV behind a step whose Ts is so many ticks of a clock."""
        measuring = self.loop.dialect._replace(ts_source=source)
        ts = self.controller.ts(inputs, measuring, ticks)
        return self.run(inputs, measuring, ts)[0]["I_MV"]

    def reproduces(self, words: Mapping[str, REAL]) -> bool:
        return same_words(self.names, words, self.seen)

    def axes_read(self) -> frozenset[str]:
        """Axes of the dialect that the law reads here: another value of any other one changes nothing."""
        if not is_settled(self.fit.before):
            return frozenset(AXES)
        noticing: Any = _Noticing(self.loop.dialect)
        self.run(dialect=noticing)
        return frozenset(noticing.read)

    def holds(self, twist: Twist, form: int = 0) -> bool:
        """Tell whether the law with this in it leaves what the PLC wrote, from a state that may be open.

        With `form`, bits of the form in which the execution before is remembered, those were misread too.
        """
        other = twist(self.loop)
        if is_settled(self.fit.before):
            low = self._left(other, self.fit.before.low, form)
            if self.fit.before.is_point or self.reproduces(low):
                return self.reproduces(low)
            # What lies between two ends so near leaves what lies between their words.
            high = self._left(other, self.fit.before.high, form)
            return all(is_between(self.seen[name], low[name], high[name]) for name in self.names)
        if other.controller.seen != self.controller.seen:
            # Another place for a word was not read as such: nothing can be said of it.
            return False
        shadow: Shadow = (self.fit.before,)
        for read in self.fit.lead:
            shadow = advanced(other, shadow, read)
        return bool(shadow and explain(other, shadow, [self.fit.inputs], self.seen, self.names).fits)

    def _left(self, other: Loop, state: Any, form: int) -> dict[str, REAL]:
        """The words that another law leaves, from one state."""
        state = state._replace(form1=state.form1 ^ form) if form else state
        with quiet(all="ignore"):
            for read in (*self.fit.lead, self.fit.inputs):
                state, terms = other.controller.step(read, state, other.dialect, self.span(read, other.dialect))
        return predicted(self.controller, state, terms)


def is_between(seen: REAL, one: REAL, other: REAL) -> bool:
    """Tell whether a word lies between two others or is one of them."""
    low, high = sorted((order(one), order(other)))
    return low <= order(seen) <= high


def blame(loop: Loop, fit: Fit, before: Picture, after: Picture, known: tuple[Suspect, ...] = ()) -> Blame:
    """Say which term left first, and what reproduces what the PLC wrote; see `blame_any`."""
    return blame_any(loop, (fit,), before, after, known)


def blame_any(
    loop: Loop, fits: Sequence[Fit], before: Picture, after: Picture, known: tuple[Suspect, ...] = ()
) -> Blame:
    """As `blame`, where it is not known how many executions there were: any of these may be it.

    Args:
        loop: The loop.
        fits: The executions as the reference came closest to them, likeliest first; at least one.
        before: Picture before.
        after: Picture behind.
        known: Only these causes are asked for, where any are given; trying all costs a hundred times as much.
    """
    wanted = frozenset(each.key for each in known)
    cases = [_Case(loop, fit, before, after, judged_names(loop), wanted) for fit in fits]
    found: dict[Key, tuple[Suspect, _Case]] = {}
    for hypothesis in HYPOTHESES:
        named = [(suspect, case) for case in cases for suspect in hypothesis(case)]
        for suspect, case in sorted(named, key=lambda each: _rank(each[0])) if len(cases) > 1 else named:
            found.setdefault(suspect.key, (suspect, case))
    case = cases[0]
    if is_settled(case.fit.before) and not case.fit.lead and all(each.twist is None for each, _ in found.values()):
        found.update({suspect.key: (suspect, case) for suspect in _two_axes(case)})
    suspects = tuple(replace(suspect, fit=each.fit) for suspect, each in found.values())
    if found:
        _, case = next(iter(found.values()))
    else:
        suspects = (
            Suspect("unknown", "no single change of an operand, mode or dialect reproduces what the PLC wrote"),
        )
    term, plc, ref = _first_term(case, suspects[0])
    return Blame(term, plc, ref, suspects, case.fit)


def _rank(suspect: Suspect) -> tuple[bool, float]:
    """Exact sizes first, then the smallest change."""
    is_fitted = suspect.estimate is not None and not suspect.estimate.is_exact
    return is_fitted, abs(log(suspect.ratio)) if suspect.ratio > 0.0 else 0.0


def sized_again(loop: Loop, fit: Fit, before: Picture, after: Picture, suspect: Suspect) -> Suspect | None:
    """Estimate a suspect of size on another execution; None when no size of it explains that one."""
    case = _Case(loop, fit, before, after, judged_names(loop))
    if suspect.cause == "cycle":
        return _cycle(case, is_carried=True)
    return _gain(case, suspect.operand, case.controller.operand(suspect.operand).attr, is_carried=True)


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
        if not hasattr(case.fit.inputs, attr) or not case.asks(cause, attr.upper()):
            continue
        value = not getattr(case.fit.inputs, attr)
        form = FORM_BITS.get(attr, 0) if hasattr(case.fit.before.low, "form1") else 0
        if case.holds(flipped(attr)) or (form and case.holds(flipped(attr), form)):
            filled = {"pid_man": "manual" if value else "automatic", "pid_de": "PV" if value else "E"}
            found.append(Suspect(cause, what.format(filled.get(attr, "")), attr.upper(), twist=flipped(attr)))
    return found


def _stale_pv(case: _Case) -> list[Suspect]:
    """The PV of an earlier execution was used."""
    if not case.asks("stale-pv", "PV"):
        return []
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
    # From a state that is open each value costs a search, and only a transfer is worth it: its integral hides nothing.
    is_open = not is_settled(case.fit.before)
    read = case.axes_read()
    for axis, values in AXES.items():
        if axis not in read or (is_open and BY_NAME[axis].group != "transfer"):
            continue
        for value in values:
            setting = f"{axis} = {value.name.lower()}"
            if value == getattr(case.loop.dialect, axis) or not case.asks("dialect", "", setting):
                continue
            other: Any = {axis: value}
            if case.holds(in_dialect(**other)):
                found.append(Suspect("dialect", f"{setting} reproduces it", setting=setting, twist=in_dialect(**other)))
    return found


def _without(case: _Case) -> list[Suspect]:
    """An operand that the instruction does not see at all."""
    found = []
    for row in case.controller.operands:
        if row.kind is not Kind.REAL or row.name in ("SV", "PV", "MV", "MOUT", "MV_MAX", "MV_MIN"):
            continue
        held = getattr(case.fit.inputs, row.attr)
        if held == 0 or not case.asks("gain", row.name, "off") or not case.holds(zeroed(row.attr)):
            continue
        estimate = Estimate(0.0, 0.0, 0.0, row.unit, True)
        evidence = f"{row.name} acts as 0, its register holds {float(held):.7g}"
        twist = zeroed(row.attr)
        found.append(Suspect("gain", evidence, row.name, 0.0, "off", estimate, twist))
    return found


def _twice(case: _Case) -> list[Suspect]:
    """Two executions where the schedule allows one."""
    if not case.asks("missed-execution"):
        return []
    if case.fit.lead:
        evidence = "two executions each time reproduce it where the schedule allows one"
        return [Suspect("missed-execution", evidence, twist=doubled())] if case.holds(doubled()) else []
    firsts = {bits(pv): pv for pv in (case.fit.inputs.pv, case.before.inputs.pv, case.after.inputs.pv)}
    span = case.span(case.fit.inputs, None)
    for pv in firsts.values():
        with quiet(all="ignore"):
            read = case.fit.inputs._replace(pv=pv)
            once, _ = case.controller.step(read, case.fit.before.low, case.loop.dialect, span)
            twice, terms = case.controller.step(case.fit.inputs, once, case.loop.dialect, span)
        if case.reproduces(predicted(case.controller, twice, terms)):
            evidence = f"two executions, the first with PV {float(pv):g}, reproduce it where time allows one"
            twist = doubled() if same_bits(pv, case.fit.inputs.pv) else None
            return [Suspect("missed-execution", evidence, twist=twist)]
    return []


def _torn(case: _Case) -> list[Suspect]:
    """Each 16-bit half holds what it held before, or what the reference predicts: some were read too early."""
    ref, _ = case.run()
    old = 0
    for name in case.names:
        seen, was, new = bits(case.seen[name]), bits(case.before.seen[name]), bits(ref[name])
        for shift in (0, 16):
            half = seen >> shift & HALF
            if half not in (was >> shift & HALF, new >> shift & HALF):
                return []
            old += half != new >> shift & HALF
    return [Suspect("torn-picture", f"{old} of the words still hold what stood there before the execution")]


def _beyond_limits(case: _Case) -> list[Suspect]:
    inputs, mv = case.fit.inputs, float(case.seen["MV"])
    low, high = sorted((float(inputs.mv_min), float(inputs.mv_max)))
    if low <= mv <= high or (not inputs.pid_run and mv == 0.0):
        return []
    return [Suspect("clamp", f"MV is {mv:g}, outside its limits {low:g} to {high:g}", "MV")]


def _gains(case: _Case) -> list[Suspect]:
    """A gain or CYCLE that acts with another size than its register shows; exact ones, then the smallest change."""
    found = [
        _gain(case, operand.name, operand.attr)
        for operand in case.controller.operands
        if operand.kind is Kind.REAL and operand.minimum == 0 and case.asks("gain", operand.name)
    ]
    cycle = _cycle(case) if case.asks("cycle", "CYCLE") else None
    suspects = [each for each in (*found, cycle) if each is not None]
    return sorted(suspects, key=_rank)


def _gain(case: _Case, name: str, attr: str, *, is_carried: bool = False) -> Suspect | None:
    held = float(getattr(case.fit.inputs, attr))
    if not isfinite(held) or held <= 0.0:
        return None

    def words(value: REAL) -> dict[str, REAL]:
        return case.run(case.fit.inputs._replace(**{attr: value}))[0]

    size = sized(words, case.seen, held, is_carried=is_carried)
    if size is None:
        return None
    estimate = _estimate(size, case.controller.operand(name).unit)
    ratio = estimate.value / held
    evidence = f"{name} acts as {estimate.text()}, its register holds {held:.7g} ({ratio - 1:+.3%})"
    return Suspect("gain", evidence, name, ratio, "", estimate, scaled(attr, ratio))


def _cycle(case: _Case, *, is_carried: bool = False) -> Suspect | None:
    held = float(case.span(case.fit.inputs, None))
    if not held > 0.0:
        return None
    size = sized(lambda value: case.run(ts=value)[0], case.seen, held, is_carried=is_carried)
    if size is None:
        return None
    estimate = _estimate(size, "s")
    ratio = estimate.value / held
    evidence = f"an interval of {estimate.text()} s instead of CYCLE's {held:.6g} s ({ratio - 1:+.3%})"
    return Suspect("cycle", evidence, "CYCLE", ratio, "", estimate, stretched(ratio))


def _measured(case: _Case) -> list[Suspect]:
    """The integral comes out by bits with another interval on a clock's grid: Ts is measured, whatever D remembers.

    MV is no witness here: what a filter holds is wrong, or open, once one interval was another than CYCLE.
    """
    read, state = case.fit.inputs, case.fit.before.low
    low, high = sorted((float(read.mv_min), float(read.mv_max)))
    is_plain = read.pid_run and not read.pid_man and not state.man1 and low < float(case.seen["MV"]) < high
    if case.fit.lead or case.loop.dialect.ts_source or not is_plain or "I_MV" not in case.names:
        return []
    wide = unlimited(read)
    held = float(case.controller.nominal_ts(read))
    once, twice = (float(case.on_grid(wide, TsSource.MS, round(1000 * held * each))) for each in (1, 2))
    if once == twice or once == float(case.seen["I_MV"]):
        return []
    span = held * (1.0 + (float(case.seen["I_MV"]) - once) / (twice - once))
    if not held * MEASURED_MIN <= span <= held * MEASURED_MAX:
        return []
    for source, per_second in ((TsSource.MS, 1000), (TsSource.TENTH_MS, 10000)):
        ticks = round(span * per_second)
        if ticks != round(held * per_second) and same_bits(case.on_grid(wide, source, ticks), case.seen["I_MV"]):
            setting = f"ts_source = {source.name.lower()}"
            text = f"I_MV comes out by bits with an interval of {ticks / per_second:g} s, CYCLE is {held:g} s"
            hint = f"{setting} measures it anew at each execution; run `ahgateway identify`"
            return [Suspect("dialect", f"{text}: {hint}", setting=setting)]
    return []


def _estimate(size: Size, unit: str) -> Estimate:
    return Estimate(float(size.value), float(size.low), float(size.high), unit, size.is_exact)


def _overwritten(case: _Case) -> list[Suspect]:
    """Only MV changed while the recorded PV and the integral stand still: nothing was executed."""
    others = [name for name in case.names if name != "MV"]
    stood_still = same_words(others, case.before.seen, case.after.seen)
    if not stood_still or same_words(others, case.run()[0], case.seen):
        return []
    old, new = float(case.before.seen["MV"]), float(case.seen["MV"])
    return [Suspect("operand-written", f"MV went from {old:g} to {new:g} without an execution", "MV")]


def _integral(case: _Case) -> list[Suspect]:
    """Everything follows from another integral: somebody wrote it, or the instruction has summed another one."""
    ref, _ = case.run()
    is_asked = case.asks("operand-written", "I_MV") or case.asks("integral", "I_MV")
    if not is_asked or same_bits(ref["I_MV"], case.seen["I_MV"]):
        return []
    held = case.fit.before.low.i
    start = REAL(float(held) + float(case.seen["I_MV"]) - float(ref["I_MV"]))
    position = order(start) if isfinite(start) else 0
    near = sorted(range(position - NEIGHBOURS, position + NEIGHBOURS + 1), key=lambda each: abs(each - position))
    for each in near:
        state = case.fit.before.low._replace(i=from_order(each))
        if case.reproduces(case.run(state=state)[0]):
            distance = ulp_distance(case.seen["I_MV"], ref["I_MV"])
            text = f"all agrees with an integral of {float(state.i):.9g} before, {float(held):.9g} was seen"
            evidence = f"{text}; I_MV is {distance} ULP away from the reference's"
            return [Suspect("operand-written", evidence, "I_MV"), Suspect("integral", evidence, "I_MV")]
    return []


def _rounding(case: _Case) -> list[Suspect]:
    """Every word is the reference's but for its last bits: the operations round otherwise, or in another order."""
    ref, terms = case.run()
    size = max(_largest(case, terms), abs(float(ref["I_MV"])), 1e-30) * 2.0**-23
    other = ref if case.fit.before.is_point else case.run(state=case.fit.before.high)[0]
    worst = max(_beyond(case.seen[name], ref[name], other[name]) / size for name in case.names)
    if not worst <= ROUNDED_ULP * (1 + len(case.fit.lead)) or not is_settled(case.fit.before):
        return []
    evidence = f"all words come within {worst:.1f} ULP of the largest term: they are rounded otherwise"
    return [Suspect("rounding", evidence)]


def _beyond(seen: REAL, one: REAL, other: REAL) -> float:
    """By how much a word lies beyond both of two; 0 between them."""
    low, high = sorted((float(one), float(other)))
    return max(low - float(seen), float(seen) - high, 0.0) if seen == seen else inf


def _largest(case: _Case, terms: Any) -> float:
    """The largest number that is rounded on the way to MV, as large as it counts there.

    D is a small difference of large numbers: their rounding counts Kd / Ts times, less what the filter takes off.
    """
    read = case.fit.inputs
    parts = [abs(float(getattr(terms, name, 0.0))) for name in ("p", "i", "d", "bias", "raw")]
    kd = float(gain(getattr(read, "td_kd", getattr(read, "kd", ZERO))))
    if not kd > 0.0:
        return max(parts)
    kd *= float(gain(read.kc_kp)) if getattr(read, "pid_eq", False) else 1.0
    ts = float(case.span(read, None))
    span = ts
    if hasattr(read, "tf") and case.loop.dialect.filter_content == FilterContent.INPUT:
        parts.append(abs(float(case.fit.before.low.d)) * kd / ts)
    elif hasattr(read, "tf"):
        span += float(gain(read.tf))
    return max(*parts, abs(float(terms.e)) * kd / span)


def _two_axes(case: _Case) -> list[Suspect]:
    """The law under other values of two axes, of those that make a difference here at all."""
    if case.wanted and not any(", " in setting for _, _, setting in case.wanted):
        return []
    axes = list(case.loop.dialect._asdict().items())
    ref, _ = case.run()
    tried = [
        {axis: value}
        for axis, held in axes
        for value in AXES[axis]
        if value != held
        and not same_words(case.names, ref, case.run(dialect=case.loop.dialect._replace(**{axis: value}))[0])
    ]
    found = []
    for first, second in combinations(tried, 2):
        both: Any = {**first, **second}
        if len(both) == 2 and case.reproduces(case.run(dialect=case.loop.dialect._replace(**both))[0]):
            setting = ", ".join(f"{axis} = {value.name.lower()}" for axis, value in both.items())
            found.append(
                Suspect("dialect", f"{setting} together reproduce it", setting=setting, twist=in_dialect(**both))
            )
    return found[:PAIRS_MAX]


HYPOTHESES: tuple[Callable[[_Case], list[Suspect]], ...] = (
    _overwritten,
    _other_modes,
    _stale_pv,
    _other_dialect,
    _without,
    _twice,
    _beyond_limits,
    _gains,
    _measured,
    _rounding,
    _integral,
    _torn,
)
"""Tried in this order; exact ones stand before fitted ones."""
