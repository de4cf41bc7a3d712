"""What the moments at which words change say about the axes of the schedule, which no word shows.

This file alone decides what times say; it judges no arithmetic. Each rule compares when something happened, at the
earliest and at the latest, with when a value of the axis allows it; a value falls only where the two cannot meet. So a
value that is true cannot fall as long as no scan is longer than `scan_ms_max`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from ahgateway.clock import MILLISECOND
from ahgateway.codec.station import Loop
from ahgateway.core.controllers.delta import limit
from ahgateway.core.dialect import (
    AXES,
    BadInput,
    CycleChange,
    EnOffTime,
    ManualHistory,
    ManualRefresh,
    MoutScan,
    RunOffHistory,
    RunOffScan,
    RunOn,
    Schedule,
    TsSource,
)
from ahgateway.core.real import same_bits
from ahgateway.lockstep.picture import Picture
from ahgateway.lockstep.shadow import judged_names

DRIFT = 1e-4
"""How far a PLC's clock and ours may run apart, as a share (ASSUMED, three times what quartz does)."""

RESTS_MAX = 5
"""After so many CYCLEs that nobody saw, where an execution falls is no longer followed."""

STILL_CYCLES = 3
"""So many executions may have met a PV between two pictures that was the one recorded before."""

CLOCK_NS = MILLISECOND
"""The coarsest clock by which a PLC measures an interval."""

Span = tuple[float, float]


@dataclass(frozen=True)
class _Seen:
    """The pictures of a loop, and between which of them something was executed."""

    loop: Loop
    pictures: Sequence[Picture]
    scan_ns: int
    happened: Sequence[bool]

    def cycle_ns(self, picture: Picture) -> int:
        return round(float(self.loop.controller.nominal_ts(picture.inputs)) * 1e9)

    def pairs(self) -> Iterator[tuple[int, Picture, Picture]]:
        """Pictures in a row with nothing lost between them, with the place of the second."""
        for number, (before, after) in enumerate(pairwise(self.pictures), 1):
            if before.aligned_since_ns == after.aligned_since_ns:
                yield number, before, after

    def standing(self) -> Iterator[tuple[int, Picture, Picture, Picture]]:
        """The same, with the first picture since which MV, MOUT and the flags have been as in the second."""
        since: Picture | None = None
        for number, before, after in self.pairs():
            old, new = before.inputs, after.inputs
            is_same = old._replace(pv=new.pv, sv=new.sv) == new and same_bits(before.seen["MV"], after.seen["MV"])
            if since is None or not is_same or since.aligned_since_ns != after.aligned_since_ns:
                since = before if is_same else after
            yield number, since, before, after

    def last(self, number: int) -> Span | None:
        """When the last execution that showed was, at the earliest and the latest, before the one behind `number`."""
        for place in range(number - 1, 0, -1):
            if self.happened[place]:
                return self.pictures[place - 1].sent_ns, self.pictures[place].last_ns
        return None

    def next(self, number: int) -> Span | None:
        """When the first execution from here on was, at the earliest and the latest."""
        for place in range(number, len(self.pictures)):
            if self.happened[place]:
                return self.pictures[place - 1].sent_ns, self.pictures[place].last_ns
        return None

    def is_early(self, number: int) -> bool:
        """Tell whether what happened before this picture came sooner after the last than any execution could."""
        last, picture = self.last(number), self.pictures[number]
        return last is not None and picture.last_ns - last[0] < self.cycle_ns(picture) - self.scan_ns


def fallen(loop: Loop, pictures: Sequence[Picture]) -> dict[str, set[int]]:
    """Return, axis by axis, the values that the times of these pictures exclude."""
    if loop.controller.law_ts is None or len(pictures) < 2 or loop.interval_ms is not None or loop.is_called:
        return {}
    seen = _Seen(loop, pictures, max(1, loop.scan_ms_max) * MILLISECOND, _happened(loop, pictures))
    rules: dict[str, Callable[[_Seen], Iterator[int]]] = {
        "manual_refresh": _manual_refresh,
        "run_off_scan": _run_off_scan,
        "run_off_history": _run_off_history,
        "manual_history": _manual_history,
        "bad_input": _bad_input,
        "mout_scan": _mout_scan,
        "run_on": _run_on,
        "cycle_change": _cycle_change,
        "en_off_time": _en_off_time,
        "schedule": _schedule,
        "ts_source": _ts_source,
    }
    found = {name: set(rule(seen)) for name, rule in rules.items()}
    # Where nothing is left, scans were longer than the profile says: times say nothing.
    return {name: gone for name, gone in found.items() if gone and len(gone) < len(AXES[name])}


def _happened(loop: Loop, pictures: Sequence[Picture]) -> list[bool]:
    names = [name for name in judged_names(loop) if name != "MOUT"]
    changed = [any(not same_bits(p.seen[name], q.seen[name]) for name in names) for p, q in pairwise(pictures)]
    return [False, *changed]


def _is_on(picture: Picture) -> bool:
    return picture.enabled is not False and picture.running is not False and picture.inputs.pid_mode != 1


def _stays(since: Picture, after: Picture, seen: _Seen) -> bool:
    """Tell whether at least one whole scan lies between two pictures that `standing` gave."""
    return after.sent_ns - since.last_ns > 2 * seen.scan_ns


def _in_manual(picture: Picture) -> bool:
    return bool(_is_on(picture) and picture.inputs.pid_run and picture.inputs.pid_man)


def _manual_refresh(seen: _Seen) -> Iterator[int]:
    """MV and MOUT in manual: MV that lags by a scan, or follows before an execution is due."""
    has_followed = False
    for number, since, before, after in seen.standing():
        if not _in_manual(before) or not _in_manual(after):
            has_followed = False
            continue
        read = after.inputs
        if not read.mv_min <= read.mv_max:
            continue
        wanted = limit(read.mv_min, read.mout, read.mv_max)
        is_there, was_there = (same_bits(each.seen["MV"], wanted) for each in (after, before))
        if has_followed and not is_there and _stays(since, after, seen):
            yield int(ManualRefresh.EACH_SCAN)
        if is_there and not was_there and seen.is_early(number):
            yield int(ManualRefresh.EACH_CYCLE)
        has_followed = has_followed or is_there


def _run_off_scan(seen: _Seen) -> Iterator[int]:
    """MV and 0 with PID_RUN off."""
    for number, since, before, after in seen.standing():
        if after.inputs.pid_run or not _is_on(before) or not _is_on(after):
            continue
        if after.seen["MV"] != 0 and _stays(since, after, seen):
            yield int(RunOffScan.EVERY_SCAN)
        if before.seen["MV"] != 0 and after.seen["MV"] == 0 and seen.is_early(number):
            yield int(RunOffScan.WHEN_DUE)


def _run_off_history(seen: _Seen) -> Iterator[int]:
    """The word of the last PV with PID_RUN off."""
    if _stands(seen, lambda picture: _is_on(picture) and not picture.inputs.pid_run):
        yield int(RunOffHistory.TRACKED)


def _manual_history(seen: _Seen) -> Iterator[int]:
    """The word of the last PV in manual."""
    if _stands(seen, _in_manual):
        yield int(ManualHistory.TRACKED)


def _stands(seen: _Seen, is_such: Callable[[Picture], bool]) -> bool:
    """Tell whether the word of the last PV stood through CYCLEs in which PV was never seen to be the same."""
    recorded = next(word.name for word in seen.loop.controller.seen if word.attr == "pv1")
    begin: int | None = None
    for _, before, after in seen.pairs():
        pv1 = after.seen[recorded]
        is_same = same_bits(before.seen[recorded], pv1) and after.inputs.pv != pv1
        if not is_same or not is_such(before) or not is_such(after):
            begin = None
            continue
        begin = before.last_ns if begin is None else begin
        if after.sent_ns - begin > STILL_CYCLES * (seen.cycle_ns(after) + seen.scan_ns):
            return True
    return False


def _bad_input(seen: _Seen) -> Iterator[int]:
    """An SV that is no number, through CYCLEs in which no word changed though PV did."""
    begin: Picture | None = None
    for number, before, after in seen.pairs():
        is_bad = all(
            _is_on(each) and each.inputs.pid_run and each.inputs.sv != each.inputs.sv for each in (before, after)
        )
        if not is_bad or seen.happened[number]:
            begin = None
            continue
        begin = begin or before
        is_long = after.sent_ns - begin.last_ns > 2 * (seen.cycle_ns(after) + seen.scan_ns)
        if is_long and begin.inputs.pv != after.inputs.pv:
            yield int(BadInput.AS_ZERO)
            yield int(BadInput.PROPAGATED)
            return


def _mout_scan(seen: _Seen) -> Iterator[int]:
    """MOUT and MV in automatic with MOUT_AUTO on."""

    def follows(picture: Picture) -> bool:
        read = picture.inputs
        return bool(_is_on(picture) and read.pid_run and read.mout_auto and not read.pid_man)

    for number, since, before, after in seen.standing():
        if not follows(before) or not follows(after):
            continue
        was_there, is_there = (same_bits(each.inputs.mout, each.seen["MV"]) for each in (before, after))
        if not was_there and not is_there:
            if _stays(since, after, seen):
                yield int(MoutScan.EACH_SCAN)
        elif not was_there and is_there and not seen.happened[number] and seen.is_early(number):
            yield int(MoutScan.EACH_EXECUTION)


def _run_on(seen: _Seen) -> Iterator[int]:
    """The first execution after PID_RUN rose."""
    scan = seen.scan_ns
    for number, before, after in seen.pairs():
        if before.inputs.pid_run or not after.inputs.pid_run or not _is_on(after):
            continue
        first, last, cycle = seen.next(number), seen.last(number), seen.cycle_ns(after)
        if first is None or (seen.happened[number] and after.seen["MV"] == 0):
            # Nothing shows which of what happened was the first execution.
            continue
        rise = (before.sent_ns, after.last_ns)
        if _apart(first, (rise[0], rise[1] + 2 * scan)):
            yield int(RunOn.AT_ONCE)
        if _apart(first, (rise[0] + cycle - scan, rise[1] + cycle + 2 * scan)):
            yield int(RunOn.AFTER_CYCLE)
        if last is None or seen.cycle_ns(before) != cycle:
            continue
        due = [(last[0] + n * (cycle - scan), last[1] + n * (cycle + scan) + scan) for n in range(1, RESTS_MAX + 1)]
        if first[1] < due[-1][0] and all(_apart(first, each) for each in due):
            yield int(RunOn.GOES_ON)


def _cycle_change(seen: _Seen) -> Iterator[int]:
    """The first execution after a shorter CYCLE was written."""
    scan = seen.scan_ns
    for number, before, after in seen.pairs():
        old, new = seen.cycle_ns(before), seen.cycle_ns(after)
        last, first = seen.last(number), seen.next(number)
        if last is None or first is None or not new < old or not (_is_on(before) and _is_on(after)):
            continue
        if seen.happened[number] or before.sent_ns - last[0] > old - scan:
            # An execution beside the write may have come before or after it.
            continue
        soonest = (max(last[0] + new - scan, before.sent_ns), max(last[1] + new, after.last_ns) + 2 * scan)
        if _apart(first, soonest):
            yield int(CycleChange.AT_ONCE)
        if _apart(first, (last[0] + old - scan, last[1] + old + 2 * scan)):
            yield int(CycleChange.NEXT)


def _en_off_time(seen: _Seen) -> Iterator[int]:
    """The first execution after EN was off for part of a CYCLE."""
    scan, off = seen.scan_ns, None
    for number, before, after in seen.pairs():
        if before.enabled and after.enabled is False:
            off = (number, before.sent_ns, after.last_ns)
        if off is None or before.enabled is not False or not after.enabled:
            continue
        last, first, cycle = seen.last(off[0]), seen.next(number), seen.cycle_ns(after)
        on = (before.sent_ns, after.last_ns)
        is_last = last is not None and off[1] - last[0] < cycle - scan and not any(seen.happened[off[0] : number])
        if last is not None and first is not None and is_last:
            shortest, longest = on[0] - off[2], on[1] - off[1]
            if _apart(first, (last[0] + cycle - scan + shortest, last[1] + cycle + longest + 2 * scan)):
                yield int(EnOffTime.STANDS)
            if _apart(first, (max(on[0], last[0] + cycle - scan), max(on[1], last[1] + cycle) + 2 * scan)):
                yield int(EnOffTime.RUNS)
        off = None


def _schedule(seen: _Seen) -> Iterator[int]:
    """So many executions in a row took less than so many CYCLEs, or more by over a scan."""
    begin: list[Span] = []
    for number, before, after in seen.pairs():
        cycle = seen.cycle_ns(after)
        is_plain = _is_on(before) and _is_on(after) and before.inputs.pid_run and after.inputs.pid_run
        if not is_plain or seen.cycle_ns(before) != cycle or _in_manual(after):
            begin = []
        elif seen.happened[number]:
            now = (float(before.sent_ns), float(after.last_ns))
            if begin and now[1] - begin[-1][0] > 1.5 * cycle:
                begin = []
            begin.append(now)
            yield from _drifted(begin, cycle, seen.scan_ns)


def _ts_source(seen: _Seen) -> Iterator[int]:
    """Two executions in automatic further from a CYCLE apart than any clock can be wrong.

    Where CYCLE alone explains what they integrated, no clock measured it.
    """
    names = [name for name in judged_names(seen.loop) if name != "MOUT"]
    last: Span | None = None
    for number, before, after in seen.pairs():
        if not seen.happened[number]:
            continue
        cycle = seen.cycle_ns(after)
        span = (float(before.sent_ns), float(after.last_ns))
        is_whole = all(not same_bits(before.seen[name], after.seen[name]) for name in names)
        is_plain = _is_on(after) and _integrates(after.inputs) and seen.cycle_ns(before) == cycle
        if last is not None and is_whole and is_plain and span[1] - last[0] < 1.5 * cycle:
            wrong = cycle * DRIFT + CLOCK_NS
            if span[0] - last[1] > cycle + wrong or span[1] - last[0] < cycle - wrong:
                yield from (int(TsSource.MS), int(TsSource.TENTH_MS), int(TsSource.MICROSECOND))
        last = span if is_whole else None


def _integrates(read: Any) -> bool:
    return bool(read.pid_run and not read.pid_man and getattr(read, "ki", getattr(read, "ti_ki", 0)) > 0)


def _drifted(begin: list[Span], cycle: int, scan: int) -> Iterator[int]:
    """What the last of these executions says, beside each of those before it."""
    low, high = begin[-1]
    back = 1
    while back < len(begin):
        first, last = begin[-1 - back]
        wanted = back * cycle
        if high - first < wanted * (1.0 - DRIFT):
            yield int(Schedule.DRIFTING)
        if low - last > wanted * (1.0 + DRIFT) + scan:
            yield int(Schedule.GRID)
        back *= 2


def _apart(left: Span, right: Span) -> bool:
    """Tell whether two spans of time have no moment in common."""
    return left[1] < right[0] or right[1] < left[0]
