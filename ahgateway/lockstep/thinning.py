"""A first, quick pass over a trace: which combinations of the integral's and the derivative's axes can be true at all.

Only plain executions count here: automatic, nothing changed, between the limits, no dead band. On them I_MV alone
decides the integral's axes, and MV less P, I and BIAS bounds D. All of them are computed at once, with the law's own
functions on arrays. The pass is lenient, it only saves work: `identify` judges what is left by every bit. Where nothing
is left, a strict pass over the executions in which nothing else can have a part in I_MV tells whether that is proof.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from itertools import product
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from ahgateway.codec.station import Loop
from ahgateway.core.controllers import delta_terms as terms_of
from ahgateway.core.dialect import AXES, Dialect, Filter, IntegralStore, TsSource, TsUnit
from ahgateway.core.real import REAL, quiet, same_bits
from ahgateway.lockstep.picture import Picture
from ahgateway.lockstep.reads import changed_inputs
from ahgateway.lockstep.shadow import judged_names

Pair = tuple[Picture, Picture]
Reals = npt.NDArray[np.float32]

FIRST = 6
"""So many executions are tried first; most combinations fall there."""

FINE_CLOCK = 1024
"""A clock with more ticks around CYCLE than this is tried on a dozen executions only."""

MOST = 160
PLAIN_MIN = 4
"""With fewer plain executions nothing is thinned."""

NEAR = 1e-5
"""Sums nearer than this share of their largest part may differ by rounding alone."""

SHARE_MIN = 0.85
"""A combination that explains less of the plain executions is out; a corner of the law may spoil a few."""


@dataclass(frozen=True)
class Plain:
    """Plain executions as columns, n each; REALs but for the flags, what was read, and their places in the trace."""

    er: Reals
    er1: Reals
    moved: Reals
    i0: Reals
    i1: Reals
    mv: Reals
    kc: Reals
    k: Reals
    kd: Reals
    tf: Reals
    bias: Reals
    dependent: npt.NDArray[np.bool_]
    of_pv: npt.NDArray[np.bool_]
    inputs: tuple[Any, ...]
    d_before: npt.NDArray[np.bool_]
    steady: npt.NDArray[np.bool_]
    places: npt.NDArray[np.int64]

    def rows(self, chosen: npt.NDArray[Any]) -> Plain:
        """The executions chosen by index or mask."""
        index = np.arange(len(self.inputs))[chosen]
        taken = {f.name: getattr(self, f.name)[index] for f in fields(self) if f.name != "inputs"}
        return Plain(**taken, inputs=tuple(self.inputs[number] for number in index))


class Thinned(NamedTuple):
    """What the plain executions leave.

    Attributes:
        left: The combinations that can be true; none where the trace has too little that is plain, and none that is.
        fell: None can be: the execution at which the last one fell, and that one.
        plain: How many plain executions there were, of those that were looked at.
    """

    left: list[dict[str, int]]
    fell: tuple[int, dict[str, int]] | None
    plain: int


def thinned(loop: Loop, pairs: Sequence[Pair], follows: Sequence[bool]) -> Thinned:
    """Return the combinations that can be true.

    Args:
        loop: The loop; its own dialect does not count.
        pairs: Pictures before and behind each execution.
        follows: Whether each execution follows the one before it in the trace.
    """
    rows = _plain_rows(loop, pairs, follows)
    if len(rows) < PLAIN_MIN:
        return Thinned([], None, len(rows))
    plain = _in_columns(rows)
    has_kc = is_dependent(pairs)
    integrating = plain.rows((plain.k > 0) & ((plain.kc > 0) | ~plain.dependent) & (plain.i1 != plain.i0))
    with quiet(all="ignore"):
        found = _integrals(loop, integrating, has_kc)
        left = [wider for fixed in found for wider in _derivatives(loop, plain, fixed)]
        return Thinned(left, None if left else _last_to_fall(loop, integrating, has_kc), len(plain.inputs))


def first_plain(loop: Loop, pairs: Sequence[Pair]) -> int:
    """Place of the first two plain executions in a row, 0 when there are none: there hidden state settles fastest."""
    for number in range(len(pairs) - 1):
        if is_plain(loop, pairs[number]) and is_plain(loop, pairs[number + 1]):
            return number
    return 0


def is_dependent(pairs: Sequence[Pair]) -> bool:
    """Tell whether any picture of the trace is in the dependent form."""
    return any(getattr(picture.inputs, "pid_eq", False) for pair in pairs for picture in pair)


def counts_ten_ms(loop: Loop) -> bool:
    """Tell whether CYCLE itself counts 10 ms, so that this unit is the count."""
    return loop.controller.name == "DPID"


def is_plain(loop: Loop, pair: Pair) -> bool:
    before, after = pair
    read = after.inputs
    low, high = sorted((float(read.mv_min), float(read.mv_max)))
    return (
        bool(read.pid_run)
        and not read.pid_man
        and read.pid_mode != 1
        and float(read.err_dbw) == 0.0
        and set(changed_inputs(loop, before, after)) <= {"mout"}
        and all(low < float(picture.seen["MV"]) < high for picture in pair)
    )


def _plain_rows(loop: Loop, pairs: Sequence[Pair], follows: Sequence[bool]) -> list[tuple[Any, ...]]:
    """The plain executions that follow a plain one, `MOST` of them; none where the registers do not show enough."""
    names = [name for name in judged_names(loop) if name != "MOUT"]
    if not {"MV", "I_MV"} <= set(names) or loop.controller.law_ts is None:
        return []
    recorded = next(word.name for word in loop.controller.seen if word.attr == "pv1")
    rows: list[tuple[Any, ...]] = []
    was_plain = was_row = False
    for number, pair in enumerate(pairs):
        is_now = is_plain(loop, pair)
        joins = number > 0 and all(same_bits(pairs[number - 1][1].seen[name], pair[0].seen[name]) for name in names)
        if is_now and was_plain and joins:
            row = _row(pairs[number - 1][1].inputs, pair, recorded, was_row)
            rows.append((*row[:-1], row[-1] and bool(follows[number]), number))
            was_row = True
        else:
            was_row = False
        was_plain = is_now
        if len(rows) >= MOST:
            break
    return rows


def _in_columns(rows: list[tuple[Any, ...]]) -> Plain:
    columns = list(zip(*rows, strict=True))
    reals: Any = [np.array(column, dtype=np.float32) for column in columns[:11]]
    flags: Any = [np.array(columns[number]) for number in (11, 12, 14, 15, 16)]
    return Plain(*[*reals, *flags[:2], tuple(columns[13]), *flags[2:]])


def _row(last: Any, pair: Pair, recorded: str, was_row: bool) -> tuple[Any, ...]:
    """One execution; the history is that of the one before, whose operands may have been others."""
    before, after = pair
    read, pv, pv1 = after.inputs, after.seen[recorded], before.seen[recorded]
    er = read.sv - pv if read.pid_dir else pv - read.sv
    er1 = last.sv - pv1 if last.pid_dir else pv1 - last.sv
    moved = pv1 - pv if read.pid_dir else pv - pv1
    extended = hasattr(read, "kc_kp")
    kc, k, kd = (read.kc_kp, read.ti_ki, read.td_kd) if extended else (read.kp, read.ki, read.kd)
    tf, bias = (read.tf, read.bias) if extended else (REAL(0), REAL(0))
    same = all(
        getattr(last, name) == getattr(read, name)
        for name in ("kc_kp", "td_kd", "tf", "pid_eq", "pid_de")
        if hasattr(read, name)
    )
    words = (before.seen["I_MV"], after.seen["I_MV"], after.seen["MV"])
    dependent, of_pv = (bool(read.pid_eq), bool(read.pid_de)) if extended else (False, False)
    is_steady = all(getattr(last, name, None) == getattr(read, name, None) for name in ("pid_dir", "pid_eq"))
    return (er, er1, moved, *words, kc, k, kd, tf, bias, dependent, of_pv, read, was_row and same, is_steady)


def _clocks(loop: Loop, source: TsSource) -> Iterator[dict[str, int]]:
    """Every way to have a Ts from one clock."""
    for unit, scale in product(TsUnit, (0, 1)):
        if unit == TsUnit.TEN_MS and source == TsSource.NOMINAL and counts_ten_ms(loop):
            continue
        if unit == TsUnit.LEFT_OUT:
            if source == TsSource.NOMINAL and not scale:
                yield {"ts_source": int(source), "ts_unit": int(unit)}
        elif unit == TsUnit.SECONDS:
            yield {"ts_source": int(source), "ts_unit": int(unit), "ts_scale": scale}
        elif not scale:
            yield {"ts_source": int(source), "ts_unit": int(unit)}


def _intervals(loop: Loop, plain: Plain, dialect: Dialect) -> Reals:
    """Every Ts that each execution can have had: n by 1, or n by the ticks around CYCLE."""
    controller = loop.controller
    per_second = terms_of.ticks_per_second(dialect)
    cache: dict[int, Reals] = {}
    for read in plain.inputs:
        if read.cycle in cache:
            continue
        ticks: Any = np.zeros(1, np.int64)
        if per_second:
            nominal = round(float(controller.nominal_ts(read)) * per_second)
            slack = max(1, -(-loop.scan_ms_max * per_second // 1000))
            ticks = max(1, nominal - slack) + np.arange(2 * slack + 1)
        cache[read.cycle] = np.broadcast_to(np.float32(controller.ts(read, dialect, ticks)), ticks.shape)
    return np.stack([cache[read.cycle] for read in plain.inputs])


def _integrals(loop: Loop, integrating: Plain, has_kc: bool) -> list[dict[str, int]]:
    """Combinations of the integral's axes that reproduce I_MV, with the coarsest clock that does.

    A finer clock explains whatever a coarser one explains, so that it counts only where that fails. Where I_MV stood, a
    limit that MV does not show may have held it: that says nothing of how it is computed.
    """
    if len(integrating.inputs) < PLAIN_MIN:
        return []
    for source in TsSource:
        found = [fixed for clock in _clocks(loop, source) for fixed in _with_clock(loop, integrating, clock, has_kc)]
        if found:
            return found
    return []


def _last_to_fall(loop: Loop, integrating: Plain, has_kc: bool) -> tuple[int, dict[str, int]] | None:
    """Hold every combination to what is proof: where the last one falls, and that one; None where one stands."""
    last: tuple[int, dict[str, int]] | None = None
    has_ratio = bool(integrating.dependent.any())
    for clock in (clock for source in TsSource for clock in _clocks(loop, source)):
        spans = _intervals(loop, integrating, _made(clock)) if len(integrating.inputs) else np.zeros((0, 1), np.float32)
        for fixed in _with_rules(clock, has_ratio, has_kc):
            place = _first_missed(integrating, _made(fixed), spans)
            if place < 0:
                return None
            if last is None or place > last[0]:
                last = (place, fixed)
    return None if last is None else (int(integrating.places[last[0]]), last[1])


def _first_missed(plain: Plain, dialect: Dialect, spans: Reals) -> int:
    """The first execution whose I_MV must come out by bits and does with none of its intervals, -1 for none."""
    begin, size = 0, FIRST
    while begin < len(plain.inputs):
        part = plain.rows(np.arange(begin, min(begin + size, len(plain.inputs))))
        found = _advanced(part, dialect, spans[begin : begin + size])
        is_missed = ~(found.view(np.uint32) == part.i1.view(np.uint32)[:, None]).any(axis=1)
        if is_missed.any():
            is_missed &= _is_proof(part, dialect, found)
        if is_missed.any():
            return begin + int(is_missed.argmax())
        begin, size = begin + size, 2 * size
    return -1


def _is_proof(plain: Plain, dialect: Dialect, found: Reals) -> npt.NDArray[np.bool_]:
    """Executions of which I_MV must be among what was found, whatever the other axes are.

    While MV lies between its limits, a limit can hold I_MV where it was, or compute it back from MV, which gives within
    rounding the term before or behind, or what MV leaves beside P and BIAS. So those executions count in which the term
    is far from these, and those in which no sum, with D or without, before the integral moved or behind, comes to a
    limit.
    """
    read = [(float(each.mv_min), float(each.mv_max)) for each in plain.inputs]
    low, high = (np.array(column) for column in zip(*read, strict=True))
    before, behind, least, most = (_term(plain, dialect, i) for i in (plain.i0, plain.i1, found.min(1), found.max(1)))
    others = (-1.0 if dialect.direction else 1.0) * plain.kc.astype(np.float64) * plain.er + plain.bias
    parts: Any = [abs(others), abs(plain.bias), abs(before), abs(behind), abs(plain.mv)]
    slack = NEAR * np.maximum.reduce(parts)
    sums = [part for term in (before, least, most) for part in (others + term, plain.mv + (term - before))]
    is_calm = np.logical_and.reduce([(low + slack < each) & (each < high - slack) for each in sums])
    nearest = abs(_term(plain, dialect, found) - behind[:, None]).min(axis=1)
    is_far = (nearest > slack) & (abs(behind - before) > slack) & (abs(plain.mv - others - behind) > slack)
    return np.asarray(plain.steady & (plain.kc >= 0) & np.isfinite(plain.k) & np.isfinite(slack) & (is_calm | is_far))


def _term(plain: Plain, dialect: Dialect, i: Reals) -> npt.NDArray[np.float64]:
    """What I_MV stands for in MV's unit, in binary64; n values, or n rows of them."""
    law: Any = terms_of
    k, kc, dependent = (each[:, None] if i.ndim > 1 else each for each in (plain.k, plain.kc, plain.dependent))
    free, bound = (law.term(dialect, form, k, kc, i) for form in (False, True))
    return np.asarray(np.where(dependent, bound, free), dtype=np.float64)


def _with_clock(loop: Loop, plain: Plain, clock: dict[str, int], has_kc: bool) -> Iterator[dict[str, int]]:
    first = plain.rows(np.arange(min(FIRST, len(plain.inputs))))
    spans = _intervals(loop, first, _made(clock))
    rest = plain if spans.shape[1] <= FINE_CLOCK else plain.rows(np.arange(min(2 * FIRST, len(plain.inputs))))
    all_spans: Reals | None = None
    for fixed in _with_rules(clock, bool(plain.dependent.any()), has_kc):
        if _share(first, _made(fixed), spans) < SHARE_MIN - 1.0 / FIRST:
            continue
        if all_spans is None:
            all_spans = _intervals(loop, rest, _made(clock))
        if _share(rest, _made(fixed), all_spans) >= SHARE_MIN:
            yield fixed


def _with_rules(clock: dict[str, int], has_ratio: bool, has_kc: bool) -> Iterator[dict[str, int]]:
    """Every way to integrate with this clock."""
    for rule in _rules(has_ratio, has_kc):
        if clock["ts_unit"] != TsUnit.LEFT_OUT or not rule.get("product"):
            yield {**clock, **rule}


def _rules(has_ratio: bool, has_kc: bool) -> Iterator[dict[str, int]]:
    """Every way to integrate; without Kc is the same as with it while nothing is in the dependent form."""
    names = ["direction", "integrator", "integral_store", "product"] + (["ratio"] if has_ratio else [])
    for values in product(*(AXES[name] for name in names)):
        fixed = {name: int(value) for name, value in zip(names, values, strict=True)}
        if fixed["integral_store"] == IntegralStore.WITHOUT_KC and not has_kc:
            continue
        if fixed["integral_store"] == IntegralStore.SUM:
            if fixed["product"]:
                continue
            del fixed["product"]
        yield fixed


def _made(fixed: dict[str, int]) -> Dialect:
    chosen: dict[str, Any] = {name: AXES[name](value) for name, value in fixed.items()}
    return Dialect(**chosen)


def _advanced(plain: Plain, dialect: Dialect, spans: Reals) -> Reals:
    """I_MV behind each execution for each of its intervals."""
    sign = REAL(-1 if dialect.direction else 1)
    law: Any = terms_of
    x = (sign * law.integrated(dialect, plain.er, plain.er1))[:, None]
    k, kc, i0 = plain.k[:, None], plain.kc[:, None], plain.i0[:, None]
    free = law.advanced(dialect, False, k, kc, x, spans, i0)[0]
    if not plain.dependent.any():
        return np.asarray(free, dtype=np.float32)
    bound = law.advanced(dialect, True, k, kc, x, spans, i0)[0]
    return np.asarray(np.where(plain.dependent[:, None], bound, free), dtype=np.float32)


def _share(plain: Plain, dialect: Dialect, spans: Reals) -> float:
    """Share of the executions whose I_MV comes out by bits, with any of their intervals."""
    same = _advanced(plain, dialect, spans).view(np.uint32) == plain.i1.view(np.uint32)[:, None]
    return float(same.any(axis=1).mean())


def _derivatives(loop: Loop, plain: Plain, fixed: dict[str, int]) -> list[dict[str, int]]:
    """Widen a combination by the derivative's axes that put MV right within rounding; itself when none does."""
    chained = plain.rows(plain.d_before)
    if len(chained.inputs) < PLAIN_MIN or "direction" not in fixed:
        return [fixed]
    chained = chained.rows(np.arange(min(40, len(chained.inputs))))
    extended = hasattr(plain.inputs[0], "kc_kp")
    axes = ["integral_used"]
    if not extended and bool((chained.kd > 0).any()):
        axes.append("derivative_of")
    smoothed = extended and bool(((chained.kd > 0) & (chained.tf > 0)).all())
    if smoothed:
        axes.append("filter")
        if bool(chained.dependent.any()):
            axes.append("tf_unit")
    found = []
    for values in product(*(AXES[name] for name in axes)):
        wider = {**fixed, **{name: int(value) for name, value in zip(axes, values, strict=True)}}
        if wider.get("filter") == Filter.IGNORED and wider.get("tf_unit"):
            continue
        if _fits_mv(loop, plain, chained, _made(wider), smoothed) >= SHARE_MIN:
            if wider.get("filter") == Filter.IGNORED:
                wider.pop("tf_unit", None)
            found.append(wider)
    return found or [fixed]


def _left_for_d(plain: Plain, dialect: Dialect) -> npt.NDArray[np.float64]:
    """What MV leaves for D."""
    k, kc = plain.k, plain.kc
    used = plain.i0 if dialect.integral_used else plain.i1
    law: Any = terms_of
    free, bound = law.term(dialect, False, k, kc, used), law.term(dialect, True, k, kc, used)
    integral = np.where(k > 0, np.where(plain.dependent, bound, free), 0.0)
    sign = -1.0 if dialect.direction else 1.0
    wide = np.float64
    return plain.mv.astype(wide) - sign * kc.astype(wide) * plain.er - integral.astype(wide) - plain.bias


def _fits_mv(loop: Loop, plain: Plain, chained: Plain, dialect: Dialect, smoothed: bool) -> float:
    """Share of the executions whose D is right within the rounding of the sum."""
    shape = _made({name: int(getattr(dialect, name)) for name in ("filter",)})
    left = _left_for_d(chained, dialect)
    before = _left_before(plain, chained, dialect)
    sign = -1.0 if dialect.direction else 1.0
    change = sign * np.where(chained.of_pv, chained.moved, chained.er - chained.er1).astype(np.float64)
    if dialect.derivative_of:
        change = sign * chained.moved.astype(np.float64)
    kd = np.where(chained.dependent, chained.kc, REAL(1)).astype(np.float64) * chained.kd
    tf = np.where(chained.dependent & bool(dialect.tf_unit), chained.tf * chained.kd, chained.tf).astype(np.float64)
    spans = _intervals(loop, chained, dialect)
    spans = spans[:, :: max(1, spans.shape[1] // 256)].astype(np.float64)
    law: Any = terms_of
    args = (kd[:, None], change[:, None])
    if smoothed and dialect.filter != Filter.IGNORED:
        steep, smooth = law.slope(_made({}), *args, spans), tf[:, None]
        if dialect.filter == Filter.EXACT:
            # The law's own exponential takes one number at a time; here the last bits do not count.
            ref = steep + np.exp(-spans / smooth) * (before[:, None] - steep)
        else:
            ref = law.filtered(shape, before[:, None], *args, smooth, spans)
    else:
        ref = law.slope(shape, *args, spans)
    size = np.maximum.reduce([abs(chained.mv), abs(chained.i1), abs(chained.kc * chained.er), abs(left)])
    growth = 1.0 + np.where(tf > 0, spans[:, 0] / np.where(tf > 0, tf, 1.0), 0.0)
    slack = 64.0 * 2.0**-24 * size * growth + 1e-3 * abs(change) * kd / spans[:, 0] * (spans.shape[1] > 1)
    return float((abs(ref - left[:, None]).min(axis=1) <= slack).mean())


def _left_before(plain: Plain, chained: Plain, dialect: Dialect) -> npt.NDArray[np.float64]:
    """What MV left for D one execution before; the row before in the trace, by construction."""
    left = _left_for_d(plain, dialect)
    index = np.flatnonzero(plain.d_before)[: len(chained.inputs)] - 1
    return np.asarray(left[index])
