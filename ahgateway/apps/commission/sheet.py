"""Step 6, the sheet to sign: one HTML file that prints to A4, and the same as JSON. It fetches nothing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from io import StringIO
from typing import Any

from ahgateway import __version__
from ahgateway.apps.commission.catalogue import CATALOGUE
from ahgateway.apps.commission.checks import Progress, Step, as_json, exit_for
from ahgateway.apps.commission.reading import dialect_text
from ahgateway.clock import SECOND
from ahgateway.codec.station import Const, Loop, Station
from ahgateway.recording.station_text import dialect_json

VERDICT = {0: "PASS", 1: "FAIL", 3: "INCONCLUSIVE"}


@dataclass(frozen=True, slots=True)
class Heading:
    """What a person adds to the sheet: who, with which instruments, remarks."""

    by: str = ""
    instruments: tuple[str, ...] = ()
    remarks: str = ""

    @classmethod
    def kept(cls, progress: Progress, typed: Heading) -> Heading:
        """Return what was typed, now or in an earlier call, and keep it with the progress."""
        before = progress.facts.get("heading", {})
        found = cls(
            typed.by or before.get("by", ""),
            typed.instruments or tuple(before.get("instruments", ())),
            typed.remarks or before.get("remarks", ""),
        )
        progress.facts["heading"] = {
            "by": found.by, "instruments": list(found.instruments), "remarks": found.remarks,
        }  # fmt: skip
        return found


def sheet_json(progress: Progress, station: Station, loop: Loop, heading: Heading, utc_ns: int) -> dict[str, Any]:
    """Return everything that stands on the sheet as one object."""
    return {
        **as_json(progress),
        "kind": "commissioning sheet",
        "version": __version__,
        "utc_ns": utc_ns,
        "rehearsal": station.target.startswith("fake://"),
        "verdict": VERDICT[int(exit_for(progress.checks))],
        "station": {"name": station.name, "target": station.target, "unit": station.unit,
                    "device_map": station.devices.name},
        "loop": {"name": loop.name, "instruction": loop.controller.name,
                 "dialect": {axis: value if isinstance(value, str) else float(value)
                             for axis, value in dialect_json(loop.controller, loop.dialect).items()},
                 "devices": {name: str(getattr(each, "value", each)) for name, each in loop.bindings.items()}},
        "by": heading.by, "instruments": list(heading.instruments), "remarks": heading.remarks,
        "operands": differences(progress.facts, loop),
    }  # fmt: skip


def differences(facts: Mapping[str, Any], loop: Loop) -> list[dict[str, Any]]:
    """Return each operand as found and as left, and whether somebody changed it."""
    found, left = facts.get("as_found"), facts.get("as_left")
    roles = loop.controller.roles
    # They change by themselves; a difference of theirs is no change of the loop.
    own = {*roles.pvs, *roles.signals, roles.mout, *(seen.operand for seen in loop.controller.seen)}
    rows = []
    for row in loop.controller.operands:
        binding = loop.bindings[row.name]
        device = f"const {binding.value}" if isinstance(binding, Const) else str(binding)
        before = found["words"].get(row.name) if found else None
        after = left["words"].get(row.name) if left else None
        rows.append(
            {
                "operand": row.name, "device": device, "unit": _unit(row.unit, loop),
                "as_found": found["values"].get(row.name) if found else None,
                "as_left": left["values"].get(row.name) if left else None,
                "changed": before != after and before is not None and after is not None and row.name not in own,
            }
        )  # fmt: skip
    return rows


def _unit(unit: str, loop: Loop) -> str:
    return {"PV": loop.pv_unit, "MV": loop.mv_unit}.get(unit, unit)


def html(progress: Progress, station: Station, loop: Loop, heading: Heading, utc_ns: int) -> str:
    """Return the sheet as one HTML page with its plots inside."""
    from jinja2 import Environment, StrictUndefined

    facts = sheet_json(progress, station, loop, heading, utc_ns)
    environment = Environment(autoescape=True, undefined=StrictUndefined)
    environment.filters["cell"] = _cell
    template = environment.from_string(TEMPLATE)
    plots = [
        {"title": title, "svg": plot(facts["facts"][key], loop)}
        for key, title in (("trace", "Observation"), ("wiring_trace", "Wiring test"))
        if facts["facts"].get(key, {}).get("t")
    ]
    steps = [
        {
            "number": step.value, "title": step.title,
            "when": _when(progress.times[step]) if step in progress.times else "not done",
            "rows": [{"kind": CATALOGUE[check.name], "outcome": check.outcome.value, "text": check.text}
                     for check in progress.steps.get(step, ())],
        }
        for step in Step
    ]  # fmt: skip
    return template.render(
        sheet=facts,
        when=_when(utc_ns),
        steps=steps,
        plots=plots,
        journal=facts["facts"].get("journal"),
        dialect=dialect_text(loop),
    )


def _cell(value: Any) -> str:
    if value is None:
        return "—"
    return str(value).upper() if isinstance(value, bool) else str(value)


def _when(utc_ns: int) -> str:
    return datetime.fromtimestamp(utc_ns // SECOND, UTC).strftime("%Y-%m-%d %H:%M:%S UTC")


def plot(trace: Mapping[str, Sequence[float]], loop: Loop) -> str:
    """Return SV, PV and MV over time as inline SVG."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.2, 2.7), layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    upper.plot(trace["t"], trace["SV"], color="#888888", linestyle="--", label="SV")
    upper.plot(trace["t"], trace["PV"], color="#1f4e9c", linewidth=1.0, label="PV")
    upper.set_ylabel(loop.pv_unit or "PV")
    upper.legend(loc="best", fontsize=7)
    lower.plot(trace["t"], trace["MV"], color="#b03a2e", linewidth=1.0, drawstyle="steps-post", label="MV")
    lower.set_ylabel(f"MV {loop.mv_unit}")
    lower.set_xlabel("s")
    for axes in (upper, lower):
        axes.grid(visible=True, linewidth=0.3)
        axes.tick_params(labelsize=7)
    out = StringIO()
    figure.savefig(out, format="svg", metadata={"Date": None, "Creator": None})
    text = out.getvalue()
    return text[text.index("<svg") :]


TEMPLATE = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>{{ sheet.loop.name }} commissioning sheet</title>
<style>
@page { size: A4; margin: 14mm; }
body { font: 10pt/1.35 "Helvetica Neue", Arial, sans-serif; color: #111; max-width: 182mm; margin: 6mm auto; }
h1 { font-size: 16pt; margin: 0 0 2mm; } h2 { font-size: 12pt; margin: 6mm 0 1.5mm; break-after: avoid; }
table { border-collapse: collapse; width: 100%; font-size: 8.5pt; }
th, td { border: 0.3pt solid #888; padding: 0.8mm 1.6mm; text-align: left; vertical-align: top; }
th { background: #eee; } tr { break-inside: avoid; } td.n { text-align: right; font-variant-numeric: tabular-nums; }
.fail { background: #f8d7d4; font-weight: bold; } .pass { background: #e2f2e2; } .inconclusive { background: #fdf1cf; }
.changed { background: #fdf1cf; font-weight: bold; } .mono { font-family: monospace; overflow-wrap: anywhere; }
.verdict { font-size: 13pt; font-weight: bold; padding: 1.5mm 3mm; display: inline-block; border: 0.6pt solid #444; }
figure { margin: 2mm 0; break-inside: avoid; } svg { width: 100%; height: auto; }
.sign td { height: 11mm; width: 33%; } .end { break-inside: avoid; }
.code { width: 15mm; } .check { width: 38mm; } .outcome { width: 20mm; }
</style></head><body>
<h1>{{ sheet.loop.name }} <small>{{ sheet.loop.instruction }}</small></h1>
<p class="verdict {{ {'PASS': 'pass', 'FAIL': 'fail'}.get(sheet.verdict, 'inconclusive') }}">{{ sheet.verdict }}</p>
{% if sheet.rehearsal %}<p class="verdict inconclusive">REHEARSAL on a fake PLC,
it says nothing about a plant</p>{% endif %}
<table>
<tr><th>Station</th><td>{{ sheet.station.name }}</td><th>Target</th><td class="mono">{{ sheet.station.target }},
unit {{ sheet.station.unit }}</td></tr>
<tr><th>Device map</th><td>{{ sheet.station.device_map }}</td><th>Written</th><td>{{ when }}</td></tr>
<tr><th>By</th><td>{{ sheet.by or '—' }}</td><th>Instruments</th><td>{{ sheet.instruments|join(', ') or '—' }}</td></tr>
<tr><th>Dialect</th><td colspan="3">{{ dialect }}</td></tr>
{% if sheet.remarks %}<tr><th>Remarks</th><td colspan="3">{{ sheet.remarks }}</td></tr>{% endif %}
</table>
{% for step in steps %}
<h2>{{ step.number }} {{ step.title|capitalize }} <small>{{ step.when }}</small></h2>
{% if step.rows %}<table>
<tr><th class="code">Code</th><th class="check">Check</th><th class="outcome">Outcome</th><th>What was seen</th></tr>
{% for row in step.rows %}<tr><td>{{ row.kind.code }}</td><td>{{ row.kind.name }}</td>
<td class="{{ row.outcome }}">{{ row.outcome }}</td><td>{{ row.text }}
{%- if row.outcome == 'fail' %}<br><i>{{ row.kind.do }}</i>{% endif %}</td></tr>
{% endfor %}</table>{% endif %}
{% endfor %}
{% for each in plots %}<figure><figcaption>{{ each.title }}</figcaption>{{ each.svg|safe }}</figure>{% endfor %}
<h2>As found, as left</h2>
<table><tr><th>Operand</th><th>Device</th><th>As found</th><th>As left</th><th>Unit</th></tr>
{% for row in sheet.operands %}<tr{% if row.changed %} class="changed"{% endif %}><td>{{ row.operand }}</td>
<td>{{ row.device }}</td><td class="n">{{ row.as_found|cell }}</td>
<td class="n">{{ row.as_left|cell }}</td><td>{{ row.unit }}</td></tr>
{% endfor %}</table>
<div class="end"><h2>Journal</h2>
<p class="mono">{% if journal %}{{ journal.file }}<br>last hash {{ journal.hash }}
{%- else %}nothing was ever written to this loop from this machine{% endif %}</p>
<p>Profile <span class="mono">{{ sheet.profile }}</span>, ahgateway {{ sheet.version }}.
{% if journal %}Check with
<span class="mono">ahgateway journal verify FILE --anchor {{ journal.hash }}</span>.{% endif %}</p>
<h2>Signatures</h2>
<table class="sign"><tr><th>Commissioned by</th><th>Operations</th><th>Date</th></tr>
<tr><td></td><td></td><td></td></tr></table></div>
</body></html>
"""
