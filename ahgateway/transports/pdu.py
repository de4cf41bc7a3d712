"""Requests and replies as Modbus PDUs, and the proof that a reply belongs to its request.

The one module that meets pymodbus' PDUs. It decides what a function code asks, how long a PDU is and what an
exception means; it knows nothing of units on a line, checksums, transaction numbers or time.

Reading words and bits is the hot path. pymodbus decodes 40 registers one by one (MEASURED 10 µs a reply, one
`struct.unpack` 0.5 µs), so reads and their replies are packed and unpacked here; writes and exceptions pass through
pymodbus.

Source: MANUAL Modbus Application Protocol V1.1b3, §6 functions, §7 exceptions.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import NamedTuple

from pymodbus.pdu import bit_message, register_message
from pymodbus.pdu.exceptionresponse import ExceptionResponse
from pymodbus.pdu.pdu import ModbusPDU

from ahgateway.codec.access import Read, Request, Table, Write
from ahgateway.errors import CodecError, FrameError, PlcRefusedError

PDU_SIZE_MAX = 253
READ_WORDS_MAX = 125
READ_BITS_MAX = 2000
WRITE_WORDS_MAX = 123
WRITE_BITS_MAX = 1968
EXCEPTION_BIT = 0x80

_READ_FUNCTION = {Table.COIL: 1, Table.DISCRETE: 2, Table.HOLDING: 3, Table.INPUT: 4}
_READ_TABLE = {function: table for table, function in _READ_FUNCTION.items()}
_READ_PDU = struct.Struct(">BHH")
"""Function, address, count."""
_WORDS = tuple(struct.Struct(f">{count}H") for count in range(READ_WORDS_MAX + 1))
_BITS_OF_BYTE = tuple(bytes(byte >> bit & 1 for bit in range(8)) for byte in range(256))

EXCEPTIONS: dict[int, tuple[str, str]] = {
    1: ("illegal function", "this PLC does not know the function; the table may be read-only or not exist"),
    2: ("illegal data address", "the address is outside this PLC's map; check the device, its range and the profile"),
    3: ("illegal data value", "the count or the value is not allowed; try fewer words per request"),
    4: ("device failure", "the PLC could not carry it out; look at its error log"),
    5: ("acknowledge", "the PLC needs time; read again later"),
    6: ("device busy", "the PLC is busy; poll more slowly or look for another master"),
    7: ("negative acknowledge", "the PLC could not carry it out"),
    8: ("memory parity error", "the PLC's extended memory is faulty"),
    10: ("gateway path unavailable", "the converter has no line to this unit; check its settings"),
    11: ("gateway target did not respond", "the converter is there, the unit behind it is not; check unit and line"),
}
"""Exception code to its name in the standard and what it usually means here."""


class Shape(NamedTuple):
    """What the reply to one request must look like.

    Attributes:
        function: Function code asked.
        head: Bytes with which the reply must begin.
        size: Its length in bytes.
    """

    function: int
    head: bytes
    size: int


def describe(request: Request) -> str:
    """Name a request for people: `read 40 holding registers from 0x1000 of unit 1`."""
    if isinstance(request, Read):
        verb, count, preposition = "read", request.count, "from"
    else:
        verb, count, preposition = "write", len(request.values), "to"
    plural = "" if count == 1 else "s"
    return f"{verb} {count} {request.table.value}{plural} {preposition} 0x{request.address:04X} of unit {request.unit}"


def encode_request(request: Request) -> bytes:
    """Return the PDU that asks `request`.

    Raises:
        CodecError: A unit, address, count or value that no PDU can hold, or a write to a read-only table.
    """
    if type(request) is Read:
        count, count_max = request.count, READ_BITS_MAX if request.table.is_bits else READ_WORDS_MAX
        _check_place(request, count, count_max)
        return _READ_PDU.pack(_READ_FUNCTION[request.table], request.address, count)
    assert isinstance(request, Write)
    return _encode_write(request)


def _encode_write(request: Write) -> bytes:
    if request.table in (Table.DISCRETE, Table.INPUT):
        raise CodecError(f"cannot {describe(request)}: this table is read-only")
    is_bits = request.table.is_bits
    _check_place(request, len(request.values), WRITE_BITS_MAX if is_bits else WRITE_WORDS_MAX)
    value_max = 1 if is_bits else 0xFFFF
    for value in request.values:
        if not 0 <= value <= value_max:
            raise CodecError(f"cannot {describe(request)}: value {value} is not in 0…{value_max}")
    message: ModbusPDU
    address, values = request.address, request.values
    if is_bits and len(values) == 1:
        message = bit_message.WriteSingleCoilRequest(address=address, bits=[bool(values[0])])
    elif is_bits:
        message = bit_message.WriteMultipleCoilsRequest(address=address, bits=[bool(value) for value in values])
    elif len(values) == 1:
        message = register_message.WriteSingleRegisterRequest(address=address, registers=values)
    else:
        message = register_message.WriteMultipleRegistersRequest(address=address, registers=values)
    return bytes((message.function_code,)) + message.encode()


def _check_place(request: Request, count: int, count_max: int) -> None:
    if not 1 <= count <= count_max:
        raise CodecError(f"cannot {describe(request)}: one request holds 1…{count_max}", hint="ask in several requests")
    if not (request.address >= 0 and request.address + count <= 0x10000):
        raise CodecError(f"cannot {describe(request)}: Modbus addresses are 0x0000…0xFFFF")
    if not 0 <= request.unit <= 255:
        raise CodecError(f"cannot {describe(request)}: units are 0…255")


def reply_shape(request: Request, pdu: bytes) -> Shape:
    """Return what the reply to `request`, sent as `pdu`, must begin with and how long it must be."""
    function = pdu[0]
    if type(request) is Read:
        size = (request.count + 7) // 8 if function <= 2 else 2 * request.count
        return Shape(function, bytes((function, size)), 2 + size)
    return Shape(function, pdu[:5], 5)


def decode_reply(request: Request, shape: Shape, pdu: bytes) -> tuple[int, ...]:
    """Return the values read (empty for a write) after proving function, byte count and echo.

    Raises:
        PlcRefusedError: The reply is an exception.
        FrameError: The PDU is no answer to this request.
    """
    if len(pdu) == shape.size and pdu.startswith(shape.head):
        if type(request) is not Read:
            return ()
        if shape.function > 2:
            return _WORDS[request.count].unpack_from(pdu, 2)
        return tuple(b"".join([_BITS_OF_BYTE[byte] for byte in pdu[2:]])[: request.count])
    if len(pdu) == 2 and pdu[0] == shape.function | EXCEPTION_BIT:
        raise refusal(request, pdu[1])
    raise FrameError(
        f"reply {pdu[:8].hex(' ')}{' …' if len(pdu) > 8 else ''} ({len(pdu)} bytes) is no answer to: "
        f"{describe(request)}, which begins with {shape.head.hex(' ')} and has {shape.size} bytes",
        hint="another master or a converter may be answering on this line",
    )


def refusal(request: Request, code: int) -> PlcRefusedError:
    """Return the error for exception `code` to `request`, with the code's name and what it usually means here."""
    name, hint = EXCEPTIONS.get(code, ("not a code of the standard", "see the device's manual"))
    return PlcRefusedError(f"PLC refused to {describe(request)}: exception {code:02d}, {name}", code=code, hint=hint)


def decode_request(unit: int, pdu: bytes) -> Request:
    """Return what a PDU asks, as the PLC's side sees it.

    Raises:
        PlcRefusedError: With the code that the standard demands: 01 unknown function, 02 range beyond 0xFFFF,
            03 a count or length that does not fit.
    """
    function = pdu[0]
    if function in _READ_TABLE:
        return _decode_read(unit, pdu)
    if function in (5, 6):
        return _decode_write_one(unit, pdu)
    if function in (15, 16):
        return _decode_write_many(unit, pdu)
    raise _malformed(1, f"function {function}")


def _decode_read(unit: int, pdu: bytes) -> Read:
    if len(pdu) != _READ_PDU.size:
        raise _malformed(3, f"{len(pdu)} bytes where a read has {_READ_PDU.size}")
    function, address, count = _READ_PDU.unpack(pdu)
    count_max = READ_BITS_MAX if function <= 2 else READ_WORDS_MAX
    if not 1 <= count <= count_max:
        raise _malformed(3, f"count {count} is not in 1…{count_max}")
    if address + count > 0x10000:
        raise _malformed(2, f"0x{address:04X} and {count} on")
    return Read(unit, _READ_TABLE[function], address, count)


def _decode_write_one(unit: int, pdu: bytes) -> Write:
    if len(pdu) != 5:
        raise _malformed(3, f"{len(pdu)} bytes where a single write has 5")
    if pdu[0] == 6:
        word = register_message.WriteSingleRegisterRequest()
        word.decode(pdu[1:])
        return Write(unit, Table.HOLDING, word.address, (word.registers[0],))
    if pdu[3:5] not in (b"\x00\x00", b"\xff\x00"):
        raise _malformed(3, f"coil value {pdu[3:5].hex()}")
    coil = bit_message.WriteSingleCoilRequest()
    coil.decode(pdu[1:])
    return Write(unit, Table.COIL, coil.address, (int(coil.bits[0]),))


def _decode_write_many(unit: int, pdu: bytes) -> Write:
    is_bits = pdu[0] == 15
    count = int.from_bytes(pdu[3:5], "big")
    size = (count + 7) // 8 if is_bits else 2 * count
    if len(pdu) < 6 or not 1 <= count <= (WRITE_BITS_MAX if is_bits else WRITE_WORDS_MAX):
        raise _malformed(3, f"count {count}")
    if pdu[5] != size or len(pdu) != 6 + size:
        raise _malformed(3, f"{pdu[5]} bytes announced, {len(pdu) - 6} sent, {size} needed")
    if int.from_bytes(pdu[1:3], "big") + count > 0x10000:
        raise _malformed(2, f"{count} beyond 0xFFFF")
    if is_bits:
        coils = bit_message.WriteMultipleCoilsRequest()
        coils.decode(pdu[1:])
        return Write(unit, Table.COIL, coils.address, tuple(int(bit) for bit in coils.bits))
    words = register_message.WriteMultipleRegistersRequest()
    words.decode(pdu[1:])
    return Write(unit, Table.HOLDING, words.address, tuple(words.registers))


def _malformed(code: int, what: str) -> PlcRefusedError:
    name, hint = EXCEPTIONS[code]
    return PlcRefusedError(f"request refused: {what}: exception {code:02d}, {name}", code=code, hint=hint)


def encode_reply(request: Request, pdu: bytes, values: Sequence[int]) -> bytes:
    """Return the PLC's answer to `request`, which arrived as `pdu`.

    Args:
        request: What was asked.
        pdu: Its bytes, for the echo of a write.
        values: Bits or words read, `request.count` of them; ignored for a write.
    """
    if not isinstance(request, Read):
        return pdu[:5]
    if len(values) != request.count:
        raise ValueError(f"a device answered {len(values)} values to: {describe(request)}")
    function = pdu[0]
    if function > 2:
        return bytes((function, 2 * request.count)) + _WORDS[request.count].pack(*values)
    size = (request.count + 7) // 8
    packed = sum(1 << index for index, bit in enumerate(values) if bit)
    return bytes((function, size)) + packed.to_bytes(size, "little")


def encode_exception(function: int, code: int) -> bytes:
    """Return the exception PDU for a request of `function`."""
    message = ExceptionResponse(function & 0x7F, code)
    return bytes((message.function_code,)) + message.encode()
