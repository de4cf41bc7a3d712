"""Results as data: one report as one JSON object, the same for every command.

The form is normative (docs/reference/monitor-json.md). A REAL is written with the fewest digits that give its bits.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np

from ahgateway.apps.monitor import LinkChange, Monitor, Report, Sample
from ahgateway.clock import SECOND
from ahgateway.core import flags
from ahgateway.core.real import REAL, bits
from ahgateway.core.verdict import Counts, outcome, reason
from ahgateway.lockstep.cause_pages import code_of
from ahgateway.lockstep.events import Change, Finding, Lost
from ahgateway.lockstep.follow import Follower
from ahgateway.lockstep.judge import Execution
from ahgateway.lockstep.suspects import Estimate, Suspect

Json = dict[str, Any]


def number(value: Any) -> Any:
    """Return a value as JSON can hold it; a REAL by its shortest decimal, NaN and infinities as strings."""
    if isinstance(value, np.floating):
        value = float(np.format_float_positional(value, unique=True)) if np.isfinite(value) else float(value)
    if isinstance(value, float) and not math.isfinite(value):
        return "NaN" if math.isnan(value) else ("Infinity" if value > 0 else "-Infinity")
    return value


def hexadecimal(value: Any) -> str:
    """Return the bits as `0x414570a4`, of a whole number its word, `0x01f4`, of a switch `0x1`."""
    if isinstance(value, np.floating):
        return f"{bits(value):#010x}"
    if isinstance(value, bool):
        return f"{int(value):#x}"
    return f"{value & 0xFFFF:#06x}" if -0x8000 <= value <= 0xFFFF else f"{value & 0xFFFF_FFFF:#010x}"


def as_json(report: Report) -> Json | None:
    """Return one report as the object of one JSON line; None for what is only shown live."""
    event = report.event
    if isinstance(event, Sample):
        return None
    head: Json = {"t": report.utc_ns / SECOND, "loop": report.loop, "tick": report.tick}
    if isinstance(event, Execution):
        aligned_s = None if report.aligned_ns is None else report.aligned_ns / SECOND
        return head | {"kind": "execution"} | _execution(event) | {"aligned_since": aligned_s}
    if isinstance(event, Change):
        return head | {
            "kind": "operand", "operand": event.operand, "old": number(event.old), "new": number(event.new),
        }  # fmt: skip
    if isinstance(event, Finding):
        return head | {
            "kind": "finding", "name": event.name, "text": event.text, "hint": event.hint, "over": event.is_over,
        }  # fmt: skip
    if isinstance(event, Lost):
        return head | {"kind": "lost", "executions": event.executions, "records": event.records, "why": event.why}
    assert isinstance(event, LinkChange)
    return head | {"kind": "link", "up": event.is_up, "cause": event.cause}


def terms_json(terms: Any) -> Json | None:
    """Return the reference's terms by name; the flags by name too."""
    if terms is None:
        return None
    found = {name: number(value) for name, value in zip(terms._fields, terms, strict=True) if name != "flags"}
    return found | {"flags": list(flags.names(terms.flags))}


def _execution(event: Execution) -> Json:
    blame = event.blame
    return {
        "verdict": event.verdict.value,
        "proof": event.proof.value if event.proof else None,
        "class": event.weight.value if event.weight else None,
        "count": event.count,
        "reason": event.reason,
        "terms": terms_json(event.terms),
        "open_terms": list(event.open_terms),
        "term": blame.term if blame else None,
        "plc": number(blame.plc) if blame else None,
        "ref": number(blame.ref) if blame else None,
        "plc_bits": hexadecimal(blame.plc) if blame else None,
        "ref_bits": hexadecimal(blame.ref) if blame else None,
        "cause": blame.cause if blame else None,
        "code": code_of(blame.cause) if blame else None,
        "causes": causes_json(blame.suspects) if blame else [],
    }


def causes_json(suspects: Iterable[Suspect]) -> list[Json]:
    """Return causes, likeliest first, each with how large it is where that is a matter of size."""
    return [
        {
            "cause": suspect.cause,
            "code": code_of(suspect.cause),
            "operand": suspect.operand,
            "setting": suspect.setting,
            "evidence": suspect.evidence,
            "estimate": None if suspect.estimate is None else estimate_json(suspect.estimate),
        }
        for suspect in suspects
    ]


def estimate_json(estimate: Estimate) -> Json:
    """Return a real size with its interval."""
    return {
        "value": number(REAL(estimate.value)),
        "low": number(REAL(estimate.low)),
        "high": number(REAL(estimate.high)),
        "unit": estimate.unit,
        "by_bits": estimate.is_exact,
    }


def summary_json(monitor: Monitor, follower: Follower, utc_ns: int, coverage_min: float) -> Json:
    """Return a loop's last object: counts, coverage by class, and what the run may claim for it."""
    counts = follower.summary()
    picture = follower.picture
    return {
        "t": utc_ns / SECOND,
        "loop": follower.loop.name,
        "tick": picture.tick if picture else 0,
        "kind": "summary",
        "way": monitor.way(follower.loop.name).value,
        "counts": counts_json(counts),
        "coverage": coverage_json(counts),
        "verdict": outcome(counts, coverage_min).name,
        "reason": reason(counts, coverage_min),
        "findings": list(follower.findings),
        "cause": follower.suspects[0].cause if follower.suspects else None,
        "code": code_of(follower.suspects[0].cause) if follower.suspects else None,
        "causes": causes_json(follower.suspects),
        "torn_pictures": sum(watch.sampler.torn_count for watch in monitor.watches if watch.follower is follower),
    }


def counts_json(counts: Counts) -> Json:
    """Return how many executions fell under each verdict."""
    return {
        "match": counts.proven + counts.ulp + counts.tolerance,
        "informative": counts.informative,
        "trivial": counts.trivial,
        "ulp": counts.ulp,
        "tolerance": counts.tolerance,
        "diverged": counts.diverged,
        "unobservable": counts.unobservable,
        "link": counts.link,
    }


def coverage_json(counts: Counts) -> Json:
    """Return shares of all executions; their number is an estimate by time and CYCLE, and says so."""
    total = counts.total
    return {
        "proven": counts.coverage,
        "informative": counts.informative / total if total else 0.0,
        "trivial": counts.trivial / total if total else 0.0,
        "unobservable": counts.unobservable / total if total else 0.0,
        "lost": counts.link / total if total else 0.0,
        "executions": total,
        "executions_are": "estimated",
    }
