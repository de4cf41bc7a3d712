"""Two sets of gains on one recorded run: what the exact law would have put out with each, PV being as it was.

This file alone decides the one number of that comparison. PV does not answer the new gains here: what is compared is
what the controller does with the same history, before anything is written. How the loop itself would have run is
`predict.replayed`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ahgateway.core.dialect import DEFAULT, Dialect
from ahgateway.tuning.record import Record
from ahgateway.tuning.runner import Given, Runner, at_rest

Array = NDArray[np.float64]

EXECUTIONS_MAX = 20_000
"""Most executions that are compared; of a longer run the last ones."""


@dataclass(frozen=True, slots=True)
class Comparison:
    """MV side by side; all arrays of one length, one point per execution.

    Attributes:
        t_s: Time in s.
        sv: Setpoint as recorded.
        pv: Process value as recorded.
        recorded: MV as recorded.
        old: MV of the law with the old gains.
        new: MV of the law with the new gains.
    """

    t_s: Array
    sv: Array
    pv: Array
    recorded: Array
    old: Array
    new: Array

    @property
    def difference(self) -> float:
        """The one number: root mean square of new − old, in MV."""
        return float(np.sqrt(np.mean((self.new - self.old) ** 2)))

    @property
    def largest(self) -> float:
        """Largest |new − old| in MV."""
        return float(np.max(np.abs(self.new - self.old)))

    @property
    def travel(self) -> tuple[float, float]:
        """Sum of |ΔMV| with the old and with the new gains."""
        return float(np.sum(np.abs(np.diff(self.old)))), float(np.sum(np.abs(np.diff(self.new))))


def compare(record: Record, instruction: str, old: Given, new: Given, dialect: Dialect = DEFAULT) -> Comparison | None:
    """Run the law over the recorded SV and PV with both settings, from the first MV of the record.

    Args:
        record: The run; None is returned when its SV is not known, for the law has no error then.
        instruction: DPID or DPIDE.
        old: Every setting as it was.
        new: Every setting as it would be.
        dialect: How this PLC discretises.
    """
    if not np.all(np.isfinite(record.sv)):
        return None
    start = max(0, int(np.searchsorted(record.t_s, record.t_s[-1] - EXECUTIONS_MAX * _ts(instruction, old))))
    t, sv, pv, mv = record.t_s[start:], record.sv[start:], record.pv[start:], record.mv[start:]

    def run(settings: Given) -> Runner:
        """The law with such an integral that its first execution gives the first recorded MV."""
        begun = (float(sv[0]), float(pv[0]))
        reached = at_rest(instruction, settings, *begun, float(mv[0]), dialect).execute(*begun)
        return at_rest(instruction, settings, *begun, 2.0 * float(mv[0]) - reached, dialect)

    first = run(old)
    times = np.arange(t[0], t[-1] + 1e-9, first.ts_s)
    held = np.clip(np.searchsorted(t, times + 1e-9, side="right") - 1, 0, t.size - 1)
    sides = [
        np.array([runner.execute(float(sv[k]), float(pv[k])) for k in held], dtype=np.float64)
        for runner in (first, run(new))
    ]
    return Comparison(times, sv[held], pv[held], mv[held], sides[0], sides[1])


def _ts(instruction: str, settings: Given) -> float:
    return at_rest(instruction, settings, 0.0, 0.0, 0.0).ts_s
