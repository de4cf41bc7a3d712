"""How well a real PLC is kept pace with: when each step was due, when it came, and what the line needs for it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ahgateway.clock import MILLISECOND

LATE_SHARE_MAX = 0.02
"""More steps late than this, and more than one: the bench is too slow to say anything of the product."""


class Pace:
    """Steps of one length, planned from one origin.

    A step is late when it comes a whole period behind its time: then the PLC has computed with a PV that the process
    had left already. Steps that were missed altogether count as late too.

    Args:
        origin_ns: When the first is due.
        period_ns: From one to the next.
    """

    def __init__(self, origin_ns: int, period_ns: int) -> None:
        self.period_ns = period_ns
        self._origin_ns = origin_ns
        self._number = 0
        self._late = 0
        self._behind_ns: list[int] = []
        self._lasted_ns: list[int] = []

    @property
    def due_ns(self) -> int:
        """When the next step is due."""
        return self._origin_ns + self._number * self.period_ns

    def begin(self, now_ns: int) -> None:
        """A step begins; those whose time is over are given up."""
        behind_ns = max(0, now_ns - self.due_ns)
        self._behind_ns.append(behind_ns)
        missed = behind_ns // self.period_ns
        self._late += missed
        self._number += 1 + missed

    def end(self, begun_ns: int, now_ns: int) -> None:
        """The step is over."""
        self._lasted_ns.append(now_ns - begun_ns)

    def restart(self, now_ns: int) -> None:
        """Something else had the line meanwhile, a write or silence: go on one period from now."""
        self._origin_ns, self._number = now_ns + self.period_ns, 0

    @property
    def steps(self) -> int:
        """How many were taken."""
        return len(self._behind_ns)

    @property
    def late(self) -> int:
        """How many came a whole period late, or not at all."""
        return self._late

    @property
    def is_kept(self) -> bool:
        """Tell whether few enough were late."""
        return self._late <= max(1.0, LATE_SHARE_MAX * (self.steps + self._late))

    def figures(self) -> Mapping[str, float]:
        """Return the figures, times in ms."""
        return {
            "period_ms": self.period_ns / MILLISECOND,
            "steps": self.steps,
            "late": self._late,
            "jitter_median_ms": _quantile(self._behind_ns, 0.5) / MILLISECOND,
            "jitter_99_ms": _quantile(self._behind_ns, 0.99) / MILLISECOND,
            "jitter_max_ms": _quantile(self._behind_ns, 1.0) / MILLISECOND,
            "step_median_ms": _quantile(self._lasted_ns, 0.5) / MILLISECOND,
            "step_99_ms": _quantile(self._lasted_ns, 0.99) / MILLISECOND,
        }


def sentence(pace: Mapping[str, float]) -> str:
    """Say how well pace was kept, for people."""
    return (
        f"{pace['steps']:.0f} steps of {pace['period_ms']:g} ms, {pace['late']:.0f} late; begun "
        f"{pace['jitter_median_ms']:.2f} ms behind their time (99 %: {pace['jitter_99_ms']:.2f}, most: "
        f"{pace['jitter_max_ms']:.2f}), {pace['step_median_ms']:.2f} ms long (99 %: {pace['step_99_ms']:.2f})"
    )


def _quantile(values: Sequence[int], share: float) -> float:
    return float(sorted(values)[min(len(values) - 1, int(share * len(values)))]) if values else 0.0
