"""Why a port cannot be had: the texts that pyserial raises on Windows, whatever language Windows speaks."""

from __future__ import annotations

import pytest
import serial

from ahgateway.transports.line import Line
from ahgateway.transports.port_errors import why_gone, why_not, windows_code
from ahgateway.transports.uri import line_of, parse_uri

COM3 = Line("COM3", 19200, "E", 7, 1)


def opening(reason: str) -> serial.SerialException:
    """As `serialwin32.Serial.open` words it; only the text survives, `errno` is not set."""
    return serial.SerialException(f"could not open port 'COM3': {reason}")


@pytest.mark.parametrize(
    ("reason", "what", "hint"),
    [
        ("FileNotFoundError(2, 'The system cannot find the file specified.', None, 2)", "no such port", "ports here:"),
        (
            "FileNotFoundError(2, 'Das System kann die angegebene Datei nicht finden.', None, 2)",
            "no such port",
            "ports",
        ),
        ("OSError(22, 'The filename, directory name, … syntax is incorrect.', None, 123)", "no such port", "ports"),
        ("PermissionError(13, 'Access is denied.', None, 5)", "port is busy", "another program has it open"),
        ("PermissionError(13, 'Accès refusé.', None, 5)", "port is busy", "another program has it open"),
        ("OSError(22, 'The semaphore timeout period has expired.', None, 121)", "answers too slowly", "Bluetooth"),
        ("OSError(22, 'A device attached to the system is not functioning.', None, 31)", "too slowly", "plug it in"),
    ],
)
def test_what_windows_says_of_a_port_is_told_apart_by_its_number(reason: str, what: str, hint: str) -> None:
    said, todo = why_not(COM3, opening(reason))
    assert what in said
    assert hint in todo


def test_a_setting_that_windows_refuses_is_named() -> None:
    error = serial.SerialException(
        "Cannot configure port, something went wrong. "
        "Original message: OSError(22, 'The parameter is incorrect.', None, 87)"
    )
    assert "the adapter refuses 19200 7E1" == why_not(COM3, error)[0]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            "ClearCommError failed (PermissionError(13, 'The device does not recognize the command.', None, 22))",
            "the port went away (Windows error 22)",
        ),
        (
            "WriteFile failed (PermissionError(13, 'Access is denied.', None, 5))",
            "the port went away (Windows error 5)",
        ),
        (
            "GetOverlappedResult failed (OSError(22, 'The I/O operation has been aborted …', None, 995))",
            "the port went away (Windows error 995)",
        ),
        (
            "WriteFile failed (OSError(22, 'The semaphore timeout period has expired.', None, 121))",
            "the port answers too slowly or not at all",
        ),
        ("device reports readiness to read but returned no data", "the port went away (device reports readiness"),
    ],
)
def test_an_adapter_pulled_out_under_windows_went_away(text: str, said: str) -> None:
    assert why_gone(serial.SerialException(text)).startswith(said)


def test_an_error_of_linux_has_no_windows_number() -> None:
    assert 0 == windows_code(
        serial.SerialException(2, "could not open port /dev/x: [Errno 2] No such file or directory")
    )


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("modbus+rtu://COM3?baud=19200", Line("COM3", 19200, "E", 8, 1)),
        ("modbus+ascii://COM12", Line("COM12", 9600, "E", 7, 1)),
        (r"modbus+rtu://\\.\COM10?baud=115200&parity=N", Line(r"\\.\COM10", 115200, "N", 8, 1)),
        ("modbus+rtu://com3", Line("com3", 9600, "E", 8, 1)),
    ],
)
def test_the_names_that_ports_have_under_windows_are_targets(text: str, line: Line) -> None:
    assert line == line_of(parse_uri(text))
