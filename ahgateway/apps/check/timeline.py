"""A scenario's time line for a PLC in real time: what is due by now, which load acts, what the sensor shows."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ahgateway.schema.scenario import Action, Scenario


class TimeLine:
    """The time line of one scenario; asked at rising times, it gives each entry once.

    Attributes:
        cuts: When the link is to be silent, from and until, in s.
    """

    def __init__(self, scenario: Scenario, pv: str) -> None:
        self._pv = pv
        self._waiting = list(scenario.actions)
        self._loads = [each for each in scenario.actions if each.load is not None]
        self._held = [each for each in scenario.actions if each.holds_pv]
        self._ramps: list[tuple[Action, dict[str, float]]] = []
        self._present: dict[str, Any] = {row.name: row.default for row in scenario.controller.operands}
        self._present |= scenario.initial
        self.cuts = [
            (each.at_s, each.until_s)
            for each in scenario.actions
            if each.do == "link-down" and each.until_s is not None
        ]

    def due(self, t_s: float) -> dict[str, Any]:
        """Return the operands to be written by now; a ramp gives a new value each time, and its end once."""
        found: dict[str, Any] = {}
        while self._waiting and self._waiting[0].at_s <= t_s:
            action = self._waiting.pop(0)
            found |= action.set
            if action.ramp:
                self._ramps.append((action, {name: float(self._present[name]) for name in action.ramp}))
        for action, first in list(self._ramps):
            assert action.until_s is not None, "the schema asks for the end of a ramp"
            share = min(1.0, (t_s - action.at_s) / (action.until_s - action.at_s))
            found |= {name: first[name] + (end - first[name]) * share for name, end in action.ramp.items()}
            if share == 1.0:
                self._ramps.remove((action, first))
        self._present |= found
        found.pop(self._pv, None)
        return found

    def load(self, t_s: float) -> float:
        """Return the load that was set last and has not ended, 0 without one."""
        acting = [each for each in self._loads if each.at_s <= t_s]
        if not acting or (acting[-1].until_s is not None and t_s >= acting[-1].until_s):
            return 0.0
        assert acting[-1].load is not None
        return acting[-1].load

    def sensor(self, t_s: float, reading: Callable[[], float]) -> float | None:
        """Return what PV is to be written, None where it stands still as it is."""
        held = [each for each in self._held if each.at_s <= t_s]
        is_over = not held or (held[-1].until_s is not None and t_s >= held[-1].until_s and not held[-1].ramp)
        if is_over:
            return reading()
        moved = self._pv in held[-1].set or self._pv in held[-1].ramp
        return float(self._present[self._pv]) if moved else None
