"""What is known of a serial line without speaking on it: its floor, its adapter, why its port cannot be had."""

from __future__ import annotations

import grp
import os
import tempfile
from pathlib import Path

import pytest

from ahgateway.codec.access import Read, Table, Write
from ahgateway.errors import LinkError
from ahgateway.transports.adapter import Adapter, adapter_of
from ahgateway.transports.floor import floor_ns, round_trip_floor_ns
from ahgateway.transports.line import Line, open_port

FORTY = Read(1, Table.HOLDING, 0, 40)
NOBODY = 65534


@pytest.mark.parametrize(
    ("line", "is_rtu", "milliseconds"),
    [
        (Line("x", 9600, "E", 7, 1), False, 195.83),  # 17 + 171 characters of 10 bits
        (Line("x", 115200, "E", 7, 1), False, 16.32),
        (Line("x", 9600, "N", 8, 1), True, 104.17),  # 8 + 85 characters and twice 3.5
        (Line("x", 19200, "N", 8, 1), True, 52.08),
        (Line("x", 115200, "N", 8, 1), True, 11.57),  # twice 1.75 ms
    ],
)
def test_the_floor_is_characters_and_silence(line: Line, is_rtu: bool, milliseconds: float) -> None:
    assert milliseconds == round(floor_ns(FORTY, line, is_rtu=is_rtu) / 1e6, 2)


def test_the_silence_behind_the_reply_is_no_part_of_the_round_trip() -> None:
    line = Line("x", 9600, "N", 8, 1)  # 93 characters of 1 041 666 ns and one gap of 3 645 831 ns
    assert 93 * 1_041_666 + 3_645_831 == round_trip_floor_ns(FORTY, line, is_rtu=True)
    ascii_line = Line("x", 9600, "E", 7, 1)
    assert 34 * 1_041_666 == round_trip_floor_ns(Write(1, Table.COIL, 0, (1,)), ascii_line, is_rtu=False)


def test_an_adapter_shows_its_driver_and_its_latency_timer(tmp_path: Path) -> None:
    device = tmp_path / "class" / "tty" / "ttyUSB9" / "device"
    (tmp_path / "drivers" / "ftdi_sio").mkdir(parents=True)
    device.mkdir(parents=True)
    (device / "driver").symlink_to(tmp_path / "drivers" / "ftdi_sio")
    (device / "latency_timer").write_text("16\n", encoding="ascii")
    found = adapter_of("/dev/ttyUSB9", tmp_path)
    assert Adapter("/dev/ttyUSB9", "n/a", "ftdi_sio", 16) == found
    assert "/sys/class/tty/ttyUSB9/device/latency_timer" == found.timer_file


def test_a_port_without_a_timer_has_none(tmp_path: Path) -> None:
    assert Adapter("/dev/ttyACM3", "n/a") == adapter_of("/dev/ttyACM3", tmp_path)


def test_a_port_that_is_not_ours_names_the_group_that_it_belongs_to() -> None:
    number, name = tempfile.mkstemp()
    os.close(number)
    os.chmod(name, 0)
    ours = os.geteuid()
    group = grp.getgrgid(os.stat(name).st_gid).gr_name
    try:
        if ours == 0:
            os.seteuid(NOBODY)  # root may open anything
        with pytest.raises(LinkError, match="no permission") as caught:
            open_port(Line(name))
    finally:
        if ours == 0:
            os.seteuid(ours)
        os.unlink(name)
    assert f"belongs to group {group}: sudo usermod -aG {group} $USER" in (caught.value.hint or "")
