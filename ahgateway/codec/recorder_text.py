"""The recorder and the trigger as Structured Text for ISPSoft: what the PLC does behind an instruction. No I/O.

Beside word devices, flags, assignments, comparisons, and counting up to a fixed number, the recorder needs one array
of words for its ring and the trigger nothing. Every value is moved word by word, so that bits stay bits.
"""

from __future__ import annotations

from ahgateway import __version__
from ahgateway.codec import block
from ahgateway.codec.devices import Device
from ahgateway.codec.record_layout import FLAGS, RANGE, SNIPPET_WORDS, TIME_UNIT_NS, standard, watched_words
from ahgateway.codec.station import Loop, Station
from ahgateway.codec.ways import Each, Recorder
from ahgateway.core.operands import Kind
from ahgateway.errors import StateError

FIRST_SCAN = "SM402"
TIME_MS = TIME_UNIT_NS // 1_000_000


def recorder(station: Station, loop: Loop) -> str:
    """Return the recorder of one loop, with a header that documents every word of a record.

    Raises:
        StateError: The loop's ring is somebody else's.
    """
    made = loop.recorder
    assert made is not None
    if made != standard(loop, made.ring, made.head, made.records, made.each, made.unrecorded):
        raise StateError(
            f"loop {loop.name}: its ring is described with fields of its own, and whoever fills it has the program",
            hint=f"leave fields out of [loops.{loop.name}.recorder], and the snippet is ours",
        )
    return "\n".join([*_recorder_header(station, loop, made), "", *_recorder_body(loop, made), ""])


def trigger(station: Station, loop: Loop) -> str:
    """Return the trigger of one loop."""
    assert loop.trigger is not None
    return "\n".join([*_trigger_header(station, loop), "", *_trigger_body(loop), ""])


def _recorder_header(station: Station, loop: Loop, made: Recorder) -> list[str]:
    lines = [
        f"Recorder of loop {loop.name} of station {station.name}, made by ahgateway {__version__}.",
        "It was never compiled by Delta's tool: read it, and try it on a bench before a plant depends on it.",
        "",
        _where(loop, made),
        f"Declare RING as ARRAY [0..{made.words - 1}] OF WORD at {made.ring}. Nothing else may use {made.ring} to",
        f"{_plus(made.ring, made.words - 1)} and {made.head} to {_plus(made.head, SNIPPET_WORDS - 1)}.",
        f"{FIRST_SCAN} is on in the first scan behind STOP: that is remembered and in no manual we have; look at it.",
        "",
        f"{made.head!s:8} slot that is written next, 0 to {made.records - 1}",
        f"{_plus(made.head, 1)!s:8} number of the last record, 0 to {RANGE - 1}",
        f"{_plus(made.head, 2)!s:8} time in {TIME_MS} ms, 0 to {RANGE - 1}",
        f"{_plus(made.head, 3)!s:8} to {_plus(made.head, SNIPPET_WORDS - 1)}: for the snippet alone",
        "",
        f"A record has {made.length} words, there are {made.records}. Of two words the low one stands first.",
        "",
        "word  meaning",
        *_meanings(loop, made),
    ]
    if made.unrecorded:
        lines += ["", f"No record holds {', '.join(sorted(made.unrecorded))}."]
    return ["(*", *(f"  {line}".rstrip() for line in lines), "*)"]


def _where(loop: Loop, made: Recorder) -> str:
    if made.each is Each.CALL:
        return (
            f"Put it directly behind the instruction, in the interval task of {loop.interval_ms} ms, and nowhere else."
        )
    return f"Put it directly behind the instruction. The time at the end belongs into an interval task of {TIME_MS} ms."


def _meanings(loop: Loop, made: Recorder) -> list[str]:
    found = [(made.sequence, "number"), (made.time or 0, "time")]
    assert made.first is not None
    found.append((made.first.offset, f"bit {made.first.bit}: first record behind STOP"))
    for name, place in made.fields.items():
        words = block.field_words(loop, name)
        text = f"bit {place.bit}: {name}" if not words else f"{name}, {words} word{'s' if words > 1 else ''}"
        found.append((place.offset, f"{text} ({_source(loop, name, 0)})"))
    found.append((made.sequence_end or 0, "number again"))
    return [f"{offset:4}  {text}" for offset, text in sorted(found, key=lambda each: each[0])]


def _recorder_body(loop: Loop, made: Recorder) -> list[str]:
    head, number, time, base, last, flags_word, same = (_plus(made.head, at) for at in range(SNIPPET_WORDS))
    words = [
        (place.offset + word, _source(loop, name, word))
        for name, place in made.fields.items()
        for word in range(block.field_words(loop, name))
    ]
    flags = _flags(loop, made)
    store = [
        f"IF {number} < {RANGE - 1} THEN {number} := {number} + 1; ELSE {number} := 0; END_IF;",
        f"RING[{base} + {made.sequence}] := {number};",
        f"RING[{base} + {made.time}] := {time};",
        *(
            line
            for offset, lines in flags.items()
            for line in (*lines, *_first(made, offset, flags_word), f"RING[{base} + {offset}] := {flags_word};")
        ),
        *(f"RING[{base} + {offset}] := {source};" for offset, source in words),
        f"RING[{base} + {made.sequence_end}] := {number};",
        f"{last} := {base};",
        f"IF {head} < {made.records - 1} THEN {head} := {head} + 1; {base} := {base} + {made.length};",
        f"ELSE {head} := 0; {base} := 0; END_IF;",
    ]
    body = ["(* 1. The record. *)"]
    if made.each is Each.CHANGE:
        body += [f"{same} := 1;"]
        for offset, lines in flags.items():
            body += [*lines, f"IF RING[{last} + {offset}] <> {flags_word} THEN {same} := 0; END_IF;"]
        body += [f"IF RING[{last} + {offset}] <> {source} THEN {same} := 0; END_IF;" for offset, source in words]
        body += [f"IF ({same} = 0) OR {FIRST_SCAN} THEN"]
        body += [*(f"  {line}" for line in store), "END_IF;"]
    else:
        body += store
    if made.each is Each.CALL:
        return body
    return [
        *body,
        "",
        f"(* 2. The time: this line alone, in an interval task of {TIME_MS} ms. *)",
        f"IF {time} < {RANGE - 1} THEN {time} := {time} + 1; ELSE {time} := 0; END_IF;",
    ]


def _flags(loop: Loop, made: Recorder) -> dict[int, list[str]]:
    """For every word of flags, the lines that gather it."""
    assert made.first is not None
    word = _plus(made.head, 5)
    found: dict[int, list[str]] = {offset: [f"{word} := 0;"] for offset in range(FLAGS, made.first.offset + 1)}
    for name, place in made.fields.items():
        if place.bit is not None:
            found[place.offset].append(f"IF {_source(loop, name, 0)} THEN {word} := {word} + {1 << place.bit}; END_IF;")
    return found


def _first(made: Recorder, offset: int, word: Device) -> list[str]:
    assert made.first is not None
    if made.first.offset != offset:
        return []
    return [f"IF {FIRST_SCAN} THEN {word} := {word} + {1 << (made.first.bit or 0)}; END_IF;"]


def _source(loop: Loop, name: str, word: int) -> str:
    """The device that holds one word of a recorded field, or its bit."""
    if name == block.EN and loop.en is not None:
        return str(loop.en)
    seen = {each.name: each for each in loop.controller.seen}
    operand, first = (seen[name].operand, 2 * seen[name].dword) if name in seen else (name, 0)
    device = loop.bindings[operand]
    assert isinstance(device, Device)
    if loop.controller.operand(operand).kind is Kind.BOOL:
        return str(device)
    return str(_plus(device, first + word))


def _plus(device: Device, words: int) -> Device:
    return Device(device.kind, device.index + words)


def _trigger_header(station: Station, loop: Loop) -> list[str]:
    assert loop.trigger is not None
    spec, words = loop.trigger, watched_words(loop)
    lines = [
        f"Trigger of loop {loop.name} of station {station.name}, made by ahgateway {__version__}.",
        "It was never compiled by Delta's tool. It belongs on a bench: without the gateway the loop stands still.",
        "",
        f"The contact EN of the instruction is {spec.coil}. Put this directly behind the instruction.",
        f"{spec.coil!s:8} set by the gateway, cleared here behind the execution",
        f"{spec.counter!s:8} executions let through, 0 to {RANGE - 1}",
    ]
    if loop.interval_ms is not None:
        lines.append(f"Both stand in the interval task of {loop.interval_ms} ms: one call is one execution.")
    else:
        lines += [
            f"{_plus(spec.counter, 1)!s:8} time since the contact closed, as CYCLE counts it",
            f"{_plus(spec.counter, 2)!s:8} 1 while nothing changed",
            f"{_plus(spec.counter, 3)!s:8} to {_plus(spec.counter, 2 + len(words))}: what the instruction left last",
            "The contact opens behind the scan that changed one of those words, or when CYCLE is over.",
        ]
    return ["(*", *(f"  {line}".rstrip() for line in lines), "*)"]


def _trigger_body(loop: Loop) -> list[str]:
    assert loop.trigger is not None
    coil, count = loop.trigger.coil, loop.trigger.counter
    counted = f"IF {count} < {RANGE - 1} THEN {count} := {count} + 1; ELSE {count} := 0; END_IF;"
    if loop.interval_ms is not None:
        return [f"IF {coil} THEN", f"  {counted}", f"  {coil} := FALSE;", "END_IF;"]
    time, same = _plus(count, 1), _plus(count, 2)
    words = [_source(loop, *word) for word in watched_words(loop)]
    copies = [_plus(count, 3 + at) for at in range(len(words))]
    cycle = loop.bindings["CYCLE"]
    limit = str(cycle) if isinstance(cycle, Device) else str(cycle.value)
    unit_ms = round(float(loop.controller.nominal_ts(loop.controller.inputs()._replace(cycle=1))) * 1000)
    changed = [f"  IF {copy} <> {word} THEN {same} := 0; END_IF;" for copy, word in zip(copies, words, strict=True)]
    return [
        "(* 1. Behind the instruction. *)",
        f"IF {coil} THEN",
        f"  {same} := 1;",
        *changed,
        f"  IF ({same} = 0) OR ({time} > {limit}) THEN",
        f"    {counted}",
        f"    {coil} := FALSE;",
        "  END_IF;",
        "ELSE",
        f"  {time} := 0;",
        "END_IF;",
        *(f"{copy} := {word};" for copy, word in zip(copies, words, strict=True)),
        "",
        f"(* 2. The time: this line alone, in an interval task of {TIME_MS} ms. *)",
        f"IF {coil} THEN IF {time} < {RANGE - 1} THEN {time} := {time} + {TIME_MS // unit_ms}; END_IF; END_IF;",
    ]
