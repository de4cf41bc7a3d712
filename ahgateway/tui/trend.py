"""Trend of one loop: SV and PV above, MV and the reference's MV below; told apart by shape."""

from __future__ import annotations

from itertools import groupby

import numpy as np

from ahgateway.apps.health import Array
from ahgateway.apps.lanes import Lane
from ahgateway.apps.lines import clock_time, shown
from ahgateway.apps.marks import SIGNS, Mark
from ahgateway.apps.trail import Trace
from ahgateway.clock import SECOND
from ahgateway.tui.lines_panel import Line, LinesPanel, plain
from ahgateway.tui.plot import cells, dots, marks, value_range

AXIS = 14
"""Columns of the scale at the left."""
SPANS_S = (60, 300, 900, 3600)
LINE, MARK = "cyan", "yellow"
DIGITS, BLOCKS = "0123456789", "▁▂▃▄▅▆▇█"
MARK_STYLE = {
    Mark.PROVEN: "green",
    Mark.TRIVIAL: "dim green",
    Mark.AGREES: "blue",
    Mark.UNOBSERVABLE: "yellow",
    Mark.LINK: "magenta",
    Mark.DIVERGED: "bold red",
}


class Trend(LinesPanel):
    """Draws a trace into the room there is; time runs to the right and ends at the newest moment."""

    DEFAULT_CSS = "Trend { height: 1fr; min-height: 8; overflow: hidden; }"

    def __init__(self, *, id: str | None = None) -> None:
        super().__init__(id=id)
        self.is_plain = False

    def show(
        self,
        trace: Trace,
        until_s: float,
        span_s: int,
        units: tuple[str, str],
        lanes: tuple[Lane, ...] = (),
        *,
        is_stale: bool = False,
    ) -> None:
        """Show a trace of `span_s` seconds up to `until_s`, both UTC; units are those of PV and MV.

        The newest values stand in parentheses when they are stale.
        """
        width, height = self.size.width - AXIS, self.size.height
        if width < 10 or height < 9:
            self.put([plain("no room for a trend")])
            return
        times = (until_s - span_s, until_s)
        how = {"is_plain": self.is_plain, "is_stale": is_stale}
        strips = strip_lines(trace, times, lanes, width, **how)[: max(1, height - 8)]
        curves = trend_lines(trace, times, units, width, height - len(strips), **how)
        # The strips stand above the line with the times.
        self.put([*curves[:-1], *strips, curves[-1]])


def trend_lines(
    trace: Trace,
    times: tuple[float, float],
    units: tuple[str, str],
    width: int,
    height: int,
    *,
    is_plain: bool,
    is_stale: bool = False,
) -> list[Line]:
    """Return a trend as `height` lines; the curves have `width` columns behind the scale."""
    upper = (height - 3) * 3 // 5
    lower = height - 3 - upper
    first, last = (clock_time(round(moment * SECOND)).partition(".")[0] for moment in times)
    return [
        _title("PV", trace.pv, "SV", trace.sv, units[0], is_plain=is_plain, is_stale=is_stale),
        *_panel(trace.t_s, trace.pv, trace.sv, times, width, upper, is_plain=is_plain),
        _title("MV", trace.mv, "reference MV", trace.ref_mv, units[1], is_plain=is_plain, is_stale=is_stale),
        *_panel(trace.t_s, trace.mv, trace.ref_mv, times, width, lower, is_plain=is_plain),
        plain(" " * AXIS + first + f"{last + 'Z':>{max(1, width - len(first))}}"),
    ]


def strip_lines(
    trace: Trace,
    times: tuple[float, float],
    lanes: tuple[Lane, ...],
    width: int,
    *,
    is_plain: bool,
    is_stale: bool = False,
) -> list[Line]:
    """Return the verdicts, and what drives the actuator, as a line each: signs, told apart without colour."""
    _, worst = per_column(trace.t_s, trace.mark, times, width)
    marks = (Mark(int(value)) if np.isfinite(value) else Mark.NONE for value in worst)
    edge = "|" if is_plain else "│"
    signs = [(SIGNS[mark], MARK_STYLE.get(mark, "")) for mark in marks]
    found: list[Line] = [((f"{'verdict':>{AXIS - 1}}{edge}", ""), *_joined(signs))]
    for lane, values in zip(lanes, trace.lanes, strict=True):
        lowest, highest = per_column(trace.t_s, values, times, width)
        if lane.is_switch:
            name, steps = lane.name, ".+#" if is_plain else "·▒█"
            filled = (lowest + highest) / 2.0
            low, high = 0.0, 1.0
        else:
            name, steps = f"{lane.name} {_last(values, is_stale=is_stale)}", DIGITS if is_plain else BLOCKS
            filled = np.where(np.abs(lowest) > np.abs(highest), lowest, highest)
            low, high = value_range(lowest, highest)
        text = "".join(_step(value, low, high, steps) for value in filled.tolist())
        found.append(((f"{name[: AXIS - 1]:>{AXIS - 1}}{edge}", ""), (text, LINE)))
    return found


def per_column(t_s: Array, values: Array, times: tuple[float, float], width: int) -> tuple[Array, Array]:
    """Return the lowest and the highest value in each column of time; one without a sample holds the one before.

    A column is NaN where nothing is known: in a gap, before the first and behind the last sample.
    """
    lowest, highest = np.full(width, np.nan), np.full(width, np.nan)
    if not t_s.size:
        return lowest, highest
    edges = np.linspace(times[0], times[1], width + 1)
    inside = np.flatnonzero((t_s >= times[0]) & (t_s <= times[1]))
    place = np.minimum(np.searchsorted(edges, t_s[inside], side="right") - 1, width - 1)
    np.fmin.at(lowest, place, values[inside])
    np.fmax.at(highest, place, values[inside])
    held = np.searchsorted(t_s, edges[1:], side="right") - 1
    empty = np.isin(np.arange(width), place, invert=True) & (held >= 0) & (edges[1:] <= t_s[-1])
    lowest[empty] = highest[empty] = values[held[empty]]
    return lowest, highest


def _step(value: float, low: float, high: float, steps: str) -> str:
    if not np.isfinite(value):
        return " "
    return steps[min(int((value - low) / (high - low) * len(steps)), len(steps) - 1)]


def _joined(signs: list[tuple[str, str]]) -> Line:
    return tuple(("".join(sign for sign, _ in run), style) for style, run in groupby(signs, key=lambda each: each[1]))


def _title(line: str, y: Array, mark: str, under: Array, unit: str, *, is_plain: bool, is_stale: bool) -> Line:
    signs = ("*", "-") if is_plain else ("⣀⠤⠒", "╌╌╌")
    return (
        (" " * AXIS, ""),
        (f"{signs[0]} {line} {_last(y, is_stale=is_stale)}", LINE),
        ("   ", ""),
        (f"{signs[1]} {mark} {_last(under, is_stale=is_stale)}", MARK),
        (f"   {unit}", ""),
    )


def _panel(
    t_s: Array, y: Array, under: Array, times: tuple[float, float], width: int, height: int, *, is_plain: bool
) -> list[Line]:
    values = value_range(y, under)
    drawn = cells(dots(t_s, y, times, values, width, height), plain=is_plain)
    below = marks(t_s, under, times, values, width, height, "-" if is_plain else "╌")
    edge = "|" if is_plain else "│"
    found = []
    for index, pair in enumerate(zip(drawn, below, strict=True)):
        scale = {0: shown_short(values[1]), height - 1: shown_short(values[0])}.get(index, "")
        found.append(((f"{scale:>{AXIS - 1}}{edge}", ""), *_laid_over(*pair)))
    return found


def _laid_over(over: str, under: str) -> Line:
    """One line from two: the upper one where it has a sign, else the lower one; neighbours of a kind are joined."""
    marked = ((a, LINE) if a != " " else (b, MARK if b != " " else "") for a, b in zip(over, under, strict=True))
    return _joined(list(marked))


def shown_short(value: float) -> str:
    """A number for a scale, at most nine characters."""
    return f"{value:.5g}"


def _last(y: Array, *, is_stale: bool) -> str:
    """The newest value, in parentheses when it is stale, or a dash when it is not known."""
    if not y.size or not np.isfinite(y[-1]):
        return "-"
    text = shown(np.float32(y[-1]))
    return f"({text})" if is_stale else text
