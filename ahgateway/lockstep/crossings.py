"""Whether DPIDE's cross status is kept scan by scan: a PV that passes SV and comes back between two executions tells.

With the status kept at each scan, an execution may find it set by a PV that no picture shows, so that this reading
explains whatever the other one does. Only an excursion that the pictures themselves show decides, and this file alone
looks for it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any

from ahgateway.clock import MILLISECOND
from ahgateway.codec.station import Loop
from ahgateway.core.dialect import CrossScan, Integrator
from ahgateway.core.real import same_bits
from ahgateway.lockstep.picture import Picture
from ahgateway.lockstep.shadow import judged_names

Fixed = Mapping[str, int]

BEHIND = 2
"""The execution that is judged: the second behind the excursion, where no integration rule looks further back."""


FAR = 4.0
"""A PV whose distance from SV is so many times what it moves has not passed SV between two pictures (ASSUMED)."""


def told(loop: Loop, pictures: Sequence[Picture]) -> dict[str, int]:
    """Return `cross_scan` where an excursion of PV decides it, nothing elsewhere."""
    if "cross" not in loop.controller.state()._fields or "I_MV" not in judged_names(loop):
        return {}
    runs = _executions(loop, pictures)
    found = {*_excursions(loop, runs), *_entries(loop, runs)}
    return {"cross_scan": found.pop()} if len(found) == 1 else {}


def _excursions(loop: Loop, runs: Sequence[Sequence[Picture]]) -> Iterator[int]:
    """E counted before an excursion of PV: does it count behind it?"""
    for number in range(1, len(runs) - BEHIND):
        first, last, *behind = runs[number - 1 : number + 1 + BEHIND]
        if not all(
            _is_plain(loop, each) and _is_inside(loop, each) for run in (first[-1:], last, *behind) for each in run
        ):
            continue
        errors = [_error(loop, run[-1]) for run in (last, *behind)]
        side = errors[0] > 0
        if _same_i(first[-1], last[-1]) or not all((each > 0) == side and each != 0 for each in errors):
            continue
        if _is_away(loop, behind[0][:-1], side) and not _is_away(loop, behind[1][:-1], side):
            yield int(CrossScan.EACH_SCAN if _same_i(behind[0][-1], behind[1][-1]) else CrossScan.EACH_CYCLE)


def _entries(loop: Loop, runs: Sequence[Sequence[Picture]]) -> Iterator[int]:
    """E is 0 inside the band though PV, far from SV and nearly at rest, cannot have passed it at any scan."""
    for number in range(len(runs) - BEHIND):
        last, *behind = runs[number : number + 1 + BEHIND]
        seen = [each for run in behind for each in run if _is_inside(loop, each)]
        errors = [float(each.inputs.sv) - float(each.inputs.pv) for each in seen]
        if len(errors) < 2 or not all(_is_plain(loop, run[-1]) for run in (last, *behind)):
            continue
        if _is_inside(loop, last[-1]) or not all(_is_inside(loop, run[-1]) for run in behind):
            continue
        side, nearest = _error(loop, last[-1]) > 0, min(map(abs, errors))
        is_far = all((each > 0) == side for each in errors) and nearest > abs(float(last[-1].inputs.err_dbw)) / FAR
        is_calm = max(errors) - min(errors) < nearest / FAR
        if is_far and is_calm and _same_i(behind[0][-1], behind[1][-1]):
            yield int(CrossScan.EACH_CYCLE)


def taken(starts: Sequence[Fixed], known: Fixed) -> list[Fixed]:
    """Begin with what is told as well, where the integral stands once E is 0, as it must for that to hold."""
    return [
        {**fixed, **known} if fixed.get("integrator", Integrator.DVP) != Integrator.DVP else fixed for fixed in starts
    ]


def _executions(loop: Loop, pictures: Sequence[Picture]) -> list[list[Picture]]:
    """The pictures from behind one execution up to the one behind the next, without a gap."""
    names = [name for name in judged_names(loop) if name != "MOUT"]
    found: list[list[Picture]] = [[]]
    for before, after in pairwise(pictures):
        found[-1].append(after)
        if before.aligned_since_ns != after.aligned_since_ns:
            found[-1] = []
        elif any(not same_bits(before.seen[name], after.seen[name]) for name in names):
            found.append([])
    return [run for run in found[:-1] if run]


def _is_plain(loop: Loop, picture: Picture) -> bool:
    """Automatic, integrating, MV between its limits, with a dead band."""
    read: Any = picture.inputs
    is_on = read.pid_run and not read.pid_man and read.pid_mode != 1
    is_on = is_on and picture.enabled is not False and picture.running is not False
    if not is_on or not read.ti_ki > 0 or (read.pid_eq and not read.kc_kp > 0):
        return False
    low, high = sorted((float(read.mv_min), float(read.mv_max)))
    return bool(read.err_dbw != 0) and low < float(picture.seen["MV"]) < high


def _is_inside(loop: Loop, picture: Picture) -> bool:
    """PV and the one that was recorded are inside the band."""
    sv, band = float(picture.inputs.sv), abs(float(picture.inputs.err_dbw))
    return all(abs(sv - pv) < band for pv in (float(picture.inputs.pv), _recorded(loop, picture)))


def _recorded(loop: Loop, picture: Picture) -> float:
    return float(next(picture.seen[word.name] for word in loop.controller.seen if word.attr == "pv1"))


def _error(loop: Loop, picture: Picture) -> float:
    return float(picture.inputs.sv) - _recorded(loop, picture)


def _same_i(before: Picture, after: Picture) -> bool:
    return same_bits(before.seen["I_MV"], after.seen["I_MV"])


def _is_away(loop: Loop, between: Sequence[Picture], side: bool) -> bool:
    """Tell whether PV stood on the other side of SV through at least one whole scan."""
    since: Picture | None = None
    for picture in between:
        error = float(picture.inputs.sv) - float(picture.inputs.pv)
        if error == 0 or (error > 0) == side:
            since = None
        elif since is None:
            since = picture
        elif picture.sent_ns - since.last_ns > 2 * max(1, loop.scan_ms_max) * MILLISECOND:
            return True
    return False
