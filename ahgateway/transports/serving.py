"""From the text of a target to a server at it: the PLC's side of every Modbus wire."""

from __future__ import annotations

from collections.abc import Callable

from ahgateway.clock import Clock
from ahgateway.errors import ProfileError
from ahgateway.transports.ascii import AsciiRequests
from ahgateway.transports.base import Device
from ahgateway.transports.framing import Framing, Mbap
from ahgateway.transports.rtu import RtuRequests
from ahgateway.transports.serial_server import SerialServer, serve_serial
from ahgateway.transports.server import TcpServer, serve_tcp
from ahgateway.transports.uri import MODBUS_TCP_PORT, Target, line_of

FRAMINGS: dict[str, Callable[[], Framing]] = {
    "modbus+tcp": Mbap,
    "modbus+rtu+tcp": RtuRequests,
    "modbus+ascii+tcp": AsciiRequests,
    "modbus+rtu": RtuRequests,
    "modbus+ascii": AsciiRequests,
}
"""By scheme: how the server's side of the wire looks."""


async def serve_at(device: Device, target: Target, clock: Clock, *, connections_max: int) -> TcpServer | SerialServer:
    """Serve `device` at a target's host and port, or on its serial port, until `close`.

    Raises:
        ProfileError: The target is no Modbus wire.
        LinkError: The port cannot be had.
    """
    framing = FRAMINGS.get(target.scheme)
    if framing is None:
        raise ProfileError(
            f"`{target.text}`: nothing of Modbus can be served there",
            key="target",
            hint=f"one of {', '.join(FRAMINGS)}",
        )
    if target.path:
        return await serve_serial(device, line_of(target), framing=framing, clock=clock)
    port = target.port or MODBUS_TCP_PORT
    return await serve_tcp(device, target.host, port, clock=clock, framing=framing, connections_max=connections_max)
