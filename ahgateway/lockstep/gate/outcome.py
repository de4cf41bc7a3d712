"""What a gate says: what it would write, how putting back ended. Values only, for people and for JSON."""

from __future__ import annotations

from dataclasses import dataclass

from ahgateway.codec.station import Loop
from ahgateway.codec.words import decode
from ahgateway.lockstep.gate import change
from ahgateway.lockstep.gate.change import Step, shown
from ahgateway.lockstep.gate.session import Conflict


@dataclass(frozen=True, slots=True)
class Plan:
    """What a write would do, in order; nothing of it has happened."""

    loop: str
    steps: tuple[Step, ...]
    unchanged: tuple[str, ...]

    @property
    def lines(self) -> list[str]:
        """One line for each operand: device, old, new, raw words."""
        return [change.line(item) for step in self.steps for item in step.items]


@dataclass(frozen=True, slots=True)
class Restored:
    """How putting back ended.

    Attributes:
        operands: What was put back, in order.
        conflicts: What somebody else has changed and was left alone.
        is_taken_over: An operator has taken the loop over, so that nothing was touched.
        error: Why it could not be done, empty when it could.
    """

    operands: tuple[str, ...] = ()
    conflicts: tuple[Conflict, ...] = ()
    is_taken_over: bool = False
    error: str = ""

    @property
    def is_clean(self) -> bool:
        """True when nothing of ours is left in the PLC."""
        return not self.conflicts and not self.error

    def text(self, loop: Loop) -> str:
        """Return it as one sentence."""
        if self.error:
            return f"could not be put back: {self.error}"
        parts = [f"{', '.join(self.operands)} put back" if self.operands else "everything else is as found"]
        if self.is_clean and not self.operands:
            return "everything is as found"
        if self.is_taken_over:
            parts = ["an operator has taken over, nothing was touched"]
        parts += [conflict_text(loop, each) for each in self.conflicts]
        return "; ".join(parts)


def conflict_text(loop: Loop, conflict: Conflict) -> str:
    """Return what somebody else changed as `MOUT holds 50.0, as found 0.0, ours 45.0`."""
    kind = loop.controller.operand(conflict.operand).kind
    ours = " or ".join(shown(decode(kind, words)) for words in conflict.ours) or shown(decode(kind, conflict.found))
    return (
        f"{conflict.operand} holds {shown(decode(kind, conflict.now))}, "
        f"as found {shown(decode(kind, conflict.found))}, ours {ours}"
    )
