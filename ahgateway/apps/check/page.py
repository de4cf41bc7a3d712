"""A run of scenarios as one HTML page that prints: the summary, then each scenario with its expectations and plot."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime
from typing import Any

from ahgateway.apps.check.fingerprint import Difference
from ahgateway.apps.check.history import Past
from ahgateway.apps.check.history import sentence as said_of
from ahgateway.apps.check.pace import sentence
from ahgateway.apps.check.result import Floor, Result, State, Verdict
from ahgateway.apps.pages import figure, framed, svg
from ahgateway.clock import SECOND

PLOTS_MAX = 60
"""Most scenarios that get a plot; failures come first."""

BODY = """
<style>td:first-child { white-space: nowrap }
code { font-size: 1rem; letter-spacing: .1em } .fail { color: #b3261e; font-weight: 700 }
.inconclusive, .error, .known { color: #b57700; font-weight: 700 }</style>
<p class="muted">{{ target }} · {{ when }} · seed {{ seed }} · {{ took }} s for {{ simulated }} s simulated</p>
<p><b>{{ claim }}</b></p>
<div class="finding {{ '' if floor.is_sound else 'refused' }}">Bench against itself: {{ floor.text }}.</div>
<table><tr><th>Scenario</th><th>Verdict</th><th>Why</th><th>Executions</th><th>Proven</th></tr>
{% for each in results %}
<tr><td><a href="#r{{ loop.index }}">{{ each.name }}</a></td><td>{{ each.verdict.value }}</td><td>{{ each.reason }}</td>
<td>{{ each.counts.total }}</td><td>{{ '%.0f %%'|format(100 * each.counts.coverage) }}</td></tr>
{% endfor %}
</table>
{% if past %}<h2>History</h2>
<p class="muted">The last runs on this target, oldest left: . passed, F failed, k known, ? inconclusive, E error.</p>
<table><tr><th>Scenario</th><th>Runs</th><th></th></tr>
{% for each in past %}
<tr><td>{{ each.name }}</td><td><code>
{%- for verdict in each.verdicts %}<span class="{{ verdict }}">{{ marks[verdict] }}</span>{% endfor -%}
</code></td><td>{{ said(each) }}</td></tr>
{% endfor %}</table>
{% for picture in drifts %}<figure>{{ picture }}</figure>{% endfor %}{% endif %}
{% if against %}<h2>Against {{ against }}</h2>
{% if differences %}<table><tr><th>Scenario</th><th>Difference</th></tr>
{% for each in differences %}<tr><td>{{ each.scenario }}</td><td>{{ each.text }}</td></tr>{% endfor %}</table>
{% else %}<p>The same words, change by change.</p>{% endif %}{% endif %}
{% for each in results %}
<h2 id="r{{ loop.index }}">{{ each.name }} <small class="muted">{{ each.title }}</small></h2>
<div class="finding {{ colours[each.verdict] }}"><b>{{ each.verdict.value }}</b> {{ each.reason }}</div>
{% if each.outcomes %}<table><tr><th>Expectation</th><th></th><th>What was seen</th></tr>
{% for out in each.outcomes %}
<tr><td>{{ out.name }}</td><td>{{ out.state.value }}</td><td>{{ out.text }}</td></tr>
{% endfor %}</table>{% endif %}
{% for trouble in each.troubles %}
<p>Bench, from {{ '%.2f'|format(trouble.at_s) }} s on: {{ trouble.text }}</p>{% endfor %}
{% if each.pace %}<p class="muted">Pace: {{ pace(each.pace) }}.</p>{% endif %}
{% if plots[each.name] is defined %}<figure>{{ plots[each.name] }}</figure>{% endif %}
{% endfor %}
"""

DRIFTS_MAX = 12
"""Most figures of which the course over the nights is drawn."""

MARKS = {"pass": ".", "fail": "F", "known": "k", "inconclusive": "?", "error": "E"}

COLOURS = {Verdict.FAIL: "refused", Verdict.ERROR: "warning", Verdict.INCONCLUSIVE: "warning", Verdict.KNOWN: "warning"}


def page(
    results: Sequence[Result],
    *,
    floor: Floor,
    target: str,
    claim: str,
    seed: int,
    utc_ns: int,
    against: str = "",
    differences: Sequence[Difference] = (),
    past: Sequence[Past] = (),
) -> str:
    """Return the whole page.

    Args:
        results: In the order in which they ran.
        floor: What the bench made of itself.
        target: What they ran on.
        claim: The run in one sentence.
        seed: Of the noise.
        utc_ns: When the run began.
        against: Fingerprint file that the run was compared with; empty for none.
        differences: What differs from it.
        past: What is known of these scenarios from earlier runs; those with one run only are left out.
    """
    worst = sorted(results, key=lambda each: each.verdict is Verdict.PASS)[:PLOTS_MAX]
    return framed(
        "ahgateway check",
        BODY,
        results=results,
        floor=floor,
        target=target,
        claim=claim,
        seed=seed,
        against=against,
        differences=differences,
        when=datetime.fromtimestamp(utc_ns // SECOND, UTC).strftime("%Y-%m-%d %H:%M UTC"),
        took=f"{sum(each.wall_s for each in results):.1f}",
        simulated=f"{sum(each.simulated_s for each in results):.0f}",
        pace=sentence,
        past=[each for each in past if each.runs > 1],
        said=said_of,
        marks=MARKS,
        drifts=[drift(each, name) for each in past for name in each.moved][:DRIFTS_MAX],
        colours=COLOURS | {Verdict.PASS: ""},
        plots={each.name: plot(each) for each in worst if each.trace.get("t")},
    )


def drift(past: Past, name: str) -> Any:
    """Return one figure of one scenario over the last runs as SVG."""
    made, (axes,) = figure(1, 1.5)
    values = past.series[name]
    runs = [number for number, value in enumerate(values, 1) if value is not None]
    axes.plot(runs, [value for value in values if value is not None], color="#1f5fa8", marker="o", markersize=3.5)
    failed = [number for number in runs if past.verdicts[number - 1] == Verdict.FAIL.value]
    axes.plot(failed, [values[number - 1] for number in failed], "x", color="#b3261e", markersize=9, label="failed")
    axes.set_title(f"{past.name}: {name}", loc="left", fontsize=9)
    axes.set_xlabel(f"run; {past.nights[0]} to {past.nights[-1]}")
    axes.xaxis.get_major_locator().set_params(integer=True)
    if failed:
        axes.legend(loc="best", fontsize=8, frameon=False)
    return svg(made)


def plot(result: Result) -> Any:
    """Return SV, PV and MV over time as SVG, with the moments at which an expectation was violated."""
    made, (upper, lower) = figure(2, 1.5)
    t = result.trace["t"]
    upper.plot(t, result.trace["SV"], color="#59626c", linestyle="--", linewidth=1.0, label="SV")
    upper.plot(t, result.trace["PV"], color="#1f5fa8", linewidth=1.1, label="PV")
    lower.plot(t, result.trace["MV"], color="#b57700", linewidth=1.1, drawstyle="steps-post", label="MV")
    lower.set_xlabel("s")
    for axes in (upper, lower):
        axes.legend(loc="best", fontsize=8, frameon=False)
        for each in result.outcomes:
            if each.state is State.VIOLATED and each.at_s is not None:
                axes.axvline(each.at_s, color="#b3261e", linewidth=0.9)
    return svg(made)
