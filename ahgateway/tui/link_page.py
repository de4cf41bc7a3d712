"""The link: totals, first cause of trouble, round trips as a histogram, the last frames decoded."""

from __future__ import annotations

from collections.abc import Iterable

from ahgateway.apps.board import Board
from ahgateway.apps.rows import NO_FRAMES, frame_lines, round_trip_classes
from ahgateway.clock import MILLISECOND
from ahgateway.transports.base import LinkFigures

FRAMES_SHOWN = 20


def link_lines(board: Board, width: int) -> list[str]:
    """Return the page as lines; the histogram's longest bar has `width` columns."""
    figures = board.monitor.link.figures
    state = "up" if board.monitor.is_up else "DOWN: nothing shown is live"
    lines = [
        f"{board.monitor.link.target}  {state}",
        "",
        f"requests {figures.requests}  replies {figures.replies}  exceptions {figures.refused}",
        f"time-outs {figures.timeouts}  late replies dropped {figures.late}  "
        f"reconnects {figures.reconnects}  bytes of no frame {figures.garbage_bytes}",
        f"first cause of trouble: {figures.first_cause or 'none'}",
        "",
        *round_trip_lines(figures, width),
    ]
    frames = frame_lines(board, FRAMES_SHOWN)
    return [*lines, "", *(["last frames, > out, < in", *frames] if frames else [NO_FRAMES])]


def round_trip_lines(figures: LinkFigures, width: int) -> list[str]:
    """Return mean, last, worst and the histogram of the latest round trips."""
    if not figures.replies:
        return ["round trip: no reply yet"]
    mean_ms = figures.round_trip_total_ns / figures.replies / MILLISECOND
    return [
        f"round trip: mean {mean_ms:.2f} ms  last {figures.round_trip_last_ns / MILLISECOND:.2f} ms  "
        f"worst {figures.round_trip_worst_ns / MILLISECOND:.2f} ms",
        f"the latest {len(figures.round_trips_ns)}:",
        *histogram(figures.round_trips_ns, width),
    ]


def histogram(round_trips_ns: Iterable[int], width: int) -> list[str]:
    """Return one line for each class that holds something or lies between such, with its count and a bar."""
    classes = round_trip_classes(round_trips_ns)
    most = max((count for _, _, count in classes), default=0)
    lines = []
    for low, high, count in classes:
        below = f"< {high:g} ms" if high is not None else "ms and more"
        bar = "█" * max(1 if count else 0, round(count * width / most))
        lines.append(f"{low:>6g} … {below:<11} {count:>6} {bar}")
    return lines
