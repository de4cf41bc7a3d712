"""The doctor: what it says of ports, clock and line, and whether a loop's CYCLE can be followed."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest
import typer
from typer.testing import CliRunner

from ahgateway.apps.doctor import (
    Check,
    Findings,
    LoopTime,
    Outcome,
    check_answer,
    check_clock,
    check_cycles,
    check_port,
    judge,
    line_behind,
    measure,
)
from ahgateway.cli.doctor import doctor
from ahgateway.clock import MILLISECOND, VirtualClock
from ahgateway.codec.can_cycle import CycleFigures
from ahgateway.fake.plc import FakePlc
from ahgateway.schema.profile import load
from ahgateway.transports.base import LinkFigures
from ahgateway.transports.line import Line
from ahgateway.transports.memory import MemoryLink
from ahgateway.transports.uri import parse_uri

app = typer.Typer()
app.command()(doctor)


@pytest.mark.parametrize(
    ("sent", "picture_ms", "round_ms", "outcome", "said"),
    [
        (6, 20, 60, Outcome.GOOD, "every execution can be seen"),
        (6, 50, 100, Outcome.GOOD, "every execution can be seen"),
        (6, 60, 100, Outcome.WARN, "executions will be missed"),
        (1, 60, 150, Outcome.GOOD, "every execution can be seen"),
        (6, 150, 150, Outcome.FAIL, "no execution can be followed"),
    ],
)
def test_a_round_and_one_picture_more_must_fit_into_cycle(
    sent: int, picture_ms: int, round_ms: int, outcome: Outcome, said: str
) -> None:
    one = LoopTime("A", (), sent, picture_ms * MILLISECOND, None, 150 * MILLISECOND)
    rest = LoopTime("B", (), sent, (round_ms - picture_ms) * MILLISECOND, None, 10**12)
    check = judge(Findings(loops=[one, rest]))[0]
    assert (outcome, True) == (check.outcome, said in check.text)
    assert (outcome is not Outcome.GOOD) == bool(check.hint)


def test_a_loop_whose_cycle_could_not_be_read_fails() -> None:
    (check,) = judge(Findings(loops=[LoopTime("A", (), 6, MILLISECOND)]))
    assert (Outcome.FAIL, "6 requests a picture, 1.0 ms; an execution falls into every picture") == (
        check.outcome,
        check.text,
    )


async def test_a_loop_is_measured_with_its_own_requests(clock: VirtualClock) -> None:
    loaded = load("demo")
    station = replace(loaded.station(), target="modbus+rtu:///dev/ttyUSB0?baud=115200&parity=N")
    plc = FakePlc(loaded.station(), loaded.fake_setup(), clock=clock)
    link = MemoryLink(plc, clock, latency_ns=20 * MILLISECOND)
    found, checks = await measure(station, station.loops[0], link, clock)
    assert [] == checks
    assert (6, 120 * MILLISECOND, 200 * MILLISECOND) == (found.sent, found.picture_ns, found.cycle_ns)
    block = found.requests[0]
    assert (46, {20 * MILLISECOND}) == (block.read.count, set(block.took_ns))
    # 8 characters, 1.75 ms, 97 characters, of 10 bits at 115200 baud
    assert 105 * 86_805 + 1_750_000 == block.floor_ns


async def test_a_loop_that_does_not_answer_fails(clock: VirtualClock) -> None:
    loaded = load("demo")
    station = loaded.station()
    link = MemoryLink(FakePlc(station, loaded.fake_setup(), clock=clock), clock, unit=7)
    found, (check,) = await measure(station, station.loops[0], link, clock)
    assert (0, Outcome.FAIL, True) == (found.picture_ns, check.outcome, "no reply within 1000 ms" in check.text)
    assert Outcome.FAIL is (await check_answer(link, 1)).outcome


async def test_a_clock_that_sleeps_well_is_good(clock: VirtualClock) -> None:
    checks = [check async for check in check_clock(clock)]
    assert [Check("clock", Outcome.GOOD, "a sleep of 1 ms ends 0.00 ms late, at worst 0.00 ms")] == checks


async def test_a_date_that_was_never_set_is_warned_of() -> None:
    checks = [check async for check in check_clock(VirtualClock(utc_start_ns=0))]
    assert ("clock", Outcome.WARN) == (checks[0].name, checks[0].outcome)


def test_a_port_that_is_not_there_fails_with_those_that_are() -> None:
    (check,) = check_port(Line("/dev/ttyNOWHERE"))
    assert (Outcome.FAIL, "/dev/ttyNOWHERE: no such port") == (check.outcome, check.text)
    assert "ports here" in check.hint


def test_only_a_serial_port_has_a_speed_that_we_know() -> None:
    assert Line("COM3", 9600, "E", 7, 1) == line_behind(parse_uri("modbus+ascii://COM3"))
    assert line_behind(parse_uri("modbus+rtu+tcp://127.0.0.1:4001")) is None


def test_the_demo_is_good_in_text_and_in_json() -> None:
    done = CliRunner().invoke(app, ["demo"], catch_exceptions=False)
    assert (0, 2) == (done.exit_code, done.stdout.count("every execution can be seen"))
    done = CliRunner().invoke(app, ["demo", "--output", "json"], catch_exceptions=False)
    facts = json.loads(done.stdout)
    assert ("doctor", True, 200.0, 6) == (
        facts["kind"],
        facts["good"],
        facts["loops"][0]["cycle_ms"],
        facts["loops"][0]["requests_per_picture"],
    )


def test_a_line_that_is_not_there_ends_with_3() -> None:
    done = CliRunner().invoke(app, ["demo", "--target", "modbus+rtu:///dev/ttyNOWHERE"], catch_exceptions=False)
    assert (3, True) == (done.exit_code, "fail  port: /dev/ttyNOWHERE: no such port" in done.stdout)


@pytest.mark.parametrize(
    ("complete", "incomplete", "missed", "outcome"),
    [(300, 0, 0, Outcome.GOOD), (297, 3, 0, Outcome.GOOD), (297, 3, 1, Outcome.WARN), (290, 10, 0, Outcome.WARN)],
)
def test_more_than_one_cycle_in_a_hundred_lost_is_warned_of(
    complete: int, incomplete: int, missed: int, outcome: Outcome
) -> None:
    cycles = CycleFigures(300, missed, complete=complete, incomplete=incomplete, late=2, jitter_ns_max=310_000)
    (check,) = check_cycles(LinkFigures(cycles=cycles))
    assert outcome is check.outcome
    assert (
        f"300 SYNC, at worst 0.31 ms off their period, {missed} missed; {complete} of 300 cycles complete, "
        "2 PDOs outside their window" == check.text
    )


def test_the_jitter_of_our_own_pdos_is_said_when_there_are_any() -> None:
    cycles = CycleFigures(10, complete=10, sent=9, sent_ns_min=1_200_000, sent_ns_max=3_450_000)
    (check,) = check_cycles(LinkFigures(cycles=cycles))
    assert check.text.endswith("; PDOs of ours leave within 2.25 ms of each other behind SYNC")
    assert [] == check_cycles(LinkFigures()), "a link without PDOs"
