"""A monitor over a link that behaves badly: it reports, counts, goes on, and claims no more than it saw."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import pytest
from lockstep.bench_world import World

from ahgateway.apps.lines import event_line, status_line, summary_lines
from ahgateway.apps.monitor import GIVE_UP_NS, LinkChange, Monitor, Report
from ahgateway.apps.report import as_json, summary_json
from ahgateway.clock import SECOND
from ahgateway.core.verdict import Exit
from ahgateway.errors import ReplyTimeoutError
from ahgateway.lockstep.follow import Change, Finding

GAINS = {"Kc_Kp": 2.0, "Ti_Ki": 0.3, "Td_Kd": 0.0}


class Session:
    """A monitor on a fake PLC in virtual time, with things that happen at given moments."""

    def __init__(self, *, initial: dict[str, Any] | None = None, **changes: Any) -> None:
        self.world = World("DPIDE", {**GAINS, **(initial or {})}, **changes)
        self.monitor = Monitor(self.world.station, self.world.link, self.world.clock)
        self.reports: list[Report] = []
        self.script: list[tuple[float, Callable[[World], None]]] = []

    async def run(self, duration_s: float) -> Session:
        async for report in self.monitor.reports(duration_ns=round(duration_s * SECOND)):
            self.reports.append(report)
            self._act()
        return self

    def _act(self) -> None:
        while self.script and self.world.clock.now_ns() >= self.script[0][0] * SECOND:
            self.script.pop(0)[1](self.world)

    def findings(self) -> list[str]:
        return [each.event.name for each in self.reports if isinstance(each.event, Finding) and not each.event.is_over]

    def links(self) -> list[bool]:
        return [each.event.is_up for each in self.reports if isinstance(each.event, LinkChange)]


async def test_a_healthy_loop_passes_with_nearly_everything_proven() -> None:
    session = await Session().run(20.0)

    counts = session.monitor.summaries()["L1"]
    assert session.monitor.outcome(0.9) is Exit.PASS
    assert counts.proven >= 0.95 * counts.total
    assert 198 <= counts.total <= 202
    assert session.links() == [True]


async def test_what_an_operator_changes_is_reported_with_both_values() -> None:
    session = Session()
    session.script.append((3.0, lambda world: world.plc.write("L1", "SV", 61.5)))
    await session.run(6.0)

    changes = [each.event for each in session.reports if isinstance(each.event, Change)]
    assert [(change.operand, float(change.old), float(change.new)) for change in changes] == [("SV", 50.0, 61.5)]


async def test_stop_is_a_finding_and_nothing_is_claimed_meanwhile() -> None:
    session = Session()
    session.world.plc.stop()
    await session.run(5.0)

    assert session.findings() == ["plc-stopped"]
    assert session.monitor.outcome(0.0) is Exit.INCONCLUSIVE


async def test_a_plc_that_stops_and_runs_again_is_followed_again_without_a_false_word() -> None:
    session = Session()
    session.script.append((4.0, lambda world: world.plc.stop()))
    session.script.append((8.0, lambda world: world.plc.run()))
    await session.run(16.0)

    assert session.monitor.summaries()["L1"].diverged == 0
    over = [each.event for each in session.reports if isinstance(each.event, Finding) and each.event.is_over]
    assert [finding.name for finding in over] == ["plc-stopped"]
    assert session.monitor.outcome(0.5) is Exit.PASS


@pytest.mark.parametrize("is_retained", [True, False])
async def test_a_restart_convicts_nobody(is_retained: bool) -> None:
    session = Session()
    session.script.append((4.0, lambda world: world.plc.restart(is_retained=is_retained)))
    await session.run(12.0)

    assert session.monitor.summaries()["L1"].diverged <= (0 if is_retained else 1)


async def test_an_en_contact_that_opens_is_a_finding() -> None:
    session = Session(en="M50")
    session.world.plc.write("L1", "EN", False)
    await session.run(4.0)

    assert "en-off" in session.findings()
    assert session.monitor.outcome(0.0) is Exit.INCONCLUSIVE


async def test_all_zeros_are_a_finding_and_never_a_pass() -> None:
    session = Session()
    session.world.plc.items.clear()
    session.world.plc.processes.clear()
    session.world.plc.memory.clear()
    session.world.plc.stop()
    await session.run(4.0)

    assert "all-zero" in session.findings()
    assert session.monitor.outcome(0.0) is Exit.INCONCLUSIVE


async def test_a_pv_that_is_no_number_is_a_finding_and_the_hold_is_no_difference() -> None:
    session = Session()
    session.script.append((4.0, break_sensor))
    await session.run(8.0)

    assert "bad-value" in session.findings()
    assert session.monitor.summaries()["L1"].diverged == 0


def break_sensor(world: World) -> None:
    world.plc.freeze_pv("L1")
    world.plc.write("L1", "PV", float("nan"))


async def test_a_lost_link_is_reported_once_counted_as_lost_and_recovered() -> None:
    session = Session()
    session.script.append((4.0, lambda world: setattr(world.link, "is_down", True)))
    session.script.append((9.0, lambda world: setattr(world.link, "is_down", False)))
    monitor, world = session.monitor, session.world
    async for report in monitor.reports(duration_ns=20 * SECOND):
        session.reports.append(report)
        session._act()
        if world.link.is_down and len(session.links()) == 2:
            world.clock.advance_ns(5 * SECOND)
            session._act()

    counts = monitor.summaries()["L1"]
    assert session.links() == [True, False, True]
    assert 45 <= counts.link <= 60
    assert counts.diverged == 0
    assert monitor.outcome(0.5) is Exit.PASS


async def test_most_of_a_run_lost_with_the_link_is_inconclusive() -> None:
    session = Session()
    async for report in session.monitor.reports(duration_ns=10 * SECOND):
        session.reports.append(report)
        if session.world.clock.now_ns() >= 3 * SECOND:
            session.world.link.is_down = True

    assert session.monitor.summaries()["L1"].link > 60
    assert session.monitor.outcome(0.0) is Exit.INCONCLUSIVE


async def test_a_target_that_never_answers_is_given_up_when_no_duration_was_asked_for() -> None:
    session = Session()
    session.world.link.is_down = True
    with pytest.raises(ReplyTimeoutError):
        async for report in session.monitor.reports():
            session.reports.append(report)

    assert GIVE_UP_NS <= session.world.clock.now_ns() <= 2 * GIVE_UP_NS
    assert session.links() == [False]


async def test_refused_addresses_are_said_once_with_what_they_mean() -> None:
    session = Session()
    table = session.world.station.devices.ranges[0].table
    session.world.plc.refuse(table, 100, 110, 2)
    await session.run(10.0)

    assert session.findings() == ["refused"]
    assert session.monitor.outcome(0.0) is Exit.INCONCLUSIVE


async def test_a_line_too_slow_for_cycle_is_said_and_nothing_is_claimed() -> None:
    session = await Session(latency_ns=60_000_000).run(20.0)

    assert session.findings() == ["torn-pictures"]
    assert session.monitor.outcome(0.0) is Exit.INCONCLUSIVE


async def test_every_json_line_has_the_normative_keys() -> None:
    session = Session()
    session.script.append((4.0, lambda world: world.plc.fail("L1", "gain-1-percent")))
    session.script.append((5.0, lambda world: world.plc.write("L1", "SV", 66.0)))
    await session.run(8.0)

    lines = [found for report in session.reports if (found := as_json(report)) is not None]
    lines.append(summary_json(session.monitor, session.monitor.watches[0].follower, 0, 0.0))
    for line in lines:
        assert {"t", "loop", "tick", "kind"} <= json.loads(json.dumps(line, allow_nan=False)).keys()
    executions = [line for line in lines if line["kind"] == "execution"]
    keys = {
        "verdict",
        "proof",
        "class",
        "terms",
        "term",
        "plc",
        "ref",
        "plc_bits",
        "ref_bits",
        "cause",
        "code",
        "aligned_since",
    }
    assert all(keys <= line.keys() for line in executions)
    diverged = next(line for line in executions if line["verdict"] == "DIVERGED")
    assert diverged["term"] == "P"
    assert diverged["cause"] == "gain"
    assert "AHG251" == diverged["code"] == diverged["causes"][0]["code"]
    assert diverged["plc_bits"].startswith("0x")
    assert len(diverged["ref_bits"]) == 10
    assert lines[-1]["counts"]["diverged"] >= 1
    assert lines[-1]["verdict"] == "DIFFERENT"
    assert "AHG251" == lines[-1]["code"]


async def test_plain_lines_name_loop_term_both_values_bits_and_cause() -> None:
    session = Session()
    session.script.append((4.0, lambda world: world.plc.fail("L1", "gain-1-percent")))
    session.script.append((5.0, lambda world: world.plc.write("L1", "SV", 66.0)))
    await session.run(8.0)

    lines = [line for report in session.reports if (line := event_line(report)) is not None]
    convicted = next(line for line in lines if "DIVERGED" in line)
    for part in (
        "L1 tick",
        "P plc ",
        "ref ",
        "(0x",
        "ULP",
        "cause gain (AHG251): Kc_Kp acts as 2.0",
        "its register holds 2",
    ):
        assert part in convicted
    follower = session.monitor.watches[0].follower
    assert "L1 DIVERGED SV 66 PV" in status_line(follower, 0, session.world.clock.now_ns())
    assert any("likely cause gain (AHG251): " in line for line in summary_lines(session.monitor, 0.0))
