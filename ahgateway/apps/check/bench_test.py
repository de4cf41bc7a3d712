"""A loop on a bench as a test writes it: started, changed over time, run, looked at; a scenario without a file."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from typing import Any

from ahgateway.apps.check.result import Outcome, Result, State, Trace
from ahgateway.schema.scenario import Scenario, made

NAMES = "SV, PV and MV"


class Ran:
    """What became of a run.

    Attributes:
        result: Verdict, expectations, counts; see `result.Result`.
    """

    def __init__(self, result: Result) -> None:
        self.result = result

    @property
    def trace(self) -> Trace:
        """Time, SV, PV and MV of each picture."""
        return self.result.trace

    @property
    def agrees(self) -> bool:
        """True when no execution of the PLC differed from the reference, and some proved it."""
        return self._state("shadow") is State.MET

    @property
    def violated(self) -> tuple[Outcome, ...]:
        """Expectations that were not met."""
        return tuple(each for each in self.result.outcomes if each.state is State.VIOLATED)

    def at(self, t_s: float) -> Mapping[str, float]:
        """Return SV, PV and MV of the last picture that is not later than this."""
        times = self.trace["t"]
        last = max((number for number, t in enumerate(times) if t <= t_s), default=0)
        return {name: values[last] for name, values in self.trace.items()}

    def _state(self, name: str) -> State:
        return next((each.state for each in self.result.outcomes if each.name == name), State.UNKNOWN)


class BenchTest:
    """One loop of a bench; nothing happens before `run`.

    Args:
        name: The test's, in results.
        instruction: Of the loop.
        plant: The process behind it, a scenario's table `plant`; None for none.
        runs: Runs a scenario and returns its result.
    """

    def __init__(
        self, name: str, instruction: str, plant: Mapping[str, Any] | None, runs: Callable[[Scenario], Result]
    ) -> None:
        self._name, self._instruction, self._runs = name, instruction, runs
        self._plant = plant
        self._initial: dict[str, Any] = {}
        self._steps: list[dict[str, Any]] = []

    def start(self, **operands: Any) -> None:
        """Set operands for the start, by the manual's names; the rest has its default."""
        self._initial |= operands

    def at(self, t_s: float, until: float | None = None, **operands: Any) -> None:
        """Set operands at a time in s; with `until` go there evenly, REALs only."""
        step: dict[str, Any] = {"at": t_s, "set" if until is None else "ramp": operands}
        self._steps.append(step if until is None else step | {"until": until})

    def do(self, t_s: float, deed: str, until: float | None = None) -> None:
        """Do `stop`, `restart`, `freeze-pv` or `link-down` at a time in s."""
        self._steps.append({"at": t_s, "do": deed} | ({} if until is None else {"until": until}))

    def load(self, t_s: float, load: float, until: float | None = None) -> None:
        """Put a load on the process at a time in s."""
        self._steps.append({"at": t_s, "load": load} | ({} if until is None else {"until": until}))

    def run(self, duration_s: float, **expect: Any) -> Ran:
        """Run the loop from its start; `expect` is a scenario's table of that name.

        Raises:
            ProfileError: Something in it is wrong.
        """
        table: dict[str, Any] = {
            "title": self._name,
            "instruction": self._instruction,
            "duration": float(duration_s),
            "initial": self._initial,
            "step": self._steps,
            "expect": expect,
        }
        if self._plant is not None:
            table["plant"] = dict(self._plant)
        return Ran(self._runs(made(table, json.dumps(table, default=str), self._name, f"test/{self._name}")))
