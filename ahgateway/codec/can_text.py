"""One CAN frame as a line for people: the service, the node, and what it says as far as CANopen or the profile knows.

Source:
    MANUAL CiA 301 v4.2 §7.2: NMT, SYNC, EMCY, SDO, heartbeat.
    MANUAL Linux `include/uapi/linux/can/error.h`: error frames.
"""

from __future__ import annotations

import struct

from ahgateway.codec.access import Span
from ahgateway.codec.can_frame import CanFrame, service
from ahgateway.codec.can_objects import CanMap
from ahgateway.codec.can_sdo import ABORTED, ABORTS
from ahgateway.codec.devices import DeviceMap
from ahgateway.errors import CodecError

COMMANDS = {1: "start", 2: "stop", 0x80: "enter pre-operational", 0x81: "reset node", 0x82: "reset communication"}
STATES = {0x00: "boot-up", 0x04: "stopped", 0x05: "operational", 0x7F: "pre-operational"}
ERRORS = {0x40: "bus-off", 0x100: "controller restarted", 0x20: "no acknowledge", 0x08: "protocol violation"} | {
    0x04: "controller trouble",
    0x02: "lost arbitration",
    0x80: "bus error",
}


def meaning(frame: CanFrame, can: CanMap | None = None, devices: DeviceMap | None = None) -> str:
    """Return what a frame says; empty when only its sender knows.

    Args:
        frame: The frame.
        can: The profile's objects and PDOs, if there is a profile.
        devices: Its device map, to name what a PDO carries.
    """
    if frame.is_error:
        said = [text for bit, text in ERRORS.items() if frame.can_id & bit]
        return f"adapter reports: {', '.join(said) or 'an error'}"
    if frame.is_extended:
        return "29-bit identifier, no CANopen"
    for pdo in can.pdos if can is not None else ():
        if pdo.cob_id == frame.can_id:
            try:
                carried = pdo.decoded(frame.data)
            except CodecError as error:
                return error.message
            return "; ".join(_carried(span, values, devices) for span, values in carried)
    name, node = service(frame.can_id)
    if frame.is_remote:
        return f"{name} of node {node} is asked for" if node else "remote request"
    if name == "NMT":
        return _nmt(frame.data)
    if name == "SYNC":
        return f"SYNC {frame.data[0]}" if frame.data else "SYNC"
    if name == "EMCY":
        return _emergency(node, frame.data)
    if name.startswith("SDO"):
        return f"node {node} {_sdo(name, frame.data)}"
    if name == "heartbeat":
        state = STATES.get(frame.data[0] & 0x7F, f"state {frame.data[0]:#04x}") if frame.data else "no state"
        return f"node {node} {state}"
    return f"{name} of node {node}" if node else name


def _nmt(data: bytes) -> str:
    if len(data) < 2:
        return "NMT, too short"
    whom = f"node {data[1]}" if data[1] else "all nodes"
    return f"NMT {COMMANDS.get(data[0], f'command {data[0]:#04x}')}: {whom}"


def _emergency(node: int, data: bytes) -> str:
    if len(data) < 3:
        return f"EMCY of node {node}, too short"
    code = int.from_bytes(data[:2], "little")
    return f"EMCY of node {node}: {'error reset' if not code else f'code {code:#06x}'}, register {data[2]:#04x}"


def _sdo(name: str, data: bytes) -> str:
    if not data:
        return f"{name}, empty"
    specifier, is_request = data[0] & 0xE0, name == "SDO request"
    if len(data) < 4:
        return f"{name} {data[0]:#04x}"
    place = "{:#06x}:{:02x}".format(*struct.unpack_from("<HB", data, 1))
    if data[0] == ABORTED:
        code = int.from_bytes(data[4:8].ljust(4, b"\0"), "little")
        return f"SDO abort of {place}: {code:#010x}, {ABORTS.get(code, ('unknown code', ''))[0]}"
    if is_request and specifier == 0x40:
        return f"is asked for {place}"
    if is_request and specifier == 0x20:
        return f"is to take {place}{_expedited(data)}"
    if not is_request and specifier == 0x40:
        return f"holds {place}{_expedited(data)}"
    if not is_request and specifier == 0x60:
        return f"has taken {place}"
    if specifier in (0x00, 0x20, 0x60):
        return f"{name}, segment{', the last' if data[0] & 1 and specifier == 0x00 else ''}"
    return f"{name}, block transfer"


def _expedited(data: bytes) -> str:
    if not data[0] & 2:
        return f", {int.from_bytes(data[4:8], 'little')} bytes follow" if data[0] & 1 else ", more follows"
    size = 4 - (data[0] >> 2 & 3) if data[0] & 1 else 4
    value = data[4 : 4 + size]
    return f" = {value[::-1].hex().upper()}"


def _carried(span: Span, values: tuple[int, ...], devices: DeviceMap | None) -> str:
    device = devices.device(span.table, span.address) if devices is not None else None
    name = str(device) if device is not None else f"{span.table.value} {span.address:#06x}"
    if span.table.is_bits:
        return f"{name} {''.join(str(value) for value in values)}"
    return f"{name} {' '.join(f'{value:04X}' for value in values)}"
