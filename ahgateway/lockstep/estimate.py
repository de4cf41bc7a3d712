"""How large an operand really is: the values under which the law leaves the very words that the PLC wrote.

The law is linear in each gain and in Ts between its branches, so a secant finds the value, and the REALs around it
that leave the same words are one run, whose ends are found by doubling and halving.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import isfinite

from ahgateway.core.real import REAL, from_order, order, same_bits

RATIO_MIN, RATIO_MAX = 0.2, 5.0
"""An operand that would have to be wrong by more than this explains nothing."""

ULP_SLACK = 16
"""How far a fitted value may miss, in ULP of the larger of MV and its terms: the fit itself is rounded."""

RATIO_NEAR = 2e-5
"""A factor so near to 1 is rounding, unless the words come out by bits."""

NEIGHBOURS = 48
"""So many REALs on either side of the fitted value are tried by bits."""

NAMES = ("I_MV", "MV")

Words = Mapping[str, REAL]


@dataclass(frozen=True, slots=True)
class Size:
    """A value with the interval of REALs that leave the same words."""

    value: REAL
    low: REAL
    high: REAL
    is_exact: bool


def sized(words: Callable[[REAL], Words], seen: Words, held: float) -> Size | None:
    """Solve for the value under which the law leaves what the PLC wrote; None when none does.

    Args:
        words: What the law leaves with this value.
        seen: What the PLC wrote.
        held: What the register holds, positive; the value is sought between a fifth and five times of it.
    """
    ratio = _ratio(words, seen, held)
    if ratio is None:
        return None
    start = order(REAL(held * ratio))
    edges = order(REAL(held * RATIO_MIN)), order(REAL(held * RATIO_MAX))

    def is_hit(position: int) -> bool:
        found = words(from_order(position))
        return all(same_bits(found[name], seen[name]) for name in NAMES)

    def is_near(position: int) -> bool:
        found = words(from_order(position))
        return all(miss(found, seen, name) <= ULP_SLACK for name in NAMES)

    for away in range(NEIGHBOURS + 1) if _is_enclosed(words, seen, start) else ():
        hit = next((each for each in (start + away, start - away) if is_hit(each)), None)
        if hit is not None:
            return _size(hit, *_run(is_hit, hit, *edges), is_exact=True)
    if abs(ratio - 1.0) < RATIO_NEAR or not is_near(start):
        return None
    return _size(start, *_run(is_near, start, *edges), is_exact=False)


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
