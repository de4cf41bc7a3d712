from __future__ import annotations

import pytest

from ahgateway.clock import VirtualClock
from ahgateway.errors import ProfileError, StateError
from ahgateway.transports.tcp import TcpLink
from ahgateway.transports.uri import open_link, parse_uri


@pytest.mark.parametrize(
    ("text", "scheme", "host", "port", "path", "options"),
    [
        ("modbus+tcp://192.0.2.10:1502?unit=3", "modbus+tcp", "192.0.2.10", 1502, "", {"unit": "3"}),
        ("modbus+tcp://plc.example", "modbus+tcp", "plc.example", 502, "", {}),
        ("modbus+tcp://[2001:db8::1]:502", "modbus+tcp", "2001:db8::1", 502, "", {}),
        (
            "modbus+rtu:///dev/ttyUSB0?baud=115200&parity=e",
            "modbus+rtu",
            "",
            None,
            "/dev/ttyUSB0",
            {"baud": "115200", "parity": "E"},
        ),
        ("modbus+ascii://COM3?bits=7&stop=1", "modbus+ascii", "", None, "COM3", {"bits": "7", "stop": "1"}),
        ("modbus+rtu+tcp://192.0.2.20:4001", "modbus+rtu+tcp", "192.0.2.20", 4001, "", {}),
        ("modbus+ascii+tcp://192.0.2.20:4001?unit=2", "modbus+ascii+tcp", "192.0.2.20", 4001, "", {"unit": "2"}),
        ("canopen://socketcan/can0?node=3", "canopen", "socketcan", None, "can0", {"node": "3"}),
        ("fake://profiles/examples/demo.toml", "fake", "", None, "profiles/examples/demo.toml", {}),
        ("replay:///tmp/a%20run.ahr", "replay", "", None, "/tmp/a run.ahr", {}),
    ],
)
def test_every_kind_of_target(
    text: str, scheme: str, host: str, port: int | None, path: str, options: dict[str, str]
) -> None:
    target = parse_uri(text)
    assert (text, scheme, host, port, path) == (target.text, target.scheme, target.host, target.port, target.path)
    assert options == target.options


@pytest.mark.parametrize(
    ("text", "message", "hint"),
    [
        ("192.0.2.10:502", "has no scheme", "modbus+tcp://192.0.2.10:502"),
        ("modbus+tpc://192.0.2.10", "`modbus+tpc`", "did you mean `modbus+tcp`?"),
        ("modbus+tcp://", "has no host", "modbus+tcp://HOST"),
        ("modbus+tcp://192.0.2.10:99999", "Port out of range", "modbus+tcp://HOST"),
        ("modbus+tcp://192.0.2.10:0", "port 0", "1…65535"),
        ("modbus+tcp://192.0.2.10/x", "a path `/x`", "modbus+tcp://HOST"),
        ("modbus+tcp://192.0.2.10?units=1", "option `units`", "did you mean `unit`?"),
        ("modbus+tcp://192.0.2.10?unit=300", "`300`, wanted a whole number 0…255", ""),
        ("modbus+tcp://192.0.2.10?unit=1&unit=2", "stands twice", "once"),
        ("modbus+rtu:///dev/ttyUSB0?parity=X", "wanted one of N, E, O", ""),
        ("modbus+rtu:///dev/ttyUSB0?bits=7", "RTU needs 8", "modbus+ascii"),
        ("modbus+rtu://", "names nothing", "/dev/ttyUSB0"),
        ("modbus+rtu+tcp://192.0.2.20", "has no port", "converter"),
        ("canopen://socketcan", "has no channel", "canopen://INTERFACE/CHANNEL"),
    ],
)
def test_a_wrong_target_says_what_is_wrong_and_what_is_near(text: str, message: str, hint: str) -> None:
    with pytest.raises(ProfileError) as caught:
        parse_uri(text)
    assert message in str(caught.value)
    assert hint in (caught.value.hint or "")
    assert caught.value.key == "target"


def test_units_are_numbers() -> None:
    assert parse_uri("modbus+tcp://192.0.2.10?unit=7").unit == 7
    assert parse_uri("modbus+tcp://192.0.2.10").unit is None
    assert parse_uri("modbus+rtu:///dev/ttyS0").whole("baud", 9600) == 9600


@pytest.mark.parametrize("text", ["modbus+tcp://192.0.2.10:502", "modbus+rtu+tcp://192.0.2.20:4001"])
def test_a_link_is_made_without_a_connection(text: str) -> None:
    link = open_link(parse_uri(text), VirtualClock())
    assert isinstance(link, TcpLink)
    assert text == link.target


def test_a_link_that_this_version_lacks_is_named() -> None:
    with pytest.raises(StateError, match="replay links are not part of this version"):
        open_link(parse_uri("replay://run.ahr"), VirtualClock())
