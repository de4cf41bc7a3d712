"""What is said about a divergence: possible causes with their evidence, how large they are, and which term left first.

This file knows no law; `causes` finds the suspects of one execution, `inquiry` holds them against the next ones.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

from ahgateway.codec.station import Loop
from ahgateway.core.real import REAL

RATIO_SPREAD = 2e-3
"""Estimates of one cause from two executions agree within this."""

Key = tuple[str, str, str]
"""Cause, operand and setting."""

Twist = Callable[[Loop], Loop]
"""Makes of a loop the one whose law differs in just one way."""


@dataclass(frozen=True, slots=True)
class Estimate:
    """How large something really is.

    Attributes:
        value: Likeliest value, in `unit`.
        low: Smallest value that leaves the same words.
        high: Largest value that leaves the same words.
        unit: The operand's unit.
        is_exact: Every value from `low` to `high` leaves the very bits, but for MV's last one where D's filter holds
            what an estimate has left there; else they come out within rounding.
    """

    value: float
    low: float
    high: float
    unit: str
    is_exact: bool

    def text(self) -> str:
        """Return value and interval as people read them."""
        return f"{self.value:.7g} ({self.low:.9g} to {self.high:.9g})"


@dataclass(frozen=True, slots=True)
class Suspect:
    """One possible cause.

    Attributes:
        cause: Its name, `gain`, `direction`, `integral` …
        evidence: What speaks for it, one sentence with numbers.
        operand: The operand that it concerns, or nothing.
        ratio: By which factor that operand acts, 1.0 when it is not a matter of size.
        setting: Axis and value of a dialect, `filter = ignored`, or nothing.
        estimate: How large the operand really is, with its interval; None when it is not a matter of size.
        twist: The law with this cause in it, to be held against other executions; None when it is a single event.
        fit: The reading of the execution in which it was named: what that read, and the state before it.
    """

    cause: str
    evidence: str
    operand: str = ""
    ratio: float = 1.0
    setting: str = ""
    estimate: Estimate | None = None
    twist: Twist | None = field(default=None, compare=False, repr=False)
    fit: Any = field(default=None, compare=False, repr=False)

    @property
    def key(self) -> Key:
        """What makes it the same suspect in another execution: not its size, nor since when a dialect is another."""
        cause = "dialect" if self.cause == "firmware-change" else self.cause
        return cause, self.operand, self.setting


@dataclass(frozen=True, slots=True)
class Blame:
    """Where and why an execution left the reference.

    Attributes:
        term: The first term that left: PV, P, I, D, MV or MOUT.
        plc: Its value on the PLC; computed back from MV where the PLC does not show it.
        ref: Its value in the reference.
        suspects: Possible causes, likeliest first; never empty.
        fit: The execution as the reference came closest to it: what it read, the state before; None where unknown.
    """

    term: str
    plc: REAL
    ref: REAL
    suspects: tuple[Suspect, ...]
    fit: Any = field(default=None, compare=False, repr=False)

    @property
    def cause(self) -> str:
        """The likeliest cause."""
        return self.suspects[0].cause


def sizeless(blame: Blame) -> Blame | None:
    """Keep the laws to which no size has to be fitted; None when there is none."""
    exact = tuple(each for each in blame.suspects if each.twist is not None and each.estimate is None)
    return replace(blame, suspects=exact, fit=exact[0].fit) if exact else None


def agreeing(known: tuple[Suspect, ...], fresh: tuple[Suspect, ...]) -> tuple[Suspect, ...]:
    """Keep the fresh suspects that the known ones name too, with the same size; all of them when none are known."""
    if not known:
        return fresh
    return tuple(
        suspect for suspect in fresh if any(suspect.key == other.key and same_size(suspect, other) for other in known)
    )


def same_size(left: Suspect, right: Suspect) -> bool:
    """Tell whether two executions give one cause the same size."""
    return abs(left.ratio - right.ratio) <= RATIO_SPREAD * max(left.ratio, right.ratio)


def misread(change: Callable[[Any], dict[str, Any]]) -> Twist:
    """Make a law that reads operands otherwise than they stand in their registers."""

    def twist(loop: Loop) -> Loop:
        step = loop.controller.step

        def wrong(inputs: Any, state: Any, dialect: Any, ts: REAL) -> tuple[Any, Any]:
            return step(inputs._replace(**change(inputs)), state, dialect, ts)

        return replace(loop, controller=replace(loop.controller, step=wrong))

    return twist


def flipped(attr: str) -> Twist:
    """Make a law that sees a switch the other way round."""
    return misread(lambda inputs: {attr: not getattr(inputs, attr)})


def scaled(attr: str, ratio: float) -> Twist:
    """Make a law in which a REAL operand acts with another size."""
    return misread(lambda inputs: {attr: REAL(float(getattr(inputs, attr)) * ratio)})


def zeroed(attr: str) -> Twist:
    """Make a law that does not see a REAL operand at all."""
    return misread(lambda inputs: {attr: REAL(0)})


def stretched(ratio: float) -> Twist:
    """Make a law that computes with another interval."""

    def twist(loop: Loop) -> Loop:
        step = loop.controller.step

        def wrong(inputs: Any, state: Any, dialect: Any, ts: REAL) -> tuple[Any, Any]:
            return step(inputs, state, dialect, REAL(float(ts) * ratio))

        return replace(loop, controller=replace(loop.controller, step=wrong))

    return twist


def doubled() -> Twist:
    """Make a law that is executed twice each time, with the same inputs."""

    def twist(loop: Loop) -> Loop:
        step = loop.controller.step

        def wrong(inputs: Any, state: Any, dialect: Any, ts: REAL) -> tuple[Any, Any]:
            once, _ = step(inputs, state, dialect, ts)
            return step(inputs, once, dialect, ts)

        return replace(loop, controller=replace(loop.controller, step=wrong))

    return twist


def in_dialect(**axes: Any) -> Twist:
    """Make a law with other values on some axes."""
    return lambda loop: replace(loop, dialect=loop.dialect._replace(**axes))
