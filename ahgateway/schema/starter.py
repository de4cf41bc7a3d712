"""The profile that a person starts from: short, commented, and valid as it stands."""

from __future__ import annotations

from ahgateway.core.controllers import CONTROLLERS, Controller
from ahgateway.errors import ProfileError
from ahgateway.schema import layout
from ahgateway.schema.findings import near

_STATION = """\
# Profile for ahgateway: one PLC and the PID loops in it. `ahgateway profile check FILE` names everything that is wrong.

[station]
name = "Line 1"
target = "modbus+tcp://192.0.2.10:502"   # or modbus+rtu:///dev/ttyUSB0?baud=115200, modbus+ascii://COM3?baud=9600
unit = 1                                 # Modbus station number
device_map = "ah500"                     # where D, M, X… stand; a shipped name or the path of a file
# running = "SM400"                      # a bit that is on while the PLC is in RUN
# kind = "bench"                         # only when nothing but our own simulation hangs on this PLC

# [station.pacing]
# reply_timeout_ms = 1000
# words_per_request_max = 100
# pause_between_requests_ms = 0

[loops.TIC-101]                          # the loop's tag
instruction = "{instruction}"
{places}
units = {{ pv = "°C", mv = "%" }}
# ranges = {{ pv = [0.0, 200.0], mv = [0.0, 100.0] }}
# en = "M10"                             # the contact in front of the instruction, when there is one
scan_ms_max = 10                         # longest scan of the PLC program to expect
"""

_LAYOUT = """\
layout = "manual"                        # registers as in the manual's example: {first}…{last}, MV {mv}, flags from M1
# data = "D300"                          # the same layout from D300 on; MV stays 100 behind
# flags = "M21"                          # flags from M21 on

# [loops.TIC-101.operands]               # an entry here beats the layout
# SV = "D500"                            # 32-bit values: the lower of the two registers
# ERR_DBW = {{ const = 0.0 }}              # a literal in the PLC program
"""


def starter(instruction: str) -> str:
    """Return the text of a first profile with one loop of this instruction.

    Raises:
        ProfileError: No such instruction.
    """
    controller = CONTROLLERS.get(instruction.upper())
    if controller is None:
        raise ProfileError(
            f"`{instruction}` is no instruction we know, known are {', '.join(CONTROLLERS)}",
            hint=near(instruction, CONTROLLERS),
        )
    head, tail = _STATION.split("{places}\n")
    if controller.name in layout.INSTRUCTIONS:
        places, operands = _from_manual(controller).split("\n\n", 1)
        text = f"{head}{places}\n{tail}\n{operands}"
    else:
        text = f"{head}{tail}\n{_named(controller)}"
    return text.replace("{instruction}", controller.name).replace("{{", "{").replace("}}", "}")


def _from_manual(controller: Controller) -> str:
    places = layout.manual(controller)
    memory = controller.operand("I_MV")
    last = f"D{places['I_MV'].index + memory.words - 1}"
    return _LAYOUT.replace("{first}", str(places["SV"])).replace("{last}", last).replace("{mv}", str(places["MV"]))


def _named(controller: Controller) -> str:
    """Every operand one after the other, to be corrected by hand."""
    lines = ["[loops.TIC-101.operands]"]
    word, flag = layout.DATA.index, layout.FLAGS.index
    for row in controller.operands:
        device = f"D{word}" if row.words else f"M{flag}"
        entry = f'{row.name} = "{device}"'
        lines.append(f"{entry:<41}# {row.text}")
        word += row.words
        flag += 0 if row.words else 1
    return "\n".join(lines) + "\n"
