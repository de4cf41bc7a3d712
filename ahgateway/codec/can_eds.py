"""The gateway as a node of the PLC's CANopen master: its objects, its RPDOs, and the EDS that describes both.

One index for each loop from 2000h on, one REAL32 for each value that the master sends: SV, PV, MV and what of the
instruction's memory is known. Two REALs travel in each RPDO. The first four RPDOs have the identifiers of the
pre-defined connection set; further ones are off until the master gives them one.

Source:
    MANUAL CiA 301 v4.2 §7.5.2: objects 1000h…1A00h; CiA 306-1 v1.4: sections and keys of an EDS.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable
from dataclasses import dataclass

from ahgateway.codec.station import Loop, Station
from ahgateway.core.operands import Kind
from ahgateway.errors import CodecError

LOOP_INDEX = 0x2000
LOOPS_MAX = 64
REAL_SIZE = 4
PDO_REALS = 2
PREDEFINED_PDOS = 4
PDO_OFF = 0x8000_0000
UNSIGNED8, UNSIGNED16, UNSIGNED32, REAL32 = 0x0005, 0x0006, 0x0007, 0x0008
RECEIVED_EVENT = 254
EDS_DATE = "01-01-2026"
"""CiA 306 wants dates; it is always the same one, so that equal profiles give equal text."""


@dataclass(frozen=True, slots=True)
class NodeValue:
    """One REAL that the master sends: where it stands, of which loop, under which name."""

    index: int
    sub: int
    loop: str
    name: str


@dataclass(frozen=True, slots=True)
class NodeLayout:
    """What the gateway is as a node.

    Attributes:
        name: Of the station.
        values: Every REAL, in the order of index and sub-index.
        rpdos: The values of each RPDO, from RPDO 1 on.
    """

    name: str
    values: tuple[NodeValue, ...]
    rpdos: tuple[tuple[NodeValue, ...], ...]

    def cob_id(self, number: int, node: int) -> int:
        """Return the identifier of an RPDO, 0 the first; `PDO_OFF` where the connection set has none."""
        return 0x200 + 0x100 * number + node if number < PREDEFINED_PDOS else PDO_OFF

    def mapping(self, number: int) -> tuple[int, ...]:
        """Return the mapping entries of an RPDO: index, sub-index and length in bits."""
        return tuple(value.index << 16 | value.sub << 8 | 8 * REAL_SIZE for value in self.rpdos[number])


def node_layout(station: Station) -> NodeLayout:
    """Return the gateway's objects for the loops of a station.

    Raises:
        CodecError: More loops than the manufacturer's range holds here.
    """
    if len(station.loops) > LOOPS_MAX:
        raise CodecError(f"station {station.name} has {len(station.loops)} loops, a node holds {LOOPS_MAX}")
    values: list[NodeValue] = []
    rpdos: list[tuple[NodeValue, ...]] = []
    for place, loop in enumerate(station.loops):
        own = [NodeValue(LOOP_INDEX + place, sub, loop.name, name) for sub, name in enumerate(_names(loop), start=1)]
        values += own
        rpdos += [tuple(own[at : at + PDO_REALS]) for at in range(0, len(own), PDO_REALS)]
    return NodeLayout(station.name, tuple(values), tuple(rpdos))


def _names(loop: Loop) -> Iterable[str]:
    """SV, PV and MV, then the REALs of the instruction's memory; MOUT and whole numbers are the master's business."""
    rows = {row.name: row for row in loop.controller.operands}
    memory = [seen.name for seen in loop.controller.seen if rows[seen.operand].kind is Kind.BLOCK]
    named = [name for name in ("SV", "PV", "MV") if name in rows and rows[name].kind is Kind.REAL]
    return [*named, *sorted(memory)]


def real_text(packed: bytes) -> str:
    """Return a REAL's bytes as people read it."""
    return f"{struct.unpack('<f', packed)[0]:g}"


def eds(layout: NodeLayout, *, version: str, heartbeat_ms: int = 1000) -> str:
    """Return the EDS; node-dependent identifiers are written with $NODEID."""
    sections = [_file_info(layout, version), _device_info(layout, version)]
    sections += [_section("DummyUsage", [(f"Dummy{number:04X}", "0") for number in range(1, 8)])]
    sections += [_section("Comments", [("Lines", "1"), ("Line1", "REALs are little-endian, as Delta's D pairs")])]
    sections += [_list("MandatoryObjects", [0x1000, 0x1001, 0x1018])]
    sections += [_variable("1000", "Device type", UNSIGNED32, "ro", "0x0")]
    sections += [_variable("1001", "Error register", UNSIGNED8, "ro", "0x0")]
    identity = ("Vendor-ID", "Product code", "Revision number", "Serial number")
    sections += _record(0x1018, "Identity", [(name, UNSIGNED32, "ro", "0x0", False) for name in identity])
    numbers = range(len(layout.rpdos))
    optional = [0x1017, *(0x1400 + number for number in numbers), *(0x1600 + number for number in numbers)]
    sections += [_list("OptionalObjects", optional)]
    sections += [_variable("1017", "Producer heartbeat time", UNSIGNED16, "rw", str(heartbeat_ms))]
    for number in numbers:
        sections += _communication(layout, number)
    for number in numbers:
        entries = [
            (f"Mapping entry {place}", UNSIGNED32, "const", f"0x{entry:08X}", False)
            for place, entry in enumerate(layout.mapping(number), start=1)
        ]
        sections += _record(0x1600 + number, f"RPDO {number + 1} mapping", entries)
    indices = sorted({value.index for value in layout.values})
    sections += [_list("ManufacturerObjects", indices)]
    for index in indices:
        own = [value for value in layout.values if value.index == index]
        sections += _record(index, own[0].loop, [(value.name, REAL32, "rww", "0", True) for value in own])
    return "\n\n".join(sections) + "\n"


def _communication(layout: NodeLayout, number: int) -> list[str]:
    cob_id = layout.cob_id(number, 0)
    text = f"0x{cob_id:X}" if cob_id == PDO_OFF else f"$NODEID+0x{cob_id:X}"
    entries = [
        ("COB-ID", UNSIGNED32, "rw", text, False),
        ("Transmission type", UNSIGNED8, "ro", str(RECEIVED_EVENT), False),
    ]
    return _record(0x1400 + number, f"RPDO {number + 1} communication", entries)


def _file_info(layout: NodeLayout, version: str) -> str:
    name = "".join(sign if sign.isalnum() else "_" for sign in layout.name)
    rows = [("FileName", f"{name}.eds"), ("FileVersion", "1"), ("FileRevision", "0"), ("EDSVersion", "4.0")]
    rows += [("Description", f"ahgateway {version} beside {layout.name}")]
    for what, by in (("Creation", "CreatedBy"), ("Modification", "ModifiedBy")):
        rows += [(f"{what}Time", "12:00AM"), (f"{what}Date", EDS_DATE), (by, f"ahgateway {version}")]
    return _section("FileInfo", rows)


def _device_info(layout: NodeLayout, version: str) -> str:
    rates = [("BaudRate_10", "1"), ("BaudRate_20", "1"), ("BaudRate_50", "1"), ("BaudRate_125", "1")]
    rates += [("BaudRate_250", "1"), ("BaudRate_500", "1"), ("BaudRate_800", "1"), ("BaudRate_1000", "1")]
    rows = [("VendorName", "ahgateway"), ("VendorNumber", "0"), ("ProductName", "ahgateway"), ("ProductNumber", "0")]
    rows += [("RevisionNumber", "0"), ("OrderCode", version), *rates, ("SimpleBootUpMaster", "0")]
    rows += [("SimpleBootUpSlave", "1"), ("Granularity", "8"), ("DynamicChannelsSupported", "0")]
    rows += [("GroupMessaging", "0"), ("NrOfRXPDO", str(len(layout.rpdos))), ("NrOfTXPDO", "0"), ("LSS_Supported", "0")]
    return _section("DeviceInfo", rows)


def _section(name: str, rows: Iterable[tuple[str, str]]) -> str:
    return "\n".join([f"[{name}]", *(f"{key}={value}" for key, value in rows)])


def _list(name: str, indices: list[int]) -> str:
    rows = [("SupportedObjects", str(len(indices)))]
    return _section(name, [*rows, *((str(place), f"0x{index:04X}") for place, index in enumerate(indices, start=1))])


def _variable(key: str, name: str, kind: int, access: str, default: str, *, is_mappable: bool = False) -> str:
    rows = [("ParameterName", name), ("ObjectType", "0x7"), ("DataType", f"0x{kind:04X}"), ("AccessType", access)]
    return _section(key, [*rows, ("DefaultValue", default), ("PDOMapping", "1" if is_mappable else "0")])


def _record(index: int, name: str, entries: list[tuple[str, int, str, str, bool]]) -> list[str]:
    head = [("ParameterName", name), ("ObjectType", "0x9"), ("SubNumber", str(len(entries) + 1))]
    found = [_section(f"{index:04X}", head)]
    found.append(_variable(f"{index:04X}sub0", "Highest sub-index", UNSIGNED8, "const", str(len(entries))))
    for sub, (title, kind, access, default, is_mappable) in enumerate(entries, start=1):
        found.append(_variable(f"{index:04X}sub{sub:X}", title, kind, access, default, is_mappable=is_mappable))
    return found
