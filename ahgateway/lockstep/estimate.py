"""How large an operand really is: the values under which the law leaves the very words that the PLC wrote.

The law is linear in each gain and in Ts between its branches, so a secant finds the value, and the REALs around it
that leave the same words are one run, whose ends are found by doubling and halving.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import isfinite

from ahgateway.core.real import REAL, bits, from_order, order, same_bits

RATIO_MIN, RATIO_MAX = 0.2, 5.0
"""An operand that would have to be wrong by more than this explains nothing."""

ULP_SLACK = 16
"""How far a fitted value may miss, in ULP of the larger of MV and its terms: the fit itself is rounded."""

RATIO_NEAR = 2e-5
"""A factor so near to 1 is rounding, unless the words come out by bits."""

NEIGHBOURS = 48
"""What so many REALs on either side of the fitted value leave must enclose each word, roundings apart."""

HOLE_MAX = 8
"""So many REALs in a row that miss by one ULP do not end a run."""

HOLES_MAX = 8
"""So many holes of a run are passed over, and no more."""

REACH = 1 << 12
"""So far from the fitted value, in REALs, a value is sought that leaves a word by bits."""

NAMES = ("I_MV", "MV")

Words = Mapping[str, REAL]


@dataclass(frozen=True, slots=True)
class Size:
    """A value with the interval of REALs that leave the same words."""

    value: REAL
    low: REAL
    high: REAL
    is_exact: bool


def sized(words: Callable[[REAL], Words], seen: Words, held: float, *, is_carried: bool = False) -> Size | None:
    """Solve for the value under which the law leaves what the PLC wrote; None when none does.

    Args:
        words: What the law leaves with this value.
        seen: What the PLC wrote.
        held: What the register holds, positive; the value is sought between a fifth and five times of it.
        is_carried: D's filter holds what an estimate has left there, so that MV may be off by a last bit.
    """
    ratio = _ratio(words, seen, held)
    if ratio is None:
        return None
    words = _remembering(words)
    start = order(REAL(held * ratio))
    edges = order(REAL(held * RATIO_MIN)), order(REAL(held * RATIO_MAX))

    def is_near(position: int) -> bool:
        found = words(from_order(position))
        return all(miss(found, seen, name) <= ULP_SLACK for name in NAMES)

    run = _hits(words, seen, start, edges, int(is_carried)) if _is_enclosed(words, seen, start) else None
    if run is not None:
        return _size(start, *run, is_exact=True)
    if abs(ratio - 1.0) < RATIO_NEAR or not is_near(start):
        return None
    return _size(start, *_run(is_near, start, *edges), is_exact=False)


def _remembering(words: Callable[[REAL], Words]) -> Callable[[REAL], Words]:
    """The same, each value asked once: both words are looked for around one place."""
    known: dict[int, Words] = {}

    def once(value: REAL) -> Words:
        key = bits(value)
        if key not in known:
            known[key] = words(value)
        return known[key]

    return once


def _hits(
    words: Callable[[REAL], Words], seen: Words, start: int, edges: tuple[int, int], slack: int
) -> tuple[int, int] | None:
    """The run of positions that leave every word by bits; None when there is none near the start.

    Each word follows the value one way, so that the run of each is found by itself.
    """
    hits = []
    for name in NAMES:

        def side(position: int, name: str = name) -> int:
            found, wanted = words(from_order(position))[name], seen[name]
            return 0 if same_bits(found, wanted) else (-1 if found < wanted else 1)

        hits.append(_zero(side, start))
        if hits[-1] is None:
            return None
    low, high = edges
    for name, hit in zip(NAMES, hits, strict=True):
        off = slack if name == "MV" else 0

        def is_hit(position: int, name: str = name, off: int = off) -> bool:
            return abs(order(words(from_order(position))[name]) - order(seen[name])) <= off

        first, last = _run(is_hit, hit or start, *edges)
        low, high = max(low, first), min(high, last)
    middle = (low + high) // 2
    for each in (middle, *(middle + sign * away for away in range(1, HOLE_MAX + 1) for sign in (1, -1))):
        if low <= each <= high:
            found = words(from_order(each))
            if all(same_bits(found[name], seen[name]) for name in NAMES):
                return low, high
    return None


def _zero(side: Callable[[int], int], start: int) -> int | None:
    """A position near the start at which a monotone side is 0."""
    here = side(start)
    if here == 0:
        return start
    for there in (start - REACH, start + REACH):
        beyond = side(there)
        if beyond != here:
            return _between(side, start, there, here) if beyond else there
    return None


def _between(side: Callable[[int], int], start: int, end: int, here: int) -> int | None:
    """A position between two of unlike sides at which the side is 0."""
    while abs(end - start) > 1:
        middle = (start + end) // 2
        found = side(middle)
        if found == 0:
            return middle
        start, end = (middle, end) if found == here else (start, middle)
    return None


def _is_enclosed(words: Callable[[REAL], Words], seen: Words, start: int) -> bool:
    """Tell whether every word can lie within those of the outermost neighbours, but for what rounding adds."""
    low, high = (words(from_order(start + away)) for away in (-NEIGHBOURS, NEIGHBOURS))
    for name in NAMES:
        first, last, target = float(low[name]), float(high[name]), float(seen[name])
        slack = abs(last - first) + 2.0**-23 * ULP_SLACK * max(abs(first), abs(last), abs(target))
        if not min(first, last) - slack <= target <= max(first, last) + slack:
            return False
    return True


def miss(words: Words, seen: Words, name: str) -> float:
    """Distance of a word from what the PLC wrote, in ULP of the larger of the two and MV's biggest term."""
    scale = max(abs(float(words["I_MV"])), abs(float(words["MV"])), abs(float(seen[name])), 1e-30)
    return abs(float(words[name]) - float(seen[name])) / (scale * 2.0**-23)


def _ratio(words: Callable[[REAL], Words], seen: Words, held: float) -> float | None:
    """The factor by a few rounds of the secant; Tf needs them, gains come out at once."""

    def at(ratio: float) -> Words:
        return words(REAL(held * ratio))

    ratio, ref = 1.0, at(1.0)
    name = max(NAMES, key=lambda word: miss(ref, seen, word))
    target = float(seen[name])
    for _ in range(6):
        here, there = float(at(ratio)[name]), float(at(ratio * 1.0078125)[name])
        slope = (there - here) / (ratio * 0.0078125)
        if not isfinite(slope) or slope == 0.0:
            return None
        ratio += (target - here) / slope
        if not isfinite(ratio) or not RATIO_MIN < ratio < RATIO_MAX:
            return None
    return ratio if ratio != 1.0 else None


def _run(holds: Callable[[int], bool], start: int, first: int, last: int) -> tuple[int, int]:
    """Both ends of the run of positions around `start` for which a condition holds, within `first` to `last`."""
    return _end(holds, start, -1, start - first), _end(holds, start, 1, last - start)


def _end(holds: Callable[[int], bool], start: int, sign: int, room: int) -> int:
    """The last position that way; terms that move against each other leave holes of a few REALs in a run."""
    end = start
    for _ in range(HOLES_MAX):
        end = _last(holds, end, sign, room - abs(end - start))
        beyond = (end + sign * away for away in range(2, HOLE_MAX + 2))
        further = next((each for each in beyond if abs(each - start) <= room and holds(each)), None)
        if further is None:
            break
        end = further
    return end


def _last(holds: Callable[[int], bool], start: int, sign: int, room: int) -> int:
    good, stride = 0, 1
    while good + stride <= room and holds(start + sign * (good + stride)):
        good += stride
        stride *= 2
    bad = min(good + stride, room + 1)
    while bad - good > 1:
        middle = (good + bad) // 2
        if holds(start + sign * middle):
            good = middle
        else:
            bad = middle
    return start + sign * good


def _size(hit: int, low: int, high: int, *, is_exact: bool) -> Size:
    value = from_order((low + high) // 2) if is_exact else from_order(hit)
    return Size(value, from_order(low), from_order(high), is_exact)
