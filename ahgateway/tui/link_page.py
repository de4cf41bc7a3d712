"""The link: totals, first cause of trouble, round trips as a histogram, the last frames as bytes."""

from __future__ import annotations

from collections.abc import Iterable

from ahgateway.apps.board import Board
from ahgateway.apps.lines import clock_time
from ahgateway.apps.rows import round_trip_classes
from ahgateway.clock import MILLISECOND
from ahgateway.transports.base import Frame, LinkFigures

FRAMES_SHOWN = 12
BYTES_SHOWN = 24


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
    if board.frames:
        lines += ["", f"last frames (> out, < in), at most {BYTES_SHOWN} bytes of each"]
        lines += [frame_line(frame) for frame in list(board.frames)[-FRAMES_SHOWN:]]
    return lines


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


def frame_line(frame: Frame) -> str:
    """One frame: time, direction, bytes."""
    more = f" … {len(frame.data)} bytes" if len(frame.data) > BYTES_SHOWN else ""
    return f"{clock_time(frame.utc_ns)} {frame.direction} {frame.data[:BYTES_SHOWN].hex(' ')}{more}"
