"""From a canopen target and the profile's objects to a link, by SDO or by PDOs."""

from __future__ import annotations

from ahgateway.clock import Clock
from ahgateway.codec.can_objects import CanMap
from ahgateway.codec.station import Pacing
from ahgateway.errors import ProfileError
from ahgateway.transports.base import Link, Tap
from ahgateway.transports.can.bus import bus_for
from ahgateway.transports.can.cyclic import CyclicLink
from ahgateway.transports.can.link import SdoLink
from ahgateway.transports.uri import Target


def can_link(target: Target, can: CanMap | None, clock: Clock, pacing: Pacing, tap: Tap | None) -> Link:
    """Return the link of a canopen target; with `pdo=1` what the profile maps comes from PDOs.

    Raises:
        ProfileError: No node in the target, or nothing in the profile says where operands stand.
    """
    if "node" not in target.options:
        raise ProfileError(f"`{target.text}` names no node", key="target", hint="add ?node=3, the PLC's node-ID")
    if can is None:
        raise ProfileError(
            f"`{target.text}`: the profile does not say which CANopen objects hold the operands",
            key="station.can",
            hint="see [[station.can.objects]] in docs/reference/can.md; the shipped example is `can`",
        )
    is_cyclic = target.options.get("pdo") == "1"
    if is_cyclic and not can.pdos:
        raise ProfileError(
            f"`{target.text}` asks for PDOs, the profile maps none", key="station.can.pdos", hint="leave out pdo=1"
        )
    bus = bus_for(target, clock, tap)
    sdo = SdoLink(bus, int(target.options["node"]), can, clock, pacing)
    return CyclicLink(sdo, bus, can, clock, pacing) if is_cyclic else sdo
