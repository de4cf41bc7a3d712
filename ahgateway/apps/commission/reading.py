"""Steps 3 and 4: what the operands say, what moved, and whether it is the manual's controller. Pure."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from ahgateway.apps.commission.checks import Check, failed, judged, passed, skipped, unclear
from ahgateway.apps.commission.observe import Observation
from ahgateway.clock import MILLISECOND, SECOND
from ahgateway.codec import block
from ahgateway.codec.station import Loop, Station
from ahgateway.core.operands import Kind
from ahgateway.core.real import bits
from ahgateway.core.verdict import Exit, outcome, reason
from ahgateway.lockstep.follow import cycle_ns, output_of, process_value_of, target_of
from ahgateway.lockstep.gate.change import shown
from ahgateway.lockstep.picture import Picture
from ahgateway.lockstep.restarts import began_anew
from ahgateway.recording.station_text import dialect_json

NOISE_MAX = 0.01
"""Standard deviation of PV's noise, as a share of its range."""
QUANTUM_MAX = 0.002
"""Smallest step of PV, as a share of its range."""
MOVED = 0.005
"""MV has moved when it covered this share of its range."""
PICTURES_MIN = 12
WRAPS_FROM = 65_000
"""From here on a count that falls has gone round, not begun anew."""
ANEW_MAX = 2
"""More divergences than these are another law, not a restart."""
LOST_MIN = 4
"""So many operands that become 0 at once are a restart, not a person."""


def read_loop(station: Station, loop: Loop, seen: Observation) -> list[Check]:
    """Return the checks of step 3."""
    if not seen.pictures:
        why = seen.refused or (seen.outages[0] if seen.outages else "no picture of the loop was taken")
        return [unclear("plc-stopped", why)]
    last = seen.pictures[-1]
    return [
        _in_run(seen),
        _numbers(loop, last),
        _limits(loop, last),
        _negative(loop, last),
        _documented(loop, last),
        _cycle(loop, last),
        *_signal(loop, seen),
        _direction(loop, last),
        _overlap(station, loop),
        _memory(loop, seen),
        _writers(loop, seen),
        _service(loop, last),
        _process_range(loop, last),
    ]


def judge_shadow(loop: Loop, seen: Observation, coverage_min: float) -> list[Check]:
    """Return the checks of step 4."""
    counts = seen.counts
    facts = {
        "proven": counts.proven, "informative": counts.informative, "diverged": counts.diverged,
        "unobservable": counts.unobservable, "link": counts.link, "total": counts.total,
        "coverage": round(counts.coverage, 4),
    }  # fmt: skip
    text = f"{reason(counts, coverage_min)}; dialect: {dialect_text(loop)}"
    checks: list[Check] = []
    if counts.diverged:
        suspect = seen.suspects[0] if seen.suspects else None
        cause = f"; likely {suspect.cause}: {suspect.evidence}" if suspect else ""
        checks.append(failed("diverged", text + cause, **facts))
    elif counts.compared:
        checks.append(passed("diverged", text, **facts))
    else:
        checks.append(skipped("diverged", "nothing was compared"))
    claim = outcome(counts, coverage_min)
    if claim is Exit.INCONCLUSIVE:
        checks.append(unclear("not-enough-seen", text, **facts))
    else:
        checks.append(passed("not-enough-seen", f"{counts.compared} executions compared", **facts))
    checks.append(
        failed("link-lost", f"{len(seen.outages)} times, first: {seen.outages[0]}")
        if seen.outages
        else passed("link-lost", "it stayed up")
    )
    checks.append(_restarted(loop, seen))
    return checks


def dialect_text(loop: Loop) -> str:
    """Name the dialect by which the reference computes: what the profile chose, for people."""
    named, default = (dialect_json(loop.controller, each) for each in (loop.dialect, loop.controller.dialect))
    chosen = [f"{axis} = {value}" for axis, value in named.items() if value != default[axis]]
    return ", ".join(chosen) or "the default"


def _restarted(loop: Loop, seen: Observation) -> Check:
    """A restart, as far as it leaves a trace: lost registers, STOP, a count or an instruction that began anew."""
    for before, after in pairwise(seen.pictures):
        lost = [name for name, words in before.words.items() if any(words) and not any(after.words[name])]
        if len(lost) >= LOST_MIN:
            return failed("restarted", f"the registers were lost meanwhile: {', '.join(lost)} read 0 all at once")
        if before.count is not None and after.count is not None and after.count < before.count <= WRAPS_FROM:
            text = f"the program counted {before.count} executions and then {after.count}"
            return failed("restarted", f"{text}: it restarted and kept its registers")
    stops = seen.found("plc-stopped")
    if stops is not None and seen.pictures and seen.pictures[0].running:
        return failed("restarted", "the PLC went to STOP meanwhile")
    anew = [after for before, after in seen.diverged if began_anew(loop, before, after)]
    if anew and len(seen.diverged) <= ANEW_MAX:
        at_s = (anew[0].last_ns - seen.pictures[0].last_ns) / SECOND
        text = f"the execution {at_s:.1f} s after the first picture comes out by bits if the instruction began anew"
        return failed("restarted", f"{text}: a restart that kept its registers, or EN was off meanwhile")
    return passed(
        "restarted", "no sign of one; one that keeps its registers shows only where the instruction began anew"
    )


def _in_run(seen: Observation) -> Check:
    last = seen.pictures[-1]
    if last.running is False:
        return failed("plc-stopped", "the PLC is in STOP")
    if last.enabled is False:
        return failed("plc-stopped", "the EN contact is off")
    if last.running is None:
        return unclear("plc-stopped", "the profile names no `running` bit, so that RUN was not read")
    return passed("plc-stopped", "the PLC is in RUN" + ("" if last.enabled is None else ", EN is on"))


def _numbers(loop: Loop, last: Picture) -> Check:
    wrong = [
        f"{row.name} is {float(value):g}"
        for row in loop.controller.operands
        if row.kind is Kind.REAL and not math.isfinite(value := _value(last, row.name))
    ]
    return judged("not-a-number", not wrong, ", ".join(wrong) or "every REAL is a finite number")


def _value(picture: Picture, operand: str) -> Any:
    attr = operand.lower()
    return getattr(picture.inputs, attr) if hasattr(picture.inputs, attr) else picture.seen[operand]


def _limits(loop: Loop, last: Picture) -> Check:
    limits = loop.controller.limits(last.inputs)
    if limits is None:
        return skipped("limits-exchanged", "no limits are in force")
    (low_name, low), (high_name, high) = limits
    text = f"{low_name} is {shown(low)}, {high_name} is {shown(high)}"
    return judged("limits-exchanged", bool(low < high), text if low != high else f"{text}: the output cannot move")


def _negative(loop: Loop, last: Picture) -> Check:
    names = [name for name in loop.controller.roles.gains if hasattr(last.inputs, name.lower())]
    wrong = [f"{name} is {shown(_value(last, name))}" for name in names if _value(last, name) < 0]
    return judged("negative-gain", not wrong, ", ".join(wrong) or f"{', '.join(names)} are 0 or above")


def _documented(loop: Loop, last: Picture) -> Check:
    wrong = []
    for row in loop.controller.operands:
        if row.kind not in (Kind.DINT, Kind.INT):
            continue
        value = _value(last, row.name)
        if (row.minimum is not None and value < row.minimum) or (row.maximum is not None and value > row.maximum):
            wrong.append(f"{row.name} is {value}, allowed {row.minimum:g}…{row.maximum:g}")
    return judged("out-of-range", not wrong, ", ".join(wrong) or "within the manual's ranges")


def _cycle(loop: Loop, last: Picture) -> Check:
    interval_ns = cycle_ns(loop, last)
    text = f"CYCLE is {interval_ns / MILLISECOND:g} ms, a scan takes up to {loop.scan_ms_max} ms by the profile"
    return judged("cycle-below-scan", interval_ns >= loop.scan_ms_max * MILLISECOND, text)


def _signal(loop: Loop, seen: Observation) -> list[Check]:
    """PV against its range: stuck, noisy, in steps; and the dead band against those steps."""
    values = [float(process_value_of(loop, each)) for each in seen.pictures]
    names = ("pv-stuck", "pv-noisy", "pv-quantised", "dead-band")
    if len(values) < PICTURES_MIN or not all(math.isfinite(value) for value in values):
        return [skipped(name, f"{len(values)} pictures with a number for PV are too few") for name in names]
    moves = [right - left for left, right in pairwise(values) if right != left]
    span = _span(loop, seen.pictures)
    checks = [_stuck(loop, seen, len(moves))]
    if not moves:
        return [*checks, *(skipped(name, "PV did not move") for name in names[1:3]), _dead_band(loop, seen, 0.0)]
    noise = _noise(values)
    checks.append(
        judged("pv-noisy", noise <= NOISE_MAX * span, f"noise {noise:.3g}, range {span:g}", noise=noise, range=span)
    )
    quantum = _quantum(moves)
    text = f"PV moves in steps of {quantum:.3g}, range {span:g}" if quantum else "no steps to be seen in PV"
    checks.append(judged("pv-quantised", quantum <= QUANTUM_MAX * span, text, quantum=quantum, range=span))
    return [*checks, _dead_band(loop, seen, quantum)]


def _span(loop: Loop, pictures: Sequence[Picture]) -> float:
    if loop.pv_range is not None:
        return loop.pv_range[1] - loop.pv_range[0]
    last = pictures[-1]
    return max(abs(float(target_of(loop, last))), abs(float(process_value_of(loop, last))), 1.0)


def _stuck(loop: Loop, seen: Observation, moves: int) -> Check:
    outputs = [float(output_of(loop, each)) for each in seen.pictures]
    low, high = loop.mv_range or (0.0, 100.0)
    travel = max(outputs) - min(outputs)
    if moves:
        return passed("pv-stuck", f"PV changed {moves} times", changes=moves)
    if travel > MOVED * (high - low):
        return failed("pv-stuck", f"PV holds the same bits while MV moved by {travel:.3g}", mv_travel=travel)
    return unclear("pv-stuck", "neither PV nor MV moved: a still process and a dead sensor look the same")


def _noise(values: Sequence[float]) -> float:
    """Standard deviation of what two neighbouring differences do not have in common: ramps cancel, noise stays.

    Repeats of one value are left out, since PV is read more often than it changes.
    """
    kept = [values[0], *(right for left, right in pairwise(values) if right != left)]
    second = [a - 2 * b + c for a, b, c in zip(kept, kept[1:], kept[2:], strict=False)]
    if not second:
        return 0.0
    return math.sqrt(sum(each * each for each in second) / len(second) / 6.0)


def _quantum(moves: Sequence[float]) -> float:
    """Smallest step when every move is a whole number of it, else 0."""
    smallest = min(abs(move) for move in moves)
    counts = Counter(round(abs(move) / smallest, 2) % 1 for move in moves)
    whole = counts[0.0]
    return smallest if whole == len(moves) and len(moves) >= 4 else 0.0


def _dead_band(loop: Loop, seen: Observation, quantum: float) -> Check:
    name = loop.controller.roles.dead_band
    band = abs(float(_value(seen.pictures[-1], name))) if name else 0.0
    if not band:
        return passed("dead-band", "there is none")
    return judged("dead-band", band >= quantum, f"{name} is {band:g}, PV moves in steps of {quantum:.3g}")


def _direction(loop: Loop, last: Picture) -> Check:
    equation = (
        "E = SV - PV: MV rises while PV is below SV"
        if loop.controller.rises(last.inputs)
        else "E = PV - SV: MV rises while PV is above SV"
    )
    return passed("direction", equation)


def _overlap(station: Station, loop: Loop) -> Check:
    memory = block.spans(loop, station.devices).get("I_MV")
    if memory is None:
        return skipped("overlap", f"{loop.controller.name} keeps no block of memory in registers of ours")
    wrong = []
    for other in station.loops:
        for name, span in block.spans(other, station.devices).items():
            if (other.name == loop.name and name == "I_MV") or span.table is not memory.table:
                continue
            if span.address < memory.end and memory.address < span.end:
                wrong.append(f"{name} of loop {other.name}")
    return judged("overlap", not wrong, f"inside I_MV: {', '.join(wrong)}" if wrong else "nothing stands inside I_MV")


def _memory(loop: Loop, seen: Observation) -> Check:
    first, last = seen.pictures[0], seen.pictures[-1]
    lasted_ns = last.last_ns - first.last_ns
    if not (math.isfinite(target_of(loop, last)) and math.isfinite(process_value_of(loop, last))):
        return skipped("i-mv-dead", "SV or PV is no number, so that the instruction holds")
    if lasted_ns < 5 * cycle_ns(loop, last):
        return skipped("i-mv-dead", "observed for less than five CYCLE")
    memory = [each.name for each in loop.controller.seen if each.operand == "I_MV" and each.name in last.seen]
    owned = memory or [name for name in loop.controller.roles.computed if name in last.seen]
    alive = any(len({_key(each.seen[name]) for each in seen.pictures}) > 1 for name in owned)
    if alive:
        return passed("i-mv-dead", f"{', '.join(owned)} change")
    if first.count != last.count:
        return passed("i-mv-dead", f"{', '.join(owned)} rest, and the program counts executions")
    stalled = seen.found("no-execution")
    if stalled is not None:
        return failed("i-mv-dead", stalled.text)
    if not memory:
        return unclear("i-mv-dead", f"{', '.join(owned)} hold the same bits: at rest, or not executed")
    still = len({_key(process_value_of(loop, each)) for each in seen.pictures}) == 1
    text = f"{', '.join(owned)} hold the same bits for {lasted_ns / SECOND:.1f} s"
    return unclear("i-mv-dead", f"{text}, and so does PV") if still else failed("i-mv-dead", text)


def _writers(loop: Loop, seen: Observation) -> Check:
    """Who else writes: operands that changed, and outputs that hold what no execution left there."""
    process = {*loop.controller.roles.pvs, *loop.controller.roles.signals}
    counts = Counter(change.operand for change in seen.changes if change.operand not in process)
    counts.update(name for execution in seen.executions for name in execution.written)
    overwritten = [suspect for suspect in seen.suspects if suspect.cause == "operand-written"]
    texts = [f"{name} {count} times" for name, count in sorted(counts.items())]
    texts += [suspect.evidence for suspect in overwritten]
    pv = len({_key(process_value_of(loop, each)) for each in seen.pictures}) > 1
    text = f"written by somebody else: {', '.join(texts)}" if texts else "nobody else wrote an operand"
    return judged("program-writes", not texts, f"{text}; PV is {'refreshed' if pv else 'not refreshed'}", **counts)


def _key(value: Any) -> Any:
    """What tells two values of one kind apart: the bits of a REAL, a whole number or a flag as it is."""
    return bits(value) if isinstance(value, np.floating) else value


def _service(loop: Loop, last: Picture) -> Check:
    wrong = loop.controller.service(last.inputs, last.seen)
    return unclear("out-of-service", "; ".join(wrong)) if wrong else passed("out-of-service", "in automatic")


def _process_range(loop: Loop, last: Picture) -> Check:
    if loop.pv_range is None and loop.mv_range is None:
        return skipped("outside-process-range", "the profile names no ranges")
    values = (
        ("SV", target_of(loop, last), loop.pv_range),
        ("PV", process_value_of(loop, last), loop.pv_range),
        ("MV", output_of(loop, last), loop.mv_range),
    )
    wrong = [
        f"{name} is {shown(value)}, range {bounds[0]:g}…{bounds[1]:g}"
        for name, value, bounds in values
        if bounds is not None and not bounds[0] <= value <= bounds[1]
    ]
    return judged("outside-process-range", not wrong, ", ".join(wrong) or "SV, PV and MV lie within their ranges")
