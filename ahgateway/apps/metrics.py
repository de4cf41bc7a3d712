"""A run as Prometheus metrics: values, verdicts, coverage, age, link; read from a board, with `prometheus-client`.

A value that is stale or not there is left out, never repeated: what is scraped is live. Names and labels are
normative (docs/reference/metrics.md).
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterable, Iterator

from prometheus_client import CollectorRegistry, start_http_server
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.registry import Collector

from ahgateway.apps.board import Board
from ahgateway.clock import SECOND
from ahgateway.core.verdict import Counts
from ahgateway.errors import StateError
from ahgateway.lockstep.follow import is_automatic, output_of, process_value_of, target_of

HOST = "127.0.0.1"
QUANTILES = (("0.5", 0.5), ("0.99", 0.99), ("1", 1.0))
VERDICTS = ("informative", "trivial", "ulp", "tolerance", "diverged", "unobservable", "link")


class BoardCollector(Collector):
    """Turns the board into metrics each time it is scraped; labels are made once."""

    def __init__(self, board: Board) -> None:
        self._board = board

    def collect(self) -> Iterable[Metric]:
        """Return every metric as it stands now."""
        yield from _loops(self._board)
        yield from _verdicts(self._board)
        yield from _link(self._board)


def _loops(board: Board) -> Iterator[Metric]:
    value = GaugeMetricFamily("ahgateway_loop_value", "SV, PV and MV, live ones only", labels=["loop", "name", "unit"])
    age = GaugeMetricFamily("ahgateway_loop_age_seconds", "time since the last picture", labels=["loop"])
    stale = GaugeMetricFamily("ahgateway_loop_stale", "1 when nothing live is known of the loop", labels=["loop"])
    auto = GaugeMetricFamily("ahgateway_loop_auto", "1 when the controller computes MV itself", labels=["loop"])
    finding = GaugeMetricFamily("ahgateway_loop_finding", "1 for each finding that holds", labels=["loop", "finding"])
    for name, watch in board.watches.items():
        picture, fresh = watch.follower.picture, board.freshness(watch)
        stale.add_metric([name], float(fresh.is_stale))
        # A scrape runs in a thread of its own, while the run goes on.
        for each in tuple(watch.follower.findings):
            finding.add_metric([name, each], 1.0)
        if picture is None or fresh.age_ns is None:
            continue
        age.add_metric([name], fresh.age_ns / SECOND)
        if fresh.is_stale:
            continue
        auto.add_metric([name], float(is_automatic(watch.loop, picture)))
        pv_unit, mv_unit = watch.loop.pv_unit, watch.loop.mv_unit
        value.add_metric([name, "SV", pv_unit], float(target_of(watch.loop, picture)))
        value.add_metric([name, "PV", pv_unit], float(process_value_of(watch.loop, picture)))
        value.add_metric([name, "MV", mv_unit], float(output_of(watch.loop, picture)))
    return iter((value, age, stale, auto, finding))


def _verdicts(board: Board) -> Iterator[Metric]:
    executions = CounterMetricFamily(
        "ahgateway_executions", "executions by what the reference says of them", labels=["loop", "verdict"]
    )
    coverage = GaugeMetricFamily("ahgateway_coverage_ratio", "share of executions proven by bits", labels=["loop"])
    diverged = GaugeMetricFamily("ahgateway_loop_diverged", "1 once an execution diverged", labels=["loop"])
    for name, watch in board.watches.items():
        counts: Counts = watch.follower.summary()
        for verdict in VERDICTS:
            executions.add_metric([name, verdict], float(getattr(counts, verdict)))
        coverage.add_metric([name], counts.coverage)
        diverged.add_metric([name], float(counts.diverged > 0))
    return iter((executions, coverage, diverged))


def _link(board: Board) -> Iterator[Metric]:
    figures = board.monitor.link.figures
    yield GaugeMetricFamily("ahgateway_link_up", "1 while the PLC answers", value=float(board.monitor.is_up))
    for name, help_text, count in (
        ("requests", "requests sent", figures.requests),
        ("replies", "replies proven to belong to their request", figures.replies),
        ("exceptions", "requests that the PLC refused", figures.refused),
        ("timeouts", "requests without a reply in time", figures.timeouts),
        ("late_replies", "replies after their time-out, dropped", figures.late),
        ("reconnects", "connections made again", figures.reconnects),
        ("garbage_bytes", "bytes that were no frame", figures.garbage_bytes),
    ):
        yield CounterMetricFamily(f"ahgateway_link_{name}", help_text, value=float(count))
    yield _round_trips(sorted(figures.round_trips_ns))


def _round_trips(round_trips_ns: list[int]) -> Metric:
    """Return quantiles of the latest round trips, given in rising order: a window, so no histogram that only grows."""
    family = GaugeMetricFamily("ahgateway_link_round_trip_seconds", "the latest round trips", labels=["quantile"])
    for text, share in QUANTILES:
        if round_trips_ns:
            index = max(0, math.ceil(share * len(round_trips_ns)) - 1)
            family.add_metric([text], round_trips_ns[index] / SECOND)
    return family


def registry(board: Board) -> CollectorRegistry:
    """Return a registry that holds this board and nothing of the process."""
    found = CollectorRegistry()
    found.register(BoardCollector(board))
    return found


@contextlib.contextmanager
def served(board: Board, port: int) -> Iterator[int]:
    """Serve the metrics on this machine only while the context lasts; yield the port.

    Args:
        board: What is served.
        port: TCP port on 127.0.0.1; 0 takes a free one.

    Raises:
        StateError: The port is taken.
    """
    try:
        server, thread = start_http_server(port, addr=HOST, registry=registry(board))
    except OSError as error:
        raise StateError(
            f"metrics cannot be served on {HOST}:{port}: {error.strerror or error}", hint="give another port, or 0"
        ) from error
    try:
        yield int(server.server_port)
    finally:
        server.shutdown()
        server.server_close()
        thread.join()
