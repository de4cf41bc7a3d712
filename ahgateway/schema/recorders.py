"""The recorder, the trigger and the interval task of a loop: which ring in D holds what, and whether that can be.

A table without `fields` has the layout of our own snippet, made from the loop's operands. Whatever can change must
stand in a record or be named in `unrecorded`: what nobody reads cannot be judged, and the profile says so.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

from ahgateway.codec import block
from ahgateway.codec.access import Span, Table
from ahgateway.codec.devices import WORD_BITS, Device, DeviceMap
from ahgateway.codec.record_layout import SNIPPET_WORDS, recordable, standard, trigger_words
from ahgateway.codec.station import Const, Loop, Station
from ahgateway.codec.ways import Each, Place, Recorder, Trigger, Way
from ahgateway.core.operands import Kind
from ahgateway.errors import CodecError
from ahgateway.schema.binding import bit_device, parsed
from ahgateway.schema.findings import Findings, near, shown
from ahgateway.schema.forms import LoopForm, ProfileForm, RecorderForm

UNITS_NS = {"1 us": 1000, "0.1 ms": 100_000, "1 ms": 1_000_000, "10 ms": 10_000_000, "100 ms": 100_000_000}
"""Units in which a program may count its time."""


@dataclass(frozen=True, slots=True)
class _Words:
    """Words that something takes, for finding out who else is there."""

    what: str
    key: str
    span: Span


def with_recorders(station: Station, form: ProfileForm, findings: Findings) -> Station:
    """Return the station with what its loops' tables say of tasks, recorders and triggers; mistakes go to findings."""
    loops = tuple(_with_ways(loop, form.loops[loop.name], station, findings) for loop in station.loops)
    made = replace(station, loops=loops)
    if not findings:
        _check_overlaps(made, findings)
    return made


def _with_ways(loop: Loop, form: LoopForm, station: Station, findings: Findings) -> Loop:
    top = f"loops.{loop.name}"
    loop = replace(loop, pv_rate_max=form.pv_rate_max, interval_ms=_interval(loop, form, findings))
    if form.trigger is not None:
        loop = _with_trigger(loop, form, station, findings)
    if form.recorder is not None:
        recorder = _recorder(loop, form.recorder, station, findings)
        loop = replace(loop, recorder=recorder, way=Way.RECORDED if recorder is not None else loop.way)
    if form.follow == "recorded" and form.recorder is None:
        findings.add(f"{top}.follow", "is recorded, and the loop has no recorder", f"add the table [{top}.recorder]")
    return replace(loop, way=Way.POLLED) if form.follow == "polled" else loop


def _interval(loop: Loop, form: LoopForm, findings: Findings) -> int | None:
    if form.interval_ms is None:
        return None
    key = f"loops.{loop.name}.interval_ms"
    if loop.controller.law_ts is None:
        findings.add(key, f"{loop.controller.name} takes its sampling time from no task, DPID and DPIDE do")
        return None
    row = loop.controller.operand("CYCLE")
    unit_ms = round(float(loop.controller.nominal_ts(loop.controller.inputs()._replace(cycle=1))) * 1000)
    if form.interval_ms % unit_ms or row.maximum is None or form.interval_ms > row.maximum * unit_ms:
        findings.add(
            key, f"is {form.interval_ms}, allowed are multiples of {unit_ms} up to {row.maximum or 0:g} × that"
        )
        return None
    return form.interval_ms


def _with_trigger(loop: Loop, form: LoopForm, station: Station, findings: Findings) -> Loop:
    assert form.trigger is not None
    top = f"loops.{loop.name}.trigger"
    if not station.bench:
        findings.add(top, f'executions are triggered only on a station of kind = "bench", {station.name} is a plant')
    coil = bit_device(form.trigger.coil, "the trigger", f"{top}.coil", station.devices, findings)
    counter = _word(form.trigger.counter, f"{top}.counter", station.devices, findings)
    if coil is None or counter is None:
        return loop
    if station.devices.address(coil, bits=True).table is not Table.COIL:
        findings.add(f"{top}.coil", f"`{coil}` is no coil that can be set by itself", "a coil is `M50`")
    if loop.en is not None and loop.en != coil:
        findings.add(
            f"loops.{loop.name}.en", f"is `{loop.en}`, but the trigger `{coil}` is the contact EN", "leave it out"
        )
    return replace(loop, trigger=Trigger(coil, counter), en=coil)


def _recorder(loop: Loop, form: RecorderForm, station: Station, findings: Findings) -> Recorder | None:
    top = f"loops.{loop.name}.recorder"
    before = len(list(findings))
    ring = _word(form.ring, f"{top}.ring", station.devices, findings)
    head = _word(form.head, f"{top}.head", station.devices, findings)
    unrecorded = _unrecorded(loop, form, findings)
    each = Each(form.each)
    if each is Each.CALL and loop.interval_ms is None:
        findings.add(
            f"{top}.each", "is call, and nobody said in which interval task", f"add interval_ms to [loops.{loop.name}]"
        )
    if not station.is_snapshot:
        findings.add(top, "a ring cannot be read over CANopen, where each object is read at its own time")
    if ring is None or head is None:
        return None
    if form.fields is None:
        for name in sorted(form.model_fields_set - {"ring", "head", "records", "each", "unrecorded"}):
            findings.add(
                f"{top}.{name}",
                "belongs to a layout of one's own, and this table has no fields",
                "add fields, or leave it out",
            )
        made: Recorder | None = standard(loop, ring, head, form.records, each, unrecorded)
    else:
        made = _own(loop, form, ring, head, each, unrecorded, findings)
    if made is not None and len(list(findings)) == before:
        _check_layout(loop, made, station, top, findings)
    return made if len(list(findings)) == before else None


def _own(
    loop: Loop,
    form: RecorderForm,
    ring: Device,
    head: Device,
    each: Each,
    unrecorded: frozenset[str],
    findings: Findings,
) -> Recorder | None:
    top = f"loops.{loop.name}.recorder"
    assert form.fields is not None
    if form.length is None:
        findings.add(f"{top}.length", "is missing, a layout of one's own needs the words of a record")
        return None
    fields = {}
    for name, where in form.fields.items():
        place = _place(loop, name, where, f"{top}.fields.{name}", findings)
        if place is not None:
            fields[name] = place
    first = None if form.first is None else _bit_place(form.first, f"{top}.first", findings)
    return Recorder(
        ring, form.records, form.length, head, fields, form.sequence, form.sequence_words, form.sequence_range,
        form.sequence_end, form.time, form.time_words, form.time_range, UNITS_NS[form.time_unit], first, each,
        form.head_is == "last", unrecorded,
    )  # fmt: skip


def _place(loop: Loop, name: str, where: int | str, key: str, findings: Findings) -> Place | None:
    """Where one field stands; a bit is written `3.0`, words are a whole number."""
    known = recordable(loop)
    if name not in known:
        try:
            block.field_words(loop, name)
            why = f"{name} is a constant of the program and stands in no record"
        except CodecError as error:
            why = error.message
        findings.add(key, why, near(name, known))
        return None
    is_bit = block.field_words(loop, name) == 0
    if isinstance(where, str):
        if not is_bit:
            findings.add(key, f"{shown(where)} is a bit, and {name} takes words", "a whole number, `12`")
            return None
        return _bit_place(where, key, findings)
    return Place(where)


def _bit_place(text: str, key: str, findings: Findings) -> Place | None:
    offset, dot, bit = text.partition(".")
    if not (dot and offset.isdecimal() and bit.isdecimal() and int(bit) < WORD_BITS):
        findings.add(key, f"{shown(text)} is no bit of a record", 'word and bit, "3.0"')
        return None
    return Place(int(offset), int(bit))


def _unrecorded(loop: Loop, form: RecorderForm, findings: Findings) -> frozenset[str]:
    key = f"loops.{loop.name}.recorder.unrecorded"
    known, found = recordable(loop), set()
    written = {seen.name for seen in loop.controller.seen}
    for name in form.unrecorded:
        if name not in known:
            findings.add(
                key, f"{loop.controller.name} has no operand {name} that a record could hold", near(name, known)
            )
        elif name in written or name in loop.controller.roles.pvs:
            findings.add(key, f"{name} changes with every execution: a record without it shows none")
        else:
            found.add(name)
    return frozenset(found)


def _check_layout(loop: Loop, made: Recorder, station: Station, top: str, findings: Findings) -> None:
    """Everything must fit into a record, stand in it once, and be there; a record must fit into a request."""
    most = station.pacing.words_per_request_max
    if made.length > most:
        findings.add(
            f"{top}.length", f"is {made.length} words, but a request may hold {most}, and a record is read whole"
        )
    taken: dict[tuple[int, int | None], str] = {}
    for name, offset, bit in _cells(loop, made):
        key = f"{top}.fields.{name}" if name in made.fields else f"{top}.{name}"
        if offset >= made.length:
            findings.add(key, f"ends at word {offset}, but a record has {made.length}, 0…{made.length - 1}")
            return
        for other, who in taken.items():
            if who != name and other[0] == offset and (bit is None or other[1] is None or other[1] == bit):
                findings.add(key, f"word {offset} of the record holds {who} already")
                return
        taken[offset, bit] = name
    missing = [
        name for name in recordable(loop) if name not in made.fields and name not in made.unrecorded and name != "EN"
    ]
    if missing:
        hint = "give each a place, or name in unrecorded what nobody writes while the loop runs"
        findings.add(f"{top}.fields", f"lacks {', '.join(missing)}: nobody could tell when they change", hint)


def _cells(loop: Loop, made: Recorder) -> Iterator[tuple[str, int, int | None]]:
    """Every word or bit of a record that something stands in: its name, offset, and bit where it is one."""
    numbers = [
        ("sequence", made.sequence, made.sequence_words),
        ("sequence_end", made.sequence_end, made.sequence_words),
    ]
    numbers.append(("time", made.time, made.time_words))
    for name, offset, words in numbers:
        if offset is not None:
            yield from ((name, offset + word, None) for word in range(words))
    if made.first is not None:
        yield "first", made.first.offset, made.first.bit
    for name, place in made.fields.items():
        words = max(1, block.field_words(loop, name))
        yield from ((name, place.offset + word, place.bit) for word in range(words))


def _word(text: str, key: str, devices: DeviceMap, findings: Findings) -> Device | None:
    """A word that the program can write, or None and a finding."""
    device = parsed(text, key, findings)
    if device is None:
        return None
    try:
        place = devices.address(device)
    except CodecError as error:
        findings.add(key, error.message, error.hint)
        return None
    if place.table is not Table.HOLDING or place.bit is not None:
        findings.add(key, f"`{device}` is no word that a program can write", "a word device is `D2000`")
        return None
    return device


def _check_overlaps(station: Station, findings: Findings) -> None:
    """A ring, its head, a count and a coil belong to one loop alone, and to nothing else."""
    others = list(_operand_words(station))
    for loop in station.loops:
        for each in _own_words(loop, station):
            if not station.devices.covers(each.span):
                last = each.span.count - 1
                findings.add(each.key, f"{each.what} of loop {loop.name} takes {each.span.count} words and goes "
                             f"{last} words on, outside the device map `{station.devices.name}`")  # fmt: skip
                continue
            for other in others:
                if (
                    other.span.table is each.span.table
                    and other.span.address < each.span.end
                    and each.span.address < other.span.end
                ):
                    findings.add(each.key, f"{each.what} of loop {loop.name} overlaps {other.what}", "move one of them")
                    break
            others.append(replace(each, what=f"{each.what} of loop {loop.name}"))


def _own_words(loop: Loop, station: Station) -> Iterator[_Words]:
    top = f"loops.{loop.name}"
    if loop.recorder is not None:
        ring, head = station.devices.address(loop.recorder.ring), station.devices.address(loop.recorder.head)
        yield _Words("the ring", f"{top}.recorder.ring", Span(ring.table, ring.address, loop.recorder.words))
        own = SNIPPET_WORDS if is_standard(loop) else 1
        yield _Words("the head", f"{top}.recorder.head", Span(head.table, head.address, own))
    if loop.trigger is not None:
        count = station.devices.address(loop.trigger.counter)
        yield _Words(
            "the trigger's counter", f"{top}.trigger.counter", Span(count.table, count.address, trigger_words(loop))
        )
        coil = station.devices.address(loop.trigger.coil, bits=True)
        yield _Words("the trigger", f"{top}.trigger.coil", Span(coil.table, coil.address, 1))


def _operand_words(station: Station) -> Iterator[_Words]:
    for loop in station.loops:
        for row in loop.controller.operands:
            binding = loop.bindings[row.name]
            if not isinstance(binding, Const):
                place = station.devices.address(binding, bits=row.kind is Kind.BOOL)
                yield _Words(f"{row.name} of loop {loop.name}", "", Span(place.table, place.address, max(1, row.words)))


def is_standard(loop: Loop) -> bool:
    """Tell whether the loop's ring has the layout of our own snippet."""
    made = loop.recorder
    return made is not None and made == standard(loop, made.ring, made.head, made.records, made.each, made.unrecorded)
