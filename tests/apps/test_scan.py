"""Scanning a line: who answers, who refuses, who is silent, and when the time is over."""

from __future__ import annotations

import json

import pytest
import typer
from typer.testing import CliRunner

from ahgateway.apps.scan import Answer, scan, units_of
from ahgateway.cli.scan import scan as command
from ahgateway.clock import MILLISECOND, VirtualClock
from ahgateway.codec.access import Request
from ahgateway.codec.station import Pacing
from ahgateway.errors import PlcRefusedError, ProfileError
from ahgateway.transports.memory import MemoryLink

app = typer.Typer()
app.command()(command)


class Street:
    """Unit 2 answers, unit 3 refuses, unit 4 counts at each request, nobody else is there."""

    def __init__(self) -> None:
        self.asked = 0

    def answer(self, request: Request) -> tuple[int, ...] | None:
        self.asked += 1
        if request.unit == 3:
            raise PlcRefusedError("no such register", code=2)
        if request.unit == 4:
            return (self.asked,) * request.count
        return (7, 9)[: request.count] if request.unit == 2 else None


def bench(clock: VirtualClock) -> MemoryLink:
    return MemoryLink(Street(), clock, latency_ns=4 * MILLISECOND, pacing=Pacing(reply_timeout_ms=100))


async def test_each_unit_is_what_it_says(clock: VirtualClock) -> None:
    found = [answer async for answer in scan(bench(clock), clock, (1, 2, 3, 4), 10**12)]
    assert [
        Answer(1, "silent"),
        Answer(2, "answers", (7, 9), True, True, 4 * MILLISECOND),
        Answer(3, "answers, and refuses to read here: exception 02", (), True, True),
    ] == found[:3]
    assert (True, False, "answers, the register changes all the time") == (
        found[3].is_there,
        found[3].is_proven,
        found[3].text,
    )


async def test_nobody_is_asked_when_the_time_is_over(clock: VirtualClock) -> None:
    found = [answer.unit async for answer in scan(bench(clock), clock, range(10, 20), 250 * MILLISECOND)]
    assert [10, 11, 12] == found, "100 ms each; the third begins at 200 ms"


def test_units_are_lists_and_ranges() -> None:
    assert (1, 2, 3, 10, 255) == units_of("1-3, 2,10,255")
    assert 247 == len(units_of("1-247"))


@pytest.mark.parametrize("text", ["", "1-", "a", "5-3", "256", "-1"])
def test_what_is_no_list_of_units_is_named(text: str) -> None:
    with pytest.raises(ProfileError, match=r"--units: `.*is no unit number and no range"):
        units_of(text)


def test_the_command_finds_the_demo_and_says_so_in_json() -> None:
    done = CliRunner().invoke(
        app, ["fake://demo", "--units", "1", "--device", "D100", "--output", "json"], catch_exceptions=False
    )
    facts = json.loads(done.stdout)
    assert (0, 1, True, True, [0x0000, 0x42A0]) == (
        done.exit_code,
        facts["unit"],
        facts["there"],
        facts["proven"],
        facts["words"],
    )


def test_a_silent_line_ends_with_3() -> None:
    done = CliRunner().invoke(app, ["fake://demo", "--units", "9", "--timeout-ms", "1"], catch_exceptions=False)
    assert (3, "") == (done.exit_code, done.stdout)
    assert "1 units asked, 0 answered" in done.stderr


def test_everybody_cannot_be_asked_on_a_serial_line() -> None:
    with pytest.raises(ProfileError, match="unit 0 is everybody"):
        CliRunner().invoke(app, ["modbus+rtu:///dev/ttyS9", "--units", "0-3"], catch_exceptions=False)
