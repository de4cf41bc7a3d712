"""Ready-made places for the operands of an instruction.

Source:
    MANUAL AH500 programming manual, example of API 0707 (spec ah500 §1.2): D100 upwards in operand order, MV at D200,
    flags M1 upwards.
    ASSUMED for API 0708: the same rule; it ends exactly where the manual puts I_MV, D126. Order of its flags.
"""

from __future__ import annotations

from ahgateway.codec.devices import WORD_BITS, Device
from ahgateway.core.controllers import Controller
from ahgateway.core.operands import Kind

INSTRUCTIONS = ("DPID", "DPIDE")
"""Instructions whose manual has such an example."""

DATA = Device("D", 100)
FLAGS = Device("M", 1)
MV_DISTANCE = 100
"""The manual's MV stands this many words behind the first register."""


def manual(controller: Controller, data: Device = DATA, flags: Device = FLAGS) -> dict[str, Device]:
    """Return the device of every operand: 32-bit values packed from `data` on, flags from `flags` on."""
    places: dict[str, Device] = {}
    words = bits = 0
    for row in controller.operands:
        if row.kind is Kind.BOOL:
            places[row.name] = _flag(flags, bits)
            bits += 1
        elif row.name == "MV":
            places[row.name] = Device(data.kind, data.index + MV_DISTANCE)
        else:
            places[row.name] = Device(data.kind, data.index + words)
            words += row.words
    return places


def _flag(first: Device, offset: int) -> Device:
    if first.bit is None:
        return Device(first.kind, first.index + offset)
    carry, bit = divmod(first.bit + offset, WORD_BITS)
    return Device(first.kind, first.index + carry, bit)
