"""What came out of a scenario, and how its expectations make its verdict.

This file alone decides what a scenario may claim. Theory of operation: each expectation is met, violated or unknown.
One violated makes FAIL, however much is unknown beside it; else anything unknown makes INCONCLUSIVE; else PASS. What
a broken bench can have caused is unknown, never violated. A scenario that checked nothing is an ERROR.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum

from ahgateway.core.verdict import Counts, Exit


class State(Enum):
    """What became of an expectation."""

    MET = "met"
    VIOLATED = "violated"
    UNKNOWN = "unknown"


class Verdict(Enum):
    """What became of a scenario; KNOWN is a failure that a file of known differences covers."""

    PASS = "pass"
    KNOWN = "known"
    INCONCLUSIVE = "inconclusive"
    ERROR = "error"
    FAIL = "fail"


@dataclass(frozen=True, slots=True)
class Outcome:
    """One expectation and what was seen.

    Attributes:
        name: `shadow`, `response.0.overshoot`.
        state: What became of it.
        text: What was seen, with the limit, one sentence without a full stop.
        figure: The measured number; None where there is none.
        at_s: When it was violated, in s from the start; None when no moment can be named.
    """

    name: str
    state: State
    text: str
    figure: float | None = None
    at_s: float | None = None


@dataclass(frozen=True, slots=True)
class Trouble:
    """Something wrong with the bench, from `at_s` on."""

    at_s: float
    text: str


@dataclass(frozen=True, slots=True)
class Floor:
    """What the bench makes of itself.

    Attributes:
        is_sound: Nothing differed.
        text: What was seen, one sentence.
        noise: Largest difference of MV between two equal runs, in MV's unit.
        executions: How many were compared.
    """

    is_sound: bool
    text: str
    noise: float = 0.0
    executions: int = 0


Trace = Mapping[str, Sequence[float]]
"""Signals by name, `t` in s among them, all of one length."""


@dataclass(frozen=True)
class Result:
    """One scenario, run once.

    Attributes:
        name: The scenario's name, with `#2` behind it when it was repeated.
        title: What it checks.
        instruction: DPID or DPIDE.
        verdict: What became of it.
        reason: Why, one sentence.
        outcomes: Its expectations in order.
        troubles: What was wrong with the bench.
        counts: Executions by verdict.
        digests: CRC32 of the words that each execution left, in order.
        trace: SV, PV and MV over time.
        seed: Of the noise.
        simulated_s: Time that passed in the PLC.
        wall_s: Time that it took.
        pace: How well a real PLC was kept pace with (`pace.Pace.figures`); empty in virtual time.
    """

    name: str
    title: str
    instruction: str
    verdict: Verdict
    reason: str
    outcomes: tuple[Outcome, ...] = ()
    troubles: tuple[Trouble, ...] = ()
    counts: Counts = field(default_factory=Counts)
    digests: tuple[int, ...] = ()
    trace: Trace = field(default_factory=dict)
    seed: int = 0
    simulated_s: float = 0.0
    wall_s: float = 0.0
    pace: Mapping[str, float] = field(default_factory=dict)

    @property
    def figures(self) -> dict[str, float]:
        """Measured numbers by expectation."""
        return {each.name: each.figure for each in self.outcomes if each.figure is not None}


def excused(outcomes: Sequence[Outcome], troubles: Sequence[Trouble]) -> tuple[Outcome, ...]:
    """Return the outcomes with everything unknown that the bench's first trouble can have caused.

    A violation that was seen before anything was wrong with the bench stands.
    """
    if not troubles:
        return tuple(outcomes)
    first = min(troubles, key=lambda each: each.at_s)
    found = []
    for each in outcomes:
        if each.state is State.VIOLATED and (each.at_s is None or each.at_s >= first.at_s):
            text = f"{each.text}; but the bench was broken from {first.at_s:g} s on: {first.text}"
            found.append(Outcome(each.name, State.UNKNOWN, text, each.figure, each.at_s))
        else:
            found.append(each)
    return tuple(found)


def concluded(outcomes: Sequence[Outcome], troubles: Sequence[Trouble]) -> tuple[Verdict, str]:
    """Return the verdict that these outcomes allow, and why.

    Args:
        outcomes: After `excused`.
        troubles: What was wrong with the bench.
    """
    if not outcomes:
        return Verdict.ERROR, "nothing was checked: the scenario expects nothing"
    violated = [each for each in outcomes if each.state is State.VIOLATED]
    if violated:
        more = f" (and {len(violated) - 1} more)" if len(violated) > 1 else ""
        return Verdict.FAIL, f"{violated[0].name}: {violated[0].text}{more}"
    if troubles:
        return Verdict.INCONCLUSIVE, f"bench: {troubles[0].text}"
    unknown = [each for each in outcomes if each.state is State.UNKNOWN]
    if len(unknown) == len(outcomes):
        return Verdict.ERROR, f"nothing was checked: {unknown[0].text}"
    if unknown:
        return Verdict.INCONCLUSIVE, f"{unknown[0].name}: {unknown[0].text}"
    return Verdict.PASS, f"{len(outcomes)} expectations met"


def run_exit(results: Sequence[Result]) -> Exit:
    """Return what a whole run may claim: 1 when anything failed, 3 when it cannot claim enough, else 0."""
    verdicts = {each.verdict for each in results}
    if Verdict.FAIL in verdicts:
        return Exit.DIFFERENT
    if not results or verdicts & {Verdict.ERROR, Verdict.INCONCLUSIVE}:
        return Exit.INCONCLUSIVE
    return Exit.PASS
