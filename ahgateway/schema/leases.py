"""The lease of a loop: where the PLC keeps it, and that nothing else stands there."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from ahgateway.codec import block, lease
from ahgateway.codec.access import Span, Table
from ahgateway.codec.station import LeaseSpec, Loop, Station
from ahgateway.errors import CodecError
from ahgateway.schema.binding import parsed
from ahgateway.schema.findings import Findings
from ahgateway.schema.forms import LeaseForm, ProfileForm


def with_leases(station: Station, form: ProfileForm, findings: Findings) -> Station:
    """Return the station with the lease of every loop that names one; what is wrong goes to `findings`."""
    loops = tuple(
        loop if (wanted := form.loops[loop.name].lease) is None else _with_lease(loop, wanted, station, findings)
        for loop in station.loops
    )
    leased = replace(station, loops=loops)
    _check_apart(leased, findings)
    return leased


def _with_lease(loop: Loop, form: LeaseForm, station: Station, findings: Findings) -> Loop:
    key = f"loops.{loop.name}.lease"
    device = parsed(form.data, f"{key}.data", findings)
    if device is None:
        return loop
    if not loop.writes:
        findings.add(key, "a lease guards what may be written, and nothing may", f"add [loops.{loop.name}.write]")
    if form.timeout_ms < 2 * form.task_ms:
        findings.add(
            f"{key}.timeout_ms", f"is {form.timeout_ms}, allowed from two calls of the task on: {2 * form.task_ms}"
        )
    leased = replace(loop, lease=LeaseSpec(device, form.timeout_ms, form.task_ms))
    words = lease.layout(leased)
    try:
        first, last = (station.devices.address(words.device(at)) for at in (0, words.length - 1))
    except CodecError as error:
        findings.add(f"{key}.data", f"the block takes {words.length} words: {error.message}", error.hint)
        return loop
    is_word = first.table is Table.HOLDING and first.bit is None
    if not is_word or last.address - first.address != words.length - 1:
        findings.add(
            f"{key}.data", f"the block takes {words.length} words in a row from `{device}`, which are not there",
            "a word device is `D900`",
        )  # fmt: skip
        return loop
    return leased


def lease_span(loop: Loop, station: Station) -> Span:
    """Return where the lease of a loop stands."""
    words = lease.layout(loop)
    place = station.devices.address(words.device(0))
    return Span(place.table, place.address, words.length)


def _check_apart(station: Station, findings: Findings) -> None:
    """No word of a lease is an operand, a counter, the scratch words or another lease."""
    used = list(_uses(station))
    for loop in station.loops:
        if loop.lease is None:
            continue
        span = lease_span(loop, station)
        own = f"the lease of loop {loop.name}"
        for what, other in used:
            if what != own and other.table is span.table and other.address < span.end and span.address < other.end:
                findings.add(
                    f"loops.{loop.name}.lease.data",
                    f"takes {span.count} words, {loop.lease.data}…{lease.layout(loop).device(span.count - 1)}, "
                    f"and there stands {what}",
                )
                break


def _uses(station: Station) -> Iterator[tuple[str, Span]]:
    for loop in station.loops:
        for name, span in block.spans(loop, station.devices).items():
            yield f"{name} of loop {loop.name}", span
        if loop.lease is not None:
            yield f"the lease of loop {loop.name}", lease_span(loop, station)
    if station.scratch is not None:
        place = station.devices.address(station.scratch)
        yield "the station's scratch", Span(place.table, place.address, 2)
