"""The trend of one loop as a Bokeh layout: what is drawn where. The page fills it and colours it, dark or light."""

from __future__ import annotations

from functools import cache
from typing import Any

from bokeh.embed import json_item
from bokeh.layouts import column
from bokeh.models import (
    ColumnDataSource,
    CrosshairTool,
    DatetimeTickFormatter,
    FactorRange,
    HoverTool,
    Range1d,
)
from bokeh.models.annotations import Legend, LegendItem, Span
from bokeh.plotting import figure

from ahgateway.apps.lanes import lanes_of
from ahgateway.codec.station import Loop

VERDICT = "verdict"
PV_HEIGHT, MV_HEIGHT, LEVEL_HEIGHT, ROW_HEIGHT = 320, 220, 150, 22
LEFT = 74
"""Room at the left of every panel, so that their time axes stand exactly one above the other."""

TIMES = DatetimeTickFormatter(
    microseconds="%H:%M:%S.%3N", milliseconds="%H:%M:%S.%3N", seconds="%H:%M:%S", minsec="%H:%M:%S",
    minutes="%H:%M", hourmin="%H:%M", hours="%d %b %H:%M", days="%d %b",
)  # fmt: skip


def chart(loop: Loop) -> dict[str, Any]:
    """Return the chart of a loop as the page embeds it; its sources are `curves` and `runs`."""
    return _chart(loop.pv_unit, loop.mv_unit, _shapes(loop))


def _shapes(loop: Loop) -> tuple[tuple[str, str, bool], ...]:
    units = {"MV": loop.mv_unit}
    return tuple((lane.name, units.get(lane.unit, lane.unit), lane.is_switch) for lane in lanes_of(loop))


@cache
def _chart(pv_unit: str, mv_unit: str, lanes: tuple[tuple[str, str, bool], ...]) -> dict[str, Any]:
    names = ["t", "sv", "pv", "mv", "ref_mv", *(f"lane{index}" for index in range(len(lanes)))]
    curves = ColumnDataSource({name: [0.0] for name in names}, name="curves")
    bars = ColumnDataSource({name: [] for name in ("left", "right", "row", "colour", "hatch", "text")}, name="runs")
    times = Range1d(start=0, end=1, name="times")
    hair = Span(dimension="height", line_dash="dotted", line_width=1)
    panels = [
        _panel("pv", f"PV {pv_unit}".strip(), PV_HEIGHT, times, curves, hair, [("PV", "pv"), ("SV", "sv")]),
        _panel("mv", f"MV {mv_unit}".strip(), MV_HEIGHT, times, curves, hair, [("MV", "mv"), ("reference", "ref_mv")]),
    ]
    levels = [(name, f"lane{index}") for index, (name, _, is_switch) in enumerate(lanes) if not is_switch]
    if levels:
        unit = next(unit for _, unit, is_switch in lanes if not is_switch)
        panels.append(_panel("level", unit, LEVEL_HEIGHT, times, curves, hair, levels))
    panels.append(_bars(times, bars, hair, [VERDICT, *(name for name, _, is_switch in lanes if is_switch)]))
    for panel in panels[:-1]:
        panel.xaxis.major_label_text_font_size = "0px"
    panels[-1].xaxis[0].formatter = TIMES
    return dict(json_item(column(*panels, sizing_mode="stretch_width", name="trend")))


def _empty(name: str, height: int, times: Range1d, hair: Span, **more: Any) -> Any:
    made = figure(
        name=name, height=height, sizing_mode="stretch_width", x_axis_type="datetime", x_range=times,
        tools="xpan,xwheel_zoom", active_drag="xpan", active_scroll="xwheel_zoom", toolbar_location=None,
        min_border_left=LEFT, min_border_right=16, min_border_top=6, min_border_bottom=4, output_backend="canvas",
        **more,
    )  # fmt: skip
    made.add_tools(CrosshairTool(overlay=hair, dimensions="height"))
    made.yaxis.fixed_location = None
    return made


def _panel(
    name: str,
    label: str,
    height: int,
    times: Range1d,
    curves: ColumnDataSource,
    hair: Span,
    lines: list[tuple[str, str]],
) -> Any:
    """One panel: the first line is solid, those behind it are dashed, so that shape tells them apart."""
    made = _empty(name, height, times, hair, y_axis_label=label)
    made.y_range.update(only_visible=True, range_padding=0.08, min_interval=1e-6)
    items: list[LegendItem] = []
    solid: Any = None
    for index, (text, field) in reversed(list(enumerate(lines))):
        dash = "solid" if index == 0 else "dashed"
        if field == "pv":
            drawn = made.line("t", field, source=curves, line_width=1.8, name=field)
        else:
            drawn = made.step(
                "t", field, source=curves, mode="after", line_width=1.8 if index == 0 else 1.6, line_dash=dash,
                name=field,
            )  # fmt: skip
        items.insert(0, LegendItem(label=text, renderers=[drawn]))
        solid = drawn
    made.add_layout(Legend(items=items, orientation="horizontal", location="left", margin=0), "above")
    tips = [("time", "@t{%H:%M:%S.%3N}"), *((text, f"@{field}{{0.[000000]}}") for text, field in lines)]
    made.add_tools(HoverTool(renderers=[solid], mode="vline", tooltips=tips, formatters={"@t": "datetime"}))
    return made


def _bars(times: Range1d, bars: ColumnDataSource, hair: Span, rows: list[str]) -> Any:
    """Verdicts and switches: a row of bars each; a bar has a hatch too, for eyes that miss the colour."""
    height = ROW_HEIGHT * len(rows) + 34
    made = _empty("bars", height, times, hair, y_range=FactorRange(factors=list(reversed(rows))))
    drawn = made.hbar(
        y="row", left="left", right="right", height=0.8, source=bars, fill_color="colour", line_color=None,
        hatch_pattern="hatch", hatch_alpha=0.55, hatch_scale=7.0, hatch_weight=1.2, name="bars",
    )  # fmt: skip
    tips = [("", "@text"), ("from", "@left{%H:%M:%S.%3N}"), ("to", "@right{%H:%M:%S.%3N}")]
    made.add_tools(HoverTool(renderers=[drawn], tooltips=tips, formatters={"@left": "datetime", "@right": "datetime"}))
    made.ygrid.grid_line_color = None
    return made
