"""Reports as plain lines, one fact a line, understandable without colour; for pipes and for people."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Any

import numpy as np

from ahgateway.apps.monitor import LinkChange, Monitor, Report
from ahgateway.apps.report import hexadecimal, number
from ahgateway.clock import MILLISECOND, SECOND
from ahgateway.codec.ways import Way
from ahgateway.core import flags
from ahgateway.core.controllers.pid_reg_ce import PHASES
from ahgateway.core.real import ulp_distance
from ahgateway.core.verdict import Verdict, reason
from ahgateway.lockstep.cause_pages import code_of
from ahgateway.lockstep.events import Change, Finding, Lost
from ahgateway.lockstep.follow import Follower, output_of, process_value_of, target_of, verdict_now
from ahgateway.lockstep.judge import Execution
from ahgateway.lockstep.suspects import Blame
from ahgateway.transports.base import LinkFigures


def clock_time(utc_ns: int) -> str:
    """UTC time of day with milliseconds."""
    moment = datetime.fromtimestamp(utc_ns // SECOND, UTC)
    return f"{moment:%H:%M:%S}.{utc_ns % SECOND // MILLISECOND:03d}Z"


def shown(value: Any) -> str:
    """A value as people read it: a REAL by its shortest decimal, a switch as ON or OFF."""
    if isinstance(value, bool):
        return "ON" if value else "OFF"
    plain = number(value)
    return f"{plain:.7g}" if isinstance(plain, float) else str(plain)


def event_line(report: Report) -> str | None:
    """Return the line of a report that a person wants to see at once; None for what goes right."""
    event = report.event
    where = f"{clock_time(report.utc_ns)} {report.loop or 'link'}"
    if isinstance(event, Execution):
        if event.verdict is Verdict.DIVERGED and event.blame is not None:
            return f"{where} tick {report.tick} DIVERGED: {blame_text(event.blame)}"
        return None
    if isinstance(event, Change):
        return f"{where} operand {event.operand}: {shown(event.old)} -> {shown(event.new)}"
    if isinstance(event, Finding):
        state = "over" if event.is_over else "finding"
        hint = f" (hint: {event.hint})" if event.hint and not event.is_over else ""
        return f"{where} {state} {event.name}: {event.text}{hint}"
    if isinstance(event, Lost):
        records = f"{event.records} records" if event.records else "no record"
        return f"{where} lost {records}, about {event.executions:.0f} executions: {event.why}"
    if isinstance(event, LinkChange):
        return f"{where} up" if event.is_up else f"{where} down: {event.cause}"
    return None


def blame_text(blame: Blame) -> str:
    """Which term, both values, both bit patterns, and the likeliest cause with its evidence."""
    distance = ulp_distance(blame.plc, blame.ref) if isinstance(blame.plc, np.floating) else None
    apart = f", {distance} ULP" if distance is not None else ""
    suspect = blame.suspects[0]
    return (
        f"{blame.term} plc {shown(blame.plc)} ({hexadecimal(blame.plc)}), "
        f"ref {shown(blame.ref)} ({hexadecimal(blame.ref)}){apart}; "
        f"cause {suspect.cause} ({code_of(suspect.cause)}): {suspect.evidence}"
    )


def status_line(follower: Follower, utc_ns: int, now_ns: int, way: Way | None = None) -> str:
    """One loop as it stands now, and how its executions are seen."""
    picture, loop = follower.picture, follower.loop
    name = loop.name
    if picture is None:
        return f"{clock_time(utc_ns)} {name} no picture yet"
    counts = follower.summary()
    verdict = verdict_now(follower)
    age_s = max(0, now_ns - picture.last_ns) / SECOND  # a recorder's clock may be a little before ours
    return (
        f"{clock_time(utc_ns)} {name} {verdict.value if verdict else 'WAITING'} "
        f"SV {shown(target_of(loop, picture))} PV {shown(process_value_of(loop, picture))} "
        f"MV {shown(output_of(loop, picture))} "
        f"{terms_text(follower)} proven {counts.proven} of {counts.total} ({counts.coverage:.1%}) "
        f"diverged {counts.diverged} way {(way or loop.way).value} age {age_s:.2f} s"
    )


def terms_text(follower: Follower) -> str:
    """P, I, D and BIAS of the reference's last execution, what drives the actuator, and what it says of itself.

    `~` marks unsettled bits. Pulses of a motor valve show their phase and what is left of it in calls, heating and
    cooling show their share and whether their pulse is on.
    """
    last = follower.last
    if last is None or last.terms is None:
        return "P - I - D -"
    terms = last.terms
    text = " ".join(
        f"{name.upper()} {'~' if name in last.open_terms else ''}{shown(getattr(terms, name))}"
        for name in ("p", "i", "d", "bias")
        if hasattr(terms, name)
    )
    said = ",".join(flags.names(terms.flags))
    drives = actuator_text(terms)
    text = f"{text} {drives}".strip() if drives else text
    return f"{text} [{said}]" if said else text


def actuator_text(terms: Any) -> str:
    """What a motor valve, or heating and cooling, are told to do; empty for an ordinary output."""
    if hasattr(terms, "open_out"):
        motion = "OPEN" if terms.open_out else ("CLOSE" if terms.close_out else "STAND")
        return f"{PHASES[terms.phase]} {terms.ticks} {motion}"
    if hasattr(terms, "outputheat"):
        heat, cool = terms.outputheat_pwm, terms.outputcool_pwm
        return f"HEAT {shown(terms.outputheat)} {shown(heat)} COOL {shown(terms.outputcool)} {shown(cool)}"
    return ""


def link_line(target: str, figures: LinkFigures) -> str:
    """The link's totals."""
    mean_ns = figures.round_trip_total_ns // figures.replies if figures.replies else 0
    return (
        f"link {target}: {figures.requests} requests, {figures.replies} replies, {figures.timeouts} time-outs, "
        f"{figures.refused} refused, {figures.reconnects} reconnects, round trip {mean_ns / MILLISECOND:.2f} ms mean, "
        f"{figures.round_trip_worst_ns / MILLISECOND:.2f} ms worst"
    )


def summary_lines(monitor: Monitor, coverage_min: float) -> list[str]:
    """What the run found, loop by loop, and what it may claim."""
    lines = []
    for watch in monitor.watches:
        counts = watch.follower.summary()
        lines.append(
            f"{watch.loop.name}: {reason(counts, coverage_min)}; informative {counts.informative}, "
            f"trivial {counts.trivial}, ulp {counts.ulp}, tolerance {counts.tolerance}, diverged {counts.diverged}, "
            f"unobservable {counts.unobservable}, lost with the link {counts.link}, "
            f"torn pictures {watch.sampler.torn_count}; way {watch.way(monitor.station).value}"
        )
        if watch.refused:
            lines.append(f"{watch.loop.name}: {watch.refused}")
        first = watch.follower.first_diverged
        if first is not None and first[1].blame is not None:
            lines.append(f"{watch.loop.name}: first at tick {first[0].tick}: {blame_text(first[1].blame)}")
        suspects = watch.follower.suspects
        if suspects:
            cause = suspects[0].cause
            lines.append(f"{watch.loop.name}: likely cause {cause} ({code_of(cause)}): {suspects[0].evidence}")
    lines.append(link_line(monitor.link.target, monitor.link.figures))
    return lines
