"""Serial ports of this machine and the adapters behind them: product, driver, latency timer; nothing is opened.

Source: MEASURED spec speed §2.3: a latency timer of 16 ms, the usual default of FTDI adapters, halves the throughput
of every client at 115200 baud. The timer stands in Linux' sysfs; elsewhere it is not looked for.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

from serial.tools import list_ports

LATENCY_MS_GOOD = 1


@dataclass(frozen=True, slots=True)
class Adapter:
    """One serial port.

    Attributes:
        port: Its name, `/dev/ttyUSB0` or `COM3`.
        product: What it calls itself, with vendor and product number where it is on USB; `n/a` where nothing is known.
        driver: Kernel module that serves it, empty where not known.
        latency_ms: How long the adapter keeps bytes back, None where not known.
    """

    port: str
    product: str
    driver: str = ""
    latency_ms: int | None = None

    @property
    def timer_file(self) -> str:
        """Where the latency timer is set."""
        return f"/sys/class/tty/{Path(self.port).name}/device/latency_timer"


def adapters(sysfs: Path = Path("/sys")) -> list[Adapter]:
    """Return every serial port that the system lists, by name."""
    return sorted((adapter_of(port.device, sysfs) for port in list_ports.comports()), key=lambda each: each.port)


def adapter_of(port: str, sysfs: Path = Path("/sys")) -> Adapter:
    """Return what is known of one port; links such as /dev/serial/by-id are followed, `\\\\.\\com3` is COM3.

    Args:
        port: Name of a local port.
        sysfs: Where Linux shows its devices.
    """
    real = str(Path(port).resolve()) if port.startswith("/") else port
    product = "n/a"
    if not port.startswith("/"):
        real = port.upper().removeprefix("\\\\.\\")  # the names of Windows have no case
    for each in list_ports.comports():
        if each.device == real:
            product = each.description or product
            if each.vid is not None:
                product += f" ({each.vid:04X}:{each.pid:04X})"
    if sys.platform != "linux":
        return Adapter(port, product)
    device = sysfs / "class" / "tty" / Path(real).name / "device"
    return Adapter(real, product, _driver(device / "driver"), _number(device / "latency_timer"))


def _driver(link: Path) -> str:
    try:
        return link.resolve(strict=True).name
    except OSError:
        return ""


def _number(file: Path) -> int | None:
    try:
        return int(file.read_text(encoding="ascii"))
    except (OSError, ValueError):
        return None
