"""The migration report: settings on both sides, losses with their sizes, both controllers side by side."""

from __future__ import annotations

from typing import Any

from ahgateway.apps.migrate import Migration, Run
from ahgateway.apps.migrate_text import fragment
from ahgateway.apps.pages import figure, framed, svg
from ahgateway.apps.tune import shown

BODY = """
<p><strong>{{ text }}</strong></p>
<h2>Settings</h2>
<table><tr><th>{{ source }}</th><th></th><th>{{ target }}</th><th></th></tr>
{% for left, old, right, new in settings %}
<tr><td>{{ left }}</td><td>{{ old }}</td><td>{{ right }}</td><td>{{ new }}</td></tr>{% endfor %}</table>
<h2>What differs</h2>
{% for each in losses %}
<div class="finding {{ 'muted' if each.is_exact else 'warning' }}"><strong>{{ each.code }}</strong>
{% if each.size and each.unit %}({{ '%.3g'|format(each.size) }} {{ each.unit }}){% endif %} {{ each.text }}.</div>
{% else %}<p>Nothing.</p>{% endfor %}
<h2>Proof</h2>
{% if runs %}<p class="muted">Both run in their own arithmetic on {{ process }}, from the same rest.</p>{% endif %}
{% for run, plot in runs %}<figure>{{ plot }}<figcaption>{{ run.name }}: MV differs by up to
{{ '%.3g'|format(100 * run.mv_apart) }} %, PV by up to {{ '%.3g'|format(100 * run.pv_apart) }} % of their ranges.
</figcaption></figure>{% else %}
<p>None: {{ text }}.</p>{% endfor %}
<h2>Profile fragment</h2>
<pre>{{ fragment }}</pre>
"""


def page(found: Migration, name: str) -> str:
    """Return the report as one HTML page that needs nothing else."""
    made = found.conversion
    left = [(key, shown(value)) for key, value in made.given.items()]
    right = [(key, shown(value)) for key, value in made.settings.items()]
    count = max(len(left), len(right))
    left += [("", "")] * (count - len(left))
    right += [("", "")] * (count - len(right))
    process = found.process
    return framed(
        f"{made.source} to {made.target}",
        BODY,
        text=found.text,
        source=made.source,
        target=made.target,
        settings=[(*one, *other) for one, other in zip(left, right, strict=True)],
        losses=made.losses,
        process=f"{process.kind.value}, K {process.gain:.4g}, dead time {process.dead_time_s:.4g} s, "
        f"τ {process.tau_s:.4g} s ({found.process_text})",
        runs=[(run, _plot(run, made.source, made.target)) for run in found.runs],
        fragment=fragment(found, name),
    )


def _plot(run: Run, old: str, new: str) -> Any:
    made, axes = figure(2)
    axes[0].plot(run.old.t_s, run.old.sv, color="#1b1f24", linewidth=0.8, linestyle="--", label="SV")
    for trace, name, colour, style in ((run.old, old, "#59626c", "-"), (run.new, new, "#26734d", "--")):
        axes[0].plot(trace.t_s, trace.pv, color=colour, linestyle=style, linewidth=1.2, label=name)
        axes[1].step(trace.t_s, trace.mv, where="post", color=colour, linestyle=style, linewidth=1.1)
    low, high = float(min(run.old.pv.min(), run.new.pv.min())), float(max(run.old.pv.max(), run.new.pv.max()))
    room = 0.1 * (high - low) or 1.0
    axes[0].set_ylim(low - room, high + room)
    axes[0].legend(loc="best", frameon=False)
    axes[0].set_ylabel("PV")
    axes[1].set_ylabel("MV")
    axes[1].set_xlabel("s")
    return svg(made)
