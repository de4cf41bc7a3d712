"""The snippets of `plc-code recorder` and `trigger`, run as they are printed, do what the fake's own items do."""

from __future__ import annotations

from typing import Any

import pytest

from ahgateway.clock import MILLISECOND
from ahgateway.codec import recorder_text
from ahgateway.codec.access import Table
from ahgateway.errors import StateError
from ahgateway.fake.plc import FakePlc
from ahgateway.fake.structured_text import program
from ahgateway.schema.profile import parse

PROFILE = """
[station]
name = "Line"
target = "memory://"
kind = "bench"

[loops.A]
instruction = "{law}"
layout = "manual"
{task}
[loops.A.{table}]
{keys}

[loops.A.fake]
plant = {{ kind = "fopdt", gain = 1.2, tau_s = 3.0, dead_time_s = 0.2, bias = 10.0, noise = 0.05, initial = 20.0 }}

[loops.A.fake.initial]
SV = 50.0
CYCLE = {cycle}
"""
RING = 'ring = "D2000"\nhead = "D1990"\nrecords = 8\neach = "{each}"'
TRIGGER = 'coil = "M60"\ncounter = "D890"'
MIRROR = 3000
"""The same words again, so many words on: there the printed text works, beside the fake's own item."""


def made(law: str, task: str, table: str, keys: str) -> FakePlc:
    cycle = 10 if law == "DPID" else 100
    loaded = parse(PROFILE.format(law=law, task=task, table=table, keys=keys, cycle=cycle), "line.toml")
    return FakePlc(loaded.station(), loaded.fake_setup(), seed=4)


def holding(plc: FakePlc, first: int, count: int) -> tuple[int, ...]:
    found: tuple[int, ...] = ()
    while count:
        part = min(count, 100)
        found += plc.memory.read(Table.HOLDING, first, part)
        first, count = first + part, count - part
    return found


@pytest.mark.parametrize("law", ["DPID", "DPIDE"])
@pytest.mark.parametrize("each", ["scan", "call", "change"])
def test_the_printed_recorder_fills_the_ring_as_the_fakes_own_does(law: str, each: str) -> None:
    plc = made(law, "interval_ms = 100" if each == "call" else "", "recorder", RING.format(each=each))
    loop = plc.station.loops[0]
    assert loop.recorder is not None
    text = recorder_text.recorder(plc.station, loop)
    for at in range(7):
        text = text.replace(f"D{1990 + at}", f"D{1990 + MIRROR + at}")
    words = plc.memory.words_at(plc.memory.devices.address(loop.recorder.ring), loop.recorder.words).copy()
    run = program(text.partition("(* 2.")[0], plc.memory, {"RING": words})
    tick = program("D4992 := D4992 + 1;", plc.memory)

    for scan in range(60):
        plc.scan(10 * MILLISECOND)
        if each != "call":
            tick()
            run()
        elif scan % 10 == 9:
            run()
        if scan == 30:
            plc.write("A", "SV", 55.0)
            plc.write("A", "PID_MAN", True)

    ring = list(holding(plc, 2000, loop.recorder.words))
    length = loop.recorder.length
    if each == "call":  # no time there: the number counts the periods
        ring[1::length] = [0] * 8
    assert ring == words.tolist()
    assert holding(plc, 1990, 1) == holding(plc, 1990 + MIRROR, 1)
    assert any(words.tolist())


@pytest.mark.parametrize("law", ["DPID", "DPIDE"])
@pytest.mark.parametrize("task", ["", "interval_ms = 100"])
def test_the_printed_trigger_lets_one_execution_through(law: str, task: str) -> None:
    plc = made(law, task, "trigger", TRIGGER)
    coil = plc.memory.bit_at(plc.memory.devices.address(plc.station.loops[0].trigger.coil, bits=True))  # type: ignore[union-attr]
    text = recorder_text.trigger(plc.station, plc.station.loops[0])
    printed = text.replace("M60", "M61")
    for at in range(20, -1, -1):
        printed = printed.replace(f"D{890 + at}", f"D{890 + MIRROR + at}")
    run = program(printed.partition("(* 2.")[0], plc.memory)
    tick = program(printed.partition("(* 2.")[2].partition("*)")[2], plc.memory)
    mirror = plc.memory.bit_at(plc.memory.devices.address(_device("M61"), bits=True))

    for _ in range(5):
        coil.put(True)
        mirror.put(True)
        for _ in range(30):
            was = coil.get()
            plc.scan(10 * MILLISECOND)
            tick()
            # In the interval task the text is called with the instruction.
            if not task or was != coil.get():
                run()
        assert (False, False) == (coil.get(), mirror.get())
    assert 5 == plc.executed("A")
    assert (5,) == holding(plc, 890, 1) == holding(plc, 890 + MIRROR, 1)


def test_the_ring_of_another_program_is_not_written_by_us() -> None:
    fields = (
        'ring = "D2000"\nhead = "D1990"\nlength = 12\nsequence_end = 11\n'
        'unrecorded = ["SV", "PID_MODE", "CYCLE", "Kp", "Ki", "Kd", "ERR_DBW", "MV_MAX", "MV_MIN",'
        ' "PID_RUN", "PID_MAN", "MOUT_AUTO", "PID_DIR"]\n'
        'fields = { PV = 1, MOUT = 3, I_MV = 5, "I_MV+1" = 7, MV = 9 }'
    )
    plc = made("DPID", "", "recorder", fields)
    with pytest.raises(StateError, match="fields of its own"):
        recorder_text.recorder(plc.station, plc.station.loops[0])


def _device(text: str) -> Any:
    from ahgateway.codec.devices import parse_device

    return parse_device(text)
