"""The tuning report: one HTML file with the data, the model, the residuals, the proposals and their predictions."""

from __future__ import annotations

from typing import Any

import numpy as np

from ahgateway.apps.pages import figure, framed, svg
from ahgateway.apps.tune import Tuning, compared, comparison_text, heads, iae, model_text, named, pace_note, rows, shown
from ahgateway.apps.tune_apply import Verification
from ahgateway.apps.tune_apply import as_text as verification_text
from ahgateway.apps.tune_spread import HEADS as SPREAD_HEADS
from ahgateway.apps.tune_spread import Spread, cells
from ahgateway.tuning.compare import Comparison
from ahgateway.tuning.predict import Response
from ahgateway.tuning.propose import Proposal

BODY = """
<p class="muted">{{ source }} · {{ samples }} samples every {{ interval }} s · noise {{ noise }}
{%- if resolution %} · resolution {{ resolution }}{% endif %}</p>
{% for each in findings %}
<div class="finding {{ each.weight.value }}"><strong>{{ each.weight.value }}: {{ each.name }}.</strong> {{ each.text }}.
{% if each.hint %}<br><em>{{ each.hint }}</em>{% endif %}</div>
{% endfor %}
<h2>Data and model</h2>
{% if model %}<p>{{ model }}<br><span class="muted">{{ reason }}; residual test p = {{ white }}</span></p>{% endif %}
<figure>{{ data_plot }}<figcaption>Above: PV as recorded and as the model gives it from MV alone. Middle: MV.
{%- if model %} Below: one-step prediction errors.{% endif %}</figcaption></figure>
{% if proposals %}
<h2>Proposals for {{ instruction }}, dial {{ dial }}</h2>
<table><tr>{% for head in heads %}<th>{{ head }}</th>{% endfor %}</tr>
{% for row in proposals %}<tr{% if row[0].endswith("*") %} class="chosen"{% endif %}>
{% for cell in row %}<td>{{ cell }}</td>{% endfor %}</tr>{% endfor %}</table>
<p class="muted">Computed from what the registers will hold, with the exact controller (binary32, CYCLE, limits, dead
band). Ms, GM and PM are those of the sampled loop. IAE in PV·s.{% for line in notes %} {{ line }}.{% endfor %}</p>
{% if chosen %}
<h2>Recommended: {{ chosen.name }}</h2>
<table><tr><th>operand</th><th>now</th><th>proposed</th></tr>
{% for name, old, new in changes %}<tr><td>{{ name }}</td><td>{{ old }}</td><td>{{ new }}</td></tr>{% endfor %}</table>
<p class="muted">{{ chosen.source }}</p>
{% endif %}
<h2>What {{ shown }} does</h2>
<figure>{{ prediction }}<figcaption>Predicted: above PV and MV after a step of SV by {{ sv_step }}, below after a load
step of {{ load_step }} in MV, both at 0 s.</figcaption></figure>
{% if compared %}<figure>{{ compared }}<figcaption>MV side by side, from the recorded SV and PV through the exact law:
{{ compared_text }}. PV is as recorded and does not answer here: where SV and PV stand apart the integral runs
on.</figcaption></figure>{% endif %}
{% if again %}<figure>{{ again }}<figcaption>The recorded run again, with what disturbed it then: as recorded (IAE
{{ recorded_iae }}), and with the gains of {{ shown }}.</figcaption></figure>{% endif %}
{% endif %}
{% if apart %}
<h2>Repeats</h2>
<p>{{ apart.count }} experiments, {{ apart.refused }} refused.</p>
<table><tr>{% for head in spread_heads %}<th>{{ head }}</th>{% endfor %}</tr>
{% for row in spread %}<tr>{% for cell in row %}<td>{{ cell }}</td>{% endfor %}</tr>{% endfor %}</table>
{% endif %}
{% if proof %}
<h2>Verification</h2>
<p>{{ proof_text }}</p>
<table><tr><th>written</th></tr>
{% for line in proof.lines %}<tr><td><code>{{ line }}</code></td></tr>{% endfor %}</table>
<figure>{{ proof_plot }}<figcaption>Predicted before, and measured: PV with what was allowed around the prediction, and
MV.</figcaption></figure>
{% endif %}
"""


def page(result: Tuning, proof: Verification | None = None, apart: Spread | None = None) -> str:
    """Return the report as one HTML page that needs nothing else.

    Args:
        result: The tuning.
        proof: What became of gains that were tried.
        apart: How far repeated experiments spread.
    """
    identified = result.identified
    record = identified.record
    facts: dict[str, Any] = {
        "source": record.name,
        "samples": record.t_s.size,
        "interval": f"{record.ts_s:g}",
        "noise": f"{identified.noise:.3g}",
        "resolution": f"{identified.resolution:g}" if identified.resolution else "",
        "findings": result.findings,
        "model": model_text(identified) if identified.fit else "",
        "reason": identified.reason,
        "white": f"{identified.whiteness.p:.2g}" if identified.whiteness else "-",
        "data_plot": _data(result),
        "proposals": rows(result),
        "heads": heads(result),
        "notes": pace_note(result),
        "dial": f"{result.dial:g}",
        "chosen": result.chosen,
    }
    loop = result.loop
    if loop is not None and result.found:
        best = named(result, proof.rule) if proof else result.chosen or result.found[0]
        facts |= {
            "instruction": loop.instruction,
            "sv_step": f"{loop.sv_step:g}",
            "load_step": f"{loop.load_step:g}",
            "prediction": _prediction(result, best),
            "shown": best.name,
            "changes": [
                (name, shown(loop.settings[name]), shown(value))
                for name, value in (result.chosen.settings.items() if result.chosen else ())
            ],
        }
        side_by_side = compared(result, best)
        if side_by_side is not None:
            facts |= {
                "compared": _side_by_side(side_by_side, best.name),
                "compared_text": comparison_text(side_by_side),
            }
        if best.name in result.again:
            trace = Response(record.t_s, record.sv, record.pv, record.mv)
            facts |= {"again": _again(trace, result.again[best.name], best.name), "recorded_iae": f"{iae(trace):.4g}"}
    if proof is not None:
        facts |= {
            "proof": proof,
            "proof_text": verification_text(proof).replace("\n ", ";"),
            "proof_plot": _proof(proof),
        }
    if apart is not None:
        facts |= {"spread": [cells(row) for row in apart.rows], "spread_heads": SPREAD_HEADS, "apart": apart}
    return framed(f"Tuning of {record.name}", BODY, **facts)


def _data(result: Tuning) -> Any:
    record, fit = result.identified.record, result.identified.fit
    made, axes = figure(3 if fit else 2)
    axes[0].plot(record.t_s, record.pv, color="#59626c", linewidth=0.9, label="PV")
    if fit is not None:
        axes[0].plot(record.t_s, record.pv[0] + fit.simulated, color="#b3261e", linewidth=1.2, label="model")
    if np.any(np.isfinite(record.sv)):
        axes[0].plot(record.t_s, record.sv, color="#1b1f24", linewidth=0.8, linestyle="--", label="SV")
    axes[0].legend(loc="best", frameon=False)
    axes[0].set_ylabel("PV")
    axes[1].step(record.t_s, record.mv, where="post", color="#1a5fb4", linewidth=1.0)
    axes[1].set_ylabel("MV")
    if fit is not None:
        axes[2].plot(record.t_s, fit.residuals, color="#59626c", linewidth=0.6)
        axes[2].set_ylabel("error")
    axes[-1].set_xlabel("s")
    return svg(made)


def _prediction(result: Tuning, best: Proposal) -> Any:
    made, axes = figure(4, 1.8)
    shown_ones = [best, *([result.present] if result.present else [])]
    for each, colour in zip(shown_ones, ("#26734d", "#59626c"), strict=False):
        for row, trace in ((0, each.setpoint_trace), (2, each.load_trace)):
            axes[row].plot(trace.t_s, trace.pv, color=colour, linewidth=1.2, label=each.name)
            axes[row + 1].step(trace.t_s, trace.mv, where="post", color=colour, linewidth=1.0)
    for row, trace, name in ((0, best.setpoint_trace, "SV step"), (2, best.load_trace, "load step")):
        axes[row].plot(trace.t_s, trace.sv, color="#1b1f24", linewidth=0.8, linestyle="--")
        axes[row].set_ylabel(f"PV, {name}")
        axes[row + 1].set_ylabel("MV")
    axes[0].legend(loc="best", frameon=False)
    axes[-1].set_xlabel("s")
    return svg(made)


def _again(then: Response, now: Response, name: str) -> Any:
    made, axes = figure(2)
    axes[0].plot(then.t_s, then.pv, color="#59626c", linewidth=0.9, label="as recorded")
    axes[0].plot(now.t_s, now.pv, color="#26734d", linewidth=1.1, label=name)
    axes[0].plot(then.t_s, then.sv, color="#1b1f24", linewidth=0.8, linestyle="--", label="SV")
    axes[0].legend(loc="best", frameon=False)
    axes[1].step(then.t_s, then.mv, where="post", color="#59626c", linewidth=0.9)
    axes[1].step(now.t_s, now.mv, where="post", color="#26734d", linewidth=1.0)
    axes[0].set_ylabel("PV")
    axes[1].set_ylabel("MV")
    axes[-1].set_xlabel("s")
    return svg(made)


def _side_by_side(found: Comparison, name: str) -> Any:
    made, axes = figure(2)
    axes[0].plot(found.t_s, found.pv, color="#59626c", linewidth=0.9, label="PV")
    axes[0].plot(found.t_s, found.sv, color="#1b1f24", linewidth=0.8, linestyle="--", label="SV")
    for values, colour, label in (
        (found.recorded, "#b9c0c7", "recorded"),
        (found.old, "#59626c", "present gains"),
        (found.new, "#26734d", name),
    ):
        axes[1].step(found.t_s, values, where="post", color=colour, linewidth=1.0, label=label)
    axes[0].set_ylabel("PV")
    axes[1].set_ylabel("MV")
    axes[1].legend(loc="best", frameon=False)
    axes[-1].set_xlabel("s")
    return svg(made)


def _proof(found: Verification) -> Any:
    made, axes = figure(2)
    low, high = found.predicted_pv - found.tube, found.predicted_pv + found.tube
    axes[0].fill_between(found.t_s, low, high, color="#eef6ee", linewidth=0.0)
    axes[0].plot(found.t_s, found.sv, color="#1b1f24", linewidth=0.8, linestyle="--", label="SV")
    axes[0].plot(found.t_s, found.pv, color="#59626c", linewidth=0.9, label="measured")
    axes[0].plot(found.t_s, found.predicted_pv, color="#26734d", linewidth=1.1, label="predicted")
    axes[1].step(found.t_s, found.mv, where="post", color="#59626c", linewidth=0.9)
    axes[1].step(found.t_s, found.predicted_mv, where="post", color="#26734d", linewidth=1.0)
    axes[0].legend(loc="best", frameon=False)
    axes[0].set_ylabel("PV")
    axes[1].set_ylabel("MV")
    axes[-1].set_xlabel("s")
    return svg(made)
