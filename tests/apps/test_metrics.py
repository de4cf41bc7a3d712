"""The metrics page: what stands on it is what the monitor knows, and nothing stale."""

from __future__ import annotations

import urllib.error
import urllib.request

import pytest
from prometheus_client import generate_latest
from prometheus_client.parser import text_string_to_metric_families
from tui.screen_world import ScreenWorld

from ahgateway.apps.metrics import registry, served
from ahgateway.clock import SECOND
from ahgateway.errors import StateError


@pytest.fixture
async def world() -> ScreenWorld:
    world = ScreenWorld(warm_up_s=5)
    await world.run(1.0)
    return world


def page(world: ScreenWorld) -> dict[str, float]:
    """Name with labels to value."""
    lines = generate_latest(registry(world.board)).decode().splitlines()
    return {name: float(value) for name, _, value in (line.rpartition(" ") for line in lines if line[0] != "#")}


def fetched(port: int) -> bytes:
    with urllib.request.urlopen(f"http://127.0.0.1:{port}/metrics", timeout=60) as reply:
        return reply.read()


async def test_values_verdicts_coverage_age_and_link_are_those_of_the_monitor(world):
    found = page(world)
    picture = world.board.watches["TIC-101"].follower.picture
    counts = world.board.watches["TIC-101"].follower.summary()
    assert 80.0 == found['ahgateway_loop_value{loop="TIC-101",name="SV",unit="°C"}']
    assert float(picture.inputs.pv) == found['ahgateway_loop_value{loop="TIC-101",name="PV",unit="°C"}']
    assert float(picture.seen["MV"]) == found['ahgateway_loop_value{loop="TIC-101",name="MV",unit="%"}']
    assert 1.0 == found['ahgateway_loop_auto{loop="TIC-101"}']
    assert 0.0 == found['ahgateway_loop_stale{loop="TIC-101"}']
    assert 0.0 <= found['ahgateway_loop_age_seconds{loop="TIC-101"}'] < 0.1
    assert counts.trivial == found['ahgateway_executions_total{loop="TIC-101",verdict="trivial"}']
    assert 0.0 == found['ahgateway_loop_diverged{loop="TIC-101"}']
    assert counts.coverage == found['ahgateway_coverage_ratio{loop="TIC-101"}']
    assert 1.0 == found["ahgateway_link_up"]
    assert world.link.figures.requests == found["ahgateway_link_requests_total"]


async def test_prometheus_reads_every_line_and_each_name_tells_its_unit(world):
    families = list(text_string_to_metric_families(generate_latest(registry(world.board)).decode()))
    kinds = {each.name.removeprefix("ahgateway_"): each.type for each in families}
    assert {"loop_value", "loop_stale", "loop_auto", "loop_finding", "loop_diverged", "link_up"} == {
        name for name, kind in kinds.items() if kind == "gauge" and not name.endswith(("_seconds", "_ratio"))
    }
    assert {"loop_age_seconds", "link_round_trip_seconds", "coverage_ratio"} < set(kinds)
    counters = {name for name, kind in kinds.items() if kind == "counter"}
    assert {"executions", "link_requests", "link_timeouts", "link_garbage_bytes"} < counters
    samples = [sample for each in families for sample in each.samples]
    assert all(sample.name.endswith("_total") for each in families if each.type == "counter" for sample in each.samples)
    assert {"°C", "%"} == {sample.labels["unit"] for sample in samples if sample.name == "ahgateway_loop_value"}
    assert all(each.documentation for each in families)


async def test_a_stale_value_is_not_there(world):
    world.clock.advance_ns(3 * SECOND)
    found = page(world)
    assert 1.0 == found['ahgateway_loop_stale{loop="TIC-101"}']
    assert not any(name.startswith("ahgateway_loop_value") for name in found)
    assert 3.0 <= found['ahgateway_loop_age_seconds{loop="TIC-101"}'] < 3.1


async def test_quantiles_are_those_of_the_latest_round_trips(world):
    world.link.figures.round_trips_ns[:] = [1_000_000 * each for each in range(100, 0, -1)]
    found = page(world)
    assert 0.050 == found['ahgateway_link_round_trip_seconds{quantile="0.5"}']
    assert 0.099 == found['ahgateway_link_round_trip_seconds{quantile="0.99"}']
    assert 0.100 == found['ahgateway_link_round_trip_seconds{quantile="1"}']


@pytest.mark.slow
async def test_it_is_served_on_this_machine_and_ends_with_the_run(world):
    with served(world.board, 0) as port:
        assert b"ahgateway_link_up 1.0" in fetched(port)
        with pytest.raises(StateError, match=f"127.0.0.1:{port}"), served(world.board, port):
            pass
    with pytest.raises(urllib.error.URLError):
        fetched(port)
