"""What the page shows, as JSON: the same rows as on the screen, and stretches of time as columns of numbers.

A number comes as it is, so that the page holds exactly what was seen; what is not known is null.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ahgateway.apps.board import Board
from ahgateway.apps.health import Health
from ahgateway.apps.history import History
from ahgateway.apps.lanes import lanes_of
from ahgateway.apps.lines import actuator_text, clock_time, shown
from ahgateway.apps.marks import TEXTS, Mark
from ahgateway.apps.monitor import Watch
from ahgateway.apps.player import Player
from ahgateway.apps.rows import NO_FRAMES, LoopRow, log_line, loop_row, operand_rows, round_trip_classes, term_rows
from ahgateway.apps.stretch import CURVES, Stretch, runs
from ahgateway.clock import MILLISECOND, SECOND
from ahgateway.core import flags

Json = dict[str, Any]

RECENT_S = 180.0
"""What the small trends of the first page look back on."""


def state(board: Board, history: History, station: str, player: Player | None) -> Json:
    """Return the line at the top and one row for each loop."""
    rows = [loop_row(board, watch) for watch in board.watches.values()]
    return {
        "station": station,
        "target": board.monitor.link.target,
        "up": board.monitor.is_up,
        "t": board.clock.utc_ns() / SECOND,
        "reach": history.reach(),
        "moves": 1.0 if player is None else player.moves,
        "player": None if player is None else player.text(),
        "stale": sum(row.is_stale for row in rows),
        "diverged": sum(row.counts.diverged > 0 for row in rows),
        "loops": [_row(row, board.watches[row.name]) for row in rows],
    }


def _row(row: LoopRow, watch: Watch) -> Json:
    counts = row.counts
    return {
        "name": row.name,
        "instruction": row.instruction,
        "word": row.word,
        "proven": counts.proven,
        "total": counts.total,
        "coverage": counts.coverage,
        "diverged": counts.diverged,
        "sv": row.values[0],
        "pv": row.values[1],
        "mv": row.values[2],
        "units": [watch.loop.pv_unit, watch.loop.mv_unit],
        "mode": row.mode,
        "way": row.way,
        "age_s": None if row.age_ns is None else row.age_ns / SECOND,
        "stale": row.is_stale,
        "health": row.health,
        "notes": row.notes,
        "look": row.needs_a_look,
    }


def recent(board: Board, since_s: float) -> Json:
    """Return the samples of every loop behind a moment, at most `RECENT_S` back: what moves the small trends."""
    now_s = board.clock.utc_ns() / SECOND
    first_s = max(since_s, now_s - RECENT_S)
    found = {}
    for name, trail in board.trails.trails.items():
        trace = trail.trace(math.nextafter(first_s, math.inf))
        found[name] = {
            "t": trace.t_s.tolist(),
            "sv": _column(trace.sv),
            "pv": _column(trace.pv),
            "mv": _column(trace.mv),
            "mark": trace.mark.astype(int).tolist(),
        }
    return {"t": now_s, "loops": found}


def stretch_json(found: Stretch) -> Json:
    """Return a stretch as columns, marks as runs."""
    return {
        "t": found.t_s.tolist(),
        **{name: _column(curve) for name, curve in zip(CURVES, found.curves, strict=True)},
        "lanes": [_column(lane) for lane in found.lanes],
        "runs": runs(found),
        "whole": found.is_whole,
    }


def loop_json(board: Board, name: str) -> Json:
    """Return one loop's page but for its trend."""
    watch = board.watches[name]
    last = watch.follower.last
    terms = last.terms if last is not None else None
    said = board.statement(name)
    return {
        "row": _row(loop_row(board, watch), watch),
        "terms": [
            {
                "name": row.name,
                "plc": None if row.plc is None else shown(row.plc),
                "ref": None if row.ref is None else f"{'~' if row.is_open else ''}{shown(row.ref)}",
                "same": row.is_same,
                "compared": row.compared,
            }
            for row in term_rows(watch)
        ],
        "actuator": actuator_text(terms),
        "flags": list(flags.names(terms.flags)) if terms is not None else [],
        "reason": last.reason if last is not None else "no execution seen yet",
        "operands": [
            {
                "name": row.name,
                "device": row.device,
                "value": row.value,
                "unit": row.unit,
                "changed": None
                if row.change is None
                else f"{clock_time(row.change[0]).partition('.')[0]} "
                f"{shown(row.change[1].old)} → {shown(row.change[1].new)}",
            }
            for row in operand_rows(board, watch)
        ],
        "health": health_json(board.health(name), watch),
        "statement": said.text if said is not None else None,
    }


def health_json(found: Health | None, watch: Watch) -> list[tuple[str, str]] | None:
    """Return the figures as names and texts; None while there are too few samples."""
    if found is None:
        return None
    pv, mv = watch.loop.pv_unit, watch.loop.mv_unit
    figures = [
        ("window", f"{found.duration_s:.0f} s, {found.samples} samples"),
        ("in automatic", f"{found.auto_share:.0%}"),
        ("at limits", f"low {found.low_share:.0%}, high {found.high_share:.0%}"),
        ("IAE", f"{found.iae:.4g} {pv}·s"),
        ("error", f"mean {found.error_mean_abs:.3g} {pv}, σ {found.error_std:.3g} {pv}"),
        ("MV travel", f"{found.mv_travel:.4g} {mv}, {found.reversals} reversals"),
        ("PV noise", f"{found.noise:.3g} {pv}" + (f", steps of {found.resolution:.3g}" if found.resolution else "")),
    ]
    if found.variability is not None:
        figures.insert(5, ("variability", f"{found.variability:.3g} %"))
    swing = found.oscillation
    if swing is not None:
        word = "yes" if found.oscillates else "no"
        figures.append(
            (
                "oscillation",
                f"{word}: {swing.period_s:.3g} s, ±{swing.amplitude:.3g} {pv}, regularity {swing.regularity:.2g}",
            )
        )
    if found.stiction is not None:
        figures.append(("stiction", found.stiction.says))
    return figures


def link_json(board: Board, frames: list[str]) -> Json:
    """Return the link's page."""
    figures = board.monitor.link.figures
    mean_ns = figures.round_trip_total_ns / figures.replies if figures.replies else None
    return {
        "target": board.monitor.link.target,
        "up": board.monitor.is_up,
        "figures": [
            ("requests", figures.requests),
            ("replies", figures.replies),
            ("exceptions", figures.refused),
            ("time-outs", figures.timeouts),
            ("late replies dropped", figures.late),
            ("reconnects", figures.reconnects),
            ("bytes of no frame", figures.garbage_bytes),
        ],
        "first_cause": figures.first_cause,
        "mean_ms": None if mean_ns is None else mean_ns / MILLISECOND,
        "worst_ms": figures.round_trip_worst_ns / MILLISECOND,
        "classes": round_trip_classes(figures.round_trips_ns),
        "frames": frames or [NO_FRAMES],
    }


def log_json(board: Board, after: int) -> Json:
    """Return what happened since so many events, newest last."""
    kept = list(board.events)
    new = kept[-max(0, board.event_count - after) :] if board.event_count > after else []
    return {"count": board.event_count, "cuts": board.cut_count, "lines": [line for line in map(log_line, new) if line]}


def legend() -> list[tuple[int, str]]:
    """Return the marks of a time line with what they mean."""
    return [(int(mark), TEXTS[mark]) for mark in Mark if mark in TEXTS]


def lanes_json(watch: Watch) -> list[Json]:
    """Return what drives the actuator, line by line."""
    return [{"name": lane.name, "unit": lane.unit, "switch": lane.is_switch} for lane in lanes_of(watch.loop)]


def _column(values: NDArray[np.float64]) -> list[float | None]:
    return [value if math.isfinite(value) else None for value in values.tolist()]
