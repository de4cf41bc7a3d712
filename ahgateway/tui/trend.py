"""Trend of one loop: SV and PV above, MV and the reference's MV below; told apart by shape."""

from __future__ import annotations

from itertools import groupby

import numpy as np

from ahgateway.apps.health import Array
from ahgateway.apps.lines import clock_time, shown
from ahgateway.apps.trail import Trace
from ahgateway.clock import SECOND
from ahgateway.tui.lines_panel import Line, LinesPanel, plain
from ahgateway.tui.plot import cells, dots, marks, value_range

AXIS = 11
"""Columns of the scale at the left."""
SPANS_S = (60, 300, 900, 3600)
LINE, MARK = "cyan", "yellow"


class Trend(LinesPanel):
    """Draws a trace into the room there is; time runs to the right and ends at the newest moment."""

    DEFAULT_CSS = "Trend { height: 1fr; min-height: 8; overflow: hidden; }"

    def __init__(self, *, id: str | None = None) -> None:
        super().__init__(id=id)
        self.is_plain = False

    def show(self, trace: Trace, until_s: float, span_s: int, units: tuple[str, str]) -> None:
        """Show a trace of `span_s` seconds up to `until_s`, both UTC; units are those of PV and MV."""
        width, height = self.size.width - AXIS, self.size.height
        if width < 10 or height < 8:
            self.put([plain("no room for a trend")])
            return
        self.put(trend_lines(trace, (until_s - span_s, until_s), units, width, height, is_plain=self.is_plain))


def trend_lines(
    trace: Trace, times: tuple[float, float], units: tuple[str, str], width: int, height: int, *, is_plain: bool
) -> list[Line]:
    """Return a trend as `height` lines; the curves have `width` columns behind the scale."""
    upper = (height - 3) * 3 // 5
    lower = height - 3 - upper
    first, last = (clock_time(round(moment * SECOND)).partition(".")[0] for moment in times)
    return [
        _title("PV", trace.pv, "SV", trace.sv, units[0], is_plain=is_plain),
        *_panel(trace.t_s, trace.pv, trace.sv, times, width, upper, is_plain=is_plain),
        _title("MV", trace.mv, "reference MV", trace.ref_mv, units[1], is_plain=is_plain),
        *_panel(trace.t_s, trace.mv, trace.ref_mv, times, width, lower, is_plain=is_plain),
        plain(" " * AXIS + first + f"{last + 'Z':>{max(1, width - len(first))}}"),
    ]


def _title(line: str, y: Array, mark: str, under: Array, unit: str, *, is_plain: bool) -> Line:
    signs = ("*", "-") if is_plain else ("⣀⠤⠒", "╌╌╌")
    return (
        (" " * AXIS, ""),
        (f"{signs[0]} {line} {_last(y)}", LINE),
        ("   ", ""),
        (f"{signs[1]} {mark} {_last(under)}", MARK),
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
    return tuple(("".join(sign for sign, _ in run), style) for style, run in groupby(marked, key=lambda each: each[1]))


def shown_short(value: float) -> str:
    """A number for a scale, at most nine characters."""
    return f"{value:.5g}"


def _last(y: Array) -> str:
    """The newest value, or a dash when it is not known."""
    return shown(np.float32(y[-1])) if y.size and np.isfinite(y[-1]) else "-"
