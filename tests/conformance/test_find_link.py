"""Step 1 of commissioning on real wires: a PLC behind other settings than the profile's is found, proven and named."""

from __future__ import annotations

import socket
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest
from conformance.peers import SERVER, serial_pair
from conformance.test_serial import SettingsServer
from transports.can.can_bench import fake_plc, served, target
from transports.can.can_bench import station as can_station

from ahgateway.apps.commission.checks import Check, Outcome
from ahgateway.apps.commission.link import Found, Patience, amended, find
from ahgateway.clock import SECOND, WallClock
from ahgateway.codec.station import Station
from ahgateway.fake.plc import FakePlc
from ahgateway.schema.profile import parse
from ahgateway.transports.base import Link
from ahgateway.transports.line import Line
from ahgateway.transports.serial_server import serve_serial
from ahgateway.transports.server import serve_tcp
from ahgateway.transports.uri import open_link, parse_uri

PROFILE = """
# The skid behind the boiler house.
[station]
name = "S"
target = "{target}"    # as the drawing says
unit = {unit}
[station.pacing]
reply_timeout_ms = 300
{pacing}
[loops.L]
instruction = "DPIDE"
layout = "manual"
[loops.L.fake.initial]
SV = 30.0
CYCLE = 5000
"""


def station(target: str, unit: int = 1, pacing: str = "") -> Station:
    return parse(PROFILE.format(target=target, unit=unit, pacing=pacing), "skid.toml").station()


def plc(real: Station) -> FakePlc:
    clock = WallClock()
    made = FakePlc(real, clock=clock)
    made.warm_up(SECOND)
    return made


def opener(seen: list[str]) -> Callable[[Station], Any]:
    async def opened(variant: Station) -> Link:
        seen.append(variant.target)
        return open_link(parse_uri(variant.target), WallClock(), variant.pacing)

    return opened


async def found_from(
    profile: Station, *, ports: tuple[str, ...] = (), idle_s: float = 0.0
) -> tuple[Found | None, dict[str, Check], list[str]]:
    seen: list[str] = []
    found, checks = await find(
        profile, profile.loops[0], opener(seen), WallClock(), ports=ports,
        patience=Patience(30 * SECOND, round(idle_s * SECOND)),
    )  # fmt: skip
    return found, {check.name: check for check in checks}, seen


def failed(checks: dict[str, Check]) -> set[str]:
    return {name for name, check in checks.items() if check.outcome is Outcome.FAIL}


@pytest.mark.slow
async def test_a_line_that_speaks_ascii_where_rtu_is_written_is_found_and_saved() -> None:
    """Over a pseudo-terminal, which carries bytes and ignores settings: framing and unit are what differs."""
    async with serial_pair() as (plc_end, our_end):
        real = station(f"modbus+ascii://{our_end}?baud=9600", 1)
        server = await serve_serial(plc(real), Line(plc_end, 9600, "E", 7), framing=SERVER["ascii"])
        profile = station(f"modbus+rtu://{our_end}?baud=9600&parity=N", 2)
        found, checks, _ = await found_from(profile)
        await server.close()
    assert found is not None, checks["no-answer"].text
    assert ("modbus+ascii", 1) == (found.station.target.partition("://")[0], found.station.unit)
    assert {"wrong-unit", "wrong-framing"} <= failed(checks) <= {"wrong-unit", "wrong-framing", "wrong-line"}
    text = amended(
        PROFILE.format(target=profile.target, unit=1, pacing="").replace("unit = 1", "unit = 2"), found.changes
    )
    assert "# The skid behind the boiler house." in text
    assert f'target = "{found.station.target}"    # as the drawing says' in text
    assert 1 == parse(text, "skid.toml").station().unit


@pytest.mark.slow
async def test_a_plc_at_another_port_of_this_machine_is_found() -> None:
    async with serial_pair() as (_, dead_end), serial_pair() as (plc_end, live_end):
        real = station(f"modbus+rtu://{live_end}?baud=9600")
        server = await serve_serial(plc(real), Line(plc_end, 9600))
        found, checks, seen = await found_from(station(f"modbus+rtu://{dead_end}/gone?baud=9600"), ports=(live_end,))
        await server.close()
    assert found is not None, checks["no-answer"].text
    assert {"wrong-port"} <= failed(checks) <= {"wrong-port", "wrong-line"}
    assert 3 == sum("/gone" in target for target in seen), "a port that is not there is given up at once"


class GuardedLine(SettingsServer):
    """A network port behind which bytes pass only while the settings are the line's own; one caller after another."""

    def __init__(self, port: str, right: tuple[int, int, str]) -> None:
        super().__init__(port)
        self.right = right
        self.asked: list[tuple[int, int, str]] = []

    def run(self) -> None:
        while True:
            try:
                super().run()
            except OSError:
                return

    def passes(self, settings: tuple[int, int, str, int]) -> bool:
        self.asked.append(settings[:3])
        return settings[:3] == self.right

    def close(self) -> None:
        self.listener.shutdown(socket.SHUT_RDWR)
        self.listener.close()
        self.join(2)
        self.serial.close()


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # pyserial 3.5's own
async def test_a_line_with_another_parity_is_found_through_a_port_that_sees_it() -> None:
    async with serial_pair() as (plc_end, gateway_end):
        line = GuardedLine(gateway_end, (9600, 8, "N"))
        line.start()
        place = f"rfc2217://127.0.0.1:{line.listener.getsockname()[1]}"
        real = station(f"modbus+rtu://{place}?baud=9600&parity=N")
        server = await serve_serial(plc(real), Line(plc_end, 9600, "N"))
        found, checks, _ = await found_from(station(f"modbus+rtu://{place}?baud=9600&parity=E"))
        await server.close()
        line.close()
    assert found is not None, checks["no-answer"].text
    assert f"modbus+rtu://{place}?baud=9600&parity=N" == found.changes["target"]
    assert {"wrong-line"} == failed(checks) - {"slow-link"}
    assert (9600, 8, "E") == line.asked[0], "the profile's own settings come first"
    assert (9600, 7, "E") in line.asked, "and then the factory's"


async def test_over_tcp_requests_in_flight_and_an_idle_connection_are_tried() -> None:
    real = station("modbus+tcp://127.0.0.1")
    server = await serve_tcp(plc(real), "127.0.0.1", 0, clock=WallClock())
    profile = station(f"modbus+tcp://127.0.0.1:{server.port}", pacing="requests_in_flight_max = 4")
    found, checks, _ = await found_from(profile, idle_s=1.0)
    await server.close()
    assert found is not None
    assert set() == failed(checks)
    assert "8 at once are answered, the profile asks for 4" == checks["requests-in-flight"].text
    assert "a connection that idled for 1 s was still open" == checks["idle-disconnect"].text
    assert {} == found.changes


class Closing:
    """A relay that closes what idles, as a PLC with few connections does."""

    def __init__(self, port: int, idle_s: float) -> None:
        self.port, self.idle_s = port, idle_s

    async def __call__(self, reader, writer) -> None:
        import asyncio

        inner_reader, inner_writer = await asyncio.open_connection("127.0.0.1", self.port)
        try:
            while piece := await asyncio.wait_for(reader.read(4096), self.idle_s):
                inner_writer.write(piece)
                writer.write(await inner_reader.read(4096))
        except TimeoutError:
            pass
        finally:
            inner_writer.close()
            writer.close()


@pytest.mark.slow
async def test_a_plc_that_closes_what_idles_is_named_and_closed_before() -> None:
    import asyncio

    server = await serve_tcp(plc(station("modbus+tcp://127.0.0.1")), "127.0.0.1", 0, clock=WallClock())
    relay = await asyncio.start_server(Closing(server.port, 1.5), "127.0.0.1", 0)
    port = relay.sockets[0].getsockname()[1]
    found, checks, _ = await found_from(station(f"modbus+tcp://127.0.0.1:{port}"), idle_s=3.0)
    relay.close()
    await server.close()
    assert found is not None
    assert Outcome.FAIL is checks["idle-disconnect"].outcome
    assert "was closed while it idled for 2 s, after 1 s it stood" in checks["idle-disconnect"].text
    assert 1000 == found.changes["pacing.close_when_idle_ms"]


async def test_a_gateway_that_cannot_reach_the_unit_is_no_answer() -> None:
    from ahgateway.errors import PlcRefusedError

    real = station("modbus+tcp://127.0.0.1", 3)
    inner = plc(real)

    class Gateway:
        def answer(self, request):
            if request.unit != 3:
                raise PlcRefusedError("no such unit", code=11)
            return inner.answer(request)

    server = await serve_tcp(Gateway(), "127.0.0.1", 0, clock=WallClock())
    found, checks, _ = await found_from(replace(real, target=f"modbus+tcp://127.0.0.1:{server.port}", unit=1))
    await server.close()
    assert found is not None
    assert (3, {"wrong-unit"}) == (found.changes["unit"], failed(checks))


async def test_nothing_there_is_said_within_the_time_stated() -> None:
    clock = WallClock()
    begun_ns = clock.now_ns()
    found, checks = await find(
        station("modbus+tcp://127.0.0.1:9"), station("modbus+tcp://127.0.0.1:9").loops[0], opener([]), clock, ports=(),
        patience=Patience(2 * SECOND, 0),
    )  # fmt: skip
    assert found is None
    assert clock.now_ns() - begun_ns < 5 * SECOND
    assert "nothing answers; " in checks[0].text
    assert "ways tried: modbus+tcp://127.0.0.1:9 unit 1, modbus+tcp://127.0.0.1:9 unit 2" in checks[0].text


async def test_step_1_over_canopen_asks_for_objects_and_finds_the_node() -> None:
    text = target()
    plc_on_bus = fake_plc()
    real = can_station(text)
    clock = WallClock()

    async def opened(variant: Station) -> Link:
        return open_link(parse_uri(variant.target), clock, variant.pacing, can=variant.can)

    async with served(text, plc_on_bus):
        found, checks = await find(real, real.loops[0], opened, clock, ports=(), patience=Patience(5 * SECOND, 0))
    assert found is not None, checks[0].text
    by_name = {check.name: check for check in checks}
    assert set() == failed(by_name) - {"slow-link"}
    assert "SDO reads each object by itself" == by_name["short-requests"].text
