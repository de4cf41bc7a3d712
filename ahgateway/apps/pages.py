"""One HTML file that prints: the frame that reports share, and plots inside it as SVG."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FRAME = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>{{ title }}</title><style>
body { font: 15px/1.45 system-ui, sans-serif; color: #1b1f24; max-width: 62rem; margin: 2rem auto; padding: 0 1rem }
h1 { font-size: 1.5rem; margin-bottom: .2rem } h2 { font-size: 1.1rem; margin-top: 1.8rem }
table { border-collapse: collapse; font-size: .86rem; width: 100% }
th, td { text-align: left; padding: .25rem .5rem; border-bottom: 1px solid #d5d9de; vertical-align: top }
th { border-bottom: 2px solid #1b1f24 } tr.chosen td { font-weight: 600; background: #eef6ee }
.finding { border-left: .3rem solid #9aa3ad; padding: .3rem .8rem; margin: .6rem 0; background: #f6f7f8 }
.refused { border-color: #b3261e } .warning { border-color: #b57700 }
.muted { color: #59626c } svg { width: 100%; height: auto } figure { margin: .5rem 0; break-inside: avoid }
figcaption { font-size: .86rem; color: #59626c } pre { white-space: pre-wrap }
@media print { body { margin: 0; max-width: none; font-size: 11px }
  h2 { break-after: avoid } tr { break-inside: avoid } }
</style></head><body>
<h1>{{ title }}</h1>
{{ body }}
</body></html>
"""


def framed(title: str, template: str, **facts: Any) -> str:
    """Return a whole page: the template of its body rendered with the facts, every text escaped."""
    from jinja2 import Environment
    from markupsafe import Markup

    environment = Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True)
    body = environment.from_string(template).render(**facts)
    return environment.from_string(FRAME).render(title=title, body=Markup(body))


def figure(rows: int, height: float = 2.2) -> tuple[Figure, Sequence[Any]]:
    """Return a figure of stacked plots that share their time axis; no window system is needed."""
    from matplotlib.figure import Figure

    made = Figure(figsize=(9.0, height * rows), layout="constrained")
    axes = made.subplots(rows, 1, sharex=True, squeeze=False)[:, 0]
    for each in axes:
        each.grid(visible=True, color="#e3e6e9", linewidth=0.6)
        each.spines[["top", "right"]].set_visible(False)
    return made, list(axes)


def svg(made: Figure) -> Any:
    """Return a figure as SVG that stands inside a page; texts stay texts."""
    import matplotlib
    from markupsafe import Markup

    with matplotlib.rc_context({"svg.fonttype": "none", "svg.hashsalt": "ahgateway", "font.size": 9}):
        out = io.StringIO()
        made.savefig(out, format="svg", metadata={"Date": None})
    text = out.getvalue()
    return Markup(text[text.index("<svg") :])
